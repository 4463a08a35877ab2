"""Exponential time weightings: Fast, Slow, Impulse, or any time constant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FAST, SLOW = 0.125, 1.0
"""Time constants in s; IEC 61672-1:2013, 5.8."""

IMPULSE, IMPULSE_DECAY = 0.035, 1.5
"""Time constants in s of the average and of the peak holder behind it; IEC 60651, 7.2 (ANSI S1.4-1983, 6.2)."""


# Samples that are summed up at once: as many time constants at most, and as the cache holds.
_GROWTH, _AT_ONCE = 200.0, 1 << 12


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
        # y(i) = keep y(i - 1) + (1 - keep) x(i) = keep^i [keep y(-1) + (1 - keep) sum of x(j) keep^-j, j <= i]: a sum
        # of positive terms, which loses nothing to rounding, over so few samples that the powers do not overflow.
        self._keep = math.exp(-1.0 / (sampling_rate * time_constant))
        together = min(max(1, int(_GROWTH * sampling_rate * time_constant)), _AT_ONCE)
        self._rise = self._keep ** -np.arange(float(together)) if together > 1 else np.ones(1)
        self._state = np.zeros((rows, 1))
        self._fall = 0.0 if decay is None else 1.0 / (sampling_rate * decay)
        self._peak = np.zeros((rows, 1))

    def __call__(
        self,
        squared: NDArray[np.float64] | NDArray[np.float32],
        factor: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Weighted mean square at every sample; `squared` has the shape (rows, n), `factor` multiplies its rows."""
        given = squared.astype(np.float64)
        if factor is not None:
            given *= factor[:, None]
        for first in range(0, given.shape[1], self._rise.size):
            piece = given[:, first : first + self._rise.size]
            rise = self._rise[: piece.shape[1]]
            piece *= (1.0 - self._keep) * rise
            np.cumsum(piece, axis=1, out=piece)
            piece += self._keep * self._state
            piece /= rise
            self._state = piece[:, -1:].copy()
        return self._hold(given) if self._fall else given

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
