"""A stream cut into sections with what goes before and after them: short transforms for filters that ring shortly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import ROWS


class Shape(NamedTuple):
    """Samples of a section: `before` to let a filter settle, `hop` new ones, `after` for what rings ahead.

    A transform is circular: the step from the end of a section to its beginning is met by every filter that is
    not causal, and a band filter whose response is cut off below half a sampling rate is not.
    """

    before: int
    hop: int
    after: int


# A filter that rings for a whole block throws half of every transform away; these waste less. The third holds A, B and
# C at 51.2 kHz.
SHAPES = (Shape(2048, 7680, 512), Shape(8192, 15360, 1024), Shape(8448, 31488, 1024))


def shape_for(samples: float) -> Shape | None:
    """The shape for a filter that rings for this many samples; None where it takes a whole block."""
    return next((shape for shape in SHAPES if samples <= shape.before), None)


class Sections:
    """Transforms of the sections of a stream that comes in blocks of `LENGTH` samples.

    Its results are `after` samples late, until `rest` gives the last ones. Several may write to one `spectrum`, if the
    transform of one has been used before another is asked for.

    Examples
    --------
    >>> sections = Sections(1, Shape(2048, 7680, 512))
    >>> [(length, spectrum.shape) for length, spectrum in sections.of(np.ones((1, 10000)))]
    [(7680, (1, 5121))]
    >>> [length for length, spectrum in sections.rest()]
    [2320]
    """

    def __init__(self, rows: int, shape: Shape, spectrum: NDArray[np.complex128] | None = None) -> None:
        self.shape = shape
        self._points = sum(shape)
        self._known = np.zeros((rows, self._points))
        self._filled = shape.before
        lines = self._points // 2 + 1
        self.spectrum = np.empty((rows, lines), dtype=np.complex128) if spectrum is None else spectrum

    def of(self, block: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.complex128]]]:
        """New samples and transform of each section; the next one is written over it.

        The new samples are behind `before` others.
        """
        known, hop, taken = self._known, self.shape.hop, 0
        while taken < block.shape[1]:
            piece = block[:, taken : taken + self._points - self._filled]
            known[:, self._filled : self._filled + piece.shape[1]] = piece
            self._filled += piece.shape[1]
            taken += piece.shape[1]
            if self._filled == self._points:
                yield hop, self._transform()
                self._move_on()

    def rest(self) -> Iterator[tuple[int, NDArray[np.complex128]]]:
        """The same for the samples after the last complete section, with silence behind them."""
        while self._filled > self.shape.before:
            self._known[:, self._filled :] = 0.0
            yield min(self.shape.hop, self._filled - self.shape.before), self._transform()
            self._move_on()

    def _move_on(self) -> None:
        known, hop = self._known, self.shape.hop
        for row in known:  # overlaps itself: numpy makes a copy of what it moves
            row[:-hop] = row[hop:]
        self._filled = max(self._filled - hop, 0)

    def _transform(self) -> NDArray[np.complex128]:
        for top in range(0, self._known.shape[0], ROWS):
            rows = slice(top, top + ROWS)
            np.fft.rfft(self._known[rows], out=self.spectrum[rows])
        return self.spectrum
