"""Exponential time weightings: Fast, Slow, Impulse, or any time constant."""

from __future__ import annotations

import math
from typing import Any

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
# What is so small beside a number does not change it.
_NOTHING = 2.0**-54


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

    def sparse(
        self,
        squared: NDArray[np.float64] | NDArray[np.float32],
        factor: NDArray[np.float64] | None = None,
    ) -> SparseAverages:
        """The same as a call, without the peak detector, for those who look at few of the values."""
        rows, n = squared.shape
        whole, rest = divmod(n, _BLOCK)
        factors = np.ones(rows) if factor is None else factor
        weights: NDArray[Any] = self._within[:-1, -1].astype(squared.dtype)
        ends = np.zeros((rows, whole + 1))
        with np.errstate(invalid="ignore", over="ignore"):
            np.matmul(squared[:, : whole * _BLOCK].reshape(rows, whole, _BLOCK), weights, out=ends[:, :whole])
            ends[:, whole] = np.add.reduce(squared[:, whole * _BLOCK :] * weights[_BLOCK - rest :], axis=1)
            ends *= factors[:, None]
            before = self._before(ends, self._state)
            self._state = self._keep**rest * before[:, -1:] + ends[:, -1:]
        return SparseAverages(self._keep, squared, factors, ends, before)

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


class SparseAverages:
    """Running averages of which few are looked at: those before each block are known, the others are found on demand.

    What is not finite makes all that follows NaN.

    Parameters
    ----------
    keep : float
        y(i) = keep y(i - 1) + (1 - keep) factor x(i).
    squared : ndarray, shape (rows, n)
        x.
    factors : ndarray, shape (rows,)
    ends, before : ndarray, shape (rows, blocks)
        What each block alone leaves at its end, and y before it.
    """

    def __init__(
        self,
        keep: float,
        squared: NDArray[np.float64] | NDArray[np.float32],
        factors: NDArray[np.float64],
        ends: NDArray[np.float64],
        before: NDArray[np.float64],
    ) -> None:
        self._keep, self._squared, self._factors = keep, squared, factors
        self._ends, self._before = ends, before

    def at(self, places: NDArray[np.intp]) -> NDArray[np.float64]:
        """Averages at these places, shape (rows, places); -1 is the one before the first."""
        blocks, inside = np.divmod(places + 1, _BLOCK)
        # The weights of a block's first intervals, as many as `inside`.
        ago = inside[:, None] - 1 - np.arange(_BLOCK)
        weights = np.where(ago < 0, 0.0, (1.0 - self._keep) * self._keep ** np.maximum(ago, 0))
        within = np.minimum(blocks[:, None] * _BLOCK + np.arange(_BLOCK), self._squared.shape[1] - 1)
        squares = np.take(self._squared, within, axis=1)
        squares[:, ago < 0] = 0.0
        found = self._keep**inside * self._before[:, blocks]
        found += np.einsum("ijk,jk->ij", squares, weights) * self._factors[:, None]
        return np.where(np.isfinite(found), found, np.nan)

    def pairs(self, places: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Averages at these places, and those one place later."""
        found, after = self.at(places), np.minimum(places + 1, self._squared.shape[1] - 1)
        fresh = np.take(self._squared, after, axis=1) * ((1.0 - self._keep) * self._factors[:, None])
        return found, self._keep * found + fresh

    def largest(
        self, span: slice, least: NDArray[np.float64], earlier: NDArray[np.float64], later: float
    ) -> NDArray[np.float64]:
        """The largest average of each row in a span, or `least`, had the signal begun at or before the span.

        `earlier`, shape (rows, 1), is the average before that; what precedes place 0 comes so many places `later`.
        """
        before = self._before
        with np.errstate(invalid="ignore"):
            left = np.max(earlier * self._keep ** (later + span.start))
            if not left < _NOTHING * np.min(least):
                begins = np.maximum(np.arange(before.shape[1]), span.start // _BLOCK) * _BLOCK
                before = before - earlier * self._keep ** (later + begins)
            # Nothing is larger than if all of the block came with its first interval.
            return self._searched(span, before, self._keep ** (_BLOCK - 1), least, np.fmax)

    def smallest(self, span: slice, most: NDArray[np.float64]) -> NDArray[np.float64]:
        """The smallest average of each row in a span, or `most`."""
        # Nothing is smaller than if all of the block came after its last interval.
        with np.errstate(invalid="ignore"):
            return self._searched(span, self._before, self._keep**-_BLOCK, most, np.fmin)

    def _searched(
        self,
        span: slice,
        before: NDArray[np.float64],
        reach: float,
        best: NDArray[np.float64],
        better: np.ufunc,
    ) -> NDArray[np.float64]:
        """Look into the blocks that may hold something better than what blocks end with.

        A block may if what it ends with (for the largest) or begins with (for the smallest) is better than `reach`
        times the best.
        """
        first, last = span.start // _BLOCK, -(-span.stop // _BLOCK)
        sought = np.ones((before.shape[0], last - first), dtype=np.bool_)
        whole = slice(-(-span.start // _BLOCK), span.stop // _BLOCK)
        if whole.stop > whole.start:
            ended = before[
                :, whole.start + 1 : whole.stop + 1
            ]  # a block ends with what is before the next one
            finite = np.isfinite(ended[:, -1])  # what is not finite stays so
            if finite.all():
                plain, seen = (np.maximum, ended) if better is np.fmax else (np.minimum, before[:, whole])
                best = better(best, plain.reduce(ended, axis=1))
                compare = np.greater if better is np.fmax else np.less
                mine = sought[:, whole.start - first : whole.stop - first]
                compare(seen, reach * best[:, None], out=mine)
        rows, blocks = np.divmod(np.flatnonzero(sought), sought.shape[1])
        blocks += first
        values = self._inside(rows, blocks, before[rows, blocks])
        for block in {end // _BLOCK for end in (span.start, span.stop) if end % _BLOCK}:
            places = block * _BLOCK + np.arange(_BLOCK)[:, None]
            some = np.flatnonzero(blocks == block)
            inside = (places >= span.start) & (places < span.stop)
            values[:, some] = np.where(inside, values[:, some], np.nan)
        best, mine = best.copy(), values[0]
        for value in values[1:]:  # faster than to reduce along a first axis
            better(mine, value, out=mine)
        better.at(best, rows, mine)
        return best

    def _inside(
        self, rows: NDArray[np.intp], blocks: NDArray[np.intp], known: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """All averages of some blocks, shape (intervals, blocks), from those before them."""
        whole = self._squared.shape[1] // _BLOCK
        pieces = np.zeros((blocks.size, _BLOCK), dtype=self._squared.dtype)
        full = blocks < whole
        of_rows = self._squared[:, : whole * _BLOCK].reshape(self._factors.size, whole, _BLOCK)
        if full.all():
            pieces = of_rows[rows, blocks]
        else:
            pieces[full] = of_rows[rows[full], blocks[full]]
            pieces[~full, : self._squared.shape[1] % _BLOCK] = self._squared[rows[~full], whole * _BLOCK :]
        values = pieces.T * ((1.0 - self._keep) * self._factors[rows])
        for value in values:
            value += self._keep * known
            known = value
        if not np.isfinite(known).all():
            values[~np.isfinite(values)] = np.nan
        return values
