"""Energy spectrum of a record that is short enough to be transformed at once."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.frequency_nodes import Spread
from specan.dsp.multirate import FACTOR, LENGTH, LOWEST_PART, ROWS, Memory, Stage, low_pass, stages_of
from specan.dsp.sections import fast_length
from specan.dsp.windows import falling_step

# Thinning divides a transform.
_UNIT = 2 * FACTOR

LONGEST = 4 * LENGTH
"""Samples of a short record. Beyond, a transform of the whole no longer stays in the cache and blocks cost less."""

# The low-pass filter before thinning falls as a Gauss function of time, to 1e-17 after so many thinned samples: its
# step from 0.40 to 0.50 of the rate is erfc(6 x / 0.05), whose slope has the transform exp(-(pi t 0.05 / 6)^2).
_RINGS = 240
# What lies below these parts of the next stage's rate belongs to the next stage; a smooth cross-over between.
CROSS_OVER = (0.28, 0.38)

# Of a line's energy; the cross-over never quite reaches zero.
_NOTHING = 1e-20


@lru_cache(maxsize=8)
def _settling(fraction: int) -> int:
    """Samples of a stage after which its narrowest band has fallen by 180 dB: 10 dB in every 1 / B.

    For whole and third octaves the filter rings less long than the low-pass filter and the cross-over, which come on
    top. For finer bands it is the time of 1/24 octaves: with fewer lines, what cubic interpolation between nodes adds
    to them (1e-6 dB) would be another.
    """
    fraction, rings = (3, FACTOR * _RINGS) if fraction <= 3 else (24, 0)
    lower, upper = bands.band_edges(0, fraction)
    return (
        math.ceil(18.0 / (float(upper - lower) / float(bands.mid_frequencies(0, fraction)) * LOWEST_PART))
        + rings
    )


def share_of_lines(stage: Stage, points: int) -> NDArray[np.float64]:
    """Factor on each line of a transform of `points`: what belongs to the stage, mirrored lines, the time step."""
    over_rate = np.arange(points // 2 + 1) / points
    share = np.full(over_rate.size, 2.0)
    share[[0, -1]] = 1.0
    share *= float(FACTOR) ** stage.number / points
    if stage.number > 0:
        share *= falling_step(over_rate, *CROSS_OVER)
    if not stage.last:
        share *= 1.0 - falling_step(over_rate * FACTOR, *CROSS_OVER)
    return share


def add_energy(
    nodes: NDArray[np.float64],
    samples: NDArray[np.float64],
    sampling_rate: float,
    first: int,
    fraction: int = 24,
    factors: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Add the energy of a record to the nodes of a frequency grid, in place; return its whole energy.

    By Parseval's theorem the energy behind a filter is the sum of |X|^2 |H|^2 over the lines of a transform, if that is
    longer than the record by the time in which the filter dies out. Lower rates take the low frequencies, so that the
    time is that of the highest band which is still too narrow for the rate above.

    Parameters
    ----------
    nodes : ndarray, shape (channels, nodes)
        See `specan.dsp.frequency_nodes`; written to.
    samples : ndarray, shape (channels, n)
        Not more than `LONGEST`.
    sampling_rate : float
        In Hz.
    first : int
        Number of the first node.
    fraction : int
        Bandwidth designator of the narrowest bands that will be read from the nodes.
    factors : ndarray, shape (n,), optional
        The samples are multiplied with these.

    Returns
    -------
    ndarray, shape (channels,)
        Sum of the squared samples, from the transform.
    """
    energy = np.empty(samples.shape[0])
    for top in range(0, samples.shape[0], ROWS):
        rows, stream = slice(top, top + ROWS), samples[top : top + ROWS]
        for stage in stages_of(sampling_rate):
            count = stream.shape[1]
            points = _UNIT * fast_length(-(-(count + _settling(fraction)) // _UNIT))
            padded = _memory.take("padded", len(stream), points, _REAL)
            if factors is None or stage.number > 0:
                padded[:, :count] = stream
            else:
                np.multiply(stream, factors, out=padded[:, :count])
            padded[:, count:] = 0.0
            transform = np.fft.rfft(
                padded, out=_memory.take("transform", len(stream), points // 2 + 1, _COMPLEX)
            )
            lines = _memory.take("lines", len(stream), points // 2 + 1, _REAL)
            np.multiply(transform.real, transform.real, out=lines)
            lines += np.multiply(transform.imag, transform.imag, out=padded[:, : points // 2 + 1])
            if stage.number == 0:
                inner = 2.0 * np.add.reduce(lines[:, 1:-1], axis=1)
                energy[rows] = (inner + lines[:, 0] + lines[:, -1]) / points
            _spread(stage, points, first).add(nodes[rows], lines)
            if not stage.last:
                stream = _thinned(transform, count)
    return energy


_REAL, _COMPLEX = np.dtype(np.float64), np.dtype(np.complex128)
_memory = Memory()


def _thinned(transform: NDArray[np.complex128], count: int) -> NDArray[np.float64]:
    """One eighth of the rate, with what the low-pass filter rings before and after the `count` samples."""
    low = (transform.shape[1] - 1) // FACTOR
    filtered = np.fft.irfft(transform[:, : low + 1] * low_pass(low), 2 * low)
    # The transform is circular: what rings ahead is at the end.
    return np.concatenate([filtered[:, -_RINGS:], filtered[:, : -(-count // FACTOR) + _RINGS]], axis=1)


@lru_cache(maxsize=16)
def _spread(stage: Stage, points: int, first: int) -> Spread:
    share = share_of_lines(stage, points)
    share[share < _NOTHING * share.max()] = 0.0
    return Spread(first, share, stage.rate / points)
