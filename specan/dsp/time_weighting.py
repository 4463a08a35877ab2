"""Exponential time weightings: Fast, Slow, Impulse, or any time constant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FAST, SLOW = 0.125, 1.0
"""Time constants in s; IEC 61672-1:2013, 5.8."""

IMPULSE, IMPULSE_DECAY = 0.035, 1.5
"""Time constants in s of the average and of the peak holder behind it; IEC 60651, 7.2 (ANSI S1.4-1983, 6.2)."""

# Samples of a block, which a product of matrices weights, and blocks in a product: OpenBLAS computes products of up to
# 9216 and 262144 multiplications (vector, matrix) in one thread; more threads cost more than they bring here.
_BLOCK, _AT_ONCE = 16, 512
# Blocks that are summed up at once make at most this many time constants, so that the powers do not overflow.
_GROWTH = 200.0


class TimeWeighting:
    """Running exponential average of a squared signal, whatever the pieces in which it comes.

    y(t) = 1/tau  integral of x(s)^2 exp(-(t - s)/tau) ds over s < t: IEC 61672-1:2013, formula (1),
    with the squared samples held constant over a sampling interval. With `decay`, a peak detector
    follows, which rises at once and falls with exp(-t/decay): 2.9 dB/s for 1.5 s.

    Parameters
    ----------
    rows : int
        Number of signals.
    sampling_rate : float
        In Hz.
    time_constant : float
        tau in s.
    decay : float, optional
        Time constant of the peak detector in s; without it there is none.

    Examples
    --------
    >>> fast = TimeWeighting(1, 1000.0, FAST)
    >>> float(fast(np.ones((1, 125)))[0, -1].round(4)), round(1 - math.exp(-1), 4)
    (0.6321, 0.6321)
    """

    def __init__(
        self, rows: int, sampling_rate: float, time_constant: float, decay: float | None = None
    ) -> None:
        self._keep = math.exp(-1.0 / (sampling_rate * time_constant))
        # y(i) = keep y(i - 1) + (1 - keep) x(i), a block at a time: its values are a matrix of powers of `keep` times
        # its samples and the y before it. Those y follow from one another in the same way, from block to block, as a
        # sum of positive terms: keep^i [y(-1) + sum of x(j) keep^-j], which loses nothing to rounding.
        later = np.arange(_BLOCK) - np.arange(_BLOCK)[:, None]
        self._within = np.zeros((_BLOCK + 1, _BLOCK))
        self._within[:-1] = np.where(later < 0, 0.0, (1.0 - self._keep) * self._keep ** np.maximum(later, 0))
        self._within[-1] = self._keep ** np.arange(1.0, _BLOCK + 1)
        over = self._keep**_BLOCK
        length = min(max(1, int(_GROWTH * sampling_rate * time_constant / _BLOCK)), _AT_ONCE)
        self._rise = np.power(over, -np.arange(float(length))) if over else np.ones(1)
        self._over = over
        # y before the next sample.
        self._state = np.zeros((rows, 1))
        self._fall = 0.0 if decay is None else 1.0 / (sampling_rate * decay)
        self._peak = np.zeros((rows, 1))

    def __call__(
        self,
        squared: NDArray[np.float64] | NDArray[np.float32],
        factor: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Weighted mean square at every sample; `squared` has the shape (rows, n), `factor` multiplies its rows."""
        factors = np.ones(squared.shape[0]) if factor is None else factor
        average = self._average(squared, factors)
        if not np.isfinite(average[:, -1:]).all():  # a product of matrices spreads it over its whole block
            lost = np.logical_or.accumulate(~np.isfinite(squared), axis=1)
            average = np.where(lost, np.nan, self._average(np.where(lost, 0.0, squared), factors))
        if squared.shape[1]:
            self._state = average[:, -1:].copy()
        return self._hold(average) if self._fall else average

    def _average(
        self, squared: NDArray[np.float64] | NDArray[np.float32], factors: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        rows, n = squared.shape
        average, state = np.empty((rows, -(-n // _BLOCK), _BLOCK)), self._state
        for start in range(0, average.shape[1], _AT_ONCE):
            blocks = average[:, start : start + _AT_ONCE]
            mine = squared[:, start * _BLOCK : (start + _AT_ONCE) * _BLOCK]
            known, whole = np.empty((*blocks.shape[:2], _BLOCK + 1)), mine.shape[1] // _BLOCK
            known[:, whole:] = 0.0
            pieces = mine[:, : whole * _BLOCK].reshape(rows, whole, _BLOCK)
            np.multiply(pieces, factors[:, None, None], out=known[:, :whole, :-1])
            known[:, whole:, : mine.shape[1] % _BLOCK] = (mine[:, whole * _BLOCK :] * factors[:, None])[
                :, None
            ]
            known[:, :, -1] = self._before(np.matmul(known[:, :, :-1], self._within[:-1, -1]), state)
            state = np.matmul(known, self._within, out=blocks)[:, -1, -1:]
        return average.reshape(rows, -1)[:, :n]

    def _before(self, ends: NDArray[np.float64], state: NDArray[np.float64]) -> NDArray[np.float64]:
        """The weighted mean square before each block, from what the blocks alone leave at their ends."""
        before = np.empty(ends.shape)
        for start in range(0, ends.shape[1], self._rise.size):
            piece = ends[:, start : start + self._rise.size]
            rise = self._rise[: piece.shape[1]]
            sums = np.cumsum(piece * rise, axis=1)
            sums += self._over * state
            sums /= rise
            before[:, start : start + 1] = state
            before[:, start + 1 : start + rise.size] = sums[:, :-1]
            state = sums[:, -1:]
        return before

    def _hold(self, average: NDArray[np.float64]) -> NDArray[np.float64]:
        """The largest of all earlier values, each with its decay: a running maximum of the logarithms."""
        fallen = self._fall * np.arange(1, average.shape[1] + 1)
        with np.errstate(divide="ignore"):
            rising = np.log(np.concatenate([self._peak, average], axis=1))
        rising[:, 1:] += fallen
        np.maximum.accumulate(rising, axis=1, out=rising)
        held = np.exp(rising[:, 1:] - fallen)
        self._peak = held[:, -1:]
        return np.asarray(held)
