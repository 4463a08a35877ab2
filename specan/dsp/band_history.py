"""Time-weighted levels behind band filters and frequency weightings, against time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.multirate import LENGTH, ROWS, MultirateTransform, Stage, stages_of
from specan.dsp.sections import Sections, Shape, shape_for
from specan.dsp.smooth_step import falling_step
from specan.dsp.time_weighting import TimeWeighting
from specan.dsp.weighting import Weighting, complex_weighting

# A band is filtered at the lowest rate whose samples are faithful up to this many times its upper edge.
_ROOM_ABOVE = 1.25
# What a filter attenuates by more than 100 dB is left out.
_NOTHING = 1e-5
# After 6 times 3 / B an order 4 band-pass has fallen by 180 dB.
_SETTLINGS_IN_A_BLOCK = 6.0
# The lowest poles of A, B and C are at 20.6 Hz.
_WEIGHTINGS_RING = 9.0 * math.log(10.0) / (2.0 * math.pi * 20.6)
_PER_TIME_CONSTANT = 64.0
# Squares are averaged over intervals as long as this many of them still make a time constant.
_INTERVALS = 256.0
# From so many cycles in a time constant on, the ripple of a squared tone is less than 0.002 dB.
_CYCLES_WITHOUT_RIPPLE = 200.0
# A thinned output is faithful up to this part of half its rate.
_FAITHFUL = 0.8

# How a filter gets its spectra: from sections of a shape, from pairs of blocks, or it needs none.
Way = Shape | None | Literal["none"]
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
        Whether it is no filter at all.
    """

    response: Response
    lower: float = 0.0
    upper: float = math.inf
    settling: float = 0.0
    ringing: float = math.inf
    identity: bool = False


def band_filter(index: int, fraction: int, weighting: Weighting = "Z") -> Filter:
    """Band filter of a fractional octave, with a frequency weighting; see `bands.power_response`."""
    mid = float(bands.mid_frequencies(index, fraction))
    lower, upper = (float(edge) for edge in bands.band_edges(index, fraction))

    def response(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        return bands.complex_response(frequency / mid, fraction) * complex_weighting(frequency, weighting)

    # The envelope of an order 4 band-pass settles to 1 % within 3 / B.
    settling = 3.0 / (upper - lower)
    return Filter(response, lower, _ROOM_ABOVE * upper, settling, _SETTLINGS_IN_A_BLOCK * settling)


def weighting_filter(weighting: Weighting) -> Filter:
    """A frequency weighting of the whole signal."""
    return Filter(
        lambda frequency: complex_weighting(frequency, weighting),
        ringing=_WEIGHTINGS_RING,
        identity=weighting == "Z",
    )


@dataclass
class _Channelised:
    """One filter at work on its stage.

    Its output is sampled at every `thinning`-th sample of the stage, and squared; intervals of `together`
    samples of the stage are averaged before the time weighting. It sees sections of the blocks, or pairs
    of blocks where there is no `shape`. With `envelope` the output is the complex one of the lines that
    matter, shifted to frequency zero: what is narrow needs few samples, and half the square of the modulus is the
    square without its ripple at twice the frequency.
    """

    stage: Stage
    shape: Shape | None
    envelope: bool
    thinning: int
    together: int
    low: int
    values: NDArray[np.complex128]
    weighting: TimeWeighting
    start: int
    end: int
    settled: int
    place: NDArray[np.float64]
    last: NDArray[np.float64]
    position: int = 0
    reading: int = 0

    @classmethod
    def of(
        cls,
        one: Filter,
        stage: Stage,
        rows: int,
        time_constant: float,
        decay: float | None,
        settled: float,
        end: float,
        times: NDArray[np.float64],
    ) -> _Channelised:
        """Put a filter to work; `settled`, `end` and `times` in s."""
        together = _power_of_two(stage.rate * time_constant / _INTERVALS)
        thinning = min(together, _power_of_two(stage.rate * _FAITHFUL / 2.0 / one.upper))
        shape = shape_for(one.ringing * stage.rate)
        size = LENGTH if shape is None else sum(shape) // 2
        low, values = _lines(one, stage, size, thinning)
        whole = _lines(one, stage, size, 1)
        narrow = min(together, _power_of_two(2 * size / whole[1].size))
        envelope = one.lower * time_constant >= _CYCLES_WITHOUT_RIPPLE and narrow > 2 * thinning
        if envelope:
            thinning, low, values = narrow, whole[0], whole[1] * (math.sqrt(2.0) / narrow)

        def place(time: NDArray[np.float64]) -> NDArray[np.float64]:
            # A sample stands for half a sampling interval on either side of it; an average is known at
            # the end of its interval.
            last = (stage.lead + end * stage.rate + 0.5) / together - 1.0
            here = (stage.lead + time * stage.rate + 0.5 * thinning) / together - 1.0
            return np.minimum(here, last)

        return cls(
            stage,
            shape,
            envelope,
            thinning,
            together,
            low,
            values,
            TimeWeighting(rows, stage.rate / together, time_constant, decay),
            math.ceil(stage.lead / together),
            math.floor(float(place(np.array(end))) + 1e-6) + 1,
            math.ceil((stage.lead + settled * stage.rate) / together),
            place(np.minimum(times, end)),
            np.zeros((rows, 1)),
        )


@dataclass(frozen=True)
class Histories:
    """Time-weighted mean squares.

    Attributes
    ----------
    readings : ndarray, shape (channels, filters, times)
        At the times asked for.
    maximum, minimum : ndarray, shape (channels, filters)
        Over all samples: the maximum from the beginning, the minimum after `settled_s`. NaN where the
        record is too short for that.
    settled_s : ndarray, shape (filters,)
        Seconds after which a filter and the time weighting behind it have settled to 0.1 dB.
    """

    readings: NDArray[np.float64]
    maximum: NDArray[np.float64]
    minimum: NDArray[np.float64]
    settled_s: NDArray[np.float64] = field(repr=False)


class BandHistory:
    """Filters the blocks of a `MultirateTransform`, squares, weights in time, reads at given times.

    Filtering is multiplication of the transform with the analogue filter's response: neither the
    bilinear transform's warping nor a sampled filter's rounding at low frequencies. The transform of two
    successive blocks gives the second one's output without error, as the filter rings for less than a
    block at the rate at which it works.

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
        shape = (rows, len(filters))
        self._readings = np.full((*shape, len(times)), np.nan)
        self._maximum, self._minimum = np.full(shape, np.nan), np.full(shape, np.nan)
        stages = stages_of(sampling_rate)
        self._working: dict[tuple[int, Way], list[tuple[int, _Channelised]]] = {}
        self._sections: dict[tuple[int, Way], Sections] = {}
        for number, one in enumerate(filters):
            if self._derivatives.any():  # these are taken on pairs of blocks
                one = replace(one, ringing=math.inf, identity=False)
            stage = _stage_for(one, stages, time_constant)
            working = _Channelised.of(
                one, stage, rows, time_constant, decay, self._settled[number], self._end, times
            )
            way: Way = "none" if one.identity else working.shape
            self._working.setdefault((stage.number, way), []).append((number, working))
            if isinstance(way, Shape) and (stage.number, way) not in self._sections:
                self._sections[stage.number, way] = Sections(rows, way)
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
                pair = self._pair(stage, transform)
                self._filter(working, pair, half * LENGTH, length)
            elif isinstance(way, Shape):
                for fresh, spectrum in self._sections[number, way].of(block):
                    self._filter(working, spectrum, way.before, fresh)
            else:
                for filter_number, one in working:
                    self._read(filter_number, one, one.weighting(_unfiltered_square(one, block)))

    def _pair(self, stage: Stage, transform: NDArray[np.complex128]) -> NDArray[np.complex128]:
        previous = self._previous.get(stage.number)
        self._previous[stage.number] = transform
        return self._differentiated(transform if previous is None else previous + transform, stage)

    def _filter(
        self,
        working: Sequence[tuple[int, _Channelised]],
        spectrum: NDArray[np.complex128],
        first: int,
        length: int,
    ) -> None:
        for number, one in working:
            square = self._filtered_square(one, spectrum, first, length)
            self._read(number, one, one.weighting(square))

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
        self, one: _Channelised, spectrum: NDArray[np.complex128], first: int, length: int
    ) -> NDArray[np.float64]:
        """Mean square of the filter's output over each interval of `length` samples from `first` on.

        The last interval may reach beyond them.
        """
        count, size = -(-length // one.together), (spectrum.shape[1] - 1) // one.thinning
        begin, parts = first // one.thinning, 2 if one.envelope else 1
        per_interval = one.together // one.thinning
        square = np.empty((self._rows, count))
        for top in range(0, self._rows, ROWS):
            part = spectrum[top : top + ROWS]
            output = self._envelope(one, part, size) if one.envelope else self._real(one, part, size)
            mine = output[:, parts * begin : parts * (begin + count * per_interval)]
            mine = mine.reshape(part.shape[0], count, parts * per_interval)
            np.einsum("ijk,ijk->ij", mine, mine, out=square[top : top + ROWS])
        square /= per_interval
        return square

    def _real(self, one: _Channelised, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """2 `size` samples of the filter's output."""
        product, lines = self._product[: part.shape[0], : size + 1], slice(one.low, one.low + one.values.size)
        product[:, : lines.start] = 0.0
        product[:, lines.stop :] = 0.0
        np.multiply(part[:, lines], one.values, out=product[:, lines])
        return np.fft.irfft(product, 2 * size, out=self._output[: part.shape[0], : 2 * size])

    def _envelope(self, one: _Channelised, part: NDArray[np.complex128], size: int) -> NDArray[np.float64]:
        """2 `size` complex samples of the filter's output, each as two real numbers."""
        used = one.values.size
        product = self._product[: part.shape[0], : 2 * size]
        product[:, used:] = 0.0
        np.multiply(part[:, one.low : one.low + used], one.values, out=product[:, :used])
        output = self._output.view(np.complex128)[: part.shape[0], : 2 * size]
        return np.fft.ifft(product, out=output).view(np.float64)

    def _read(self, number: int, one: _Channelised, weighted: NDArray[np.float64]) -> None:
        length = weighted.shape[1]
        upto = min(length, one.end - one.position)
        for extreme, choose, since in (
            (self._maximum, np.fmax, one.start),
            (self._minimum, np.fmin, one.settled),
        ):
            part = weighted[:, max(since - one.position, 0) : max(upto, 0)]
            if part.shape[1]:
                extreme[:, number] = choose(extreme[:, number], choose.reduce(part, axis=1))
        # Samples i and i + 1 around each reading, the last one of the block before included.
        done = int(np.searchsorted(one.place, one.position + length - 1, side="right"))
        if done > one.reading:
            place = one.place[one.reading : done] - (one.position - 1)
            before = np.clip(np.floor(place).astype(int), 0, length - 1)
            share = place - before
            around = np.concatenate([one.last, weighted], axis=1)
            self._readings[:, number, one.reading : done] = (
                around[:, before] * (1.0 - share) + around[:, before + 1] * share
            )
            one.reading = done
        one.last = weighted[:, -1:].copy()
        one.position += length

    def result(self) -> Histories:
        """What was read; call it after the transform is finished."""
        return Histories(self._readings, self._maximum, self._minimum, self._settled)


class BandHistoryAccumulator:
    """Takes a record in consecutive blocks and gives its time-weighted histories; see `BandHistory`.

    The mean of the first block is taken off: a constant part would strike the filters at the beginning.

    Examples
    --------
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
    ) -> None:
        self._history = BandHistory(
            rows, sampling_rate, n_samples, filters, time_constant, decay, times, derivatives
        )
        self._transform = MultirateTransform(rows, sampling_rate, [self._history], without_offset=True)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        self._transform.add(samples)

    def result(self) -> Histories:
        """The histories; call it once, after the last samples."""
        self._transform.finish()
        return self._history.result()


def _stage_for(one: Filter, stages: Sequence[Stage], time_constant: float) -> Stage:
    """The lowest rate that is faithful to a filter's band and fine enough for the time weighting.

    The ripple of a squared low tone is followed with `_PER_TIME_CONSTANT` samples, unless the filter
    rings for longer than a block at such a rate.
    """
    possible = [stage for stage in stages if stage.number == 0 or stage.flat_to >= one.upper]
    lasting = [stage for stage in possible if LENGTH / stage.rate >= _SETTLINGS_IN_A_BLOCK * one.settling]
    fine = [stage for stage in lasting if stage.rate * time_constant >= _PER_TIME_CONSTANT]
    return fine[-1] if fine else (lasting or possible[-1:])[0]


def _unfiltered_square(one: _Channelised, block: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square of the samples themselves over each of the block's intervals."""
    rows, length = block.shape
    count = -(-length // one.together)
    if count * one.together > length:
        block = np.pad(block, ((0, 0), (0, count * one.together - length)))
    intervals = block.reshape(rows, count, one.together)
    return np.asarray(np.einsum("ijk,ijk->ij", intervals, intervals) / one.together)


def _lines(one: Filter, stage: Stage, size: int, thinning: int) -> tuple[int, NDArray[np.complex128]]:
    """The response at the lines of a transform of 2 `size` samples as far as it matters, and the first of these lines.

    For a thinned output it is cut off smoothly below half the output's rate, and scaled for the
    shorter inverse transform.
    """
    top = stage.rate / 2.0 / thinning
    frequency = np.linspace(0.0, top, size // thinning + 1)
    values = one.response(frequency) / thinning
    if thinning > 1:
        values *= falling_step(frequency, _FAITHFUL * top, top)
    used = np.flatnonzero(np.abs(values) > _NOTHING / thinning)
    return int(used[0]), values[used[0] : used[-1] + 1]


def _power_of_two(limit: float) -> int:
    """The largest power of two up to `limit` that divides a block; 1 at least."""
    return 1 << min(max(math.floor(math.log2(limit)), 0), 6) if limit > 0.0 else 1
