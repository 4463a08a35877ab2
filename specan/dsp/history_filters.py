"""The filters of time-weighted levels: bands and frequency weightings as analogue and minimum-phase responses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.weighting import F_1, POLES, ZEROS, Weighting, complex_weighting, power_weighting

# A band is filtered at the lowest rate whose samples are faithful up to this many times its upper edge.
_ROOM_ABOVE = 1.25
# A response that is not below -60 dB at half the sampling rate is made causal: cut off there, it rings ahead, and a
# band hears the record's end before it. Below a tone that ends there: 75 dB with the band's edge at half the rate,
# 100 dB with -42 dB of it.
_REACHES = 1e-3
# After 6 times 3 / B an order 4 band-pass has fallen by 180 dB.
SETTLINGS_IN_A_BLOCK = 6.0
# The lowest poles of A, B and C are at 20.6 Hz: seconds to fall by 180 dB.
WEIGHTINGS_RING = 9.0 * math.log(10.0) / (2.0 * math.pi * F_1)
# ... and by 100 dB.
_WEIGHTINGS_SETTLE = 5.0 * math.log(10.0) / (2.0 * math.pi * F_1)
# In Hz. Where the sampling rate is so high that a thinned stream has all up to here, A, B and C are of that: they let
# less than 1 / 4000 of the energy above it through.
_WEIGHTINGS_REACH = 1e5
# Lines up to half the rate on which a weighting is made causal, its poles and zeros taken out.
_LINES = 1 << 13

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
    weighting : {"A", "B", "C"}, optional
        Of the whole signal: it is sampled by `sampled_weighting`, and what the cut at the record's beginning makes it
        ring with is taken off (see `specan.dsp.record_start`).
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
    weighting: Weighting | None = None
    sampled: Callable[[float, int], NDArray[np.complex128]] | None = None

    def causal(self, rate: float, lines: int) -> NDArray[np.complex128] | None:
        """Response of the causal sampled filter where the analogue one goes on beyond half the rate, else None."""
        if self.sampled is None or (
            math.isfinite(self.upper) and abs(self.response(np.array([rate / 2.0]))[0]) < _REACHES
        ):
            return None
        return self.sampled(rate, lines)


def band_filter(band: bands.Band, weighting: Weighting = "Z") -> Filter:
    """Filter of a band, with a frequency weighting; see `bands.power_response`."""
    mid, lower, upper, _, fraction = band

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
        upper=_WEIGHTINGS_REACH,
        settling=_WEIGHTINGS_SETTLE,
        ringing=WEIGHTINGS_RING,
        weighting=weighting,
    )


def sampled_weighting(weighting: Weighting, rate: float, samples: int) -> NDArray[np.float64]:
    """The first samples of the impulse response of the causal sampled filter with a weighting's magnitude.

    Each pole at -s and each zero at 0 becomes one of a recursive filter, at exp(-s / rate) and 1. What these leave of
    the magnitude is so even that its response is short, whatever the rate; it is made causal by `minimum_phase`.

    Examples
    --------
    >>> response = np.fft.rfft(sampled_weighting("A", 48000.0, 1 << 14))
    >>> float((20 * np.log10(np.abs(response[np.argmin(np.abs(np.fft.rfftfreq(1 << 14, 1 / 48e3) - 100))]))).round(1))
    -19.2
    """
    poles = np.exp(-2.0 * np.pi * np.array(POLES[weighting]) / rate)
    zeros = np.arange(poles.size) < ZEROS[weighting]

    def rest(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        later = np.exp(-2j * np.pi * frequency / rate)
        found = np.sqrt(power_weighting(frequency, weighting))
        for pole, zero in zip(poles, zeros, strict=True):
            found *= np.abs(1.0 - pole * later) / (np.abs(1.0 - later) if zero else 1.0)
        return found

    short = np.fft.irfft(minimum_phase(rest, 0, rate, _LINES + 1, 0.0))
    # Long enough for what is cut off to have rung out.
    points = 1 << math.ceil(math.log2(max(2.0 * WEIGHTINGS_RING * rate, short.size)))
    later = np.exp(-2j * np.pi * np.arange(points // 2 + 1) / points)
    lines = np.fft.rfft(short, points)
    for pole, zero in zip(poles, zeros, strict=True):
        lines *= ((1.0 - later) if zero else 1.0) / (1.0 - pole * later)
    return np.fft.irfft(lines)[:samples]


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
