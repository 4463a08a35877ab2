"""What repeats tell about the scatter: pooled over all conditions, as a function of the condition.

The scatter at a condition may grow with the reading or with its sensitivity to a setting. Variances of
the replicates, nu_g s_g^2 / sigma_g^2 ~ chi-square(nu_g), are pooled by gamma likelihood into
sigma_g^2 = a (1 + rho c_g) with one component c out of a few, taken only where the data ask for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array

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
) -> VarianceFunction | None:
    """Variance of `values` about the means of their groups.

    Parameters
    ----------
    values : array, shape (n,)
        Readings less a smooth model of them.
    groups : array of int
        Replicates share a number.
    slopes : array, shape (n, k)
        What readings of one group may differ by without being scattered: the settings that were read.
        A linear dependence on these is fitted and taken out.
    components : mapping
        Non-negative functions of the condition that the variance may grow with.

    Returns
    -------
    VarianceFunction or None
        None where nothing is repeated.
    """
    rest, dof = _within(values, groups, slopes)
    if dof < 1:
        return None
    _, index, counts = np.unique(groups, return_inverse=True, return_counts=True)
    share = dof / float(np.sum(counts - 1))
    several = counts > 1
    nu = share * (counts - 1)[several]
    variance = np.bincount(index, rest**2)[several] / nu
    best = VarianceFunction(float(np.sum(nu * variance) / np.sum(nu)), 0.0, "", dof)
    gain_needed = ASKED_FOR
    for name, component in components.items():
        mean = np.asarray(np.bincount(index, component)[several] / counts[several], dtype=float)
        if not np.ptp(mean) > 0.05 * mean.max():
            continue
        level, share, gain = _with_component(variance, nu, mean)
        if gain > gain_needed:
            gain_needed = gain
            best = VarianceFunction(level, share, name, dof)
    return best


def _within(values: Array, groups: NDArray[np.intp], slopes: Array) -> tuple[Array, int]:
    """Residuals about group means with the slopes taken out, and their degrees of freedom."""
    _, index, counts = np.unique(groups, return_inverse=True, return_counts=True)
    dof = int(np.sum(counts - 1))

    def centred(column: Array) -> Array:
        return column - (np.bincount(index, column) / counts)[index]

    y = centred(values)
    x = np.stack([centred(c) for c in slopes.T], axis=1) if slopes.shape[1] else slopes
    size = np.linalg.norm(x, axis=0)
    x = x[:, size > 1e-12] / size[size > 1e-12]
    if dof < 3 * x.shape[1]:
        x = x[:, :0]
    if x.shape[1]:
        basis, s, _ = np.linalg.svd(x, full_matrices=False)
        basis = basis[:, s > 1e-8 * s[0]]
        y = y - basis @ (basis.T @ y)
        dof -= basis.shape[1]
    return y, dof


def _with_component(variance: Array, nu: Array, component: Array) -> tuple[float, float, float]:
    """Level, share and gain in 2 log-likelihood over a constant, their ratio on a fine grid."""
    scaled = component / component.mean()

    def minus_two_log_likelihood(ratio: float) -> tuple[float, float]:
        shape = 1 + ratio * scaled
        level = float(np.sum(nu * variance / shape) / np.sum(nu))
        return float(np.sum(nu * np.log(max(level, 1e-300) * shape))), level

    constant, _ = minus_two_log_likelihood(0.0)
    tried = [(*minus_two_log_likelihood(r), r) for r in np.geomspace(0.03, 3000.0, 60)]
    value, level, ratio = min(tried)
    return level, level * ratio / float(component.mean()), constant - value
