"""A sampled filter that is causal and has exactly a given magnitude at every frequency that it can have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray


def minimum_phase(
    magnitude: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    zeros: int,
    rate: float,
    lines: int,
    ringing: float,
) -> NDArray[np.complex128]:
    """Response of the sampled filter of minimum phase that has a given magnitude up to half the sampling rate.

    An analogue filter's response, cut off at half the rate, belongs to a filter that is no longer causal: it rings
    before each sample as (-1)^n / n. The filter of minimum phase with the same magnitude is causal. Its phase is
    the Hilbert transform of the logarithm of its magnitude: of the real cepstrum, twice the causal half is kept
    (Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., 13.5).

    Parameters
    ----------
    magnitude : callable
        |H| at frequencies in Hz; it rises as f^`zeros` from 0 Hz and is positive elsewhere.
    zeros : int
        How many zeros H has at 0 Hz. There the logarithm has no value, so they are taken out as factors
        1 - exp(-j w), which are of minimum phase.
    rate : float
        Sampling rate in Hz.
    lines : int
        The response is given at this many frequencies from 0 to half the rate.
    ringing : float
        Seconds until the filter has fallen to nothing: its cepstrum has fallen at least as much.

    Examples
    --------
    A single pole at 100 Hz, far below half the rate:

    >>> response = minimum_phase(lambda f: 1 / np.hypot(1.0, f / 100.0), 0, 48000.0, 4097, 0.1)
    >>> f = np.linspace(0, 24000.0, 4097)
    >>> bool(np.allclose(np.abs(response), 1 / np.hypot(1.0, f / 100.0)))
    True
    >>> bool(np.abs(np.fft.irfft(response)[4097:]).max() < 1e-6)  # nothing before time 0
    True
    """
    times = max(1, int(np.ceil(ringing * rate / (lines - 1))))
    fine = (lines - 1) * times
    angle = np.pi * np.arange(fine + 1) / fine
    angle[0] = 1e-3 * angle[1]  # in the place of 0 Hz, where numerator and denominator vanish
    rest = magnitude(angle * rate / (2.0 * np.pi)) / (2.0 * np.sin(angle / 2.0)) ** zeros
    cepstrum = np.fft.irfft(np.log(rest))
    cepstrum[1:fine] *= 2.0
    cepstrum[fine + 1 :] = 0.0
    angle[0] = 0.0
    response = np.exp(np.fft.rfft(cepstrum)) * (1.0 - np.exp(-1j * angle)) ** zeros
    return np.asarray(response[::times])
