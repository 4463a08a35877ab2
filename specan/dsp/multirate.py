"""A record of any length as transforms of blocks or sections, at its own rate and at an eighth of it, and so on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from specan.arrays import Complex, Real
from specan.dsp.windows import falling_step

FACTOR = 8
# Edges of the low-pass filter over the new sampling rate: response 1 to 1e-17 below PASS, 0 above STOP.
PASS, STOP = 0.40, 0.50


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
def low_pass(low: int) -> Real:
    """Response at `low` + 1 lines up to half the new rate, over the factor by which a transform becomes shorter."""
    response = falling_step(np.arange(low + 1) / (2.0 * low), PASS, STOP) / FACTOR
    response[-1] = 0.0
    response.flags.writeable = False
    return response


def thinned(lines: Complex) -> Real:
    """Samples at the next rate, of a transform whose number of points is a multiple of twice the factor."""
    low = (lines.shape[1] - 1) // FACTOR
    return np.fft.irfft(lines[:, : low + 1] * low_pass(low), 2 * low)


class Decimator:
    """Low-pass filters and thins out consecutive blocks whose transforms are already there.

    The filter has zero phase, so the decimated stream is not late. Its response is 1 up to `PASS` and
    0 from `STOP` (times the new rate) on, so that nothing is aliased and no droop has to be divided
    out; between them it falls as an error function, so that it rings for less than half a block.

    Attributes
    ----------
    rest : ndarray, shape (rows, L / 8), optional
        What the filter rings after the last block; None is zero.
    """

    def __init__(self) -> None:
        self.rest: Real | None = None

    def add(self, spectrum: Complex | None, half: int) -> Real | None:
        """Take the transform of the next block; return L / 8 samples of the decimated stream. None is zero.

        `half` says in which half of the 2 L samples the block stands. The stream begins L / 16 of its samples before
        the first block: there the filter rings already.
        """
        before, self.rest = self.rest, None
        if spectrum is None:
            return before
        low = LENGTH // FACTOR
        # The block's own samples stand from half * low on; half a block of ringing on either side.
        filtered = np.roll(thinned(spectrum), low // 2 - half * low, axis=1)
        self.rest = filtered[:, low:].copy()
        return filtered[:, :low] if before is None else before + filtered[:, :low]


# Samples of a block on every stage. It belongs to the method: with it go the last bits of a result.
LENGTH = 1 << 15

# Lowest mid-frequency in Hz of a 1/24 octave whose filter rings for less than a block of the last stage.
LOWEST_BAND = 1.0

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
        Samples of this stage before the record's first one in the streams of `Sections`.
    last : bool
        Whether no lower rate follows.
    """

    number: int
    rate: float
    lead: float
    last: bool


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
        lead = (lead + LATE) / FACTOR
    return stages


# Everything is a multiple of so many samples: a whole number of intervals fills them.
GRAIN = 1024

# Samples after a section: as many as a response that is cut off smoothly at half a rate rings ahead, to -100 dB of
# what is left of it there.
_AFTER = 1024
# The thinned stream is this much behind the section, which gives its low-pass room to ring ahead. Its slope is
# exp(-(12 f / w)^2) with w = 1/80 of the rate (`PASS`, `STOP`): after 1912 samples it is below 1e-17.
LATE, _RINGS = 2048, 2048
# With ten times the ringing nine tenths of a transform are results. On lower rates, with fewer samples, memory counts.
_TIMES, _LONGEST, _LONGEST_BELOW = 10, 160 * GRAIN, 80 * GRAIN


class Shape(NamedTuple):
    """Samples of a section: `before` to let a filter settle, `hop` new ones, `after` for what rings ahead.

    A transform is circular: the step from the end of a section to its beginning is met by every filter that is
    not causal, and a band filter whose response is cut off below half a sampling rate is not.
    """

    before: int
    hop: int
    after: int

    @property
    def points(self) -> int:
        """Samples of the transform."""
        return self.before + self.hop + self.after


def shape_for(ringing: float, samples: int, stage: int = 0) -> Shape:
    """The shape for filters that ring for so many samples, in a stream of so many, on a stage.

    Examples
    --------
    >>> shape_for(8200.0, 10**6)
    Shape(before=9216, hop=81920, after=1024)
    >>> shape_for(8200.0, 51200).points  # a short record
    65536
    """
    before = LENGTH if math.isinf(ringing) else min(round(ringing), samples)
    before = -(-max(before, LATE + _RINGS) // GRAIN) * GRAIN
    whole = -(-(before + samples + LATE + _RINGS + _AFTER) // GRAIN)
    longest = max(_LONGEST_BELOW if stage else _LONGEST, GRAIN * fast_length(2 * before // GRAIN + 1))
    points = min(_TIMES * before, GRAIN * fast_length(whole), longest)
    return Shape(before, points - before - _AFTER, _AFTER)


@lru_cache(maxsize=256)
def fast_length(count: int) -> int:
    """The least 2^a 3^b 5^c that is not smaller: transforms of such lengths are fast."""
    while True:
        rest = count
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return count
        count += 1


class Sections:
    """Transforms of the sections of a stream.

    Its results are `after` samples late, until `rest` gives the last ones.

    Parameters
    ----------
    rows : int
        Number of channels.
    shape : Shape
    factor : ndarray, shape (rows, points / 2 + 1), optional
        Multiplies the transforms (not the thinned stream).
    filtered, thinned : bool
        Whether transforms are wanted, and the stream at one eighth of the rate.

    Attributes
    ----------
    spectrum : complex array, shape (rows, points / 2 + 1)
        Transform of the section.
    low : ndarray, shape (rows, hop / 8)
        The thinned stream, `LATE` samples behind the section's new ones.

    Examples
    --------
    >>> sections = Sections(1, Shape(2048, 7168, 1024), filtered=True)
    >>> [(length, sections.spectrum.shape) for length in sections.of(np.ones((1, 10000)))]
    [(7168, (1, 5121))]
    >>> [length for length in sections.rest()]
    [2832]
    """

    def __init__(
        self,
        rows: int,
        shape: Shape,
        factor: Complex | None = None,
        *,
        filtered: bool = False,
        thinned: bool = False,
    ) -> None:
        self.shape, self._factor = shape, factor
        self._filtered, self._thinned = filtered, thinned
        self._known = np.zeros((rows, shape.points))
        self._filled = shape.before
        self.spectrum: Complex = np.empty((0, 0), dtype=complex)
        self.low = np.empty((rows if thinned else 0, shape.hop // FACTOR))

    def lines_of(self, samples: Real) -> Complex:
        """What samples (rows, points) would add to `spectrum`."""
        lines = np.fft.rfft(samples)
        return lines if self._factor is None else lines * self._factor

    @property
    def fresh(self) -> Real:
        """The section's new samples, silence behind the last ones."""
        return self._known[:, self.shape.before : self.shape.before + self.shape.hop]

    def of(self, samples: Real) -> Iterator[int]:
        """How many new samples there are in each section that samples (rows, n) complete."""
        taken = 0
        while taken < samples.shape[1]:
            piece = samples[:, taken : taken + self.shape.points - self._filled]
            self._known[:, self._filled : self._filled + piece.shape[1]] = piece
            self._filled += piece.shape[1]
            taken += piece.shape[1]
            if self._filled == self.shape.points:
                self._transform()
                yield self.shape.hop
                self._move_on()

    def rest(self) -> Iterator[int]:
        """The same for the samples after the last complete section, with silence behind them."""
        left = self._filled + (LATE + _RINGS if self._thinned else 0) - self.shape.before
        while left > 0:
            self._known[:, self._filled :] = 0.0
            self._transform()
            yield min(self.shape.hop, left)
            self._move_on()
            left -= self.shape.hop

    def _move_on(self) -> None:
        hop = self.shape.hop
        for row in self._known:  # overlaps itself: numpy makes a copy of what it moves
            row[:-hop] = row[hop:]
        self._filled = max(self._filled - hop, 0)

    def _transform(self) -> None:
        if not (self._filtered or self._thinned):
            return
        self.spectrum = np.fft.rfft(self._known)
        if self._thinned:
            first = (self.shape.before - LATE) // FACTOR
            self.low = thinned(self.spectrum)[:, first : first + self.shape.hop // FACTOR]
        if self._factor is not None:
            self.spectrum *= self._factor
