"""Mean squares over successive intervals, weighted in time: readings at given times, maximum and minimum."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from specan.dsp.filter_at_work import FilterAtWork
from specan.dsp.history_filters import Filter
from specan.dsp.multirate import Stage
from specan.dsp.sections import GRAIN
from specan.dsp.time_weighting import TimeWeighting

Real = NDArray[np.float64] | NDArray[np.float32]

# What a band filter makes of the cut at the record's beginning has fallen by 60 dB after 2 times 3 / B: 10 dB
# in every 1 / B.
_SETTLINGS_OF_A_CUT = 2.0
# Time constants after which nothing is left of an average, to the last bit.
_FORGOTTEN = 38.0


class RunningLevel:
    """Weights in time what a filter's intervals bring, and reads the result.

    Parameters
    ----------
    one : Filter
    stage : Stage
    rows : int
        Number of channels.
    way : FilterAtWork
        Says what an interval is.
    time_constant, decay : float
        See `TimeWeighting`.
    settled : float
        Seconds from the record's beginning after which a minimum is looked for.
    end : float
        Where the record ends, in s.
    times : ndarray, shape (times,)
        When to read, in s from the record's beginning; ascending.
    """

    def __init__(
        self,
        one: Filter,
        stage: Stage,
        rows: int,
        way: FilterAtWork,
        time_constant: float,
        decay: float | None,
        settled: float,
        end: float,
        times: NDArray[np.float64],
    ) -> None:
        # A weighting has what the cut makes of it taken off.
        starts = 0.0 if one.weighting else _SETTLINGS_OF_A_CUT * one.settling
        rate, lead, together = stage.rate, stage.lead, way.together
        self._weighting = TimeWeighting(rows, rate / together, time_constant, decay)
        self._peaks = TimeWeighting(rows, rate / together, time_constant, decay) if decay and starts else None
        # A sample stands for half a sampling interval on either side of it; an average is known at the end of its
        # interval.
        last = (lead + end * rate + 0.5) / together - 1.0
        # Extremes are looked for at the ends of intervals, and at the two moments that bound the search.
        place = np.append(np.minimum(times, end), [min(settled, end), end])
        place = (lead + place * rate + 0.5 * together / way.kept) / together - 1.0
        self._order = np.argsort(place, kind="stable")
        self._place, self._falls = place[self._order], settled < end
        # Up to half an interval later than the last one is known: found from the last two.
        self._known_from = np.minimum(self._place, last)
        self._end = math.floor(min(float(place[-1]), last) + 1e-6) + 1
        # Where the record begins, and where a search begins that leaves out what the cut makes of a band.
        self._first = math.ceil(lead / together)
        self._start = math.ceil((lead + starts * rate) / together)
        self._from, self._fall = float(self._start - 1), together / (rate * time_constant)
        if starts and not decay:
            self._from = (lead + starts * rate + 0.5 * together / way.kept) / together - 1.0
            self._start = math.floor(self._from) + 1
        self._settled = math.ceil((lead + settled * rate) / together)
        samples = math.floor(lead + end * rate + 1e-6) + 1
        self._last_interval = samples * way.intervals // GRAIN
        self._last_part = max(samples / together - self._last_interval, 1.0 / together)
        self._intervals = (samples - lead) / together
        self._position, self._read = 0, 0
        self._last = np.zeros((rows, 1))
        # The average after which a maximum is looked for, and what the end has of it.
        self._before_start: NDArray[np.float64] | None = None
        self._left = math.exp((self._from - float(place[-1])) * self._fall)
        self._readings = np.full((rows, place.size), np.nan)
        self._maximum, self._minimum = np.full(rows, np.nan), np.full(rows, np.nan)
        self._counted = np.full(rows, np.nan)
        self._whole, self._sum = one.identity or one.weighting is not None, np.zeros(rows)
        # Behind a weighting whose decays at the beginning are not taken off.
        self._time = rate / together, time_constant, decay
        self._cut_intervals, self._cut_sum, self.highest_with_cut = 0, np.zeros(rows), np.full(rows, np.nan)

    def cut(self, count: int) -> tuple[int, float] | None:
        """In which of the next intervals the record ends, and which part of it the record has."""
        place = self._last_interval - self._position
        return (place, self._last_part) if 0 <= place < count else None

    def due(self, count: int) -> NDArray[np.float64]:
        """Where in the next intervals the next readings are, in intervals from the first one on."""
        # A place as computed may miss an interval by a rounding error.
        done = int(np.searchsorted(self._known_from, self._position + count - 1 + 1e-6, side="right"))
        return np.asarray(self._place[self._read : done] - self._position)

    def inside(self, count: int) -> slice:
        """Which of the next intervals belong to the record, behind a filter that has answered to its beginning."""
        return slice(max(self._start - self._position, 0), max(min(count, self._end - self._position), 0))

    def take(
        self,
        square: Real,
        factor: NDArray[np.float64] | None = None,
    ) -> None:
        """Weight the next mean squares (channels, intervals), each channel's times a factor, and read the result."""
        high, low = self._span(square, self._start), self._span(square, self._settled)
        counted = self._span(square, self._first)
        if self._whole:
            square[:, : counted.start] = 0.0
            self._add_up(square, factor)
        weighted = self._weighting(square, factor)
        self._minimum = np.fmin(self._minimum, np.fmin.reduce(weighted[:, low], axis=1, initial=np.nan))
        self._counted = np.fmax(self._counted, np.fmax.reduce(weighted[:, counted], axis=1, initial=np.nan))
        if self._peaks is not None:  # what a peak holder has held cannot be taken off
            square[:, : max(self._start - self._position, 0)] = 0.0
            later = self._peaks(square, factor)[:, high]
        else:
            later = self._without_beginning(weighted, high)
        self._maximum = np.fmax(self._maximum, np.fmax.reduce(later, axis=1, initial=np.nan))
        self._look(weighted)
        self._last = weighted[:, -1:].copy()
        self._position += square.shape[1]

    def see_cut(self, rows: slice, square: NDArray[np.float64]) -> None:
        """Take the first mean squares of some rows, from the record's beginning on, with the cut in them."""
        weighted = TimeWeighting(len(square), *self._time)(square)
        self.highest_with_cut[rows] = np.max(weighted, axis=1, initial=0.0)
        self._cut_intervals, self._cut_sum[rows] = square.shape[1], np.add.reduce(square, axis=1)

    def _add_up(self, square: Real, factor: NDArray[np.float64] | None) -> None:
        """Add the next mean squares to the sum over the record, the last interval as far as it belongs to it."""
        last = self._last_interval - self._position
        if self._position == 0 and self._cut_intervals:
            known = np.add.reduce(square[:, : self._cut_intervals], axis=1, dtype=np.float64)
            self._cut_sum -= known if factor is None else known * factor
        found = np.add.reduce(square[:, : max(last, 0)], axis=1, dtype=np.float64)
        if 0 <= last < square.shape[1]:
            found += self._last_part * square[:, last]
        self._sum += found if factor is None else found * factor

    def mean_square(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Over the record, of what comes out of a weighting, or of the record itself; and with the cut."""
        return self._sum / self._intervals, (self._sum + self._cut_sum) / self._intervals

    def _span(self, square: Real, since: int) -> slice:
        """Which of the next intervals belong to the record from an interval of it on."""
        return slice(max(since - self._position, 0), max(min(square.shape[1], self._end - self._position), 0))

    def result(self) -> tuple[NDArray[np.float64], ...]:
        """Readings (channels, times), maxima and minimum (channels,); see `specan.dsp.band_history.Histories`."""
        readings = np.empty_like(self._readings)
        readings[:, self._order] = self._readings
        highest, lowest = self._maximum, self._minimum
        if self._before_start is not None:
            highest = np.fmax(highest, readings[:, -1] - self._left * self._before_start[:, 0])
        if self._falls:
            lowest = np.fmin(lowest, np.fmin(readings[:, -2], readings[:, -1]))
        counted = highest
        if self._start > self._first:
            counted = np.fmax(self._counted, readings[:, -1])
        return readings[:, :-2], counted, highest, lowest

    def _at(self, weighted: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Averages at the ends of intervals, of which -1 is the last one of those before."""
        return np.where(places < 0, self._last, weighted[:, np.clip(places, 0, weighted.shape[1] - 1)])

    def _without_beginning(self, weighted: NDArray[np.float64], span: slice) -> NDArray[np.float64]:
        """Averages in a span without what is left in them of what came before the search."""
        if self._start <= self._first or span.start >= span.stop:
            return weighted[:, span]
        if self._before_start is None:
            # Between the ends of two intervals, as if the square were constant.
            earlier, at_end = np.hsplit(self._at(weighted, span.start + np.array([-1, 0])), 2)
            share = math.expm1((self._start - 1 - self._from) * self._fall) / math.expm1(-self._fall)
            self._before_start = earlier + share * (at_end - earlier)
        since = self._position - self._from + np.arange(span.start, span.stop)
        left = np.exp(-self._fall * since[since * self._fall < _FORGOTTEN])
        if not left.size:
            return weighted[:, span]
        found = weighted[:, span].copy()
        found[:, : left.size] -= self._before_start * left
        return found

    def _look(self, weighted: NDArray[np.float64]) -> None:
        """Interpolate between the ends of two intervals."""
        due = self.due(weighted.shape[1])
        if due.size:
            last = self._known_from[self._read : self._read + due.size] - self._position
            before = np.floor(last).astype(int)
            # A reading on the end of the last interval, as computed, may lie behind it by a rounding error.
            earlier, later = self._at(weighted, before), self._at(weighted, np.maximum(before + 1, 0))
            share = due - before
            done = self._read + due.size
            # What is left of an earlier average is taken off that at the end: both as if the square were constant.
            at_end = self._place[self._read : done] == self._place[-1]
            share = np.where(at_end, np.expm1(-share * self._fall) / math.expm1(-self._fall), share)
            self._readings[:, self._read : done] = earlier * (1.0 - share) + later * share
            self._read = done
