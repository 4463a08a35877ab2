"""Time-weighted levels behind band filters and frequency weightings, against time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from specan.dsp.filter_at_work import FilterAtWork, stage_for
from specan.dsp.history_filters import Filter
from specan.dsp.multirate import FACTOR, Memory, Stage, keep_freed_memory, stages_of
from specan.dsp.running_level import RunningLevel
from specan.dsp.sections import GRAIN, LATE, Sections, shape_for
from specan.dsp.slow_part import SlowPart

# The rounding of a transform in single precision, 1e-7 of the RMS of its section, is spread over all of the section. A
# moment of so many intervals that is 50 dB below the mean has it at 3e-5 of its own amplitude, which changes its mean
# square by less than 1e-4 dB. Where there is a quieter one, double precision is used.
_MOMENT, _QUIET = 16, 1e-5
# Samples of which a constant part is taken off at once.
_PIECE = 1 << 15


# Samples this far below the largest so far may have the largest value beside them: at a fifth of the sampling rate,
# the nearest sample of a sine is at least cos(36 degrees) = 0.81 of its peak.
_NEAR = 0.8


class Peaks:
    """Peak of |p_C(t)| and the like (IEC 61672-1:2013, 3.11), of signals that come in pieces.

    Between samples, a parabola goes through the largest sample and its neighbours.

    Parameters
    ----------
    channels : int

    Attributes
    ----------
    largest : ndarray, shape (channels,)

    Examples
    --------
    >>> peaks = Peaks(1)
    >>> peaks.look(slice(0, 1), np.sin(2 * np.pi * np.arange(20) / 7.3)[None])
    >>> peaks.largest.round(2).tolist()
    [1.0]
    """

    def __init__(self, channels: int) -> None:
        self.largest = np.zeros(channels)
        # Samples of the piece before, beside which a peak may lie; before the first piece there are none.
        self._last = np.full((channels, 2), np.nan)

    def look(self, rows: slice, samples: NDArray[np.float64]) -> None:
        """Take the next samples of some channels."""
        y = np.abs(np.concatenate([self._last[rows], samples], axis=1))
        self._last[rows] = y[:, -2:]
        largest = self.largest[rows]
        with np.errstate(invalid="ignore"):  # a channel may hold NaN
            np.maximum(largest, y[:, 2:].max(axis=1), out=largest)
            for row, values in enumerate(y):
                at = 1 + np.flatnonzero(values[1:-1] >= _NEAR * largest[row])
                a, b, c = values[at - 1], values[at], values[at + 1]
                high = (b >= a) & (b > c)
                a, b, c = a[high], b[high], c[high]
                tops = b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c))
                if tops.size:
                    largest[row] = max(largest[row], float(tops.max()))


@dataclass(frozen=True)
class Histories:
    """Time-weighted mean squares.

    Attributes
    ----------
    readings : ndarray, shape (channels, filters, times)
        At the times asked for.
    maximum, minimum : ndarray, shape (channels, filters)
        The maximum over all of the record, the minimum after `settled_s`. NaN where the record is too short for that.
    later_maximum : ndarray, shape (channels, filters)
        The maximum from the time on at which the cut at the record's beginning has left a band (what came
        before it does not count, not even as a decay), likewise.
    settled_s : ndarray, shape (filters,)
        Seconds after which a filter and the time weighting behind it have settled to 0.1 dB.
    mean_square : ndarray, shape (channels, filters)
        Over the record, of Z and the weightings of the whole signal; zero for bands.
    peak : ndarray, shape (channels,)
        Largest magnitude of what comes out of the filter `peak_of`, between samples as well.
    with_cut : tuple of ndarray
        Maximum, mean square and peak, had the cut at the record's beginning stayed in what comes out of weightings.
    """

    readings: NDArray[np.float64]
    maximum: NDArray[np.float64]
    minimum: NDArray[np.float64]
    later_maximum: NDArray[np.float64]
    settled_s: NDArray[np.float64] = field(repr=False)
    mean_square: NDArray[np.float64] = field(repr=False)
    peak: NDArray[np.float64] = field(repr=False)
    with_cut: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] = field(repr=False)


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
    slow : SlowPart, optional
        The constant part of each channel, which is taken off, and a drift, which no band has.
    peak_of : int, optional
        Number of the filter, a weighting, whose peak is found.
    read : int, optional
        How many of the filters are read at the given times, the first ones; all by default.

    Examples
    --------
    >>> from specan.dsp.bands import Bands
    >>> from specan.dsp.history_filters import band_filter
    >>> t = np.arange(16000) / 8000
    >>> history = BandHistoryAccumulator(
    ...     1, 8000.0, 16000, [band_filter(*Bands.octaves(3, 0))], 0.125, None, times=np.array([1.0, 1.9])
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
        slow: SlowPart | None = None,
        peak_of: int | None = None,
        read: int | None = None,
    ) -> None:
        keep_freed_memory()
        self._peak_of, self._read = peak_of, len(filters) if read is None else read
        self._peaks, self._peaks_with_cut = Peaks(rows), Peaks(rows)
        self._n_samples, nowhere = n_samples, np.empty(0)
        self._slow, self._taken = slow, 0
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
        self._working: list[list[tuple[FilterAtWork, int]]] = []
        self._records: list[slice] = []
        self._levels: dict[int, RunningLevel] = {}
        for stage in stages[: max(at) + 1]:
            mine = [number for number, where in enumerate(at) if where == stage.number]
            self._add_stage(
                stage, rows, n_samples, [filters[k] for k in mine], thinned=stage.number < max(at)
            )
            shape, working = self._sections[-1].shape, []
            for k in mine:
                way = FilterAtWork.of(filters[k], stage, shape, time_constant)
                self._levels[k] = RunningLevel(
                    filters[k],
                    stage,
                    rows,
                    way,
                    time_constant,
                    decay,
                    self._settled[k],
                    end,
                    times if k < self._read else nowhere,
                )
                working.append((way, k))
            self._working.append(working)
            lead = round(stage.lead)
            self._records.append(slice(lead, lead + math.ceil(n_samples / FACTOR**stage.number)))
        self._scratch = Memory()

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
            if self._slow is not None:
                piece = piece - self._slow.constant[:, None]
                drift = self._slow.drift(self._taken, piece.shape[1])
                piece = piece if drift is None else piece - drift
            self._taken += piece.shape[1]
            self._pass_on(0, piece)

    def _pass_on(self, number: int, samples: NDArray[np.float64]) -> None:
        for fresh in self._sections[number].of(samples):
            self._take(number, fresh)

    def _take(self, number: int, fresh: int) -> None:
        """See the next section of a stage."""
        section, record = self._sections[number], self._records[number]
        shape, inside = section.shape, slice(max(record.start, 0), max(min(record.stop, fresh), 0))
        begins = inside if record.start >= 0 else None
        self._records[number] = slice(record.start - shape.hop, record.stop - shape.hop)
        # Z has the drift, and a weighting tells it from the rest itself.
        drift = None
        if number == 0 and self._slow is not None:
            drift = self._slow.drift(-record.start - shape.before, shape.points)
        drifting = None if drift is None else section.lines_of(drift)
        for way, k in self._working[number]:
            running = self._levels[k]
            count = -(-fresh * way.intervals // GRAIN)
            cut = running.cut(count)
            if way.values.size:
                more = drifting if way.start is not None else None
                work = partial(
                    way.squares,
                    shape=shape,
                    count=count,
                    scratch=self._scratch,
                    cut=cut,
                    record=begins,
                )
                watch = before = None
                if k == self._peak_of:
                    watch = partial(self._see, self._peaks, section.scale, inside)
                if way.start is not None and begins is not None:
                    before = partial(self._see_cut, k, way, section.scale, inside)
                square = work(
                    section.spectrum if more is None else section.spectrum + more,
                    watch=watch,
                    with_cut=before,
                )
                uneven = _uneven(square[:, running.inside(count)])
                if uneven.any():
                    exact = section.exact() if more is None else section.exact() + more
                    square[uneven] = work(exact[slice(None) if uneven.all() else uneven])
                running.take(square, np.square(section.scale))
            else:
                samples = (
                    section.fresh
                    if drift is None
                    else section.fresh + drift[:, shape.before :][:, : shape.hop]
                )
                running.take(_unfiltered_square(samples, round(way.together), count, cut))
        if section.low.size:
            self._pass_on(number + 1, section.low)

    def _see(
        self,
        peaks: Peaks,
        scale: NDArray[np.float64],
        inside: slice,
        rows: slice,
        output: NDArray[np.float32],
    ) -> None:
        peaks.look(rows, output[:, inside] * scale[rows, None])

    def _see_cut(
        self,
        k: int,
        way: FilterAtWork,
        scale: NDArray[np.float64],
        inside: slice,
        rows: slice,
        output: NDArray[np.float32],
    ) -> None:
        if k == self._peak_of:
            self._see(self._peaks_with_cut, scale, inside, rows, output)
        square = np.square(output[:, inside] * scale[rows, None])
        whole = square.shape[1] // way.kept
        self._levels[k].see_cut(
            rows, square[:, : whole * way.kept].reshape(len(square), whole, way.kept).mean(axis=2)
        )

    def result(self) -> Histories:
        """The histories; call it once, after the last samples."""
        for number, section in enumerate(self._sections):
            for fresh in section.rest():
                self._take(number, fresh)
        self._sections.clear()
        self._working.clear()
        count, rows = len(self._levels), self._derivatives.size
        readings = np.empty((rows, self._read, self._times))
        highest, later, lowest, mean, highest_with, mean_with = np.empty((6, rows, count))
        for k in range(count):  # what has been copied is let go of
            running = self._levels.pop(k)
            found, highest[:, k], later[:, k], lowest[:, k] = running.result()
            mean[:, k], mean_with[:, k] = running.mean_square()
            highest_with[:, k] = np.fmax(highest[:, k], running.highest_with_cut)
            if k < self._read:
                readings[:, k] = found
        with_cut = highest_with, mean_with, np.maximum(self._peaks.largest, self._peaks_with_cut.largest)
        return Histories(readings, highest, lowest, later, self._settled, mean, self._peaks.largest, with_cut)


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
