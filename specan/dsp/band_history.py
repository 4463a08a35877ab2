"""Time-weighted levels behind band filters and frequency weightings, against time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.multirate import (
    FACTOR,
    GRAIN,
    LATE,
    LENGTH,
    PASS,
    Sections,
    Shape,
    Stage,
    fast_length,
    keep_freed_memory,
    shape_for,
    stages_of,
)
from specan.dsp.record_edges import RecordStart, SlowPart, start_of
from specan.dsp.weighting import (
    WEIGHTINGS_RING,
    WEIGHTINGS_SETTLE,
    ZEROS,
    TimeWeighting,
    Weighting,
    complex_weighting,
    minimum_phase,
)
from specan.dsp.windows import falling_step

# A band is filtered at the lowest rate whose samples are faithful up to this many times its upper edge.
_ROOM_ABOVE = 1.25
# A response that is not below -60 dB at half the sampling rate is made causal: cut off there, it rings ahead, and a
# band hears the record's end before it. Below a tone that ends there: 75 dB with the band's edge at half the rate,
# 100 dB with -42 dB of it.
_REACHES = 1e-3
# After 6 times 3 / B an order 4 band-pass has fallen by 180 dB.
SETTLINGS_IN_A_BLOCK = 6.0
# In Hz. Where the sampling rate is so high that a thinned stream has all up to here, A, B and C are of that: they let
# less than 1 / 4000 of the energy above it through.
_WEIGHTINGS_REACH = 1e5
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
        ring with is taken off (see `specan.dsp.record_edges`).
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
        settling=WEIGHTINGS_SETTLE,
        ringing=WEIGHTINGS_RING,
        weighting=weighting,
    )


Watch = Callable[[slice, NDArray[Any]], None]
"""Is given rows and what comes out of a filter there."""

# What a filter attenuates by more than 100 dB is left out.
_NOTHING = 1e-5
# An envelope is sampled at a rate that holds what the filter attenuates by up to 80 dB; what is left of the skirts
# is folded on it: their energy is kept, and products with the band itself are below -80 dB.
_FOLDED = 1e-4
_PER_TIME_CONSTANT = 64.0
# Squares are averaged over intervals as long as this many of them still make a time constant ...
_INTERVALS = 256.0
# ... but not over more than so many samples: a burst ends between two readings ...
_LONGEST = 64.0
# ... or longer behind a narrow filter: the weighted level y has y'' of up to 2 pi B y / tau, and its largest value
# between two readings h apart is not more than y'' h^2 / 8 above them. This many dB are allowed.
_UNSEEN = 0.001
# From so many cycles in a time constant on, an envelope will do: the ripple of a squared tone, 10 lg(1 + 1 / (2 w tau))
# dB = 0.346 dB / (f tau), is less than 0.004 dB.
_CYCLES_WITHOUT_RIPPLE = 100.0
# A thinned output is faithful up to this part of half its rate.
_FAITHFUL = 0.8
# Points of inverse transforms that stay in the cache with what they are made from.
_POINTS = 1 << 16


@dataclass
class FilterAtWork:
    """One filter at work on its stage.

    Its output has `kept` samples in each interval, of which `intervals` fill `GRAIN` samples of the stage; squares are
    averaged over an interval. With `envelope` the output is the complex one of the lines that matter, shifted to
    frequency zero: what is narrow needs few samples, and half the square of the modulus is the square without its
    ripple at twice the frequency.

    Attributes
    ----------
    low : int
        The first line that matters.
    values : complex array
        The response from this line on, with the factors of the inverse transform.
    start : RecordStart
        Of a frequency weighting: what the cut at the record's beginning does to it.
    """

    shape: Shape
    intervals: int
    kept: int
    envelope: bool
    low: int
    values: NDArray[np.complex128]
    start: RecordStart | None = None

    @property
    def together(self) -> float:
        """Samples of the stage in an interval."""
        return GRAIN / self.intervals

    @classmethod
    def of(cls, one: Filter, stage: Stage, shape: Shape, time_constant: float) -> FilterAtWork:
        """Put a filter to work on sections of a shape."""
        points = shape.points
        least = math.ceil(GRAIN * min(max(_INTERVALS / (stage.rate * time_constant), 1.0 / _LONGEST), 1.0))
        every = 1 << (least - 1).bit_length()
        if one.identity:
            return cls(shape, every, GRAIN // every, False, 0, np.empty(0, dtype=np.complex128))
        if one.weighting is not None:
            response, start = start_of(one.weighting, stage.rate, shape.before)
            return cls(shape, every, GRAIN // every, False, 0, np.fft.rfft(response, points), start=start)
        # What is thinned out has nothing at half its rate.
        causal = None if stage.number else one.causal(stage.rate, points // 2 + 1)
        if causal is not None:
            return cls(shape, every, GRAIN // every, False, 0, causal)
        need = math.ceil(2.0 * GRAIN * min(one.upper / (_FAITHFUL * stage.rate), 1.0))
        intervals, kept = _grid(min(need, GRAIN), least, 1)
        if intervals * kept >= GRAIN:
            intervals, kept = every, GRAIN // every
        if one.lower * time_constant >= _CYCLES_WITHOUT_RIPPLE:
            found = cls._as_envelope(one, stage, shape, time_constant)
            if 2 * found.kept * found.intervals <= kept * intervals:
                return found
        part = intervals * kept / GRAIN
        top = stage.rate / 2.0 * part
        low, values = _lines(one, stage.rate / points, points // GRAIN * intervals * kept // 2)
        if part < 1.0:
            frequency = (low + np.arange(values.size)) * stage.rate / points
            values = values * falling_step(frequency, _FAITHFUL * top, top)
        return cls(shape, intervals, kept, False, low, values * part)

    @classmethod
    def _as_envelope(cls, one: Filter, stage: Stage, shape: Shape, time_constant: float) -> FilterAtWork:
        points = shape.points
        bandwidth = 3.0 / one.settling  # see `band_filter`
        unseen = math.log(10.0) / 10.0 * _UNSEEN
        longest = math.sqrt(8.0 * unseen * time_constant / (2.0 * math.pi * bandwidth))
        longest = max(longest, time_constant / _INTERVALS)
        low, values = _lines(one, stage.rate / points, points // 2)
        wide = np.flatnonzero(np.abs(values) > _FOLDED)
        need = math.ceil((wide[-1] - wide[0] + 1) * GRAIN / points)
        intervals, kept = _grid(need, math.ceil(min(GRAIN / (stage.rate * longest), GRAIN)), 2)
        # Half the square of the modulus, in samples so much fewer than those of the stage.
        part = intervals * kept / GRAIN
        values = values * (math.sqrt(2.0) * part)
        return cls(shape, intervals, kept, True, low, values)

    def analogue_phases(self, response: Response, rate: float) -> NDArray[np.complex128]:
        """Factors that make of what comes out of a sampled weighting what comes out of the analogue one."""
        lines = np.arange(1, GRAIN // 2 + 1)
        factors = response(lines * rate / GRAIN) / self.values[lines * (self.shape.points // GRAIN)]
        return np.concatenate([[1.0], factors])

    def squares(
        self,
        spectrum: NDArray[np.complex128],
        count: int,
        cut: tuple[int, float] | None,
        record: slice | None,
        watch: Watch,
        with_cut: Watch,
    ) -> NDArray[np.float64]:
        """Mean square of the output over each of `count` intervals from the first new sample on.

        `cut` is an interval and which part of it belongs to the record. `record` are the samples of the record in a
        section that it begins in; `watch` sees the output, `with_cut` that of a weighting at the record's beginning
        before its decays are taken off.
        """
        size = self.shape.points // GRAIN * self.intervals * self.kept
        width = (2 if self.envelope else 1) * self.kept
        first = self.shape.before // GRAIN * self.intervals
        square = np.empty((len(spectrum), count))
        step = max(4, _POINTS // size)
        for top in range(0, len(spectrum), step):
            rows = slice(top, top + step)
            output = (self._envelope if self.envelope else self._real)(spectrum[rows], size)
            flat = output[:, first * width : (first + count) * width]
            if self.start is not None and record is not None:
                with_cut(rows, flat)
                flat[:, record] = self.start.without(flat[:, record])
            watch(rows, flat)
            mine = flat.reshape(len(flat), count, width)
            if cut is not None:  # what comes after the end of the record is not part of it
                inside = math.ceil(cut[1] * self.kept)
                mine[:, cut[0], width * inside // self.kept :] = 0.0
                mine[:, cut[0]] *= math.sqrt(self.kept / inside)
            square[rows] = np.einsum("ijk,ijk->ij", mine, mine)
        square /= self.kept
        return square

    def _real(self, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """`size` samples of the filter's output."""
        product = np.zeros((len(part), size // 2 + 1), dtype=complex)
        lines = slice(self.low, self.low + self.values.size)
        np.multiply(part[:, lines], self.values, out=product[:, lines])
        return np.fft.irfft(product, size)

    def _envelope(self, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """`size` complex samples of the filter's output, each as two real numbers."""
        product = np.zeros((len(part), size), dtype=complex)
        for begin in range(0, self.values.size, size):
            some = self.values[begin : begin + size]
            product[:, : some.size] += part[:, self.low + begin : self.low + begin + some.size] * some
        return np.fft.ifft(product).view(float)


def stage_for(one: Filter, stages: Sequence[Stage], time_constant: float) -> Stage:
    """The lowest rate that is faithful to a filter's band and fine enough for the time weighting.

    The ripple of a squared low tone is followed with `_PER_TIME_CONSTANT` samples, unless the filter
    rings for longer than a block at such a rate.
    """
    possible = [stage for stage in stages if stage.number == 0 or stage.rate * PASS >= one.upper]
    lasting = [stage for stage in possible if LENGTH / stage.rate >= SETTLINGS_IN_A_BLOCK * one.settling]
    fine = [stage for stage in lasting if stage.rate * time_constant >= _PER_TIME_CONSTANT]
    return fine[-1] if fine else (lasting or possible[-1:])[0]


def _lines(one: Filter, step: float, last: int) -> tuple[int, NDArray[np.complex128]]:
    """The response at the lines that matter, of those up to `last`, `step` Hz apart; and the first of them."""
    # A look at each 64th line at high frequencies, and at all of them at low ones, says where to look closely.
    look = np.unique(
        np.concatenate([np.arange(min(128, last + 1)), np.geomspace(1, last, 512).astype(int), [last]])
    )
    seen = np.flatnonzero(np.abs(one.response(look * step)) > _NOTHING)
    first, end = look[max(seen[0] - 1, 0)], look[min(seen[-1] + 1, look.size - 1)] + 1
    values = one.response(np.arange(first, end) * step)
    used = np.flatnonzero(np.abs(values) > _NOTHING)
    return int(first + used[0]), values[used[0] : used[-1] + 1]


def _grid(need: int, least: int, numbers: int) -> tuple[int, int]:
    """How many intervals to make of `GRAIN` samples, and how many samples of an output to keep in each.

    At least `need` and `least`, so that transforms are fast and there is least to do: each sample is so many `numbers`.
    """
    ways = []
    for kept in filter(lambda count: fast_length(count) == count, range(1, need // least + 2)):
        intervals = max(least, -(-need // kept))
        while intervals * kept % 2 or fast_length(intervals * kept) != intervals * kept:
            intervals += 1
        ways.append(((numbers * kept + 1) * intervals, intervals, kept))
    return min(ways)[1:]


# What a band filter makes of the cut at the record's beginning has fallen by 60 dB after 2 times 3 / B: 10 dB
# in every 1 / B.
_SETTLINGS_OF_A_CUT = 2.0
# Time constants after which nothing is left of an average, to the last bit.
_FORGOTTEN = 38.0


SETTLING_TIME_CONSTANTS = 5.0


class Record(NamedTuple):
    """`rows` channels of `n_samples` at a rate in Hz; how often each is differentiated, and its `SlowPart`."""

    rows: int
    rate: float
    n_samples: int
    derivatives: Sequence[int] = ()
    slow: SlowPart | None = None


class Average(NamedTuple):
    """How squares are averaged (see `TimeWeighting`), and when to read: in s from the record's beginning, ascending."""

    time_constant: float
    decay: float | None
    times: NDArray[np.float64]


class RunningLevel:
    """Weights in time what a filter's intervals bring, and reads the result.

    Parameters
    ----------
    one : Filter
    stage : Stage
    way : FilterAtWork
        Says what an interval is.
    average : Average
    read : bool
        Whether it is read at the times of the average.
    """

    def __init__(
        self, one: Filter, stage: Stage, way: FilterAtWork, record: Record, average: Average, read: bool
    ) -> None:
        time_constant, decay, times = average
        rows, end = record.rows, (record.n_samples - 0.5) / record.rate
        times = times if read else np.empty(0)
        settled = SETTLING_TIME_CONSTANTS * time_constant + one.settling
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

    def take(self, square: NDArray[np.float64]) -> None:
        """Weight the next mean squares (channels, intervals), and read the result."""
        high, low = self._span(square, self._start), self._span(square, self._settled)
        counted = self._span(square, self._first)
        if self._whole:
            square[:, : counted.start] = 0.0
            self._add_up(square)
        weighted = self._weighting(square)
        self._minimum = np.fmin(self._minimum, np.fmin.reduce(weighted[:, low], axis=1, initial=np.nan))
        self._counted = np.fmax(self._counted, np.fmax.reduce(weighted[:, counted], axis=1, initial=np.nan))
        if self._peaks is not None:  # what a peak holder has held cannot be taken off
            square[:, : max(self._start - self._position, 0)] = 0.0
            later = self._peaks(square)[:, high]
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

    def _add_up(self, square: NDArray[np.float64]) -> None:
        """Add the next mean squares to the sum over the record, the last interval as far as it belongs to it."""
        last = self._last_interval - self._position
        if self._position == 0 and self._cut_intervals:
            self._cut_sum -= np.add.reduce(square[:, : self._cut_intervals], axis=1)
        self._sum += np.add.reduce(square[:, : max(last, 0)], axis=1)
        if 0 <= last < square.shape[1]:
            self._sum += self._last_part * square[:, last]

    def mean_square(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Over the record, of what comes out of a weighting, or of the record itself; and with the cut."""
        return self._sum / self._intervals, (self._sum + self._cut_sum) / self._intervals

    def _span(self, square: NDArray[np.float64], since: int) -> slice:
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


# Samples of which a constant part is taken off at once.
_PIECE = 1 << 15


# A peak may lie beside samples that are this part of the largest so far, and beside no more of them in a piece.
_NEAR, _MOST = 0.5, 64
# So many values to a sample are computed from so many samples on either side, under a Kaiser window; nearer to an end
# from half as many, and so on: from no sample that a record does not have.
_BETWEEN, _AROUND, _KAISER = 8, (64, 32, 16, 8), 5.0


class Peaks:
    """Peak of |p_C(t)| and the like (IEC 61672-1:2013, 3.11), of signals that come in pieces.

    Between samples is what signals have that end below half the rate: a sum of sin(x) / x. Of the first eight samples
    and of the last ones only themselves count.

    Parameters
    ----------
    channels : int
    factors : complex array, shape (513,), optional
        On the lines up to half the rate, before the peak is looked for; they delay by half a sample at most.

    Examples
    --------
    >>> peaks = Peaks(1)
    >>> peaks.look(slice(0, 1), np.sin(2 * np.pi * np.arange(80) / 2.9)[None])
    >>> peaks.largest().round(2).tolist()
    [1.0]
    """

    def __init__(self, channels: int, factors: NDArray[np.complex128] | None = None) -> None:
        lines = np.ones(GRAIN // 2 + 1, dtype=complex) if factors is None else factors.copy()
        lines[-1] *= 0.5
        fine = _BETWEEN * np.fft.irfft(lines, _BETWEEN * GRAIN)
        self._parts = {around: _parts(fine, around) for around in _AROUND}
        none = np.empty(0)
        self._largest, self._first, self._last = np.zeros(channels), [none] * channels, [none] * channels

    def look(self, rows: slice, samples: NDArray[np.float64]) -> None:
        """Take the next samples of some channels."""
        for row, new in enumerate(samples, rows.start):
            y = np.concatenate([self._last[row], new])
            if self._first[row].size < 2 * _AROUND[0]:
                self._first[row] = y[: 2 * _AROUND[0]]
            self._last[row] = y[-2 * _AROUND[0] :]
            self._between(row, y, _AROUND[0])

    def _between(self, row: int, y: NDArray[np.float64], around: int) -> None:
        """Count what lies beside the largest samples that have so many on either side."""
        sizes = np.abs(y[around - 1 : 1 - around])
        top = sizes.max(initial=0.0)
        at = np.flatnonzero(sizes[1:-1] >= _NEAR * max(top, self._largest[row]))
        at = at[(sizes[at + 1] >= sizes[at]) & (sizes[at + 1] >= sizes[at + 2])]
        if at.size > _MOST:
            at = at[np.argpartition(sizes[at + 1], -_MOST)[-_MOST:]]
        self._count(row, y[at[:, None] + np.arange(2 * around + 1)] @ self._parts[around])
        self._count(row, 0.0 * np.array([top]))  # NaN of a channel that has it

    def _count(self, row: int, values: NDArray[np.float64]) -> None:
        self._largest[row] = np.maximum(self._largest[row], np.abs(values).max(initial=0.0))

    def largest(self) -> NDArray[np.float64]:
        """Of each channel, after its last samples."""
        for row, ends in enumerate(zip(self._first, self._last, strict=True)):
            for end, towards in zip(ends, (1, -1), strict=True):
                inwards = end[::towards]
                self._count(row, inwards[: _AROUND[-1]])
                for around in _AROUND[1:]:
                    self._between(row, inwards[: 3 * around][::towards], around)
        return self._largest


def _parts(fine: NDArray[np.float64], around: int) -> NDArray[np.float64]:
    """Factors of the samples beside the largest for values from one before it to two after it, columns."""
    at = np.arange(-_BETWEEN, 2 * _BETWEEN + 1) - _BETWEEN * np.arange(-around, around + 1)[:, None]
    window = np.kaiser(2 * np.max(np.abs(at)) + 1, _KAISER)
    parts = fine[at] * window[at + window.size // 2]
    return np.asarray(parts / np.add.reduce(parts))


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
    later_peak : ndarray, shape (channels,)
        The same after the beginning that decays are taken off by.
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
    later_peak: NDArray[np.float64] = field(repr=False)
    with_cut: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] = field(repr=False)


@dataclass
class _AtStage:
    """A rate, with the samples of the record in its next section and the filters that work at it, by number."""

    section: Sections
    record: slice
    ways: dict[int, FilterAtWork]


class BandHistoryAccumulator:
    """Takes a record in consecutive blocks, filters, squares, weights in time, reads at given times.

    Filtering is multiplication of the transform of a section with the filter's response: neither the bilinear
    transform's warping nor a sampled filter's rounding at low frequencies. A section begins with so many known
    samples as its filters ring for.

    Parameters
    ----------
    record : Record
        The constant part of each channel is taken off, and a drift, which no band has.
    filters : sequence of Filter
    average : Average
    peak_of : int, optional
        Number of the filter, a weighting, whose peak is found.
    read : int, optional
        How many of the filters are read at the given times, the first ones; all by default.

    Examples
    --------
    >>> from specan.dsp.bands import Bands
    >>> from specan.dsp.band_history import band_filter
    >>> t = np.arange(16000) / 8000
    >>> average = Average(0.125, None, np.array([1.0, 1.9]))
    >>> history = BandHistoryAccumulator(Record(1, 8000.0, 16000), [band_filter(*Bands.octaves(3, 0))], average)
    >>> history.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> history.result().readings[0, 0].round(2).tolist()
    [0.5, 0.5]
    """

    def __init__(
        self,
        record: Record,
        filters: Sequence[Filter],
        average: Average,
        peak_of: int | None = None,
        read: int | None = None,
    ) -> None:
        keep_freed_memory()
        self._record, self._taken, self._times = record, 0, len(average.times)
        self._peak_of, self._read = peak_of, len(filters) if read is None else read
        self._peaks = [Peaks(record.rows) for _ in range(3)]
        self._derivatives = np.array(record.derivatives or [0] * record.rows)
        self._settled = np.array(
            [SETTLING_TIME_CONSTANTS * average.time_constant + f.settling for f in filters]
        )
        # an integrator rings for ever, and what is not filtered is differentiated
        if self._derivatives.any():
            filters = [replace(one, ringing=math.inf, identity=False) for one in filters]
        stages = stages_of(record.rate)
        at = [stage_for(one, stages, average.time_constant).number for one in filters]
        self._stages: list[_AtStage] = []
        self._levels: dict[int, RunningLevel] = {}
        for stage in stages[: max(at) + 1]:
            mine = {k: filters[k] for k, where in enumerate(at) if where == stage.number}
            self._stages.append(self._at(stage, mine, average, thinned=stage.number < max(at)))

    def _at(self, stage: Stage, filters: dict[int, Filter], average: Average, *, thinned: bool) -> _AtStage:
        """The filters that work at a rate, by number, ready to work."""
        record, tau = self._record, average.time_constant
        ringing = max((one.ringing * stage.rate for one in filters.values()), default=0.0)
        count = record.n_samples / FACTOR**stage.number
        shape = shape_for(ringing, math.ceil(stage.lead) + math.floor(count) + 2 * LATE, stage.number)
        factor = None
        if self._derivatives.any():
            factor = _differentiation(self._derivatives, stage.rate, shape.points)
        filtered = any(not one.identity for one in filters.values())
        section = Sections(record.rows, shape, factor, filtered=filtered, thinned=thinned)
        ways = {k: FilterAtWork.of(one, stage, shape, tau) for k, one in filters.items()}
        for k, way in ways.items():
            self._levels[k] = RunningLevel(filters[k], stage, way, record, average, k < self._read)
            if k == self._peak_of:
                phases = way.analogue_phases(filters[k].response, stage.rate)
                self._peaks = [Peaks(record.rows, phases) for _ in range(3)]
        lead = round(stage.lead)
        return _AtStage(section, slice(lead, lead + math.ceil(count)), ways)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        for first in range(0, samples.shape[1], _PIECE):
            piece = samples[:, first : first + _PIECE]
            if self._record.slow is not None:
                piece = self._record.slow.off(piece, self._taken)
            self._taken += piece.shape[1]
            self._pass_on(0, piece)

    def _pass_on(self, number: int, samples: NDArray[np.float64]) -> None:
        for fresh in self._stages[number].section.of(samples):
            self._take(number, fresh)

    def _take(self, number: int, fresh: int) -> None:
        """See the next section of a stage."""
        at = self._stages[number]
        section, record, shape = at.section, at.record, at.section.shape
        inside = slice(max(record.start, 0), max(min(record.stop, fresh), 0))
        begins = inside if record.start >= 0 else None
        at.record = slice(record.start - shape.hop, record.stop - shape.hop)
        # Z has the drift, and a weighting tells it from the rest itself.
        drift = None
        if number == 0 and self._record.slow is not None:
            drift = self._record.slow.drift(-record.start - shape.before, shape.points)
        drifting = None if drift is None else section.lines_of(drift)

        for k, way in at.ways.items():
            running = self._levels[k]
            count = -(-fresh * way.intervals // GRAIN)
            cut = running.cut(count)
            if not way.values.size:
                samples = section.fresh
                if drift is not None:
                    samples = samples + drift[:, shape.before :][:, : shape.hop]
                running.take(_unfiltered_square(samples, round(way.together), count, cut))
                continue
            more = None if way.start is None else drifting
            spectrum = section.spectrum if more is None else section.spectrum + more
            running.take(way.squares(spectrum, count, cut, begins, *self._watchers(k, way, inside, begins)))
        if section.low.size:
            self._pass_on(number + 1, section.low)

    def _watchers(
        self, k: int, way: FilterAtWork, inside: slice, begins: slice | None
    ) -> tuple[Watch, Watch]:
        """What sees the output of a filter, and that of a weighting before its decays are taken off a beginning."""
        early, later, early_with_cut = self._peaks
        window = 0 if way.start is None or begins is None else way.start.window
        beginning = slice(window + 2 * _AROUND[0] if window else 0)

        def watch(rows: slice, output: NDArray[Any]) -> None:
            if k == self._peak_of:
                early.look(rows, output[:, inside][:, beginning])
                later.look(rows, output[:, inside][:, window:])

        def before(rows: slice, output: NDArray[Any]) -> None:
            seen = output[:, inside]
            if k == self._peak_of:
                early_with_cut.look(rows, seen[:, beginning])
            whole = seen.shape[1] // way.kept * way.kept
            square = np.square(seen[:, :whole]).reshape(len(seen), -1, way.kept)
            self._levels[k].see_cut(rows, square.mean(axis=2))

        return watch, before

    def result(self) -> Histories:
        """The histories; call it once, after the last samples."""
        for number, at in enumerate(self._stages):
            for fresh in at.section.rest():
                self._take(number, fresh)
        self._stages.clear()
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
        early, rest, early_with_cut = (peaks.largest() for peaks in self._peaks)
        with_cut = highest_with, mean_with, np.maximum(early_with_cut, rest)
        peaks = np.maximum(early, rest)
        return Histories(readings, highest, lowest, later, self._settled, mean, peaks, rest, with_cut)


def _differentiation(derivatives: NDArray[np.int64], rate: float, points: int) -> NDArray[np.complex128]:
    """(j omega)^d on the lines of a transform; nothing at 0 Hz but in channels that are not differentiated."""
    omega = 2.0 * np.pi * rate / points * np.arange(points // 2 + 1)
    factor = np.zeros((derivatives.size, omega.size), dtype=np.complex128)
    for row, times in zip(factor, derivatives, strict=True):
        row[1:] = (1j * omega[1:]) ** int(times)
        row[0] = times == 0
    return factor


def _unfiltered_square(
    samples: NDArray[np.float64], together: int, count: int, cut: tuple[int, float] | None
) -> NDArray[np.float64]:
    """Mean square of the samples themselves over each interval; silence follows the last one."""
    intervals = samples[:, : count * together].reshape(samples.shape[0], count, together)
    square = np.asarray(np.einsum("ijk,ijk->ij", intervals, intervals) / together)
    if cut is not None:
        square[:, cut[0]] /= cut[1]
    return square
