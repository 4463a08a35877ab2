"""Decay of the energy of an impulse response: where noise begins, backward integration, decay times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from specan.arrays import Real

# Lundeby, Vigran, Bietz & Vorlaender, Acustica 81 (1995) 344: share of the end that is the first estimate of the
# noise, margins above the noise in dB, range of the late slope in dB, averaging intervals in 10 dB of decay.
_TAIL, _MARGIN_DB, _LATE_DB, _INTERVALS = 0.1, 10.0, 20.0, 5
_ROUNDS = 8
_FEWEST = 4  # points of a regression
DB_PER_NEPER = 10.0 / math.log(10.0)


@dataclass(frozen=True)
class NoiseFloor:
    """Where an impulse response disappears in noise.

    Attributes
    ----------
    power : float
        Mean square of the noise.
    end : int
        Sample from which on there is more noise than response.
    late : float
        Energy, in samples times mean square, that the response has beyond `end` if it goes on as it fell before.
    """

    power: float
    end: int
    late: float


def noise_floor(energy: Real, step: int) -> NoiseFloor:
    """Find the crossing of decay and noise by the iteration of Lundeby et al. (1995).

    Parameters
    ----------
    energy : array (n,)
        Squared response, from its strongest arrival on.
    step : int
        Samples of the first averaging interval (10 ms to 50 ms).

    Returns
    -------
    NoiseFloor
        With `end` at the last sample and no noise where the response does not level out.

    Examples
    --------
    >>> t = np.arange(20000) / 10000
    >>> found = noise_floor(np.exp(-13.8155 * t) + 1e-4, 100)
    >>> round(found.power * 1e4, 1), abs(found.end / 10000 - 0.667) < 0.03
    (1.0, True)
    """
    n = energy.size
    noise = float(np.mean(energy[-max(1, int(_TAIL * n)) :]))
    slope, level = _fit(energy, step, noise, None)
    crossing = _crossing(slope, level, noise, n)
    for _ in range(_ROUNDS if slope < 0 else 0):
        fall = 10.0 / -slope  # samples in which the response falls by 10 dB
        step = max(1, int(fall / _INTERVALS))
        begin = min(int(crossing + 0.5 * fall), int((1 - _TAIL) * n))
        noise = float(np.mean(energy[begin:]))
        slope, level = _fit(energy, step, noise, _LATE_DB)
        previous, crossing = crossing, _crossing(slope, level, noise, n)
        if abs(crossing - previous) < step or not slope < 0:
            break
    if not slope < 0:
        return NoiseFloor(0.0, n, 0.0)
    end = int(crossing)
    beyond = 10.0 ** ((level + slope * end) / 10.0) * DB_PER_NEPER / -slope
    # Where the record ends before the noise, its tail is response.
    return NoiseFloor(noise if end < n else 0.0, end, beyond)


def _fit(energy: Real, step: int, noise: float, span_dB: float | None) -> tuple[float, float]:
    """Slope (dB a sample) and level at sample 0 of the decay above the noise; of its last `span_dB` if given."""
    step = max(1, min(step, energy.size // _FEWEST))
    count = energy.size // step
    mean = np.add.reduce(energy[: count * step].reshape(count, step), axis=1) / step
    with np.errstate(divide="ignore"):
        level = 10.0 * np.log10(mean)
    floor = (10.0 * math.log10(noise) if noise > 0 else -math.inf) + _MARGIN_DB
    first = int(np.argmax(level))
    low = first + int(np.argmax(np.append(level[first:] <= floor, True)))
    if span_dB is not None:
        above = np.flatnonzero(level[first:low] > floor + span_dB)
        first = first + int(above[-1]) if above.size else first
    if low - first < _FEWEST:
        low = min(count, first + _FEWEST)
    shown = level[first:low]
    if shown.size < 2 or not np.isfinite(shown).all():
        return 0.0, 0.0
    time = (np.arange(first, low) + 0.5) * step
    slope, start = np.polyfit(time, shown, 1)
    return float(slope), float(start)


def _crossing(slope: float, level: float, noise: float, n: int) -> float:
    if not slope < 0 or noise <= 0:
        return float(n)
    return float(np.clip((10.0 * math.log10(noise) - level) / slope, 1.0, n))


def energy_decay(energy: Real, floor: NoiseFloor) -> Real:
    """Energy left at each instant up to the noise floor's `end`: backward integration (Schroeder 1965).

    The mean square of the noise is taken off, and what lies beyond the end is added (ISO 3382-1:2009, 5.3.3).

    Returns
    -------
    array (end,)
        In samples times mean square.
    """
    kept = energy[: floor.end] - floor.power
    return np.asarray(np.cumsum(kept[::-1])[::-1] + floor.late)


@dataclass(frozen=True)
class DecayLine:
    """A straight line through a part of a decay curve.

    Attributes
    ----------
    samples : float
        Samples in which the line falls by 60 dB; NaN where the curve does not hold the part.
    nonlinearity : float
        xi = 1000 (1 - r^2) in permille, r the correlation (ISO 3382-2:2008, B.2).
    """

    samples: float
    nonlinearity: float


def decay_line(curve_dB: Real, upper_dB: float, lower_dB: float) -> DecayLine:
    """Least squares line through a decay curve between two levels below its beginning (ISO 3382-1:2009, 6).

    Examples
    --------
    >>> decay_line(-0.01 * np.arange(5000.0), -5.0, -25.0).samples
    6000.0
    """
    below = np.flatnonzero(curve_dB <= lower_dB)
    if not below.size:
        return DecayLine(math.nan, math.nan)
    last = int(below[0])
    first = int(np.argmax(curve_dB <= upper_dB))
    if last - first < _FEWEST:
        return DecayLine(math.nan, math.nan)
    time = np.arange(first, last)
    slope, _ = np.polyfit(time, curve_dB[first:last], 1)
    correlation = np.corrcoef(time, curve_dB[first:last])[0, 1]
    return DecayLine(round(-60.0 / float(slope), 9), 1000.0 * (1.0 - float(correlation) ** 2))
