"""Length of the blocks of an analysis, from how long the field of a recording rings."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from specan.arrays import Real
from specan.dsp.energy_decay import NoiseFloor, decay_line, energy_decay

USUAL_S = 1.0  # lines of 1 Hz, as long as the modes are no narrower
LONG_S = 2.0  # reverberation time above which blocks are as long as it: their lines are then as narrow as the modes
MOST_S = 20.0  # as a rig file may say
# Of the decay that is looked at: its beginning, above what the ends of a record of five reverberation times leave.
RANGE_DB = (-2.0, -15.0)
SURE = 10.0  # standard deviations of the noise that the energy of a response must exceed
TAIL = 0.25  # of the impulse response, its end, where only noise is left
DRIVEN = 1e-2  # of the reference's mean power, where lines lose half of their weight
LEAST_OF_RECORD = 5.0  # blocks that a record holds, with what is left out at its beginning


def block_length(
    reference: Real, responses: Iterable[Real], rate: float, band_hz: tuple[float, float]
) -> float:
    """Length of blocks in s: the usual one, or the reverberation time where that is long.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> v = rng.standard_normal(40_000)
    >>> t = np.arange(8000) / 1000
    >>> ringing = np.exp(-6.91 * t / 4.0) * np.sin(2 * np.pi * 150 * t)  # 60 dB in 4 s
    >>> p = np.convolve(v, ringing)[: v.size]
    >>> 3 < block_length(v, [p], 1000.0, (20.0, 400.0)) < 5
    True
    """
    times = [reverberation_s(reference, response, rate, band_hz) for response in responses]
    known = [time for time in times if np.isfinite(time)]
    found = float(np.quantile(known, 0.25)) if known else 0.0  # hum and noise make a decay seem longer
    most = min(MOST_S, reference.size / rate / LEAST_OF_RECORD)
    return USUAL_S if found < LONG_S or most < LONG_S else min(found, most)


def reverberation_s(reference: Real, response: Real, rate: float, band_hz: tuple[float, float]) -> float:
    """Reverberation time of a band from the whole record's impulse response; nan where noise hides it.

    Schroeder's integral, the noise of the response's end taken off.
    """
    first, last = (int(f * reference.size / rate) for f in band_hz)
    v, p = (np.fft.rfft(x)[: last + 1] for x in (reference, response))
    power = np.abs(v) ** 2
    power[:first] = 0.0
    least = DRIVEN * power[first:].mean()  # lines that the source hardly drove count little
    n = 2 * last  # samples at twice the highest frequency
    rate = n * rate / reference.size
    squared = np.fft.irfft(np.where(power > 0, p * v.conj(), 0) / (power + least), n)[: n // 2] ** 2
    floor = NoiseFloor(float(squared[-int(TAIL * squared.size) :].mean()), squared.size, 0.0)
    left = energy_decay(squared, floor)
    # of squares of a normal law, the sum scatters by that
    if left[0] <= SURE * floor.power * np.sqrt(2 * squared.size):
        return float("nan")
    level = 10 * np.log10(np.maximum(left, 1e-12 * left[0]) / left[0])
    return decay_line(level, *RANGE_DB).samples / rate
