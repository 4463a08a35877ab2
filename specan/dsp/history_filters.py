"""The filters of time-weighted levels: bands and frequency weightings as analogue and minimum-phase responses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.weighting import ZEROS, Weighting, complex_weighting, power_weighting

# A band is filtered at the lowest rate whose samples are faithful up to this many times its upper edge.
_ROOM_ABOVE = 1.25
# A response that is not below -60 dB at half the sampling rate is made causal: cut off there, it rings ahead, and a
# band hears the record's end before it. Below a tone that ends there: 75 dB with the band's edge at half the rate,
# 100 dB with -42 dB of it.
_REACHES = 1e-3
# After 6 times 3 / B an order 4 band-pass has fallen by 180 dB.
SETTLINGS_IN_A_BLOCK = 6.0
# The lowest poles of A, B and C are at 20.6 Hz: seconds to fall by 180 dB.
_WEIGHTINGS_RING = 9.0 * math.log(10.0) / (2.0 * math.pi * 20.6)
# ... and by 100 dB.
_WEIGHTINGS_SETTLE = 5.0 * math.log(10.0) / (2.0 * math.pi * 20.6)

Response = Callable[[NDArray[np.float64]], NDArray[np.complex128]]


@dataclass(frozen=True)
class Filter:
    """A causal analogue filter.

    Attributes
    ----------
    response : callable
        Complex response at frequencies in Hz (exp(+j w t)).
    lower, upper : float
        Frequency from which on it lets something through, and up to which the samples have to be faithful.
    settling : float
        Seconds until the filter has settled.
    ringing : float
        Seconds until it has fallen by 180 dB.
    identity : bool
        Whether it is not a filter at all.
    silent : float
        Seconds from the beginning of the record in which its output counts as nothing: a filter so short that
        nothing is lost when it is left to settle.
    sampled : callable, optional
        Response at a number of lines up to half a sampling rate, of the causal filter with this magnitude; used by
        `causal`.
    """

    response: Response
    lower: float = 0.0
    upper: float = math.inf
    settling: float = 0.0
    ringing: float = math.inf
    identity: bool = False
    silent: float = 0.0
    sampled: Callable[[float, int], NDArray[np.complex128]] | None = None

    def causal(self, rate: float, lines: int) -> NDArray[np.complex128] | None:
        """Response of the causal sampled filter where the analogue one goes on beyond half the rate, else None."""
        if self.sampled is None or (
            math.isfinite(self.upper) and abs(self.response(np.array([rate / 2.0]))[0]) < _REACHES
        ):
            return None
        return self.sampled(rate, lines)


def band_filter(index: int, fraction: int, weighting: Weighting = "Z") -> Filter:
    """Band filter of a fractional octave, with a frequency weighting; see `bands.power_response`."""
    mid = float(bands.mid_frequencies(index, fraction))
    lower, upper = (float(edge) for edge in bands.band_edges(index, fraction))

    def response(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        return bands.complex_response(frequency / mid, fraction) * complex_weighting(frequency, weighting)

    # The envelope of an order 4 band-pass settles to 1 % within 3 / B.
    settling = 3.0 / (upper - lower)
    ringing = SETTLINGS_IN_A_BLOCK * settling

    def sampled(rate: float, lines: int) -> NDArray[np.complex128]:
        zeros = bands.FILTER_ORDER + ZEROS[weighting]
        return minimum_phase(lambda f: np.abs(response(f)), zeros, rate, lines, ringing)

    return Filter(response, lower, _ROOM_ABOVE * upper, settling, ringing, sampled=sampled)


def weighting_filter(weighting: Weighting) -> Filter:
    """A frequency weighting of the whole signal, from the moment on at which it has settled."""
    if weighting == "Z":
        return Filter(np.ones_like, ringing=0.0, identity=True)
    return Filter(
        lambda frequency: complex_weighting(frequency, weighting),
        settling=_WEIGHTINGS_SETTLE,
        ringing=_WEIGHTINGS_RING,
        silent=_WEIGHTINGS_SETTLE,
        sampled=partial(_sampled_weighting, weighting),
    )


@lru_cache(maxsize=16)
def _sampled_weighting(weighting: Weighting, rate: float, lines: int) -> NDArray[np.complex128]:
    def magnitude(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sqrt(power_weighting(frequency, weighting))

    return minimum_phase(magnitude, ZEROS[weighting], rate, lines, _WEIGHTINGS_RING)


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
