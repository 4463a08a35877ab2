"""Least-squares sine fits (IEEE Std 1057, three and four parameters), with harmonics and any number of cycles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from specan.arrays import Complex, Real
from specan.dsp.windows import window


class SineFit(NamedTuple):
    """Result of a sine fit, x(t) = mean + sum_k Re(phasor_k exp(+j 2 pi k f t)), t = 0 at the first sample.

    Attributes
    ----------
    frequency_hz : float
    phasors : complex array (..., harmonics)
        Peak amplitude and phase of the fundamental and its harmonics.
    mean : array (...)
    residual_rms : array (...)
        RMS of what the fit leaves.
    """

    frequency_hz: float
    phasors: Complex
    mean: Real
    residual_rms: Real


def tone_basis(n: int, rate: float, frequency_hz: float, harmonics: int = 1) -> Real:
    """Rows cos, sin of the fundamental, cos, sin of each harmonic below rate/2, and ones: (2 h + 1, n)."""
    order = harmonics_below_nyquist(rate, frequency_hz, harmonics, n)
    angle = 2 * np.pi * (frequency_hz / rate) * np.arange(n)
    rows = [f(k * angle) for k in range(1, order + 1) for f in (np.cos, np.sin)]
    return np.stack([*rows, np.ones(n)])


def harmonics_below_nyquist(rate: float, frequency_hz: float, harmonics: int, n: int) -> int:
    """How many of the wished harmonics lie half a line of n samples or more below half the sampling rate."""
    if not 0 < frequency_hz < rate / 2:
        raise ValueError(f"frequency {frequency_hz} Hz is not between 0 and {rate / 2} Hz")
    return max(1, min(harmonics, int(_inside(rate / 2, rate, n) / frequency_hz)))


def products(basis: Real, samples: Real) -> Real:
    """Inner products (..., rows) of each row of `samples` (..., n) with each row of `basis` (rows, n).

    Summed row by row, never by BLAS: the bits then depend on neither threads nor the number of rows.
    """
    return np.stack([np.add.reduce(samples * row, axis=-1) for row in basis], axis=-1)


def fit_sine(samples: Real, rate: float, frequency_hz: float, harmonics: int = 1) -> SineFit:
    """Three-parameter fit at a known frequency (IEEE Std 1057), harmonics fitted along.

    Parameters
    ----------
    samples : array (..., n)
    rate, frequency_hz : float
        In hertz. The number of cycles in the record need not be whole.
    harmonics : int
        1 for the fundamental alone; harmonics at or above rate/2, or less than half a line below it, are left out.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> fit = fit_sine(2 * np.cos(2 * np.pi * 12.34 * t + 0.5), 1000.0, 12.34)
    >>> round(float(abs(fit.phasors[0])), 9), round(float(np.angle(fit.phasors[0])), 9)
    (2.0, 0.5)
    """
    samples = np.asarray(samples, dtype=float)
    basis = tone_basis(samples.shape[-1], rate, frequency_hz, harmonics)
    coefficients = solve_normal(products(basis, basis), products(basis, samples))
    residual = samples - np.einsum("...k,kn->...n", coefficients, basis)
    return SineFit(
        frequency_hz,
        phasors_of(coefficients),
        coefficients[..., -1],
        np.sqrt(np.mean(residual**2, axis=-1)),
    )


def solve_normal(gram: Real, right: Real) -> Real:
    """Solve gram @ c = right for every row of `right` (..., k)."""
    inverse = np.linalg.pinv(gram, hermitian=True)  # a tone of hardly a cycle is hardly determined
    return np.asarray(np.einsum("ij,...j->...i", inverse, right))


def phasors_of(coefficients: Real) -> Complex:
    """a cos + b sin = Re((a - j b) exp(j w t)); the last coefficient is the mean and left out."""
    return np.asarray(coefficients[..., 0:-1:2] - 1j * coefficients[..., 1:-1:2])


def peak_frequency(samples: Real, rate: float, fmin: float = 0.0, fmax: float | None = None) -> float:
    """Frequency of the highest line between `fmin` and `fmax`, interpolated for the Hann window.

    For a tone d lines above line i the Hann window gives r = |X(i+1)| / |X(i)| with d = (2 r - 1) / (r + 1)
    (Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355): within some thousandths of a line for a clean tone.
    """
    n = samples.shape[-1]
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * window("hann", n)))
    lines = np.arange(len(spectrum)) * rate / n
    allowed = (lines >= max(fmin, 1.5 * rate / n)) & (lines <= (rate / 2 if fmax is None else fmax))
    allowed[[0, -1]] = False  # both neighbours are needed
    if not allowed.any():
        raise ValueError(f"no line between {fmin} and {fmax} Hz in {n} samples at {rate} Hz")
    peak = int(np.argmax(np.where(allowed, spectrum, -1.0)))
    side = 1 if spectrum[peak + 1] >= spectrum[peak - 1] else -1
    if spectrum[peak] == 0:
        return _inside(float(lines[peak]), rate, n)
    ratio = spectrum[peak + side] / spectrum[peak]
    return _inside(float((peak + side * (2 * ratio - 1) / (ratio + 1)) * rate / n), rate, n)


def _inside(frequency_hz: float, rate: float, n: int) -> float:
    """Half a line away from 0 Hz and rate/2, where cosine and sine are no longer two functions."""
    return min(max(frequency_hz, 0.5 * rate / n), (0.5 - 0.5 / n) * rate)


def fit_frequency(samples: Real, rate: float, guess_hz: float | None = None) -> SineFit:
    """Four-parameter fit (IEEE Std 1057): the frequency is found along with phasors and mean.

    Gauss-Newton from `guess_hz` (default: the highest line of the spectrum); a guess has to be within
    about half a line, rate / n, of the truth. The step ends when it is below 1e-12 of the frequency or
    after 30 steps, whichever is first; it is held to half a line, so that noise cannot run away.

    Parameters
    ----------
    samples : array (n,)

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> round(fit_frequency(np.sin(2 * np.pi * 12.34 * t), 1000.0).frequency_hz, 9)
    12.34
    """
    samples = np.asarray(samples, dtype=float)
    n = samples.shape[-1]
    frequency = start = peak_frequency(samples, rate) if guess_hz is None else guess_hz
    # Time counted from the middle decouples frequency from phase.
    time = (np.arange(n) - (n - 1) / 2) / rate
    for _ in range(30):
        basis = tone_basis(n, rate, frequency)
        a, b, _ = solve_normal(products(basis, basis), products(basis, samples))
        slope = 2 * np.pi * time * (b * basis[0] - a * basis[1])
        extended = np.concatenate([basis, [slope * rate / n]])  # the step then is in lines
        gram = products(extended, extended)
        if gram[-1, -1] == 0:
            break
        step = float(solve_normal(gram, products(extended, samples))[-1]) * rate / n
        moved = float(np.clip(frequency + step, start - 0.5 * rate / n, start + 0.5 * rate / n))
        moved = _inside(moved, rate, n)
        done = abs(moved - frequency) <= 1e-12 * frequency
        frequency = moved
        if done:
            break
    return fit_sine(samples, rate, frequency)
