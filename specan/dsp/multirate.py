"""A record of any length as transforms of blocks, at its own sampling rate and at one eighth of it, again and again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from specan.dsp.overlapped_blocks import BlockGrid
from specan.dsp.windows import falling_step

FACTOR = 8
PASS, STOP = 0.40, 0.50
"""Edges of the low-pass filter over the new sampling rate: response 1 to 1e-17 below PASS, 0 above STOP."""


@lru_cache(maxsize=16)
def low_pass(low: int) -> NDArray[np.float64]:
    """Response at `low` + 1 lines up to half the new rate, over the factor by which a transform becomes shorter."""
    response = falling_step(np.arange(low + 1) / (2.0 * low), PASS, STOP) / FACTOR
    response[-1] = 0.0
    response.flags.writeable = False
    return response


class Decimator:
    """Low-pass filters and thins out consecutive blocks whose transforms are already there.

    The filter has zero phase, so the decimated stream is not late. Its response is 1 up to `PASS` and
    0 from `STOP` (times the new rate) on, so that nothing is aliased and no droop has to be divided
    out; between them it falls as an error function, so that it rings for less than half a block.

    Parameters
    ----------
    rows : int
        Number of channels.
    length : int
        L, samples of a block; the transforms given to `add` are over 2 L samples. A multiple of 16.
    """

    def __init__(self, rows: int, length: int) -> None:
        self._low = length // FACTOR
        self._response = low_pass(self._low)
        self._pending = np.zeros((rows, self._low))

    def add(self, spectrum: NDArray[np.complex128], half: int) -> NDArray[np.float64]:
        """Take the transform of the next block; return L / 8 samples of the decimated stream.

        `half` says in which half of the 2 L samples the block stands. The stream begins L / 16 of its
        samples before the first block: there the filter rings already.
        """
        low = self._low
        filtered = np.fft.irfft(spectrum[:, : low + 1] * self._response, 2 * low)
        # The block's own samples stand from half * low on; half a block of ringing on either side.
        filtered = np.roll(filtered, low // 2 - half * low, axis=1)
        complete = self._pending + filtered[:, :low]
        self._pending = filtered[:, low:]
        return complete

    def rest(self) -> NDArray[np.float64]:
        """The L / 8 samples in which the filter rings after the last block."""
        return self._pending


LENGTH = 1 << 15
"""Samples of a block on every stage. It belongs to the method: with it go the last bits of a result."""

LOWEST_BAND = 1.0
"""Lowest mid-frequency in Hz of a 1/24 octave whose filter rings for less than a block of the last stage."""

# A block holds the ringing of a 1/24 octave (to 1e-12) at this part of its stage's rate, and above.
LOWEST_PART = 0.28 / FACTOR

# Rows transformed together: enough to share the twiddle factors, few enough to stay in the cache.
ROWS = 4


@dataclass(frozen=True)
class Stage:
    """One sampling rate.

    Attributes
    ----------
    number : int
        0 is the record's own rate.
    rate : float
        In Hz.
    lead : float
        Samples of this stage before the record's first one (decimation filters ring before it).
    last : bool
        Whether no lower rate follows.
    """

    number: int
    rate: float
    lead: float
    last: bool

    @property
    def flat_to(self) -> float:
        """Frequency in Hz up to which the stage's samples are those of the record."""
        return self.rate * (0.5 if self.number == 0 else PASS)


def stages_of(sampling_rate: float) -> list[Stage]:
    """The stages that a record of this sampling rate goes through.

    Examples
    --------
    >>> [stage.rate for stage in stages_of(51200.0)]
    [51200.0, 6400.0, 800.0, 100.0, 12.5]
    """
    depth = max(0, math.ceil(math.log(sampling_rate * LOWEST_PART / LOWEST_BAND, FACTOR) - 1e-9))
    stages, lead = [], 0.0
    for number in range(depth + 1):
        stages.append(Stage(number, sampling_rate / FACTOR**number, lead, number == depth))
        lead = lead / FACTOR + LENGTH / (2 * FACTOR)
    return stages


class Consumer(Protocol):
    """What looks at the blocks of all stages."""

    def take(
        self, stage: Stage, block: NDArray[np.float64], transform: NDArray[np.complex128], half: int
    ) -> None:
        """See the next block of a stage, shape (channels, LENGTH), the last one of a stage shorter.

        `transform` is that of 2 `LENGTH` samples, shape (channels, LENGTH + 1), zero but for the block in
        the half that `half` says; successive blocks of a stage alternate. The array may be kept until the
        next block of the stage has been seen; the one after that may be written over it.
        """
        ...


class MultirateTransform:
    """Brings consecutive samples onto a fixed grid of blocks, transforms these, and thins them out.

    Parameters
    ----------
    rows : int
        Number of channels.
    sampling_rate : float
        In Hz.
    consumers : sequence of Consumer
        One transform serves them all.
    offset : ndarray, shape (channels,), optional
        A constant part of each channel that is taken off all its samples: a filter at rest would be struck by it
        when the record begins and ends.
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        consumers: Sequence[Consumer],
        offset: NDArray[np.float64] | None = None,
    ) -> None:
        self._offset = None if offset is None or not offset.any() else offset[:, None]
        self.stages = stages_of(sampling_rate)
        self._rows, self._consumers = rows, consumers
        self._grids = [BlockGrid(rows, LENGTH) for _ in self.stages]
        self._decimators: list[Decimator | None] = [None] * len(self.stages)
        self._halves = [0] * len(self.stages)
        # Memory that is used again: on fresh memory, a transform takes twice the time. The lower stages
        # have so few blocks that it is not worth it.
        self._reused: dict[int, NDArray[np.complex128]] = {}
        self._padded = np.zeros((min(rows, ROWS), 2 * LENGTH))

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        self._pass_on(0, samples)

    def finish(self) -> None:
        """Take what is left after the last samples, on every stage."""
        for number, grid in enumerate(self._grids):
            if grid.rest().shape[1]:
                self._take(number, grid.rest())
            if number == 0:
                self._reused.clear()
            decimator, self._decimators[number] = self._decimators[number], None
            if decimator is not None:
                self._pass_on(number + 1, decimator.rest())

    def _pass_on(self, number: int, samples: NDArray[np.float64]) -> None:
        for block in self._grids[number].add(samples):
            self._take(number, block)

    def _take(self, number: int, block: NDArray[np.float64]) -> None:
        stage, half = self.stages[number], self._halves[number]
        self._halves[number] = 1 - half
        if number == 0 and self._offset is not None:
            block = block - self._offset
        transform = self._transform(number, block, half)
        for consumer in self._consumers:
            consumer.take(stage, block, transform, half)
        if stage.last:
            return
        decimator = self._decimators[number] or Decimator(self._rows, LENGTH)
        self._decimators[number] = decimator
        self._pass_on(number + 1, decimator.add(transform, half))

    def _transform(self, number: int, block: NDArray[np.float64], half: int) -> NDArray[np.complex128]:
        result = self._reused.get(half) if number == 0 else None
        if result is None:
            result = np.empty((self._rows, LENGTH + 1), dtype=np.complex128)
        if number == 0:
            self._reused[half] = result
        self._padded[...] = 0.0
        place = slice(half * LENGTH, half * LENGTH + block.shape[1])
        for top in range(0, self._rows, ROWS):
            part = block[top : top + ROWS]
            padded = self._padded[: part.shape[0]]
            padded[:, place] = part
            np.fft.rfft(padded, out=result[top : top + ROWS])
        return result
