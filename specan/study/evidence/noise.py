"""Forms of the noise beside the declared one: noise that follows itself in time, and errors of each row by itself.

The whitened residuals of one recording and observable, in the order in which they were read, follow
r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t with unit variance of r: the size of the noise stays as declared, so that no
missing effect hides in it. The coefficients are those of Burg's recursion (1975) on the residual of a fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from specan.study.data.setpoints import TIME
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.autoregression import burg, innovations, ln_volume, of_likely_order

ORDER = 2  # most coefficients: an oscillation of what is not measured has two
LEAST_ROWS = 30  # of a chain, from which it is looked at


class Noise(Protocol):
    """A form of the noise: whitened rows as rows of unit variance under it, and what that costs."""

    def innovations(self, columns: Array) -> Array:
        """Rows of whitened columns (n, k) as independent rows of unit variance."""

    @property
    def ln_volume(self) -> float:
        """-1/2 ln det of the covariance of the whitened rows, and of what was estimated for it."""


@dataclass(frozen=True, eq=False)
class Rough:
    """Errors that no row shares with another, beside the declared noise.

    Attributes
    ----------
    sizes : array, shape (n,)
        Standard deviation of each row's, in units of the noise that the row does not share.
    """

    sizes: Array

    @property
    def weights(self) -> Array:
        """Of each row."""
        return np.asarray(1 / np.sqrt(1 + self.sizes**2))

    def innovations(self, columns: Array) -> Array:
        """Rows that such errors widen count for less."""
        return columns * self.weights[:, None]

    @property
    def ln_volume(self) -> float:
        """-1/2 ln det of the covariance."""
        return float(np.sum(np.log(self.weights)))


@dataclass(frozen=True, eq=False)
class Autoregression:
    """An autoregressive form of the noise.

    Attributes
    ----------
    chains : tuple of int arrays
        Rows in the order of time, one array for each recording and observable.
    reflections : tuple of float
        Reflection coefficients, each between -1 and 1.
    """

    chains: tuple[NDArray[np.intp], ...]
    reflections: tuple[float, ...]

    def innovations(self, columns: Array) -> Array:
        """Rows of whitened columns as independent innovations of unit variance (lattice filter)."""
        return innovations(columns, self.chains, self.reflections)

    @property
    def ln_volume(self) -> float:
        """-1/2 ln det of the correlation, less half ln of the rows for each estimated coefficient (Schwarz 1978)."""
        price = 0.5 * len(self.reflections) * np.log(sum(rows.size for rows in self.chains))
        return ln_volume(self.chains, self.reflections) - float(price)


def chains_of(problem: Problem) -> tuple[NDArray[np.intp], ...]:
    """Rows of each recording and observable in the order of time, or of the table where it has none."""
    found, first = [], 0
    for o in problem.observations:
        recording = getattr(o, "recording", None)
        observable = getattr(o, "observable", None)
        lines = o.conditions.get(TIME, getattr(o, "lines", None))
        if recording is None or observable is None or lines is None or o.kind not in ("table", "time"):
            first += o.n
            continue
        for number in np.unique(recording):
            for name in np.unique(observable):
                rows = np.flatnonzero((recording == number) & (observable == name))
                if rows.size >= LEAST_ROWS:
                    found.append(first + rows[np.argsort(np.asarray(lines)[rows], kind="stable")])
        first += o.n
    return tuple(found)


def autoregressions(
    chains: tuple[NDArray[np.intp], ...], residual: Array, likeliest: bool = False
) -> list[Autoregression]:
    """Forms of one to two coefficients, or the likeliest, by Burg's recursion over all chains together.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> e, r = rng.standard_normal(4000), np.zeros(4000)
    >>> for t in range(1, 4000):
    ...     r[t] = 0.9 * r[t - 1] + e[t] * np.sqrt(1 - 0.9**2)
    >>> found = autoregressions((np.arange(4000),), r)
    >>> round(found[0].reflections[0], 1), round(float(np.var(found[0].innovations(r))), 1)
    (0.9, 1.0)
    """
    if not chains:
        return []
    if likeliest:
        order = of_likely_order(chains, residual)
        return [Autoregression(chains, order)] if order else []
    found, _ = burg(chains, residual, ORDER)
    return [Autoregression(chains, tuple(found[:k])) for k in range(1, ORDER + 1)]
