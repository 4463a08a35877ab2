"""A logarithmic frequency grid on which an energy spectrum can be weighted with any smooth response."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.dsp.bands import OCTAVE_RATIO, REFERENCE_FREQUENCY

NODES_PER_OCTAVE = 1536
"""64 to a 1/24 octave: cubic interpolation of |H|^2 between them is good to 0.0005 dB on the steepest skirt."""

LOWEST_NODE = 0.1
"""In Hz; what lies below is in no band and behind no weighting."""


def node_range(sampling_rate: float) -> tuple[int, int]:
    """Number of the first node, and how many there are up to half the sampling rate.

    Node j lies at 1000 Hz x G^(j / 1536).
    """
    first = math.floor(_place(LOWEST_NODE)) - 2
    last = math.ceil(_place(sampling_rate / 2.0)) + 2
    return first, max(last - first + 1, 0)


def node_frequencies(first: int, count: int) -> NDArray[np.float64]:
    """Frequencies in Hz of `count` nodes from `first` on."""
    return REFERENCE_FREQUENCY * OCTAVE_RATIO ** ((first + np.arange(count)) / NODES_PER_OCTAVE)


def node_of_band(index: NDArray[np.int64], fraction: int) -> NDArray[np.int64]:
    """Number of the node at each band's exact mid-frequency (every one has a node)."""
    step = NODES_PER_OCTAVE // fraction
    return index * step + (0 if fraction % 2 else step // 2)


def spread(
    nodes: NDArray[np.float64],
    first: int,
    energy: NDArray[np.float64],
    share: NDArray[np.float64],
    spacing: float,
) -> None:
    """Add lines of an energy spectrum to the nodes, in place.

    Each line goes to the four nodes around it with the factors of cubic interpolation: the transpose of
    interpolating a response from the nodes to the lines, so that sums over nodes are sums over lines.

    Parameters
    ----------
    nodes : ndarray, shape (channels, nodes)
    first : int
        Number of the first node.
    energy : ndarray, shape (channels, lines)
    share : ndarray, shape (lines,)
        Factor on each line; the lines with a factor are contiguous.
    spacing : float
        Distance of the lines in Hz; the first lies at 0 Hz.
    """
    used = np.flatnonzero((share > 0.0) & (np.arange(share.size) * spacing >= LOWEST_NODE))
    if not used.size:
        return
    low, high = int(used[0]), int(used[-1]) + 1
    starts, node, factors = _neighbours(low, high, spacing)
    for tap in range(4):
        sums = np.add.reduceat(energy[:, low:high] * (factors[tap] * share[low:high]), starts, axis=1)
        nodes[:, node + (tap - 1 - first)] += sums


@lru_cache(maxsize=16)
def _neighbours(
    low: int, high: int, spacing: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Where lines with the same neighbours begin, their second neighbour, and four factors for each line."""
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
    starts = np.flatnonzero(np.diff(node, prepend=node[0] - 1))
    return starts, node[starts], factors


def _place(frequency: ArrayLike) -> NDArray[np.float64]:
    """Place of a frequency on the grid, in nodes from 1 kHz."""
    return np.asarray(
        NODES_PER_OCTAVE * np.log(np.asarray(frequency) / REFERENCE_FREQUENCY) / math.log(OCTAVE_RATIO)
    )
