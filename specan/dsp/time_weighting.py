"""Exponential time weightings: Fast, Slow, Impulse, or any time constant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FAST, SLOW = 0.125, 1.0
"""Time constants in s; IEC 61672-1:2013, 5.8."""

IMPULSE, IMPULSE_DECAY = 0.035, 1.5
"""Time constants in s of the average and of the peak holder behind it; IEC 60651, 7.2 (ANSI S1.4-1983, 6.2)."""

# A piece that is summed up at once: at most this many time constants, so that the powers do not overflow, and so
# many samples, which stay in the cache.
_GROWTH, _LONGEST_PIECE = 200.0, 2048


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
        # y(i) = keep y(i - 1) + (1 - keep) x(i), as a sum of positive terms: keep^i [keep y(-1) + (1 - keep) sum of
        # x(j) keep^-j], which loses nothing to rounding.
        length = min(max(1, int(_GROWTH * sampling_rate * time_constant)), _LONGEST_PIECE)
        self._rise = np.power(self._keep, -np.arange(float(length)))
        # keep y(-1) of the next piece.
        self._state = np.zeros((rows, 1))
        self._fall = 0.0 if decay is None else 1.0 / (sampling_rate * decay)
        self._peak = np.zeros((rows, 1))

    def __call__(self, squared: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weighted mean square at every sample; `squared` has the shape (rows, n)."""
        average = np.empty(squared.shape)
        for start in range(0, squared.shape[1], self._rise.size):
            piece = squared[:, start : start + self._rise.size]
            rise = self._rise[: piece.shape[1]]
            sums = np.cumsum(
                piece * ((1.0 - self._keep) * rise), axis=1, out=average[:, start : start + rise.size]
            )
            sums += self._state
            sums /= rise
            self._state = self._keep * sums[:, -1:]
        # A mean square may be negative by its rounding.
        np.maximum(average, 0.0, out=average)
        return self._hold(average) if self._fall else average

    def without(
        self, earlier: NDArray[np.float64], weighted: NDArray[np.float64], later: int, forgotten: float
    ) -> NDArray[np.float64]:
        """What would have been found, had the signal begun later.

        Parameters
        ----------
        earlier : ndarray, shape (rows, 1)
            The average just before that.
        weighted : ndarray, shape (rows, n)
            Averages from `later` samples after the beginning on (not those of a peak detector).
        forgotten : float
            Where less than this part of `earlier` is left it is not looked for.
        """
        keep = self._keep ** (later + 1.0)
        if keep < forgotten or not earlier.any():
            return weighted
        left = earlier * keep * self._keep ** np.arange(weighted.shape[1])
        return np.maximum(weighted - left, 0.0)

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
