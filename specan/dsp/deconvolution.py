"""Impulse responses of a system from its input and output, by spectral division."""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Real = NDArray[np.float64]

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
