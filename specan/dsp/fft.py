"""The DFT of one block as peak amplitudes; blocks of any length in bounded memory."""

from __future__ import annotations

import math

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from specan.dsp.windows import Windowing, WindowName

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class AmplitudeTransform:
    """One-sided amplitude spectrum (..., n // 2 + 1) of blocks (..., n), peak values, exp(+j w t).

    A tone A cos(2 pi f t + phi) on a line, t = 0 at the first sample, gives A exp(j phi) there. Between two
    lines the magnitude falls by the scallop loss of the window and the phase of the nearest line is off by
    180 degrees times the distance in lines: use a sine fit for the phase of such a tone.

    Parameters
    ----------
    n : int
        Samples of a block.

    Examples
    --------
    >>> t = np.arange(64) / 64
    >>> spectrum = AmplitudeTransform(64)(3 * np.cos(2 * np.pi * 8 * t + 1))
    >>> round(float(abs(spectrum[8])), 6), round(float(np.angle(spectrum[8])), 6)
    (3.0, 1.0)
    """

    def __init__(self, n: int, window_name: WindowName = "hann", *, detrend: bool = True) -> None:
        self._shape, self._detrend = Windowing(window_name, n), detrend
        self._scale = 2 / self._shape.sum
        self._single = np.flatnonzero(~has_mirror(n // 2 + 1, n))

    def __call__(self, samples: Real) -> Complex:
        """The spectrum of blocks (..., n), whose memory is used for the work."""
        if self._detrend:
            samples -= np.add.reduce(samples, axis=-1, keepdims=True) / samples.shape[-1]
        self._shape(samples)
        spectrum: Complex = real_transform(samples) if samples.ndim == 1 else np.fft.rfft(samples, axis=-1)
        spectrum *= self._scale
        spectrum[..., self._single] /= 2
        return spectrum


def has_mirror(lines: int, block: int) -> NDArray[np.bool_]:
    """Which of the first lines of a DFT stand for two: all but 0 Hz and half the sampling rate."""
    mirrored = np.ones(lines, dtype=np.bool_)
    mirrored[:1] = False
    if block % 2 == 0:
        mirrored[block // 2 : block // 2 + 1] = False
    return mirrored


# Shorter ones are as fast at once. Columns of the matrix that are transformed side by side.
_LEAST, _COLUMNS = 1 << 18, 32
_CHUNK = 1 << 12


def real_transform(samples: NDArray[np.float64]) -> NDArray[np.complex128]:
    """`np.fft.rfft` of one block (n,), whose memory is used for the work if it is long.

    Even and odd samples are the real and imaginary parts of n / 2 complex ones (Numerical Recipes, 3rd ed., 12.3.2).
    These are the elements of a matrix, of which first the columns are transformed, then, turned by
    exp(-2 pi j * column * line / (n / 2)), the rows: Bailey, J. Supercomputing 4 (1990) 23. Where n / 2 has no two
    factors of a like size, it is numpy's transform.

    Examples
    --------
    >>> samples = np.random.default_rng(1).standard_normal(600_000)
    >>> bool(np.allclose(real_transform(samples.copy()), np.fft.rfft(samples), atol=1e-9))
    True
    """
    half = samples.size // 2
    rows = _factor(half)
    if samples.size < _LEAST or samples.size % 2 or rows is None or not samples.flags.c_contiguous:
        return np.asarray(np.fft.rfft(samples))
    result = np.empty(half + 1, dtype=np.complex128)
    pairs = samples.view(np.complex128)
    _by_rows_and_columns(pairs, result[:half], rows)
    _separate(pairs, result)
    return result


def _factor(count: int) -> int | None:
    """The divisor next to the square root; None where there is none within a factor of eight."""
    root = math.isqrt(count)
    return next((d for d in range(root, max(root // 8, 1), -1) if count % d == 0), None)


def _by_rows_and_columns(values: NDArray[np.complex128], between: NDArray[np.complex128], rows: int) -> None:
    """Transform values (n,) in place, by way of other memory of their size."""
    size, columns = values.size, values.size // rows
    matrix, turned = values.reshape(rows, columns), between.reshape(columns, rows)
    step = -2j * np.pi / size * np.arange(rows)
    near = np.exp(np.arange(_COLUMNS)[:, None] * step)
    for first in range(0, columns, _COLUMNS):
        some = np.fft.fft(np.ascontiguousarray(matrix[:, first : first + _COLUMNS].T))
        some *= near[: some.shape[0]]
        # Of the product of column and line only the rest by n counts: it is exact as an integer.
        some *= np.exp(-2j * np.pi / size * (first * np.arange(rows) % size))
        turned[first : first + _COLUMNS] = some
    natural = values.reshape(columns, rows)
    for first in range(0, rows, _COLUMNS):
        some = np.fft.fft(np.ascontiguousarray(turned[:, first : first + _COLUMNS].T))
        natural[:, first : first + _COLUMNS] = some.T


def _separate(pairs: NDArray[np.complex128], result: NDArray[np.complex128]) -> None:
    """Lines of the real samples from those of the complex ones."""
    half = pairs.size
    near = np.exp(-1j * np.pi / half * np.arange(_CHUNK))
    for first in range(1, half, _CHUNK):
        last = min(first + _CHUNK, half)
        mine = pairs[first:last]
        mirrored = np.conj(pairs[half - last + 1 : half - first + 1][::-1])
        turn = near[: mine.size] * np.exp(-1j * np.pi * first / half)
        result[first:last] = 0.5 * (mine + mirrored) - 0.5j * turn * (mine - mirrored)
    result[0] = pairs[0].real + pairs[0].imag
    result[half] = pairs[0].real - pairs[0].imag


FLOOR = 1e-6
"""Share of the input's strongest line below which a line is not divided: -60 dB, beyond the 30 dB by which an
exponential sweep over ten octaves falls; 0.01 dB at its weakest line."""


class Deconvolution:
    """Division by the spectrum of one input.

    H = Y X* / (|X|^2 + FLOOR max|X|^2), of signals lengthened by zeros so that nothing wraps round.

    Parameters
    ----------
    reference : array (n,)
        The input, about its mean.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(1000) * np.hanning(1000)
    >>> x = np.append(x, np.zeros(100))
    >>> y = 0.5 * np.roll(x, 7)
    >>> (Deconvolution(x).response(y, 10).round(3) + 0.0).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0]
    """

    def __init__(self, reference: Real) -> None:
        self.length = scipy.fft.next_fast_len(2 * reference.size, real=True)
        spectrum = scipy.fft.rfft(reference, self.length)
        power = np.abs(spectrum) ** 2
        self._inverse = np.conj(spectrum) / (power + FLOOR * max(float(power.max()), np.finfo(float).tiny))

    def response(self, output: Real, n: int, correction: NDArray[np.complex128] | None = None) -> Real:
        """The first `n` samples of the response of one output; `correction` is a factor on its lines."""
        found = scipy.fft.rfft(output, self.length) * self._inverse
        if correction is not None:
            found = found * correction
        return scipy.fft.irfft(found, self.length)[:n]
