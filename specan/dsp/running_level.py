"""Mean squares over successive intervals, weighted in time: readings at given times, maximum and minimum."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from specan.dsp.history_filters import Filter
from specan.dsp.multirate import Stage
from specan.dsp.time_weighting import TimeWeighting

Real = NDArray[np.float64] | NDArray[np.float32]

# What a band filter makes of the cut at the record's beginning has fallen by 60 dB after 2 times 3 / B: 10 dB
# in every 1 / B.
_SETTLINGS_OF_A_CUT = 2.0


class RunningLevel:
    """Weights in time what a filter's intervals bring, and reads the result.

    Parameters
    ----------
    one : Filter
    stage : Stage
    rows : int
        Number of channels.
    together, kept : int
        Samples of the stage in an interval, and samples of the filter's output in it.
    time_constant, decay : float
        See `TimeWeighting`.
    settled : float
        Seconds from the record's beginning after which a minimum is looked for.
    end : float
        Where the record ends, in s.
    times : ndarray, shape (times,)
        When to read, in s from the record's beginning; ascending.

    Attributes
    ----------
    readings : ndarray, shape (channels, times)
    maximum, minimum : ndarray, shape (channels,)
        See `specan.dsp.band_history.Histories`.
    """

    def __init__(
        self,
        one: Filter,
        stage: Stage,
        rows: int,
        together: int,
        kept: int,
        time_constant: float,
        decay: float | None,
        settled: float,
        end: float,
        times: NDArray[np.float64],
    ) -> None:
        starts = max(one.silent, 0.0 if one.sampled else _SETTLINGS_OF_A_CUT * one.settling)
        rate, lead = stage.rate, stage.lead
        self._weighting = TimeWeighting(rows, rate / together, time_constant, decay)
        self._peaks = TimeWeighting(rows, rate / together, time_constant, decay) if decay and starts else None
        # A sample stands for half a sampling interval on either side of it; an average is known at the end of its
        # interval.
        last = (lead + end * rate + 0.5) / together - 1.0
        place = (
            lead + np.append(np.minimum(times, end), end) * rate + 0.5 * together / kept
        ) / together - 1.0
        place = np.minimum(place, last)
        self._place = place[:-1]
        self._end = math.floor(float(place[-1]) + 1e-6) + 1
        self._silent = math.ceil((lead + one.silent * rate) / together) if one.silent else 0
        self._start = math.ceil((lead + starts * rate) / together)
        self._settled = math.ceil((lead + settled * rate) / together)
        samples = math.floor(lead + end * rate + 1e-6) + 1
        self._together, self._last_interval = together, samples // together
        self._last_samples = max(samples % together, 1)
        self._position, self._read = 0, 0
        self._held, self._last = decay is not None, np.zeros((rows, 1))
        self._before_start: NDArray[np.float64] | None = None
        self.readings = np.full((rows, len(times)), np.nan)
        self.maximum, self.minimum = np.full(rows, np.nan), np.full(rows, np.nan)

    def cut(self, count: int) -> tuple[int, int] | None:
        """In which of the next intervals the record ends, and how many samples of the stage it has there."""
        place = self._last_interval - self._position
        return (place, self._last_samples) if 0 <= place < count else None

    def inside(self, count: int) -> slice:
        """Which of the next intervals belong to the record, behind a filter that has answered to its beginning."""
        return slice(max(self._start - self._position, 0), max(min(count, self._end - self._position), 0))

    def take(self, square: Real, factor: NDArray[np.float64] | None = None) -> None:
        """Weight the next mean squares (channels, intervals), each channel's times a factor, and read the result."""
        square[:, : max(self._silent - self._position, 0)] = 0.0
        high, low = self._span(square, self._start), self._span(square, self._settled)
        if self._held:
            weighted = self._weighting(square, factor)
            self.minimum = np.fmin(self.minimum, np.fmin.reduce(weighted[:, low], axis=1, initial=np.nan))
            known = np.concatenate([self._last, weighted], axis=1)
            self._last = known[:, -1:]
            if self._peaks is not None:
                square[:, : max(self._start - self._position, 0)] = 0.0
                weighted = self._peaks(square, factor)
            self.maximum = np.fmax(self.maximum, np.fmax.reduce(weighted[:, high], axis=1, initial=np.nan))
            self._look(square.shape[1], lambda places: known[:, places + 1])
        else:
            sparse = self._weighting.sparse(square, factor)
            if low.start < low.stop:
                self.minimum = sparse.smallest(low, self.minimum)
            if high.start < high.stop:
                if self._before_start is None:
                    self._before_start = sparse.at(np.array([high.start - 1]))
                later = self._position - self._start
                self.maximum = sparse.largest(high, self.maximum, self._before_start, later)
            self._look(square.shape[1], sparse.at)
        self._position += square.shape[1]

    def _span(self, square: Real, since: int) -> slice:
        """Which of the next intervals belong to the record from an interval of it on."""
        return slice(max(since - self._position, 0), max(min(square.shape[1], self._end - self._position), 0))

    def _look(self, length: int, at: Callable[[NDArray[np.intp]], NDArray[np.float64]]) -> None:
        """Intervals i and i + 1 around each reading, the last one of before included."""
        # A place as computed may miss an interval by a rounding error.
        done = int(np.searchsorted(self._place, self._position + length - 1 + 1e-6, side="right"))
        if done == self._read:
            return
        place = self._place[self._read : done] - (self._position - 1)
        before = np.clip(np.floor(place).astype(int), 0, length - 1)
        share = place - before
        earlier, later = np.hsplit(at(np.concatenate([before - 1, before])), 2)
        self.readings[:, self._read : done] = earlier * (1.0 - share) + later * share
        self._read = done
