"""At which rate, with how many samples and on which lines a filter of a time-weighted level works."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.dsp.history_filters import SETTLINGS_IN_A_BLOCK, Filter
from specan.dsp.multirate import LENGTH, Memory, Stage
from specan.dsp.record_start import RecordStart, start_of
from specan.dsp.sections import GRAIN, Shape, fast_length
from specan.dsp.windows import falling_step

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
# Up to so many numbers are added column by column: a sum over an axis so short costs more.
_FEW = 6
# Rows whose transforms numpy computes side by side in single precision, and points of an inverse transform that stay
# in the cache with what they are made from.
_SIDE_BY_SIDE, _POINTS = 4, 1 << 17


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
            return cls(every, GRAIN // every, False, 0, np.empty(0, dtype=np.complex128))
        if one.weighting is not None:
            response, start = start_of(one.weighting, stage.rate, shape.before)
            return cls(every, GRAIN // every, False, 0, np.fft.rfft(response, points), start=start)
        # What is thinned out has nothing at half its rate.
        causal = None if stage.number else one.causal(stage.rate, points // 2 + 1)
        if causal is not None:
            return cls(every, GRAIN // every, False, 0, causal)
        need = math.ceil(2.0 * GRAIN * min(one.upper / (_FAITHFUL * stage.rate), 1.0))
        intervals, kept = _grid(min(need, GRAIN), least, 1)
        if intervals * kept >= GRAIN:
            intervals, kept = every, GRAIN // every
        if one.lower * time_constant >= _CYCLES_WITHOUT_RIPPLE:
            found = cls._as_envelope(one, stage, points, time_constant)
            if 2 * found.kept * found.intervals <= kept * intervals:
                return found
        part = intervals * kept / GRAIN
        top = stage.rate / 2.0 * part
        low, values = _lines(one, stage.rate / points, points // GRAIN * intervals * kept // 2)
        if part < 1.0:
            frequency = (low + np.arange(values.size)) * stage.rate / points
            values = values * falling_step(frequency, _FAITHFUL * top, top)
        return cls(intervals, kept, False, low, values * part)

    @classmethod
    def _as_envelope(cls, one: Filter, stage: Stage, points: int, time_constant: float) -> FilterAtWork:
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
        return cls(intervals, kept, True, low, values)

    def squares(
        self,
        spectrum: NDArray[Any],
        shape: Shape,
        count: int,
        scratch: Memory,
        cut: tuple[int, float] | None,
        record: slice | None = None,
        watch: Watch | None = None,
        with_cut: Watch | None = None,
    ) -> NDArray[np.float32]:
        """Mean square of the output over each of `count` intervals from the first new sample on.

        Computed in the precision of `spectrum`. `cut` is an interval and which part of it belongs to the record.
        `record` are the samples of the record in a section that it begins in; `watch` sees the output,
        `with_cut` that of a weighting at the record's beginning before its decays are taken off.
        """
        rows, size = spectrum.shape[0], shape.points // GRAIN * self.intervals * self.kept
        width = (2 if self.envelope else 1) * self.kept
        values = self.values.astype(spectrum.dtype)
        first = shape.before // GRAIN * self.intervals
        square = np.empty((rows, count), dtype=np.float32)
        step = max(1, _POINTS // (size * _SIDE_BY_SIDE)) * _SIDE_BY_SIDE
        for start in range(0, rows, step):
            # At the end some rows again: that is faster than fewer rows.
            some = min(step, -(-(rows - start) // _SIDE_BY_SIDE) * _SIDE_BY_SIDE, rows)
            top = min(start, rows - some)
            part = spectrum[top : top + some]
            output = (self._envelope if self.envelope else self._real)(part, values, size, scratch)
            flat = output[:, first * width : (first + count) * width]
            if self.start is not None and record is not None:
                if with_cut is not None:
                    with_cut(slice(start, top + some), flat[start - top :])
                flat[:, record] = self.start.without(flat[:, record])
            if watch is not None:
                watch(slice(start, top + some), flat[start - top :])
            mine = flat.reshape(part.shape[0], count, width)
            if cut is not None:  # what comes after the end of the record is not part of it
                inside = math.ceil(cut[1] * self.kept)
                mine[:, cut[0], width * inside // self.kept :] = 0.0
                mine[:, cut[0]] *= math.sqrt(self.kept / inside)
            _sum_of_squares(mine, square[top : top + some])
        square /= self.kept
        return square

    def _real(self, part: NDArray[Any], values: NDArray[Any], size: int, scratch: Memory) -> NDArray[Any]:
        """`size` samples of the filter's output."""
        product = scratch.take("lines", part.shape[0], size // 2 + 1, part.dtype)
        lines = slice(self.low, self.low + values.size)
        product[:, : lines.start] = 0.0
        product[:, lines.stop :] = 0.0
        np.multiply(part[:, lines], values, out=product[:, lines])
        return np.fft.irfft(product, size, out=_output(scratch, part, size))

    def _envelope(self, part: NDArray[Any], values: NDArray[Any], size: int, scratch: Memory) -> NDArray[Any]:
        """`size` complex samples of the filter's output, each as two real numbers."""
        product, used = scratch.take("lines", part.shape[0], size, part.dtype), values.size
        product[:, used:] = 0.0
        for begin in range(0, used, size):
            some = values[begin : begin + size]
            lines = part[:, self.low + begin : self.low + begin + some.size]
            if begin == 0:
                np.multiply(lines, some, out=product[:, : some.size])
            else:
                product[:, : some.size] += lines * some
        output = _output(scratch, part, 2 * size)
        np.fft.ifft(product, out=output.view(part.dtype))
        return output


def _output(scratch: Memory, part: NDArray[Any], size: int) -> NDArray[Any]:
    """Memory for real numbers in the precision of complex ones."""
    return scratch.take("output", part.shape[0], size, np.dtype(part.real.dtype))


def _sum_of_squares(numbers: NDArray[Any], result: NDArray[np.float32]) -> None:
    """Sum over the last axis; the numbers are lost."""
    if numbers.shape[2] > _FEW:
        np.einsum("ijk,ijk->ij", numbers, numbers, out=result, casting="same_kind")
        return
    np.multiply(numbers, numbers, out=numbers)
    if numbers.shape[2] == 1:
        result[...] = numbers[:, :, 0]
        return
    np.add(numbers[:, :, 0], numbers[:, :, 1], out=result, casting="same_kind")
    for column in range(2, numbers.shape[2]):
        result += numbers[:, :, column]


def stage_for(one: Filter, stages: Sequence[Stage], time_constant: float) -> Stage:
    """The lowest rate that is faithful to a filter's band and fine enough for the time weighting.

    The ripple of a squared low tone is followed with `_PER_TIME_CONSTANT` samples, unless the filter
    rings for longer than a block at such a rate.
    """
    possible = [stage for stage in stages if stage.number == 0 or stage.flat_to >= one.upper]
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
