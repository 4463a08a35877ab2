"""At which rate, in which sections and on which lines a filter of a time-weighted level works."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specan.dsp.history_filters import SETTLINGS_IN_A_BLOCK, Filter
from specan.dsp.multirate import LENGTH, Stage
from specan.dsp.sections import Shape, shape_for
from specan.dsp.smooth_step import falling_step
from specan.dsp.time_weighting import TimeWeighting

# What a filter attenuates by more than 100 dB is left out.
_NOTHING = 1e-5
# What a band filter makes of the cut at the record's beginning has fallen by 60 dB after 2 times 3 / B: 10 dB
# in every 1 / B.
_SETTLINGS_OF_A_CUT = 2.0
_PER_TIME_CONSTANT = 64.0
# Squares are averaged over intervals as long as this many of them still make a time constant.
_INTERVALS = 256.0
# From so many cycles in a time constant on, the ripple of a squared tone is less than 0.002 dB.
_CYCLES_WITHOUT_RIPPLE = 200.0
# A thinned output is faithful up to this part of half its rate.
_FAITHFUL = 0.8

# How a filter gets its spectra: from sections of a shape, from pairs of blocks, or it needs none.
Way = Shape | None | Literal["none"]


@dataclass
class FilterAtWork:
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
    peaks: TimeWeighting | None
    silent: int
    start: int
    end: int
    settled: int
    place: NDArray[np.float64]
    last: NDArray[np.float64]
    position: int = 0
    reading: int = 0
    before_start: NDArray[np.float64] | None = None
    last_interval: int = -1
    last_samples: int = 1

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
    ) -> FilterAtWork:
        """Put a filter to work; `settled`, `end` and `times` in s."""
        together = _power_of_two(stage.rate * time_constant / _INTERVALS)
        thinning = min(together, _power_of_two(stage.rate * _FAITHFUL / 2.0 / one.upper))
        shape = shape_for(one.ringing * stage.rate)
        starts = max(one.silent, 0.0 if one.sampled else _SETTLINGS_OF_A_CUT * one.settling)
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

        samples = math.floor(stage.lead + end * stage.rate + 1e-6) + 1
        return cls(
            stage,
            shape,
            envelope,
            thinning,
            together,
            low,
            values,
            TimeWeighting(rows, stage.rate / together, time_constant, decay),
            TimeWeighting(rows, stage.rate / together, time_constant, decay) if decay and starts else None,
            math.ceil((stage.lead + one.silent * stage.rate) / together) if one.silent else 0,
            math.ceil((stage.lead + starts * stage.rate) / together),
            math.floor(float(place(np.array(end))) + 1e-6) + 1,
            math.ceil((stage.lead + settled * stage.rate) / together),
            place(np.minimum(times, end)),
            np.zeros((rows, 1)),
            last_interval=samples // together,
            last_samples=max(samples % together, 1),
        )


def stage_for(one: Filter, stages: Sequence[Stage], time_constant: float) -> Stage:
    """The lowest rate that is faithful to a filter's band and fine enough for the time weighting.

    The ripple of a squared low tone is followed with `_PER_TIME_CONSTANT` samples, unless the filter
    rings for longer than a block at such a rate.
    """
    possible = [stage for stage in stages if stage.number == 0 or stage.flat_to >= one.upper]
    lasting = [stage for stage in possible if LENGTH / stage.rate >= SETTLINGS_IN_A_BLOCK * one.settling]
    fine = [stage for stage in lasting if stage.rate * time_constant >= _PER_TIME_CONSTANT]
    return fine[-1] if fine else (lasting or possible[-1:])[0]


def _lines(one: Filter, stage: Stage, size: int, thinning: int) -> tuple[int, NDArray[np.complex128]]:
    """The response at the lines of a transform of 2 `size` samples as far as it matters, and the first of these lines.

    For a thinned output it is cut off smoothly below half the output's rate, and scaled for the
    shorter inverse transform.
    """
    top = stage.rate / 2.0 / thinning
    frequency = np.linspace(0.0, top, size // thinning + 1)
    if one.sampled is not None:
        return 0, one.sampled(stage.rate, frequency.size)
    values = one.response(frequency) / thinning
    if thinning > 1:
        values *= falling_step(frequency, _FAITHFUL * top, top)
    used = np.flatnonzero(np.abs(values) > _NOTHING / thinning)
    return int(used[0]), values[used[0] : used[-1] + 1].copy()


def _power_of_two(limit: float) -> int:
    """The largest power of two up to `limit` that divides a block; 1 at least."""
    return 1 << min(max(math.floor(math.log2(limit)), 0), 6) if limit > 0.0 else 1
