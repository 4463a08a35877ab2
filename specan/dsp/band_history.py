"""Time-weighted levels behind band filters and frequency weightings, against time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from specan.dsp.filter_at_work import FilterAtWork, Scratch, stage_for
from specan.dsp.freed_memory import keep_freed_memory
from specan.dsp.history_filters import Filter
from specan.dsp.multirate import FACTOR, Stage, stages_of
from specan.dsp.running_level import RunningLevel
from specan.dsp.sections import GRAIN, LATE, Sections, shape_for

# The rounding of a transform in single precision, 1e-7 of the RMS of its section, is spread over all of the section. A
# moment of so many intervals that is 50 dB below the mean has it at 3e-5 of its own amplitude, which changes its mean
# square by less than 1e-4 dB. Where there is a quieter one, double precision is used.
_MOMENT, _QUIET = 16, 1e-5
# Samples of which a constant part is taken off at once.
_PIECE = 1 << 15


@dataclass(frozen=True)
class Histories:
    """Time-weighted mean squares.

    Attributes
    ----------
    readings : ndarray, shape (channels, filters, times)
        At the times asked for.
    maximum, minimum : ndarray, shape (channels, filters)
        The maximum from the time on at which the cut at the record's beginning has left the filter (what came
        before it does not count, not even as a decay), the minimum after `settled_s`. NaN where the record is
        too short for that.
    settled_s : ndarray, shape (filters,)
        Seconds after which a filter and the time weighting behind it have settled to 0.1 dB.
    """

    readings: NDArray[np.float64]
    maximum: NDArray[np.float64]
    minimum: NDArray[np.float64]
    settled_s: NDArray[np.float64] = field(repr=False)


class BandHistoryAccumulator:
    """Takes a record in consecutive blocks, filters, squares, weights in time, reads at given times.

    Filtering is multiplication of the transform of a section with the filter's response: neither the bilinear
    transform's warping nor a sampled filter's rounding at low frequencies. A section begins with so many known
    samples as its filters ring for. What comes out of a filter is found in single precision unless it has very quiet
    moments; transforms of the samples, and the weighting in time, are in double precision.

    Parameters
    ----------
    rows : int
        Number of channels.
    sampling_rate : float
        In Hz.
    n_samples : int
        Length of the record.
    filters : sequence of Filter
    time_constant, decay : float
        See `TimeWeighting`.
    times : array_like
        When to read, in s from the record's beginning; ascending.
    derivatives : sequence of int, optional
        How many times each channel is to be differentiated.
    offset : ndarray, shape (channels,), optional
        A constant part of each channel that is taken off all its samples.

    Examples
    --------
    >>> from specan.dsp.history_filters import band_filter
    >>> t = np.arange(16000) / 8000
    >>> history = BandHistoryAccumulator(
    ...     1, 8000.0, 16000, [band_filter(0, 3)], 0.125, None, times=np.array([1.0, 1.9])
    ... )
    >>> history.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> history.result().readings[0, 0].round(2).tolist()
    [0.5, 0.5]
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        n_samples: int,
        filters: Sequence[Filter],
        time_constant: float,
        decay: float | None,
        times: NDArray[np.float64],
        derivatives: Sequence[int] | None = None,
        offset: NDArray[np.float64] | None = None,
    ) -> None:
        keep_freed_memory()
        self._offset = None if offset is None or not offset.any() else offset[:, None]
        self._derivatives = np.zeros(rows, dtype=int) if derivatives is None else np.asarray(derivatives)
        self._times = len(times)
        end = (n_samples - 0.5) / sampling_rate
        self._settled = np.array([5.0 * time_constant + one.settling for one in filters])
        if (
            self._derivatives.any()
        ):  # an integrator rings for ever, and what is not filtered is differentiated
            filters = [replace(one, ringing=math.inf, identity=False) for one in filters]
        stages = _stages(sampling_rate)
        at = [stage_for(one, stages, time_constant).number for one in filters]
        self._sections: list[Sections] = []
        self._store: list[NDArray[np.complex64]] = []
        self._working: list[list[tuple[FilterAtWork, RunningLevel]]] = []
        self._levels: dict[int, RunningLevel] = {}
        for stage in stages[: max(at) + 1]:
            mine = [number for number, where in enumerate(at) if where == stage.number]
            self._add_stage(
                stage, rows, n_samples, [filters[k] for k in mine], thinned=stage.number < max(at)
            )
            points, working = self._sections[-1].shape.points, []
            for k in mine:
                way = FilterAtWork.of(filters[k], stage, points, time_constant, followed=decay is None)
                self._levels[k] = RunningLevel(
                    filters[k],
                    stage,
                    rows,
                    way,
                    time_constant,
                    decay,
                    self._settled[k],
                    end,
                    times,
                )
                working.append((way, self._levels[k]))
            self._working.append(working)
        self._scratch = Scratch()

    def _add_stage(
        self, stage: Stage, rows: int, n_samples: int, filters: Sequence[Filter], *, thinned: bool
    ) -> None:
        ringing = max((one.ringing * stage.rate for one in filters), default=0.0)
        samples = math.ceil(stage.lead) + n_samples // FACTOR**stage.number + 2 * LATE
        shape = shape_for(ringing, samples, stage.number)
        factor = None
        if self._derivatives.any():
            factor = _differentiation(self._derivatives, stage.rate, shape.points)
        filtered = any(not one.identity for one in filters)
        self._sections.append(
            Sections(rows, shape, factor, filtered=filtered, thinned=thinned, store=self._store)
        )

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        for first in range(0, samples.shape[1], _PIECE):
            piece = samples[:, first : first + _PIECE]
            self._pass_on(0, piece if self._offset is None else piece - self._offset)

    def _pass_on(self, number: int, samples: NDArray[np.float64]) -> None:
        for fresh in self._sections[number].of(samples):
            self._take(number, fresh)

    def _take(self, number: int, fresh: int) -> None:
        """See the next section of a stage."""
        section = self._sections[number]
        for way, running in self._working[number]:
            count = -(-fresh * way.intervals // GRAIN)
            cut, due = running.cut(count), running.due(count)
            if way.values.size:
                work = partial(
                    way.squares, shape=section.shape, count=count, scratch=self._scratch, cut=cut, places=due
                )
                square, ripple = work(section.spectrum)
                uneven = _uneven(square[:, running.inside(count)])
                if uneven.any():
                    exact = section.exact()[slice(None) if uneven.all() else uneven]
                    square[uneven], ripple[uneven] = work(exact)
                running.take(square, np.square(section.scale), ripple)
            else:
                running.take(_unfiltered_square(section.fresh, round(way.together), count, cut))
        if section.low.size:
            self._pass_on(number + 1, section.low)

    def result(self) -> Histories:
        """The histories; call it once, after the last samples."""
        for number, section in enumerate(self._sections):
            for fresh in section.rest():
                self._take(number, fresh)
        self._sections.clear()
        self._working.clear()
        count = len(self._levels)
        readings = np.empty((self._derivatives.size, count, self._times))
        highest, lowest = np.empty(readings.shape[:2]), np.empty(readings.shape[:2])
        for k in range(count):  # what has been copied is let go of
            readings[:, k], highest[:, k], lowest[:, k] = self._levels.pop(k).result()
        return Histories(readings, highest, lowest, self._settled)


def _stages(sampling_rate: float) -> list[Stage]:
    """The stages with the lead that `Sections` give them: the thinned stream is `LATE` samples behind."""
    stages, lead = [], 0.0
    for stage in stages_of(sampling_rate):
        stages.append(replace(stage, lead=lead))
        lead = (lead + LATE) / FACTOR
    return stages


def _differentiation(derivatives: NDArray[np.int64], rate: float, points: int) -> NDArray[np.complex128]:
    """(j omega)^d on the lines of a transform; nothing at 0 Hz but in channels that are not differentiated."""
    omega = 2.0 * np.pi * rate / points * np.arange(points // 2 + 1)
    factor = np.zeros((derivatives.size, omega.size), dtype=np.complex128)
    for row, times in zip(factor, derivatives, strict=True):
        row[1:] = (1j * omega[1:]) ** int(times)
        row[0] = times == 0
    return factor


def _uneven(square: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which rows have a moment that is so quiet beside the others that the rounding of these would be seen."""
    whole = square.shape[1] // _MOMENT
    if not whole:
        return np.zeros(square.shape[0], dtype=np.bool_)
    pieces = square[:, : whole * _MOMENT].reshape(square.shape[0], whole, _MOMENT)
    moments = np.matmul(pieces, np.ones(_MOMENT, dtype=square.dtype))
    return np.asarray(moments.min(axis=1) < _QUIET * moments.mean(axis=1))


def _unfiltered_square(
    samples: NDArray[np.float64], together: int, count: int, cut: tuple[int, float] | None
) -> NDArray[np.float64]:
    """Mean square of the samples themselves over each interval; silence follows the last one."""
    intervals = samples[:, : count * together].reshape(samples.shape[0], count, together)
    square = np.asarray(np.einsum("ijk,ijk->ij", intervals, intervals) / together)
    if cut is not None:
        square[:, cut[0]] /= cut[1]
    return square
