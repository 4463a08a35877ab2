"""Forms of the noise beside the declared one: correlated in time, larger than declared, errors of each row by itself.

The whitened residuals of one recording and observable, in the order in which they were read, follow
r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t with unit variance of r: the size of the noise stays as declared, so that no
missing effect hides in it. The coefficients are those of Burg's recursion (1975) on the residual of a fit.

Readings that scatter more than their declared uncertainty are a form of its own. It costs ln det of the covariance, so
that what goes with the operating variables is no noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.study.data.setpoints import TIME
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.table import TableObservation
from specan.study.observation.time import Noise as Form
from specan.study.observation.time import (
    TimeObservation,
    burg,
    coloured,
    innovations,
    ln_volume,
    of_likely_order,
)
from specan.units import spoken

WHITE = Form("white")
ORDER = 2  # most coefficients: an oscillation of what is not measured has two


@dataclass(frozen=True, eq=False)
class Rough:
    """Errors beside the declared noise that no row shares with another, or only with the other repeats of its setting.

    Attributes
    ----------
    sizes : array, shape (n,), or one of each group
        Standard deviation of each row's, in units of the noise that the row does not share.
    groups : int array, shape (n,), optional
        Of each row; every row is one of its own without.
    text : str
        What a person has to know.
    price : float
        ln that it costs to estimate the sizes.
    """

    sizes: Array
    groups: NDArray[np.intp] | None = None
    text: str = ""
    price: float = 0.0

    @property
    def _spread(self) -> Array:
        """Standard deviation of each group's mean with such errors over that without."""
        count = 1 if self.groups is None else np.bincount(self.groups)
        return np.asarray(np.sqrt(1 + count * self.sizes**2))

    def innovations(self, columns: Array) -> Array:
        """Rows that such errors widen count for less."""
        if self.groups is None:
            return columns / self._spread[:, None]
        return columns - ((1 - 1 / self._spread)[:, None] * means(columns, self.groups))[self.groups]

    @property
    def ln_volume(self) -> float:
        """-1/2 ln det of the covariance, less the price."""
        return -float(np.sum(np.log(self._spread))) - self.price


def means(columns: Array, groups: NDArray[np.intp]) -> Array:
    """Of the rows of each group."""
    count = np.bincount(groups)
    first = np.cumsum(count) - count
    return np.add.reduceat(columns[np.argsort(groups, kind="stable")], first) / count[:, None]


def scatter(problem: Problem, residual: Array, predicted: Array, times: float) -> list[Rough]:
    """Readings, or settings beside their repeats, that scatter more than known: all alike, or as the prediction.

    Their variance is `times` that of a whitened residual; half ln of their number is the price for each observable
    (Schwarz 1978).
    """
    groups, repeats = _settings(problem), np.isfinite(problem.noise_dof)
    count = np.bincount(groups)
    variance = times * count * means(residual[:, None], groups)[:, 0] ** 2
    sigma = np.concatenate([o.sigma for o in problem.observations])
    found = []
    for course, how in (
        (np.ones(sigma.size), ""),
        (np.abs(predicted) / sigma, ", in proportion to what is read"),
    ):
        sizes, price, told = means(course[:, None], groups)[:, 0], 0.0, []
        for name, rows in problem.observable_rows.items():
            own = np.unique(groups[rows])
            known, power = float(np.mean(variance[own])), np.mean(count[own] * sizes[own] ** 2)
            if not power:  # nothing is read
                continue
            sizes[own] *= np.sqrt(max(known - 1, 0.0) / power)
            price += 0.5 * np.log(own.size)
            # 1.4: times the declared variance, from which a larger one is looked for
            told += [f"{name} {spoken(np.sqrt(known), digits=2)} times"] if known > 1.4 else []
        if told:
            text = (
                f"settings scatter more than their repeats ({', '.join(told)}{how}): declare how well they are set"
                if repeats
                else f"the readings scatter more than declared ({', '.join(told)}{how}): correct their uncertainty"
            )
            found.append(Rough(sizes, groups if repeats else None, text, price))
    return found


def _settings(problem: Problem) -> NDArray[np.intp]:
    """Rows of one observable that repeat each other, where repeats told the noise; else each by itself."""
    found: list[tuple[int, Any]] = []
    for k, o in enumerate(problem.observations):
        alike: Iterable[Any] = range(o.n)
        if (
            isinstance(o, TableObservation)
            and o.replicate_group is not None
            and np.isfinite(problem.noise_dof)
        ):
            alike = zip(o.replicate_group.tolist(), o.observable.tolist(), strict=True)
        found += [(k, one) for one in alike]
    number = {one: place for place, one in enumerate(dict.fromkeys(found))}
    return np.array([number[one] for one in found])


@dataclass(frozen=True, eq=False)
class Autoregression:
    """An autoregressive form of the noise.

    Attributes
    ----------
    chains : tuple of int arrays
        Rows in the order of time, one array for each recording and observable.
    reflections : tuple of float
        Reflection coefficients, each between -1 and 1.
    size : float
        Standard deviation, in units of that which whitened the columns.
    before : specan.study.observation.time.Noise
        In whose place it stands.
    """

    chains: tuple[NDArray[np.intp], ...]
    reflections: tuple[float, ...]
    size: float = 1.0
    before: Form = WHITE
    text = "the noise is correlated in time: rows are not independent"

    def innovations(self, columns: Array) -> Array:
        """Rows of whitened columns as independent innovations of unit variance (lattice filter)."""
        columns = columns.copy()
        for rows in self.chains:
            columns[rows] = coloured(columns[rows], self.before.reflections) / self.size
        return innovations(columns, self.chains, self.reflections)

    @property
    def ln_volume(self) -> float:
        """-1/2 ln det of the correlation, less half ln of the rows for each estimated coefficient (Schwarz 1978)."""
        count = sum(rows.size for rows in self.chains)
        price = 0.5 * (len(self.reflections) - self.before.estimated) * np.log(count) + count * np.log(
            self.size
        )
        before = ln_volume(self.chains, self.before.reflections)
        return ln_volume(self.chains, self.reflections) - before - float(price)


Noise = Autoregression | Rough


def chains_of(problem: Problem) -> tuple[NDArray[np.intp], ...]:
    """Rows of each recording and observable in the order of time, or of the table where it has none."""
    found, first = [], 0
    for o in problem.observations:
        if (
            isinstance(o, TableObservation)
            and o.kind == "table"
            and o.recording is not None
            and (lines := o.conditions.get(TIME, o.lines)) is not None
        ):
            for number, name in product(np.unique(o.recording), np.unique(o.observable)):
                rows = np.flatnonzero((o.recording == number) & (o.observable == name))
                # 30: rows of a chain, from which it is looked at
                if rows.size >= 30:
                    found.append(first + rows[np.argsort(lines[rows], kind="stable")])
        first += o.n
    return tuple(found)


def autoregressions(chains: tuple[NDArray[np.intp], ...], residual: Array) -> list[Autoregression]:
    """Forms of one to two coefficients, by Burg's recursion over all chains together.

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
    found, _ = burg(chains, residual, ORDER)
    return [Autoregression(chains, tuple(found[:k])) for k in range(1, ORDER + 1)] if chains else []


def own_noises(problem: Problem, residual: Array) -> Iterator[Autoregression]:
    """The likeliest noise of each observable of recordings, in place of that which whitened the residual."""
    first = 0
    for o in problem.observations:
        assert isinstance(o, TimeObservation)
        for name, chains in o.chains.items():
            rows, before = tuple(first + chain for chain in chains), o.noise.get(name, WHITE)
            own = Autoregression(rows, (), before=before).innovations(residual)
            if (order := of_likely_order(rows, own)) != before.reflections:
                size = np.mean(innovations(own, rows, order)[np.concatenate(rows)] ** 2)
                yield Autoregression(rows, order, float(np.sqrt(size)), before)
        first += o.n
