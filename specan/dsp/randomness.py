"""Whether sections of a signal look like noise: their spectra scatter as those of a Gaussian process do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specan.dsp.windows import window

Real = NDArray[np.float64]

# Lengths of the frames in which the scatter is looked at, from what a fast sweep needs to what a slow one does.
_FRAMES = tuple(1 << power for power in range(6, 16))
_LEAST_FRAMES, _LEAST_LINES = 16, 16
# Lines that hold these parts of the energy are looked at, in frames that hold this part of the loudest one's.
# The strongest half alone shows what a floor of noise over many more lines would hide.
_ENERGY, _ON = (0.9, 0.5), 0.1
# Sum over lags of the squared correlation of lines under the Hann window: 1 + 2 (2/3)^2 + 2 (1/6)^2.
_CORRELATED_LINES = 1.944
# Allowance for what is nearly stationary and nearly Gaussian, besides the scatter of the estimate.
# Mean fourth power of samples over the squared mean square: 3 of a Gaussian process,
# 3/d of one that is on for a part d.
_PEAKED = 10.0
# Mean fourth power of an envelope over the squared mean square: 1 where it is constant, 2 of noise; 99 of 100
# bands of noise with 20 independent samples lie above this.
_CONSTANT_ENVELOPE, _LEAST_RESOLVED = 1.3, 2.5
_NEARLY, _DEVIATIONS = 0.1, 3.0


def scatters_as_noise(sections: Sequence[Real]) -> bool | None:
    """Whether the lines of short frames scatter within each frame as those of Gaussian noise do.

    Each line of a stationary Gaussian process has an exponentially distributed power, so that the mean
    square of the power over lines of equal expectation is twice the squared mean: the spectral kurtosis
    is 0 (Antoni, Mech. Syst. Signal Process. 20 (2006) 282-307; variance 4/n for n independent lines). The lines
    are brought to equal expectation by their mean over all frames, and compared within a frame, so that a gate
    does not matter. A sweep or a step holds one line of a frame (far more than 2), a pulse all of them evenly (1).

    Parameters
    ----------
    sections : sequence of array (n,)
        Of one signal.

    Returns
    -------
    bool or None
        The ratio exceeds 2 at no length of the frames, and falls short of it at one length at most where
        a signal repeats itself within the frame (a maximum length sequence). None where no length
        of the frames can tell.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(8000)
    >>> t = np.arange(8000) / 8000
    >>> sweep = np.sin(2 * np.pi * (50 * t + 1000 * t**2))
    >>> scatters_as_noise([noise]), scatters_as_noise([sweep])
    (True, False)
    """
    if _peaked(sections):
        return False
    answers = []
    for energy in _ENERGY:
        seen = [found for length in _FRAMES if (found := _scatter(sections, length, energy)) is not None]
        if seen:
            excess = [(ratio - expected) / margin for ratio, expected, margin in seen]
            # Only a frame that is shorter than the period of a sequence sees it as noise.
            answers.append(bool(max(excess) <= 1.0 and (energy < max(_ENERGY) or excess[0] >= -1.0)))
    return all(answers) if answers else None


def _peaked(sections: Sequence[Real]) -> bool:
    """Whether the samples are rarer and higher than those of a Gaussian process that is on part of the time."""
    x = np.concatenate(sections)
    square = np.square(x - x.mean())
    return bool(np.mean(square**2) > _PEAKED * np.mean(square) ** 2)


def _scatter(sections: Sequence[Real], length: int, energy: float) -> tuple[float, float, float] | None:
    """Mean square over squared mean of the lines in a frame; what noise has; how far it may be from that."""
    shape = window("hann", length)
    parts = [s[: len(s) // length * length].reshape(-1, length) for s in sections if len(s) >= length]
    if not parts:
        return None
    frames = np.concatenate(parts)
    power = np.abs(np.fft.rfft((frames - frames.mean(axis=1, keepdims=True)) * shape)[:, 2:-1]) ** 2
    whole = power.sum(axis=1)
    power = power[whole > _ON * whole.max()]
    expected = power.mean(axis=0)
    order = np.argsort(expected)[::-1]
    held = np.cumsum(expected[order])
    kept = order[: int(np.searchsorted(held, energy * held[-1])) + 1]
    n, m = len(power), len(kept)
    if n < _LEAST_FRAMES or m < _LEAST_LINES:
        return None
    even = power[:, kept] / expected[kept]
    ratio = float(np.mean(m * np.sum(even**2, axis=1) / np.sum(even, axis=1) ** 2))
    noise = 2 * n / (n + 1) / (1 + _CORRELATED_LINES / m)
    return ratio, noise, _NEARLY + _DEVIATIONS * 2 / np.sqrt(n * m)


def narrow_band_is_noise(sections: Sequence[Real], low: float, high: float) -> bool:
    """Whether what lies between two frequencies (in cycles a sample) is a narrow band of Gaussian noise.

    Steady lines have one power in every section, noise has not; and the envelope of noise is that of a complex
    Gaussian process, whose mean fourth power is twice the squared mean square. Of a sine, a
    sweep and frequency modulation it is that square itself, of two tones 1.5 times at most.

    Parameters
    ----------
    sections : sequence of array (n,)
        All of one length.
    """
    n = len(sections[0])
    first, last = max(int(low * n), 1), min(int(np.ceil(high * n)), n // 2 - 1)
    if len(sections) < 2 or last - first < 2:
        return False
    shape = window("hann", n)
    power = np.stack([np.abs(np.fft.rfft(s * shape)[first : last + 1]) ** 2 for s in sections])
    # Sections in which the signal is off say nothing.
    power = power[power.sum(axis=1) > 0.01 * power.sum(axis=1).max()]
    k = len(power)
    mean = power.mean(axis=0)
    lines = float(mean.sum() ** 2 / np.sum(mean**2)) / _CORRELATED_LINES
    if k < 2 or lines < _LEAST_RESOLVED:
        return False  # all of it lies in one line, or in two: that is not resolved
    repeated = float(np.mean(power**2, axis=0) @ (1 / mean) / mean.sum())
    envelopes = np.concatenate([_envelope_square(s, first, last) for s in sections])
    envelopes = envelopes[envelopes > 0]
    fourth = float(np.mean(envelopes**2) / np.mean(envelopes) ** 2)
    scatter = 1 / np.sqrt(lines * k)
    expected = 2 * k / (k + 1)
    # Halfway to what steady lines have (1); far above is what stands elsewhere in every section.
    if not 0.5 * (1 + expected) < repeated < expected + 5 * scatter:
        return False
    return bool(_CONSTANT_ENVELOPE < fourth < 2 + 5 * scatter)


def _envelope_square(x: Real, first: int, last: int) -> Real:
    """Squared envelope of what lies between two lines, without the ends, which the cut has bent."""
    spectrum = np.fft.rfft(x)[first : last + 1]
    count = 2 * len(spectrum)
    envelope = np.abs(np.fft.ifft(spectrum, count)) ** 2
    return np.asarray(envelope[count // 10 : count - count // 10])
