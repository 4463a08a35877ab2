"""RMS values alone, for channels that are sampled too slowly for a band."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.dsp.block_grid import BlockGrid

_GRID = 1 << 15


class RmsPass:
    """RMS about the mean of `channels`, from samples in pieces of any length.

    Examples
    --------
    >>> channel = Channel("Temperature", unit="K", sampling_rate=1.0, n_samples=4)
    >>> rms = RmsPass((channel,))
    >>> rms.add(np.array([[299.0, 301.0, 299.0, 301.0]]))
    >>> rms.result().tolist()
    [1.0]
    """

    def __init__(self, channels: tuple[Channel, ...]) -> None:
        self.channels, self.start = channels, 0
        self.stop = min(c.n_samples for c in channels)
        self._grid = BlockGrid(len(channels), _GRID)
        self._origin: NDArray[np.float64] | None = None
        self._sum, self._squares = np.zeros(len(channels)), np.zeros(len(channels))

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples (channels, m)."""
        for block in self._grid.add(samples):
            self._take(block)

    def _take(self, block: NDArray[np.float64]) -> None:
        if not block.shape[1]:
            return
        if self._origin is None:
            self._origin = block[:, :1].copy()
        away = block - self._origin  # a large constant part would leave few digits for the rest
        self._sum += np.add.reduce(away, axis=1)
        self._squares += np.add.reduce(away * away, axis=1)

    def result(self) -> NDArray[np.float64]:
        """RMS of each channel; call it once."""
        self._take(self._grid.rest())
        n = self.stop - self.start
        return np.sqrt(np.maximum(self._squares / n - (self._sum / n) ** 2, 0.0))
