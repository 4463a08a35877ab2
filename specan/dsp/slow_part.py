"""The constant part of a record and what drifts at its ends: what no level is taken of, or only in part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

# At an end a drift is (a + b t + c t^2 + d t^3) exp(-t^2 / 2 s^2): there is nothing of it above 1 / s. With s of 0.1 s
# it meets an oscillation of 0.5 Hz to 0.001 of itself; s is longer where oscillations from 1 / s on are analysed, which
# must stay. A record has so many s at least: in a shorter one a drift cannot be told from these.
_SPREAD, _SPREADS, _TERMS = 0.1, 10.0, 4
# It is over after so many s: 1e-6 of the last term are left.
_SEEN = 6.0
# In Hz. Above, the ends alone would take more memory than all the rest of an analysis.
_HIGHEST_RATE = 1e6


@dataclass(frozen=True)
class SlowPart:
    """A constant part, and a drift at either end that makes the record begin and end smoothly.

    Attributes
    ----------
    constant : ndarray, shape (channels,)
        Mean of the samples.
    beginning, end : ndarray, shape (channels, m)
        What the first and the last samples drift, about the mean.
    n_samples : int
        Length of the record.
    total, square : ndarray, shape (channels,)
        What the drift has in the sum of all samples about the mean, and in that of their squares.

    Examples
    --------
    >>> drift = np.cos(np.arange(40000) / 40000)[None]
    >>> slow = SlowPart.of(np.zeros(1), drift[:, :4000], drift[:, -4000:], 40000, drift_spread(40000, 8000.0, 20.0))
    >>> float(np.abs(drift[:, :10] - slow.drift(0, 10)).max().round(3))
    0.0
    """

    constant: Real
    beginning: Real
    end: Real
    n_samples: int
    total: Real
    square: Real

    @classmethod
    def of(cls, constant: Real, first: Real, last: Real, n_samples: int, spread: float) -> SlowPart:
        """From the mean and the samples at the ends, by least squares; see `drift_spread`."""
        drifts = []
        total, square = np.zeros((2, constant.size))
        for samples in (first, last[:, ::-1]):
            about = samples - constant[:, None]
            drift = _drift(about, spread)
            total += np.add.reduce(drift, axis=1)
            square += np.add.reduce((2.0 * about - drift) * drift, axis=1)
            drifts.append(drift)
        return cls(constant, drifts[0], drifts[1][:, ::-1], n_samples, total, square)

    @classmethod
    def only(cls, constant: Real) -> SlowPart:
        """A constant part and no drift."""
        none, zero = np.empty((constant.size, 0)), np.zeros(constant.size)
        return cls(constant, none, none, 0, zero, zero)

    def drift(self, first: int, count: int) -> Real | None:
        """What `count` samples from the number `first` on drift; None where they do not."""
        m = self.beginning.shape[1]
        if not m or m <= first <= first + count <= self.n_samples - m:
            return None
        found = np.zeros((self.constant.size, count))
        for place, drift in ((-first, self.beginning), (self.n_samples - m - first, self.end)):
            low, high = max(place, 0), min(place + m, count)
            if low < high:
                found[:, low:high] += drift[:, low - place : high - place]
        return found


def drift_spread(n_samples: int, sampling_rate: float, lowest_hz: float) -> float:
    """s in samples, for levels from a frequency on; 0 where nothing is taken for a drift."""
    spread = min(max(_SPREAD, 1.0 / lowest_hz), n_samples / sampling_rate / _SPREADS)
    return spread * sampling_rate if spread * lowest_hz >= 1.0 and sampling_rate <= _HIGHEST_RATE else 0.0


def drift_length(spread: float) -> int:
    """How many samples at either end tell the drift."""
    return int(_SEEN * spread)


def _drift(samples: Real, spread: float) -> Real:
    """At the beginning of samples, shape (channels, n)."""
    if not samples.shape[1]:
        return samples
    # Each channel alone: none depends on how many there are.
    base = _base(samples.shape[1], spread)
    return np.array([(base @ row) @ base for row in samples])


@lru_cache(maxsize=4)
def _base(count: int, spread: float) -> Real:
    """Polynomials, fitted with the weights that they are faded out with."""
    t = np.arange(count) / spread
    root = np.exp(-0.25 * t * t)
    return np.ascontiguousarray(np.linalg.qr((t ** np.arange(_TERMS)[:, None] * root).T)[0].T * root)
