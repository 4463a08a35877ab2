"""The filters of time-weighted levels: bands and frequency weightings as analogue responses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.minimum_phase import minimum_phase
from specan.dsp.weighting import ZEROS, Weighting, complex_weighting, power_weighting

# A band is filtered at the lowest rate whose samples are faithful up to this many times its upper edge.
_ROOM_ABOVE = 1.25
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
        Response at a number of lines up to half a sampling rate, of the causal filter with this magnitude.
    """

    response: Response
    lower: float = 0.0
    upper: float = math.inf
    settling: float = 0.0
    ringing: float = math.inf
    identity: bool = False
    silent: float = 0.0
    sampled: Callable[[float, int], NDArray[np.complex128]] | None = None


def band_filter(index: int, fraction: int, weighting: Weighting = "Z") -> Filter:
    """Band filter of a fractional octave, with a frequency weighting; see `bands.power_response`."""
    mid = float(bands.mid_frequencies(index, fraction))
    lower, upper = (float(edge) for edge in bands.band_edges(index, fraction))

    def response(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        return bands.complex_response(frequency / mid, fraction) * complex_weighting(frequency, weighting)

    # The envelope of an order 4 band-pass settles to 1 % within 3 / B.
    settling = 3.0 / (upper - lower)
    return Filter(response, lower, _ROOM_ABOVE * upper, settling, SETTLINGS_IN_A_BLOCK * settling)


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
