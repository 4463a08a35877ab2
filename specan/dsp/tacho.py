"""From the samples of a tacho to the angle of its shaft: pulses, their repair, and what jitter leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import InputError

FEWEST = 6  # samples a pulse: the third harmonic, which makes a pulse flat, is below half the sampling rate
REGULAR = 0.35  # deviation over mean of times between rises: noise has 0.5, few samples a pulse at most 0.25
HYSTERESIS = 0.2  # of the step between the two levels, to either side of the threshold
MOST_FAULTS = 0.05  # of the pulses: with more the tacho is not repaired but refused
# An edge over within a few samples: at least this part of the step between two of them (of a sine with ten samples a
# turn 0.44), and the outer two of the samples that are summed as near to its levels as filters ring.
_STEEP, _SETTLED, _REACHES = 0.49, 0.1, (3, 4)
# Standard deviations about them that the levels must lie apart: noise has 2.2, a sine 4.5.
_LEVELS_APART = 3.0
_NEAR = 4  # intervals to either side whose median tells what an interval should be
_SHORT, _LONG = 0.6, 1.5  # of that: below, one pulse is too many; above, pulses are missing
# Intervals whose pulses can be counted: no more than the neighbours reach that tell what an interval should be.
COUNTABLE = 2 * _NEAR
_DEGREE = 5  # of the spline: the change of the speed is smooth too


@dataclass(frozen=True)
class Pulses:
    """Pulses of a tacho after repair.

    Attributes
    ----------
    time : array
        Instants in s, strictly rising.
    number : array of int
        Which pulse it is, counted from the first one; a missing pulse leaves a gap.
    missing, double : int
        Pulses that should have been there, and pulses that were taken away.
    silent : tuple of (float, float)
        From when to when there are no pulses, and none can be counted: the shaft stands still, or the tacho fails.
    """

    time: Real
    number: NDArray[np.int64]
    missing: int
    double: int
    silent: tuple[tuple[float, float], ...] = ()


def pulse_times(samples: Real, sampling_rate: float) -> Real:
    """Instants at which a tacho's signal rises through the middle of its two levels, in s.

    The levels are the medians of what lies above and below the middle (two clusters; edges do not move them). A
    rise counts when the signal has gone from below the lower to above the upper end of a hysteresis. Of an edge that is
    over within a few samples, the area under it tells the instant: an anti-alias filter without gain at multiples of
    the sampling rate leaves it as it was. Other instants are interpolated between the samples about the middle, which
    of a steep edge errs by a tenth of a sample, in beats of the pulses with the sampling rate.

    Parameters
    ----------
    samples : array
        Signal of the tacho, any unit.
    sampling_rate : float
        In Hz.

    Raises
    ------
    InputError
        The signal has no two levels: there are no pulses, or too few samples a pulse.

    Examples
    --------
    >>> t = np.arange(1000) / 1000.0
    >>> pulse_times(np.sin(2 * np.pi * 10 * t - 0.3), 1000.0)[:2].round(4).tolist()
    [0.0048, 0.1048]
    """
    x = np.asarray(samples, dtype=float)
    low, high = _levels(x, sampling_rate)
    middle, gap = 0.5 * (low + high), HYSTERESIS * (high - low)
    state = (x > middle + gap).astype(np.int8) - (x < middle - gap).astype(np.int8)
    known = np.flatnonzero(state)
    rises = known[1:][(state[known[1:]] > 0) & (state[known[:-1]] < 0)]
    before = known[:-1][(state[known[1:]] > 0) & (state[known[:-1]] < 0)]
    # The last sample below the middle before the rise is complete.
    place = rises - 1
    while (waiting := (x[place] >= middle) & (place > before)).any():
        place = np.where(waiting, place - 1, place)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (middle - x[place]) / (x[place + 1] - x[place])
    found = place + np.clip(np.nan_to_num(part), 0.0, 1.0)
    for reach in _REACHES:
        found = _by_area((x - low) / (high - low), place, reach, found)
    return found / sampling_rate


def _by_area(x: Real, place: NDArray[np.intp], reach: int, otherwise: Real) -> Real:
    """Instants in samples of edges from 0 to 1 that are over within `reach` samples; `otherwise` where they are not."""
    window = place[:, None] + np.arange(1 - reach, 1 + reach)
    edge = x[np.clip(window, 0, x.size - 1)]
    outer = np.abs(np.concatenate([edge[:, :2], 1 - edge[:, -2:]], axis=1)).max(axis=1)
    inside = (window[:, 0] >= 0) & (window[:, -1] < x.size)
    steep = inside & (edge[:, reach] - edge[:, reach - 1] > _STEEP) & (outer < _SETTLED)
    return np.where(steep, place + reach + 0.5 - edge.sum(axis=1), otherwise)


def _levels(x: Real, sampling_rate: float) -> tuple[float, float]:
    """Low and high level of a signal that has two."""
    finite = x[np.isfinite(x)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if high > low:
        for _ in range(8):
            middle = 0.5 * (low + high)
            below, above = finite[finite <= middle], finite[finite > middle]
            if not above.size:
                break
            low, high = float(np.median(below)), float(np.median(above))
        scatter = float(
            np.sqrt(np.mean(np.where(finite > 0.5 * (low + high), finite - high, finite - low) ** 2))
        )
        if high - low > _LEVELS_APART * scatter:
            return low, high
        over = finite > 0.5 * (low + high)
        apart = np.diff(np.flatnonzero(over[1:] & ~over[:-1]))
        if apart.size and apart.std() < REGULAR * apart.mean() and apart.mean() < FEWEST:
            rate = sampling_rate / apart.mean()
            raise InputError(
                f"the tacho has {rate:.0f} pulses per second, too many for {sampling_rate:.6g} samples per second",
                expected=f"at least {FEWEST} samples per pulse",
                remedy=f"sample at {FEWEST * rate:.0f} Hz or more, use a tacho with fewer pulses per turn, or give the "
                "speed; if these are no pulses, name the right channel",
            )
    raise InputError(
        "the tacho shows no pulses: its signal does not have two levels",
        remedy="name the right channel, or give the speed",
    )


def repair(times: Real, start: float = -np.inf, stop: float = np.inf) -> Pulses:
    """Take double pulses away and leave gaps where pulses are missing, in one part in which the shaft turns.

    Of several parts, with gaps between them that are too long to be counted, the one that is longest between `start`
    and `stop` is taken.

    What an interval should be is the median of its neighbours. Of two pulses that are too close, that one goes whose
    absence leaves the more even interval.

    Raises
    ------
    InputError
        Fewer than four pulses, or more than a twentieth of them at fault.

    Examples
    --------
    >>> found = repair(np.array([0.0, 1.0, 2.0, 2.1, 3.0, 5.0, 6.0, 7.0]))
    >>> found.time.tolist(), found.number.tolist(), found.missing, found.double
    ([0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0], [0, 1, 2, 3, 5, 6, 7], 1, 1)
    """
    kept = np.asarray(times, dtype=float)
    if kept.size < 4:
        raise InputError(f"the tacho shows {kept.size} pulses", expected="at least four")
    double = 0
    while kept.size >= 4:
        spacing = np.diff(kept)
        usual = _usual(spacing)
        short = np.flatnonzero(spacing < _SHORT * usual)
        if not short.size:
            break
        away = _worse_of_two(spacing, usual, short)
        double += away.size
        kept = np.delete(kept, away)
    kept, silent = _longest_part(kept, start, stop)
    spacing = np.diff(kept)
    usual = _usual(spacing)
    steps = np.where(spacing < _LONG * usual, 1.0, np.rint(spacing / usual)).astype(np.int64)
    missing = int(np.sum(steps - 1))
    if missing + double > max(1.0, MOST_FAULTS * kept.size) and missing + double > 2:
        raise InputError(
            f"the tacho has {missing} missing and {double} double pulses among {kept.size}",
            expected=f"at most {100 * MOST_FAULTS:g} % of them",
            remedy="check its level and its cable, or give the speed",
        )
    return Pulses(kept, np.concatenate([[0], np.cumsum(steps)]), missing, double, silent)


def _longest_part(times: Real, start: float, stop: float) -> tuple[Real, tuple[tuple[float, float], ...]]:
    """Pulses between two gaps that are too long to be counted, and those gaps.

    A shaft that stops or starts gives ever longer intervals: none tells how many pulses the last one should have.
    """
    spacing = np.diff(times)
    gaps = np.flatnonzero(spacing > COUNTABLE * _usual(spacing))
    silent = tuple((float(times[k]), float(times[k + 1])) for k in gaps)
    parts = np.split(times, gaps + 1)
    kept = max(parts, key=lambda part: min(part[-1], stop) - max(part[0], start))
    while kept.size > 4:
        spacing = np.diff(kept)
        first, *_, last = spacing > _LONG * _usual(spacing)
        if not (first or last):
            break
        kept = kept[int(first) : kept.size - int(last)]
    return kept, silent


def _usual(spacing: Real) -> Real:
    """Median of the intervals about each one; where a shaft is slowest, the shorter one of its two neighbours."""
    width = min(_NEAR, (spacing.size - 1) // 2)
    padded = np.pad(spacing, width, mode="reflect") if width else spacing
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1), axis=1)
    beside = np.pad(spacing, 1, constant_values=0.0)
    return np.maximum(middle, np.minimum(beside[:-2], beside[2:]))


def _worse_of_two(spacing: Real, usual: Real, short: NDArray[np.intp]) -> NDArray[np.intp]:
    """For each short interval, the pulse at its one or other end; each interval once, neighbours in later rounds."""
    short = short[np.concatenate([[True], np.diff(short) > 2])]
    left = np.where(short > 0, spacing[short - 1] + spacing[short], np.inf)
    after = np.minimum(short + 1, spacing.size - 1)
    right = np.where(short + 1 < spacing.size, spacing[short] + spacing[after], np.inf)
    first_goes = np.abs(left - usual[short]) < np.abs(right - usual[short])
    return np.where(first_goes, short, short + 1)


@dataclass(frozen=True)
class ShaftAngle:
    """Turns of a shaft against time.

    Attributes
    ----------
    time, turns : arrays
        Smoothed instants of the pulses and the turns at them.
    jitter_s : float
        Standard deviation of what smoothing took off the pulses.
    """

    time: Real
    turns: Real
    jitter_s: float

    def at(self, time: Real) -> Real:
        """Turns at instants between the first pulse and the last; beyond them the speed goes on as it was."""
        inside = np.clip(time, self.time[0], self.time[-1])
        spline = self._spline
        return spline(inside) + (np.asarray(time) - inside) * spline(inside, 1)

    def speed(self, time: Real) -> Real:
        """Turns per second."""
        return self._spline(np.clip(time, self.time[0], self.time[-1]), 1)

    @cached_property
    def _spline(self):
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.time, self.turns)


def shaft_angle(pulses: Pulses, pulses_per_turn: float) -> ShaftAngle:
    """Angle from pulses whose instants scatter.

    The instant of a pulse is a smooth function of its number: a spline of the fifth degree by least squares, whose
    knots lie as far apart as generalised cross-validation finds best (Craven and Wahba, Numer. Math. 31 (1979) 377).
    Jitter of the pulses is averaged over a knot's width; what the shaft does more slowly than that stays.

    Parameters
    ----------
    pulses : Pulses
    pulses_per_turn : float
        Of the shaft whose angle is wanted: the wheel's pulses times the turns of its shaft per turn of that one.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> number = np.arange(2000)
    >>> found = shaft_angle(Pulses(number / 200 + 1e-5 * rng.standard_normal(2000), number, 0, 0), 20.0)
    >>> bool(abs(found.at(np.array([5.0]))[0] - 50.0) < 2e-5), round(1e6 * found.jitter_s)
    (True, 10)
    """
    from scipy.interpolate import make_lsq_spline

    x = pulses.number.astype(float)
    line = np.polyfit(x, pulses.time, 1)
    y = pulses.time - np.polyval(line, x)  # small numbers: the fit keeps its digits
    best, chosen = np.inf, None
    spacing = 2.0
    while spacing < max(4.0, x[-1] / 2):
        knots = _knots(x, spacing)
        spacing *= 2.0
        freedom = x.size - (len(knots) - _DEGREE - 1)
        if freedom <= 0:  # as many coefficients as pulses: nothing is averaged
            continue
        spline = make_lsq_spline(x, y, knots, k=_DEGREE)
        rest = float(np.sum((y - spline(x)) ** 2))
        score = x.size * rest / freedom**2
        if score < best:
            best, chosen = score, (spline, np.sqrt(rest / freedom))
    whole = np.arange(pulses.number[-1] + 1, dtype=float)
    if chosen is None:  # a handful of pulses: nothing to smooth
        return ShaftAngle(pulses.time, x / pulses_per_turn, 0.0)
    spline, jitter = chosen
    time = spline(whole) + np.polyval(line, whole)
    if not np.all(np.diff(time) > 0):
        raise InputError("the tacho's pulses are too irregular for an angle", remedy="give the speed")
    return ShaftAngle(time, whole / pulses_per_turn, float(jitter))


def _knots(x: Real, spacing: float) -> Real:
    """Knots of a spline some pulses apart, each with pulses between it and the next."""
    inner = np.arange(spacing, x[-1] - 0.5 * spacing, spacing)
    held = np.searchsorted(x, np.concatenate([[x[0]], inner, [x[-1]]]))
    inner = inner[(np.diff(held)[:-1] > 1) & (np.diff(held)[1:] > 1)] if inner.size else inner
    return np.concatenate([[x[0]] * (_DEGREE + 1), inner, [x[-1]] * (_DEGREE + 1)])
