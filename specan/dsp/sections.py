"""A stream cut into sections with what goes before and after them: short transforms for filters that ring shortly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import LENGTH, ROWS


class Shape(NamedTuple):
    """Samples of a section: `before` to let a filter settle, `hop` new ones, `after` for what rings ahead.

    A transform is circular: the step from the end of a section to its beginning is met by every filter that is
    not causal, and a band filter whose response is cut off below half a sampling rate is not.
    """

    before: int
    hop: int
    after: int


# A filter that rings for a whole block throws half of every transform away; these waste less.
SHAPES = (Shape(2048, 7680, 512), Shape(8192, 15360, 1024))


def shape_for(samples: float) -> Shape | None:
    """The shape for a filter that rings for this many samples; None where it takes a whole block."""
    return next((shape for shape in SHAPES if samples <= shape.before), None)


class Sections:
    """Transforms of the sections of a stream that comes in blocks of `LENGTH` samples.

    Its results are `after` samples late, until `rest` gives the last ones.

    Examples
    --------
    >>> sections = Sections(1, Shape(2048, 7680, 512))
    >>> [(length, spectrum.shape) for length, spectrum in sections.of(np.ones((1, 10000)))]
    [(7680, (1, 5121))]
    >>> [length for length, spectrum in sections.rest()]
    [2320]
    """

    def __init__(self, rows: int, shape: Shape) -> None:
        self.shape = shape
        self._points = sum(shape)
        self._known = np.zeros((rows, shape.before + LENGTH + self._points))
        self._filled = shape.before
        self._spectrum = np.empty((rows, self._points // 2 + 1), dtype=np.complex128)

    def of(self, block: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.complex128]]]:
        """New samples and transform of each section; the next one is written over it.

        The new samples stand behind `before` others.
        """
        known, start = self._known, 0
        known[:, self._filled : self._filled + block.shape[1]] = block
        self._filled += block.shape[1]
        while start + self._points <= self._filled:
            yield self.shape.hop, self._transform(start)
            start += self.shape.hop
        self._filled -= start
        known[:, : self._filled] = known[:, start : start + self._filled].copy()

    def rest(self) -> Iterator[tuple[int, NDArray[np.complex128]]]:
        """The same for the samples after the last complete section, with silence behind them."""
        self._known[:, self._filled :] = 0.0
        left = self._filled - self.shape.before
        for start in range(0, left, self.shape.hop):
            yield min(self.shape.hop, left - start), self._transform(start)

    def _transform(self, start: int) -> NDArray[np.complex128]:
        for top in range(0, self._known.shape[0], ROWS):
            rows = slice(top, top + ROWS)
            np.fft.rfft(self._known[rows, start : start + self._points], out=self._spectrum[rows])
        return self._spectrum
