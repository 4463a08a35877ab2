"""Blocks cut into sections with what went before them: short transforms for filters that ring shortly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import LENGTH, ROWS


class Shape(NamedTuple):
    """Samples of a section: `before` to let a filter settle, `hop` new ones."""

    before: int
    hop: int


# A filter that rings for a whole block throws half of every transform away; these waste less.
SHAPES = (Shape(2048, 8192), Shape(8192, 16384))


def shape_for(samples: float) -> Shape | None:
    """The shape for a filter that rings for this many samples; None where it takes a whole block."""
    return next((shape for shape in SHAPES if samples <= shape.before), None)


class Sections:
    """Transforms of the sections of consecutive blocks of `LENGTH` samples.

    Examples
    --------
    >>> sections = Sections(1, Shape(2048, 8192))
    >>> [(length, spectrum.shape) for length, spectrum in sections.of(np.ones((1, 10000)))]
    [(8192, (1, 5121)), (1808, (1, 5121))]
    """

    def __init__(self, rows: int, shape: Shape) -> None:
        self.shape = shape
        points = shape.before + shape.hop
        self._known = np.zeros((rows, shape.before + LENGTH))
        self._spectrum = np.empty((rows, points // 2 + 1), dtype=np.complex128)

    def of(self, block: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.complex128]]]:
        """New samples and transform of each section; the next one is written over it."""
        before, hop = self.shape
        length, known = block.shape[1], self._known
        known[:, before : before + length] = block
        known[:, before + length :] = 0.0
        for start in range(0, length, hop):
            for top in range(0, known.shape[0], ROWS):
                rows = slice(top, top + ROWS)
                np.fft.rfft(known[rows, start : start + before + hop], out=self._spectrum[rows])
            yield min(hop, length - start), self._spectrum
        known[:, :before] = known[:, LENGTH:].copy()
