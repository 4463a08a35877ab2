"""A logarithmic frequency grid on which an energy spectrum can be weighted with any smooth response."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.dsp.bands import OCTAVE_RATIO, REFERENCE_FREQUENCY
from specan.dsp.weighting import Weighting, power_weighting

NODES_PER_OCTAVE = 1536
"""64 to a 1/24 octave: cubic interpolation of |H|^2 between them is good to 0.0005 dB on the steepest skirt."""

# Of a place, as computed.
_ROUNDING = 1e-6

LOWEST_NODE = 0.1
"""In Hz; what lies below is in no band and behind no weighting."""


def node_range(sampling_rate: float) -> tuple[int, int]:
    """Number of the first node, and how many there are up to half the sampling rate.

    Node j lies at 1000 Hz x G^(j / 1536).
    """
    first = math.floor(_place(LOWEST_NODE)) - 2
    last = math.ceil(_place(sampling_rate / 2.0)) + 2
    return first, max(last - first + 1, 0)


@lru_cache(maxsize=8)
def node_frequencies(first: int, count: int) -> NDArray[np.float64]:
    """Frequencies in Hz of `count` nodes from `first` on; kept for all who ask, not to be written to."""
    found = REFERENCE_FREQUENCY * OCTAVE_RATIO ** ((first + np.arange(count)) / NODES_PER_OCTAVE)
    found.flags.writeable = False
    return np.asarray(found)


@lru_cache(maxsize=16)
def node_weights(first: int, count: int, weighting: Weighting) -> NDArray[np.float64]:
    """A frequency weighting of mean squares at these nodes; likewise kept."""
    found = power_weighting(node_frequencies(first, count), weighting)
    found.flags.writeable = False
    return found


def nearest_nodes(frequency: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Numbers of the nodes nearest to frequencies, and how far beyond these they lie: 0 for octaves."""
    place = _place(frequency)
    nodes = np.rint(place)
    beyond = place - nodes
    return nodes.astype(np.int64), np.where(np.abs(beyond) < _ROUNDING, 0.0, beyond)


class Spread:
    """How the lines of an energy spectrum fall to the nodes.

    Each line goes to the four nodes around it with the factors of cubic interpolation: the transpose of
    interpolating a response from the nodes to the lines, so that sums over nodes are sums over lines.

    Parameters
    ----------
    first : int
        Number of the first node.
    share : ndarray, shape (lines,)
        Factor on each line; the lines with a factor are contiguous.
    spacing : float
        Distance of the lines in Hz; the first lies at 0 Hz.
    """

    def __init__(self, first: int, share: NDArray[np.float64], spacing: float) -> None:
        used = np.flatnonzero((share > 0.0) & (np.arange(share.size) * spacing >= LOWEST_NODE))
        self._lines = slice(int(used[0]), int(used[-1]) + 1) if used.size else None
        if self._lines is None:
            return
        node, factors = _neighbours(self._lines.start, self._lines.stop, spacing)
        self._factors = factors * share[self._lines]
        self._node, self._first = node - node[0], int(node[0]) - first
        self._count = int(self._node[-1]) + 1

    def add(self, nodes: NDArray[np.float64], energy: NDArray[np.float64]) -> None:
        """Add lines, shape (channels, lines), to the nodes, shape (channels, nodes), in place."""
        if self._lines is None:
            return
        # One row at a time, in memory that is used again: it stays in the cache.
        shared = np.empty(self._node.size)
        for row, lines in zip(nodes, energy[:, self._lines], strict=True):
            for first, factor in enumerate(self._factors, self._first - 1):
                np.multiply(lines, factor, out=shared)
                row[first : first + self._count] += np.bincount(self._node, shared, self._count)


def _neighbours(low: int, high: int, spacing: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The second of the four neighbours of each line, and the factors of all four."""
    place = _place(np.arange(low, high) * spacing)
    node = np.floor(place).astype(np.int64)
    s = place - node
    factors = np.stack(
        [
            -s * (s - 1.0) * (s - 2.0) / 6.0,
            (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0,
            (s + 1.0) * s * (s - 1.0) / 6.0,
        ]
    )
    return node, factors


def _place(frequency: ArrayLike) -> NDArray[np.float64]:
    """Place of a frequency on the grid, in nodes from 1 kHz."""
    return np.asarray(
        NODES_PER_OCTAVE * np.log(np.asarray(frequency) / REFERENCE_FREQUENCY) / math.log(OCTAVE_RATIO)
    )
