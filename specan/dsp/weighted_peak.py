"""Largest magnitude of a frequency-weighted signal, between samples as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.dsp.history_filters import weighting_filter
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.weighting import Weighting

Real = NDArray[np.float64]

# Samples this far below the largest so far may have the largest value beside them: at a fifth of the sampling rate,
# the nearest sample of a sine is at least cos(36 degrees) = 0.81 of its peak.
_NEAR = 0.8


class WeightedPeak:
    """Peak of |p_C(t)| and the like (IEC 61672-1:2013, 3.11), of signals (channels, m) that come in pieces.

    Between samples, a parabola goes through the largest sample and its neighbours.

    Parameters
    ----------
    channels : int
    rate : float
        Sampling rate in Hz.
    weighting : {"A", "B", "C"}

    Examples
    --------
    >>> t = np.arange(48000) / 48000
    >>> peak = WeightedPeak(1, 48000.0, "C")
    >>> peak.add((np.sin(2 * np.pi * 1000 * t) * np.minimum(1, 100 * t))[None])
    >>> peak.result().round(3).tolist()
    [1.0]
    """

    def __init__(self, channels: int, rate: float, weighting: Weighting) -> None:
        chosen = weighting_filter(weighting)
        assert chosen.sampled is not None  # Z needs no filter
        self._ring = int(np.ceil(chosen.ringing * rate))
        self._block = 1 << int(np.ceil(np.log2(4 * self._ring)))
        self._response = chosen.sampled(rate, self._block // 2 + 1)
        self._blocks = OverlappedBlocks(self._block, self._block - self._ring)
        self._peak = np.zeros(channels)
        self._last = np.zeros((channels, 2))  # samples of the block before, beside which a peak may lie
        self._open = 0  # samples since the last whole block
        self.add(np.zeros((channels, self._ring)))

    def add(self, samples: Real) -> None:
        """Take the next samples."""
        self._open += samples.shape[1]
        for block in self._blocks.feed(samples):
            self._look(block, self._block)
            self._open -= self._block - self._ring

    def result(self) -> Real:
        """Peak of each channel; call it once."""
        rest = self._open
        if rest > self._ring:
            channels = self._peak.size
            for block in self._blocks.feed(np.zeros((channels, self._block - rest))):
                self._look(block, rest)
        return self._peak

    def _look(self, block: Real, valid: int) -> None:
        found = np.fft.irfft(np.fft.rfft(block, axis=-1) * self._response, self._block, axis=-1)
        y = np.abs(np.concatenate([self._last, found[:, self._ring : valid]], axis=1))
        self._last = found[:, valid - 2 : valid]
        with np.errstate(invalid="ignore"):  # a channel may hold NaN
            self._peak = np.maximum(self._peak, y.max(axis=1))
            for row in range(y.shape[0]):
                before, here, after = y[row, :-2], y[row, 1:-1], y[row, 2:]
                high = (here >= _NEAR * self._peak[row]) & (here >= before) & (here > after)
                a, b, c = before[high], here[high], after[high]
                tops = b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c))
                if tops.size:
                    self._peak[row] = max(self._peak[row], float(tops.max()))
