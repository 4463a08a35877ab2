"""What repeats tell about the scatter: pooled over all conditions, as a function of the condition.

The scatter at a condition may grow with the reading or with its sensitivity to a setting. Variances of
the replicates, nu_g s_g^2 / sigma_g^2 ~ chi-square(nu_g), are pooled by gamma likelihood into
sigma_g^2 = a (1 + rho c_g) with one component c out of a few, taken only where the data support it.

Readings are looked at less a smooth picture of what was measured: the base model, fitted once. How a setting's scatter
goes over into the reading needs the slope of the reading over that setting, and a discrepancy in percent of what the
effects do needs that part. Both are taken from the model with its own base effects - not from the model that a study
is trying out - so that the covariance stays the same from step to step and chi-squares of different models may be
compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import SpecanError
from specan.models import Assembly, Model, varying
from specan.study.data.operating_table import Rows
from specan.study.data.setpoints import slope_by
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.table import TableObservation

SETTING = "the scatter of setting that the rig declares"
ASKED_FOR = 9.0  # gain in 2 log-likelihood that takes in a component: p = 0.01 over some four that are tried


@dataclass(frozen=True)
class VarianceFunction:
    """sigma^2 = level + share * component.

    Attributes
    ----------
    dof : float
        Degrees of freedom: replicates less conditions less slopes.
    component : str
        Name of the component; empty for a constant.
    """

    level: float
    share: float
    component: str
    dof: float

    def at(self, components: Mapping[str, Array], size: int) -> Array:
        """Variance of each of `size` rows."""
        varying = components[self.component] if self.component else np.zeros(size)
        return self.level + self.share * varying


def pooled(
    values: Array,
    groups: NDArray[np.intp],
    slopes: Array,
    components: Mapping[str, Array],
    instrument: Array | None = None,
    known: Array | None = None,
) -> VarianceFunction | None:
    """Variance of `values` about the means of their groups.

    Parameters
    ----------
    values : array, shape (n,)
        Readings less a smooth model of them.
    groups : array of int
        Replicates share a number.
    slopes : array, shape (n, k)
        What readings of one group may differ by without being scattered, most likely first. A linear
        dependence on these is fitted and taken out; the last ones are left out where repeats are few.
    components : mapping
        Non-negative functions of the condition that the variance may grow with. `SETTING` is known beforehand, but
        for its size: it is believed to be there unless the data speak against it; few repeats can tell a size, but no
        shape.
    instrument : array, optional
        Variance of a reading by the rig. With it the whole of setting and instrument has one free size;
        a second one is taken in where the data support it.
    known : array, optional
        Variance of each value that is known and is to be left out of what is returned: what the readings of a
        set-up put into their mean.

    Returns
    -------
    VarianceFunction or None
        None where nothing is repeated.
    """
    _, index, counts = np.unique(groups, return_inverse=True, return_counts=True)
    several = counts > 1
    means = {
        name: np.asarray(np.bincount(index, component) / counts, dtype=float)
        for name, component in components.items()
    }
    told = None if instrument is None else np.bincount(index, instrument) / counts
    size, best = np.ones(counts.size), None
    share = np.zeros(counts.size) if known is None else np.bincount(index, known) / counts
    # 4: of weights for the slopes; the second differs from the first, the fourth hardly from the third
    for _ in range(4 if slopes.shape[1] else 1):
        rest, dof = _within(values, index, counts, slopes, size)
        if dof < 1:
            return None
        nu = np.asarray(dof / float(np.sum(counts - 1)) * (counts - 1)[several], dtype=float)
        variance = np.bincount(index, rest**2)[several] / nu
        best = _likeliest(
            _Variances(variance, nu, share[several]), {name: mean[several] for name, mean in means.items()},
            None if told is None else told[several], dof,
        )  # fmt: skip
        found = share + best.at(means, counts.size)
        if not np.all(found > 0):  # repeats that agree to the last digit tell no weights
            break
        size = np.sqrt(found)
    return best


@dataclass(frozen=True)
class _Variances:
    """Variances of groups with their degrees of freedom, and the part of them that is known."""

    found: Array
    nu: Array
    known: Array

    def level(self, shape: Array) -> float:
        """Size a of ``known + a * shape`` by maximum likelihood; at least a twentieth of that without `known`."""
        whole = float(np.sum(self.nu * self.found / shape) / np.sum(self.nu))
        if not np.any(self.known):
            return whole
        least, a = 0.05 * whole, whole
        # 12: steps of Fisher's scoring; each halves the error or better
        for _ in range(12):
            weight = self.nu * shape / (self.known + a * shape) ** 2
            a = max(float(np.sum(weight * (self.found - self.known)) / np.sum(weight * shape)), least)
        return a

    def misfit(self, expected: Array) -> float:
        """Minus twice the log-likelihood of the variances under chi-square laws, up to a constant."""
        total = self.known + np.maximum(expected, 1e-300)
        return float(np.sum(self.nu * (np.log(total) + self.found / total)))

    def with_component(self, component: Array) -> tuple[float, float, float]:
        """Level, share and misfit of a constant plus a component, their ratio on a fine grid."""
        scaled = component / component.mean()
        tried = []
        for ratio in np.geomspace(0.03, 3000.0, 60):
            shape = 1 + ratio * scaled
            level = self.level(shape)
            tried.append((self.misfit(level * shape), level, ratio))
        misfit, level, ratio = min(tried)
        return level, level * ratio / float(component.mean()), misfit


def _likeliest(
    of: _Variances, means: Mapping[str, Array], told: Array | None, dof: float
) -> VarianceFunction:
    """The form that the variances of the groups ask for: a constant, or with one component."""
    constant = VarianceFunction(of.level(np.ones(of.nu.size)), 0.0, "", dof)
    if constant.level == 0:  # repeats that agree to the last digit have no shape
        return constant
    best, misfit = constant, of.misfit(np.full(of.nu.size, constant.level))
    if np.any(means.get(SETTING, 0) > 0):
        known, left = _as_declared(of, means[SETTING], told, dof)
        # 0.1: of a declared variance that must be found for it to be there at all
        if known.share > 0.1 and left - misfit < ASKED_FOR:
            best, misfit = known, left
    most = ASKED_FOR
    for name, mean in means.items():
        if np.ptp(mean) > 0.05 * mean.max():
            level, share, left = of.with_component(mean)
            if misfit - left > most:
                most = misfit - left
                best = VarianceFunction(level, share, name, dof)
    return best


def _as_declared(
    of: _Variances, setting: Array, instrument: Array | None, dof: float
) -> tuple[VarianceFunction, float]:
    """Setting and instrument at one common size, or at two where the data support it; with its misfit."""
    level, share, left = of.with_component(setting)
    two = VarianceFunction(level, share, SETTING, dof), left
    if instrument is None or not np.all(instrument > 0):
        return two
    shape = instrument + setting
    size = of.level(shape)
    left = of.misfit(size * shape)
    one = VarianceFunction(size * float(np.mean(instrument)), size, SETTING, dof), left
    # 3.84: the same for a second size of what is known to be there: p = 0.05
    return two if left - two[1] > 3.84 else one


def _within(
    values: Array, index: NDArray[np.intp], counts: NDArray[np.intp], slopes: Array, size: Array
) -> tuple[Array, int]:
    """Residuals about group means with the slopes taken out, and their degrees of freedom.

    The slopes are fitted with weights, the inverse of the standard deviation `size` of each group: without them the
    scatter of large readings would be put into the small ones, which it is not small for.
    """
    dof = int(np.sum(counts - 1))
    width = size[index]

    def centred(column: Array) -> Array:
        return (column - (np.bincount(index, column) / counts)[index]) / width

    y = centred(values)
    x = np.stack([centred(c) for c in slopes.T], axis=1) if slopes.shape[1] else slopes
    length = np.linalg.norm(x, axis=0)
    x = x[:, length > 1e-12 * max(length.max(initial=0.0), 1e-300)]
    x = x / np.linalg.norm(x, axis=0)
    x = x[:, : dof // 3]  # no more of them than the repeats can bear
    if x.shape[1]:
        basis, s, _ = np.linalg.svd(x, full_matrices=False)
        basis = basis[:, s > 1e-8 * s[0]]
        y = y - basis @ (basis.T @ y)
        dof -= basis.shape[1]
    return y * width, dof


@dataclass(frozen=True, eq=False)
class Reference:
    """The fitted base model, or the model without effects where that could not be fitted."""

    assembly: Assembly
    values: Mapping[str, Any]

    def predict(self, rows: Rows, conditions: Mapping[str, Array] | None = None) -> Array:
        """What the reference expects in every row, at other conditions if need be."""
        return replace(rows, conditions=conditions or rows.conditions).predict(self.assembly, self.values)

    def slope(self, rows: Rows, condition: str) -> Array:
        """Derivative of the reading over one condition."""
        x = rows.conditions[condition]
        return slope_by(x, lambda step: self.predict(rows, {**rows.conditions, condition: x + step}))

    def quantity(self, rows: Rows, name: str) -> Array:
        """Another quantity of the model in every row."""
        found = self.assembly.evaluate(rows.conditions, self.values)[name]
        return np.broadcast_to(np.asarray(found, dtype=float), (rows.n,))

    def effects_part(self, rows: Rows) -> Array:
        """What the effects do to the reading: prediction less that of the model without effects.

        A model whose base has no effects is taken whole.
        """
        predicted = self.predict(rows)
        model = self.assembly.model
        if not model.base_effects:
            return predicted
        ideal = model.assemble()
        return predicted - Reference(ideal, ideal.defaults).predict(rows)


def crude(rows: Rows) -> TableObservation:
    """Rows as an observation, each weighted by its size: good enough for a first fit."""
    size = np.abs(rows.measured)
    largest = {name: float(size[rows.observable == name].max()) for name in set(rows.observable.tolist())}
    # 0.01: relative weight of a row in the first fit
    weight = 0.01 * np.maximum(size, [0.01 * (largest[name] or 1.0) for name in rows.observable.tolist()])
    return replace(rows, covariance=weight**2)


def reference(model: Model, rows: Rows) -> Reference:
    """Fit the base effects to the rows."""
    ideal = model.assemble()
    try:
        assembly = model.assemble(model.base_effects)
        free = assembly.free(varying([rows.conditions]))
        # 2: of the fit of the base: where both lead is the minimum
        return Reference(assembly, fit(Problem(assembly, (crude(rows),), free), starts=2).values)
    except SpecanError:  # too few rows, or data that the base cannot follow at all: the ideal slopes serve
        return Reference(ideal, ideal.defaults)
