"""Complex lines among the rows of a problem: what errors of them are, smooth along an axis or of each line by itself.

A smooth error of a response is a complex factor near one that changes slowly along the axis of its lines and is the same
for all channels. Where resonances are narrow an equation that is not exact leaves more than that: an error of each line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.kept_lines import KeptLines


@dataclass(frozen=True)
class Lines:
    """Where the real and the imaginary parts of lines stand among the rows.

    Attributes
    ----------
    real, imaginary : array of int, shape (k,)
        Rows of the two parts.
    n : int
        Rows in all.
    """

    real: NDArray[np.intp]
    imaginary: NDArray[np.intp]
    n: int

    @property
    def any(self) -> bool:
        """Whether there are lines."""
        return bool(self.real.size)

    def turned(self, rows: Array) -> Array:
        """Lines turned by a quarter of a period."""
        out = np.zeros_like(rows)
        out[self.real], out[self.imaginary] = -rows[self.imaginary], rows[self.real]
        return out

    def modulated(self, change: Array, root: Array) -> Array:
        """Columns of a smooth relative error of a change; of lines in phase and in quadrature."""
        columns = change[:, None] * root
        return np.hstack([columns, self.turned(change)[:, None] * root]) if self.any else columns

    def size(self, white: Array) -> Array:
        """Size of each line in units of its noise, on either of its parts; nothing of other rows."""
        out = np.zeros(self.n)
        out[self.real] = out[self.imaginary] = np.hypot(white[self.real], white[self.imaginary]) / np.sqrt(2)
        return out

    def level(self, problem: Problem, predicted: Array) -> Array:
        """RMS over the channels of what is predicted at each line, in units of the noise."""
        parts = []
        for o, own in zip(problem.observations, problem.split(predicted), strict=False):
            if isinstance(o, KeptLines):
                power = np.abs(o.lines_of(own)) ** 2
                level = np.sqrt(power.sum(axis=0) / np.maximum(o.kept.sum(axis=0), 1) / 2)
                parts.append(o.rows(level) / o.sigma)
            else:
                parts.append(np.zeros(o.n))
        return np.concatenate(parts)


def lines_of(problem: Problem) -> Lines:
    """Those of the observations of complex lines."""
    real: list[Array] = []
    imaginary: list[Array] = []
    first = 0
    for o in problem.observations:
        if isinstance(o, KeptLines):
            real.append(first + np.arange(o.n // 2))
            imaginary.append(first + o.n // 2 + np.arange(o.n // 2))
        first += o.n
    none = [np.empty(0, dtype=np.intp)]
    return Lines(np.concatenate(real or none), np.concatenate(imaginary or none), first)
