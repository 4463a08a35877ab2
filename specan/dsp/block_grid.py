"""Consecutive blocks of any size, regrouped onto a fixed absolute grid of samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class BlockGrid:
    """Regroups what a reader delivers into blocks that begin at multiples of `size`.

    A result that is a sum over blocks depends on where these begin (in its last bits at least). With the
    grid laid down here it depends on the samples alone, not on how much of them a reader holds at once.

    Parameters
    ----------
    rows : int
        Number of channels.
    size : int
        Samples of a block.

    Examples
    --------
    >>> grid = BlockGrid(1, 4)
    >>> [block.tolist() for block in grid.add(np.arange(6.0)[None])]
    [[[0.0, 1.0, 2.0, 3.0]]]
    >>> [block.tolist() for block in grid.add(np.arange(6.0, 9.0)[None])], grid.rest().tolist()
    ([[[4.0, 5.0, 6.0, 7.0]]], [[8.0]])
    """

    def __init__(self, rows: int, size: int) -> None:
        self.size = size
        self._rest: NDArray[np.float64] = np.empty((rows, 0))

    def add(self, samples: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Take consecutive samples, shape (rows, n); return the blocks that they complete."""
        blocks, first = [], 0
        if self._rest.shape[1]:
            first = min(self.size - self._rest.shape[1], samples.shape[1])
            self._rest = np.concatenate([self._rest, samples[:, :first]], axis=1)
            if self._rest.shape[1] < self.size:
                return []
            blocks.append(self._rest)
        whole = first + (samples.shape[1] - first) // self.size * self.size
        blocks += [samples[:, begin : begin + self.size] for begin in range(first, whole, self.size)]
        self._rest = samples[:, whole:].copy()
        return blocks

    def rest(self) -> NDArray[np.float64]:
        """The samples after the last complete block, shape (rows, fewer than `size`)."""
        return self._rest
