"""Time-weighted levels behind band filters and frequency weightings, against time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from specan.dsp.filter_at_work import FilterAtWork, Way, stage_for
from specan.dsp.history_filters import Filter
from specan.dsp.multirate import LENGTH, ROWS, MultirateTransform, Stage, stages_of
from specan.dsp.sections import Sections, Shape

# The decaying rest of what came before a maximum is looked for is followed down to this part of it.
_FORGOTTEN = 1e-9
# Samples of a block whose output waits for the next block: as many as a response that is cut off smoothly at half
# a stage's rate rings ahead, to -100 dB of what is left of it there.
_AHEAD = 1024
_LONGEST_INTERVAL = 64


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


class BandHistory:
    """Filters the blocks of a `MultirateTransform`, squares, weights in time, reads at given times.

    Filtering is multiplication of the transform with the filter's response: neither the bilinear
    transform's warping nor a sampled filter's rounding at low frequencies. The transform of two
    successive blocks gives the output of the second one, as the filter rings for less than a block at the rate
    at which it works; the last samples of it wait for the next block, as a filter whose response is cut off at
    a frequency rings ahead.

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
    ) -> None:
        self._rows, self._end = rows, (n_samples - 0.5) / sampling_rate
        self._derivatives = np.zeros(rows, dtype=int) if derivatives is None else np.asarray(derivatives)
        self._settled = np.array([5.0 * time_constant + one.settling for one in filters])
        self._previous: dict[int, NDArray[np.complex128]] = {}
        self._waiting: dict[int, tuple[int, int]] = {}
        shape = (rows, len(filters))
        self._readings = np.full((*shape, len(times)), np.nan)
        self._maximum, self._minimum = np.full(shape, np.nan), np.full(shape, np.nan)
        stages = stages_of(sampling_rate)
        self._working: dict[tuple[int, Way], list[tuple[int, FilterAtWork]]] = {}
        self._sections: dict[tuple[int, Way], Sections] = {}
        for number, one in enumerate(filters):
            if self._derivatives.any():  # these are taken on pairs of blocks
                one = replace(one, ringing=math.inf, identity=False)
            stage = stage_for(one, stages, time_constant)
            working = FilterAtWork.of(
                one, stage, rows, time_constant, decay, self._settled[number], self._end, times
            )
            way: Way = "none" if one.identity else working.shape
            self._working.setdefault((stage.number, way), []).append((number, working))
            if isinstance(way, Shape) and (stage.number, way) not in self._sections:
                alike = (s.spectrum for (_, other), s in self._sections.items() if other == way)
                self._sections[stage.number, way] = Sections(rows, way, next(alike, None))
        # Used again and again: fresh memory costs more than the arithmetic.
        self._product = np.zeros((min(rows, ROWS), LENGTH + 1), dtype=np.complex128)
        self._output = np.empty((min(rows, ROWS), 2 * LENGTH))

    def take(
        self, stage: Stage, block: NDArray[np.float64], transform: NDArray[np.complex128], half: int
    ) -> None:
        """See the next block of a stage; see `specan.dsp.multirate.Consumer`."""
        length = block.shape[1]
        for (number, way), working in self._working.items():
            if number != stage.number:
                continue
            if way is None:
                self._filter(working, *self._pair(stage, transform, half, length))
            elif isinstance(way, Shape):
                for fresh, spectrum in self._sections[number, way].of(block):
                    self._filter(working, spectrum, [(way.before, fresh)])
            else:
                for filter_number, one in working:
                    self._weigh(filter_number, one, _unfiltered_square(one, block))

    def _pair(
        self, stage: Stage, transform: NDArray[np.complex128], half: int, length: int
    ) -> tuple[NDArray[np.complex128], list[tuple[int, int]]]:
        """Transform of a block and the one before it, and where in it the output is ready: beginnings and lengths."""
        previous = self._previous.get(stage.number)
        self._previous[stage.number] = transform
        waiting = 0 if previous is None else _AHEAD
        # A block that is shorter is the last one, with silence behind it.
        ready = length
        if length > LENGTH - _AHEAD:
            ready = (length - _AHEAD) // _LONGEST_INTERVAL * _LONGEST_INTERVAL
        first = half * LENGTH
        self._waiting[stage.number] = (first + ready, length - ready)
        places = [(first, ready)] if not waiting else [(first - waiting, waiting + ready)]
        if places[0][0] < 0:  # the block before is behind this one
            places = [(2 * LENGTH - waiting, waiting), (0, ready)]
        both = transform if previous is None else previous + transform
        return self._differentiated(both, stage), places

    def _filter(
        self,
        working: Sequence[tuple[int, FilterAtWork]],
        spectrum: NDArray[np.complex128],
        places: Sequence[tuple[int, int]],
    ) -> None:
        for number, one in working:
            self._weigh(number, one, self._filtered_square(one, spectrum, places))

    def _finish(self) -> None:
        """Filter what waits for samples that do not come."""
        for (number, way), working in self._working.items():
            stage = working[0][1].stage
            if way is None and number in self._waiting:
                spectrum = self._differentiated(self._previous[number], stage)
                self._filter(working, spectrum, [self._waiting[number]])
            elif isinstance(way, Shape):
                for fresh, spectrum in self._sections[number, way].rest():
                    self._filter(working, spectrum, [(way.before, fresh)])

    def _differentiated(self, pair: NDArray[np.complex128], stage: Stage) -> NDArray[np.complex128]:
        if not self._derivatives.any():
            return pair
        omega = np.pi * stage.rate / LENGTH * np.arange(LENGTH + 1)
        omega[0] = np.inf if (self._derivatives < 0).any() else 0.0
        with np.errstate(invalid="ignore"):
            factors = [(1j * omega) ** int(d) if d else np.ones(LENGTH + 1) for d in self._derivatives]
        factor = np.stack(factors)
        factor[self._derivatives != 0, 0] = 0.0
        return pair * factor

    def _filtered_square(
        self,
        one: FilterAtWork,
        spectrum: NDArray[np.complex128],
        places: Sequence[tuple[int, int]],
    ) -> NDArray[np.float64]:
        """Mean square of the filter's output over each interval of some places: first samples and lengths.

        The last interval may reach beyond them.
        """
        counts, size = [-(-length // one.together) for _, length in places], spectrum.shape[1] - 1
        size, parts = size // one.thinning, 2 if one.envelope else 1
        per_interval = one.together // one.thinning
        square = np.empty((self._rows, sum(counts)))
        for top in range(0, self._rows, ROWS):
            part = spectrum[top : top + ROWS]
            output = self._envelope(one, part, size) if one.envelope else self._real(one, part, size)
            done = 0
            for (first, _), count in zip(places, counts, strict=True):
                begin = first // one.thinning
                mine = output[:, parts * begin : parts * (begin + count * per_interval)]
                mine = mine.reshape(part.shape[0], count, parts * per_interval)
                last = one.last_interval - one.position - done
                if 0 <= last < count:  # what comes after the end of the record is not part of it
                    inside = -(-one.last_samples // one.thinning)
                    mine[:, last, parts * inside :] = 0.0
                    mine[:, last] *= math.sqrt(per_interval / inside)
                np.einsum("ijk,ijk->ij", mine, mine, out=square[top : top + ROWS, done : done + count])
                done += count
        square /= per_interval
        return square

    def _real(self, one: FilterAtWork, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """2 `size` samples of the filter's output."""
        product, lines = self._product[: part.shape[0], : size + 1], slice(one.low, one.low + one.values.size)
        product[:, : lines.start] = 0.0
        product[:, lines.stop :] = 0.0
        np.multiply(part[:, lines], one.values, out=product[:, lines])
        return np.fft.irfft(product, 2 * size, out=self._output[: part.shape[0], : 2 * size])

    def _envelope(self, one: FilterAtWork, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """2 `size` complex samples of the filter's output, each as two real numbers."""
        used = one.values.size
        product = self._product[: part.shape[0], : 2 * size]
        product[:, used:] = 0.0
        np.multiply(part[:, one.low : one.low + used], one.values, out=product[:, :used])
        output = self._output.view(np.complex128)[: part.shape[0], : 2 * size]
        return np.fft.ifft(product, out=output).view(np.float64)

    def _weigh(self, number: int, one: FilterAtWork, square: NDArray[np.float64]) -> None:
        """Weight the next mean squares in time, and read the result."""
        square[:, : max(one.silent - one.position, 0)] = 0.0
        weighted = one.weighting(square)
        if one.peaks is not None:
            square[:, : max(one.start - one.position, 0)] = 0.0
        self._extremes(number, one, weighted, None if one.peaks is None else one.peaks(square))
        self._read(number, one, weighted)
        one.last = weighted[:, -1:].copy() if weighted.shape[1] else one.last
        one.position += weighted.shape[1]

    def _extremes(
        self,
        number: int,
        one: FilterAtWork,
        weighted: NDArray[np.float64],
        peaks: NDArray[np.float64] | None,
    ) -> None:
        upto = max(min(weighted.shape[1], one.end - one.position), 0)
        low = weighted[:, max(one.settled - one.position, 0) : upto]
        if low.shape[1]:
            self._minimum[:, number] = np.fmin(self._minimum[:, number], np.fmin.reduce(low, axis=1))
        since = max(one.start - one.position, 0)
        if since >= upto:
            return
        high = (weighted if peaks is None else peaks)[:, since:upto]
        if peaks is None:
            if one.before_start is None:
                one.before_start = one.last if since == 0 else weighted[:, since - 1 : since].copy()
            high = one.weighting.without(one.before_start, high, one.position + since - one.start, _FORGOTTEN)
        self._maximum[:, number] = np.fmax(self._maximum[:, number], np.fmax.reduce(high, axis=1))

    def _read(self, number: int, one: FilterAtWork, weighted: NDArray[np.float64]) -> None:
        """Samples i and i + 1 around each reading, the last one of the block before included."""
        length = weighted.shape[1]
        # A place as computed may miss a sample by a rounding error.
        done = int(np.searchsorted(one.place, one.position + length - 1 + 1e-6, side="right"))
        if done > one.reading:
            place = one.place[one.reading : done] - (one.position - 1)
            before = np.clip(np.floor(place).astype(int), 0, length - 1)
            share = place - before
            around = np.concatenate([one.last, weighted], axis=1)
            self._readings[:, number, one.reading : done] = (
                around[:, before] * (1.0 - share) + around[:, before + 1] * share
            )
            one.reading = done

    def result(self) -> Histories:
        """What was read; call it once, after the transform is finished."""
        self._finish()
        return Histories(self._readings, self._maximum, self._minimum, self._settled)


class BandHistoryAccumulator:
    """Takes a record in consecutive blocks and gives its time-weighted histories; see `BandHistory`.

    Examples
    --------
    >>> from specan.dsp.history_filters import band_filter
    >>> t = np.arange(16000) / 8000
    >>> history = BandHistoryAccumulator(
    ...     1, 8000.0, 16000, [band_filter(0, 3)], 0.125, None, times=np.array([1.0, 1.9])
    ... )
    >>> history.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> history.result().readings[0, 0].round(3).tolist()
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
        self._history = BandHistory(
            rows, sampling_rate, n_samples, filters, time_constant, decay, times, derivatives
        )
        self._transform = MultirateTransform(rows, sampling_rate, [self._history], offset)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        self._transform.add(samples)

    def result(self) -> Histories:
        """The histories; call it once, after the last samples."""
        self._transform.finish()
        return self._history.result()


def _unfiltered_square(one: FilterAtWork, block: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square of the samples themselves over each of the block's intervals."""
    rows, length = block.shape
    count = -(-length // one.together)
    left = length - (count - 1) * one.together  # the last interval of a record is shorter
    if left < one.together:
        block = np.pad(block, ((0, 0), (0, count * one.together - length)))
    intervals = block.reshape(rows, count, one.together)
    square = np.asarray(np.einsum("ijk,ijk->ij", intervals, intervals) / one.together)
    square[:, -1:] *= one.together / left
    return square
