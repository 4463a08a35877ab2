"""From equal steps of time to equal steps of angle, with the band limited by the steps of the angle."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

PASS = 2.56  # samples a turn over the highest order: what lies above it may be aliased, up to it nothing is
ATTENUATION_DB = 100.0  # of what would be aliased into the orders up to the highest one
_FINE = 4096  # steps of the kernel's table between two output samples


def samples_per_turn(max_order: float) -> int:
    """Samples a turn that hold orders up to `max_order`; an even number.

    Examples
    --------
    >>> samples_per_turn(200.0)
    512
    """
    return 2 * math.ceil(PASS * max_order / 2)


def _kernel() -> tuple[int, Real]:
    """Half length in output samples, and a table of the low-pass kernel from its middle on.

    A sinc under a Kaiser window (Kaiser 1974: beta and length from attenuation and transition width). It passes up to
    1/2.56 of the output rate, and stops what would fold back below that, from 1 - 1/2.56 on.
    """
    edge = 1.0 / PASS
    width = 2 * np.pi * (1.0 - 2.0 * edge)
    length = (ATTENUATION_DB - 8.0) / (2.285 * width)
    half = math.ceil(length / 2)
    beta = 0.1102 * (ATTENUATION_DB - 8.7)
    at = np.arange(half * _FINE + 2) / _FINE
    window = np.i0(beta * np.sqrt(np.clip(1.0 - (at / half) ** 2, 0.0, 1.0))) / np.i0(beta)
    window[at >= half] = 0.0
    return half, np.sinc(at) * window


class AngularResampler:
    """Takes samples at equal steps of time in pieces and gives them at equal steps of angle.

    Output sample k is at the turn ``first_turn + k / per_turn``. It is the sum of the input about it under a
    low-pass kernel that is as wide as the output steps are there (or the input steps, where those are wider), so that
    at low speed nothing is aliased. Up to 1/2.56 of the output rate the band is kept to 0.01 dB.

    Parameters
    ----------
    turns_at : callable
        Turns of the shaft at sample numbers (floats), rising.
    per_turn : int
        Output samples a turn.
    first_turn : float
        Turn of the first output sample.
    count : int
        Output samples in all.
    start : int
        Number of the first input sample.

    Examples
    --------
    >>> speed = 0.01  # turns a sample
    >>> resampler = AngularResampler(lambda n: speed * n, 16, first_turn=5.0, count=160, start=0)
    >>> x = np.cos(2 * np.pi * 3 * speed * np.arange(4000))
    >>> y = np.concatenate([resampler.add(x[None, :2500]), resampler.add(x[None, 2500:])], axis=1)
    >>> truth = np.cos(2 * np.pi * 3 * np.arange(160) / 16)
    >>> y.shape, bool(np.abs(y - truth).max() < 1e-3)
    ((1, 160), True)
    """

    def __init__(
        self,
        turns_at: Callable[[Real], Real],
        per_turn: int,
        *,
        first_turn: float,
        count: int,
        start: int = 0,
    ) -> None:
        self._turns_at, self._per_turn = turns_at, per_turn
        self._first, self._count, self._given = first_turn, count, 0
        self._half, self._table = _kernel()
        self._turns: Real = np.empty(0)
        self._held: Real | None = None
        self._next = start

    def add(self, samples: Real) -> Real:
        """Take the next samples (channels, m); return what has become ready, (channels, k)."""
        n = samples.shape[1]
        turns = self._turns_at(self._next + np.arange(n, dtype=float))
        self._next += n
        columns = np.ascontiguousarray(samples.T)
        self._held = columns if self._held is None else np.concatenate([self._held, columns])
        self._turns = np.concatenate([self._turns, turns])
        if self._turns.size < 3:
            return np.empty((samples.shape[0], 0))
        step = np.gradient(self._turns)
        ready = self._ready(step)
        if ready <= self._given:
            return np.empty((samples.shape[0], 0))
        found = self._weights(ready, step) @ self._held
        self._given = ready
        self._drop(step)
        return np.ascontiguousarray(found.T)

    def reach(self, speed_per_sample: float) -> float:
        """Turns to either side of an output sample that it is made from."""
        return self._half * max(1.0 / self._per_turn, speed_per_sample)

    def _ready(self, step: Real) -> int:
        """Output samples whose input is complete."""
        last = self._turns[-1] - 1.01 * self.reach(float(step[-64:].max()))
        return int(np.clip(math.floor((last - self._first) * self._per_turn), 0, self._count))

    def _weights(self, ready: int, step: Real):
        from scipy.sparse import csr_array

        at = self._first + np.arange(self._given, ready) / self._per_turn
        place = np.clip(np.searchsorted(self._turns, at), 0, self._turns.size - 1)
        # Width of the kernel's unit in turns: the output step, or the input step where that is wider.
        unit = np.maximum(1.0 / self._per_turn, step[place])
        low = np.searchsorted(self._turns, at - self._half * unit)
        high = np.searchsorted(self._turns, at + self._half * unit)
        counts = high - low
        rows = np.concatenate([[0], np.cumsum(counts)])
        index = np.arange(rows[-1]) - np.repeat(rows[:-1] - low, counts)
        distance = np.abs(self._turns[index] - np.repeat(at, counts)) * np.repeat(_FINE / unit, counts)
        np.minimum(distance, self._half * _FINE, out=distance)
        cell = distance.astype(np.int32)
        part = distance - cell
        values = self._table[cell]
        values += part * (self._table[cell + 1] - values)
        values *= step[index]
        # The kernel's sum is one but for its ripple; a constant stays exactly what it is.
        total = np.add.reduceat(values, np.minimum(rows[:-1], max(values.size - 1, 0)))
        values /= np.repeat(np.where(counts > 0, total, 1.0), counts)
        return csr_array((values, index, rows), shape=(at.size, self._turns.size))

    def _drop(self, step: Real) -> None:
        """Forget the input that no later output needs."""
        at = self._first + self._given / self._per_turn
        keep = int(np.searchsorted(self._turns, at - 1.5 * self.reach(float(step.max()))))
        keep = max(0, min(keep - 2, self._turns.size - 3))
        if keep > 0 and self._held is not None:
            self._turns, self._held = self._turns[keep:], self._held[keep:]
