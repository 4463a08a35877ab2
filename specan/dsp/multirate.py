"""A record of any length as transforms of blocks, at its own sampling rate and at one eighth of it, again and again."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.windows import falling_step

FACTOR = 8
PASS, STOP = 0.40, 0.50
"""Edges of the low-pass filter over the new sampling rate: response 1 to 1e-17 below PASS, 0 above STOP."""


# Bytes; glibc takes note of pieces up to 32 MB. Transforms of a few rows work in 1 to 4 MB, a short file in some 20 MB.
_LARGE = 31 << 20


def keep_freed_memory() -> None:
    """Let the C library keep what it has been given back, up to 62 MB, for what is asked for next.

    Every transform asks for memory to work in. glibc gets pieces beyond a threshold from the system and gives them
    back at once, and each new page costs a fault: a fifth of the CPU time of level histories, a twelfth of that of many
    short files. The threshold becomes the size of the largest such piece that was ever freed, and twice that is kept
    (mallopt(3), M_MMAP_THRESHOLD). What is asked for here is never touched, so it takes no memory, and other C
    libraries just take it back.
    """
    np.empty(_LARGE, dtype=np.uint8)


@lru_cache(maxsize=16)
def low_pass(low: int) -> NDArray[np.float64]:
    """Response at `low` + 1 lines up to half the new rate, over the factor by which a transform becomes shorter."""
    response = falling_step(np.arange(low + 1) / (2.0 * low), PASS, STOP) / FACTOR
    response[-1] = 0.0
    response.flags.writeable = False
    return response


class Memory(threading.local):
    """Arrays that are used again: on fresh memory, a transform takes twice the time."""

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[np.uint8]] = {}

    def take(self, name: str, rows: int, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """An array of that shape, which holds anything."""
        size = rows * count * dtype.itemsize
        if name not in self._kept or self._kept[name].size < size:
            self._kept[name] = np.empty(size, dtype=np.uint8)
        return self._kept[name][:size].view(dtype).reshape(rows, count)


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

    def add(
        self, spectrum: NDArray[np.complex128], half: int, rows: slice = slice(None)
    ) -> NDArray[np.float64]:
        """Take the transform of the next block of some rows; return L / 8 samples of their decimated stream.

        `half` says in which half of the 2 L samples the block stands. The stream begins L / 16 of its
        samples before the first block: there the filter rings already.
        """
        low = self._low
        filtered = np.fft.irfft(spectrum[:, : low + 1] * self._response, 2 * low)
        # The block's own samples stand from half * low on; half a block of ringing on either side.
        filtered = np.roll(filtered, low // 2 - half * low, axis=1)
        complete = self._pending[rows] + filtered[:, :low]
        self._pending[rows] = filtered[:, low:]
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


def few_rows(rows: int) -> list[slice]:
    """The rows in groups that are transformed together."""
    return [slice(top, min(top + ROWS, rows)) for top in range(0, rows, ROWS)]


class Consumer(Protocol):
    """What looks at the blocks of all stages."""

    def take(
        self,
        stage: Stage,
        rows: slice,
        block: NDArray[np.float64],
        transform: NDArray[np.complex128],
        half: int,
    ) -> None:
        """See some rows of the next block of a stage, shape (rows, LENGTH), the last block of a stage shorter.

        All rows of a block come one after the other, from the first one on. `transform` is that of 2 `LENGTH` samples,
        shape (rows, LENGTH + 1), zero but for the block in the half that `half` says; successive blocks of a stage
        alternate. The array is written over afterwards.
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
    consumer : Consumer
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        consumer: Consumer,
    ) -> None:
        keep_freed_memory()
        self.stages = stages_of(sampling_rate)
        self._rows, self._consumer = rows, consumer
        self._grids = [OverlappedBlocks(LENGTH) for _ in self.stages]
        self._decimators: list[Decimator | None] = [None] * len(self.stages)
        self._halves = [0] * len(self.stages)
        self._padded = PaddedTransform(rows)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        self._pass_on(0, samples)

    def finish(self) -> None:
        """Take what is left after the last samples, on every stage."""
        for number, grid in enumerate(self._grids):
            low = None if grid.rest is None or not grid.rest.shape[1] else self._take(number, grid.rest)
            self._grids[number] = OverlappedBlocks(LENGTH)
            if low is not None:
                self._pass_on(number + 1, low)
            decimator, self._decimators[number] = self._decimators[number], None
            if decimator is not None:
                self._pass_on(number + 1, decimator.rest())

    def _pass_on(self, number: int, samples: NDArray[np.float64]) -> None:
        for block in self._grids[number].feed(samples):
            low = self._take(number, block)
            if low is not None:
                self._pass_on(number + 1, low)

    def _take(self, number: int, block: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Show a block to the consumer, and return it thinned out if there is a lower rate."""
        stage, half = self.stages[number], self._halves[number]
        self._halves[number] = 1 - half
        low = None if stage.last else np.empty((self._rows, LENGTH // FACTOR))
        for rows in few_rows(self._rows):
            part = block[rows]
            transform = self._padded(part, half)
            self._consumer.take(stage, rows, part, transform, half)
            if low is not None:
                decimator = self._decimators[number] or Decimator(self._rows, LENGTH)
                self._decimators[number] = decimator
                low[rows] = decimator.add(transform, half, rows)
        return low


class PaddedTransform:
    """Transforms of 2 `LENGTH` samples, of which a block fills the first or the second half, a few rows at a time.

    The memory is used again: on fresh memory, a transform takes twice the time.
    """

    def __init__(self, rows: int) -> None:
        self._samples = np.zeros((min(rows, ROWS), 2 * LENGTH))
        self._lines = np.empty((min(rows, ROWS), LENGTH + 1), dtype=np.complex128)

    def __call__(self, block: NDArray[np.float64], half: int) -> NDArray[np.complex128]:
        """The lines of some rows; the next call writes over them."""
        samples = self._samples[: block.shape[0]]
        samples[...] = 0.0
        samples[:, half * LENGTH : half * LENGTH + block.shape[1]] = block
        return np.fft.rfft(samples, out=self._lines[: block.shape[0]])
