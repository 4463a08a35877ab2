"""A model made linear: derivatives of what it predicts, and what is left of a residual that its parameters absorb.

A stencil is points around a place, and the weights that make derivatives of what a model predicts there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_DAMPING = 1e-6  # of the first step inside bounds
MOST_STEPS, STEADY = 60, 1e-9  # of them, and the share of the sum of squares that the last one promises
SETTLED = 1e-10  # gradient, and share of the sum of squares, that bounded steps leave
STEP = 1e-4  # of a parameter's scale, for central differences: truncation and rounding both near 1e-8

# Offsets in steps, their weights, and the weight of the centre. Taylor's theorem; Abramowitz & Stegun, table 25.2.
_Rule = tuple[tuple[int, ...], tuple[float, ...], float]
_FORWARD: _Rule = ((1,), (1.0,), -1.0)
_CENTRAL: _Rule = ((-1, 1), (-0.5, 0.5), 0.0)
_AT_AN_END: _Rule = ((1, 2), (2.0, -0.5), -1.5)
_FOURTH: _Rule = ((-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12), 0.0)
_FOURTH_AT_AN_END: _Rule = ((1, 2, 3, 4), (4.0, -3.0, 4 / 3, -1 / 4), -25 / 12)

Array = NDArray[np.float64]


def usual_stencil(
    theta: Array, scale: Array, low: Array, high: Array, exact: bool
) -> tuple[list[Array], Array]:
    """Points around theta (itself first, where it counts) and the weights that make derivatives of their predictions.

    Central differences; one-sided ones of second order where a bound is near. Plain one-sided ones where they
    need not be `exact`: what they err by, the step's share of the parameter's width, no step
    of a fit and no interval shows.
    """
    steps = STEP * np.maximum(scale, np.abs(theta))
    steps = (theta + steps) - theta
    rules = []
    for k, step in enumerate(steps):
        if not exact:
            rules.append(_mirrored(_FORWARD) if theta[k] + step > high[k] else _FORWARD)
        elif theta[k] - step < low[k]:
            rules.append(_AT_AN_END)
        elif theta[k] + step > high[k]:
            rules.append(_mirrored(_AT_AN_END))
        else:
            rules.append(_CENTRAL)
    return _stencil(theta, steps, rules)


def chosen_stencil(
    theta: Array, steps: Array, low: Array, high: Array, order: int
) -> tuple[list[Array], Array]:
    """The same of second or fourth order, with a step for each element of theta; one-sided where a bound is near.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.array([np.inf])
    >>> points, weights = chosen_stencil(np.array([1.0]), np.array([1e-3]), -none, none, 4)
    >>> derivative = np.exp(np.array(points)[:, 0]) @ weights
    >>> bool(abs(derivative[0] - np.e) < 1e-12)
    True
    """
    inside, at_an_end = (_FOURTH, _FOURTH_AT_AN_END) if order == 4 else (_CENTRAL, _AT_AN_END)
    steps = np.minimum(steps, (high - low) / 8)  # four of them fit between one end and the middle
    steps = (theta + steps) - theta
    rules = []
    for k, step in enumerate(steps):
        reach = order // 2 * step
        if low[k] <= theta[k] - reach and theta[k] + reach <= high[k]:
            rules.append(inside)
        else:
            rules.append(at_an_end if theta[k] + 2 * reach <= high[k] else _mirrored(at_an_end))
    return _stencil(theta, steps, rules)


def _mirrored(rule: _Rule) -> _Rule:
    offsets, weights, centre = rule
    return tuple(-o for o in offsets), tuple(-w for w in weights), -centre


def _stencil(theta: Array, steps: Array, rules: list[_Rule]) -> tuple[list[Array], Array]:
    points = [theta]
    weights = np.zeros((1 + sum(len(rule[0]) for rule in rules), theta.size))
    for k, (step, (offsets, outside, centre)) in enumerate(zip(steps, rules, strict=True)):
        weights[0, k] = centre / step
        for offset, weight in zip(offsets, outside, strict=True):
            weights[len(points), k] = weight / step
            points.append(theta.copy())
            points[-1][k] += offset * step
    return (points, weights) if np.any(weights[0]) else (points[1:], weights[1:])


@dataclass(frozen=True)
class Projection:
    """A fit, linearised: whitened residual and an orthonormal basis of what its parameters can do.

    Attributes
    ----------
    residual : array, (n_rows,)
        Whitened residual, pseudo-data of the priors included.
    basis : array, (n_rows, rank)
        Orthonormal basis of the whitened Jacobian's columns.
    """

    residual: Array
    basis: Array

    @classmethod
    def of(cls, residual: Array, jacobian: Array) -> Projection:
        """Linearise; columns that add nothing to the others are left out of the basis."""
        return cls(residual, orthonormal(jacobian))

    @property
    def rank(self) -> int:
        """Number of parameter combinations that the data determine."""
        return int(self.basis.shape[1])

    def project_out(self, columns: Array) -> Array:
        """Part of a vector, or of each column, that no change of the parameters can produce.

        Examples
        --------
        >>> import numpy as np
        >>> line = np.column_stack([np.ones(3), [-1.0, 0.0, 1.0]])
        >>> Projection.of(np.zeros(3), line).project_out(np.array([0.0, 1.0, 2.0])).round(12) + 0.0
        array([0., 0., 0.])
        """
        return columns - self.basis @ (self.basis.T @ columns)

    def free_chi2(self, shift: Array) -> float:
        """Chi-square that is left of `shift` after a linear refit."""
        rest = self.project_out(shift)
        return float(rest @ rest)


def orthonormal(columns: Array, tolerance: float = 1e-9) -> Array:
    """Orthonormal basis of the span of the columns, each counted at its own scale."""
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 0] / norms[norms > 0]
    if not columns.size:
        return np.zeros((columns.shape[0], 0))
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > tolerance * values[0]])


def held_inside(columns: Array, residual: Array, low: Array, high: Array) -> Array:
    """The x between two ends that makes the sum of squares of ``residual + columns x`` least (Stark & Parker 1995).

    Parameters
    ----------
    columns : array, shape (n, p)
    residual : array, shape (n,)
    low, high : array, shape (p,)
        Ends of x, about zero.

    Examples
    --------
    >>> import numpy as np
    >>> columns = np.array([[1.0, 0.9], [0.0, 0.5]])
    >>> held_inside(columns, np.array([-2.0, 1.0]), np.array([-9.0, -0.5]), np.array([9.0, 9.0]))
    array([ 2.45, -0.5 ])
    """
    x: Array = np.asarray(np.linalg.lstsq(columns, -residual, rcond=-1)[0], dtype=float)
    side = np.where(x >= high, 1, np.where(x <= low, -1, 0))  # the end at which each is held
    x = np.clip(x, low, high)

    def solved(free: NDArray[np.bool_]) -> Array:
        rest = residual + columns @ np.where(free, 0.0, x)
        return np.asarray(np.linalg.lstsq(columns[:, free], -rest, rcond=None)[0], dtype=float)

    while not np.all(side):  # what leaves its ends is held there, until nothing does
        free = side == 0
        x[free] = solved(free)
        side = np.where(x > high, 1, np.where(x < low, -1, side))
        x = np.clip(x, low, high)
        if np.array_equal(free, side == 0):
            break
    left = residual + columns @ x
    for _ in range(low.size):  # what gains most is set free again, one at a time
        downhill = -(columns.T @ left)
        gains = np.where(side == 0, np.abs(downhill), -downhill * side)
        if gains.max() < SETTLED:
            break
        side[int(np.argmax(-downhill * side))] = 0
        while np.any(free := side == 0):
            wanted = x.copy()
            wanted[free] = solved(free)
            out = np.flatnonzero(free & ((wanted < low) | (wanted > high)))
            if not out.size:
                x = wanted
                break
            ends = np.where(wanted < low, low, high)[out]
            shares = (ends - x[out]) / (wanted[out] - x[out])
            first = int(np.argmin(shares))
            x = np.where(free, x + shares[first] * (wanted - x), x)
            x[out[first]] = ends[first]
            side[out[first]] = 1 if wanted[out[first]] > high[out[first]] else -1
        before, left = left, residual + columns @ x
        if before @ before - left @ left < SETTLED * (before @ before):
            break
    return x


def least_inside(
    residual: Callable[[Array], Array], slopes: Callable[[Array], Array], x: Array, low: Array, high: Array
) -> tuple[Array, float]:
    """Where damped steps (Marquardt 1963) inside bounds lead, and the sum of squares there.

    Parameters
    ----------
    residual, slopes : callable
        Of x, and its derivative.
    x : array
        Start.
    low, high : array
        Ends of x.

    Examples
    --------
    >>> import numpy as np
    >>> end = np.array([9.0])
    >>> place, left = least_inside(np.exp, lambda x: np.diag(np.exp(x)), np.array([1.0]), -end / 9, end)
    >>> place, round(left, 6)
    (array([-1.]), 0.135335)
    """
    damping, x = LEAST_DAMPING, np.clip(x, low, high)
    rows, slope = residual(x), slopes(x)
    for _ in range(MOST_STEPS):
        sizes = np.linalg.norm(slope, axis=0)
        sizes = np.where(sizes > 0, sizes, 1.0)
        damped = np.vstack([slope / sizes, np.sqrt(damping) * np.eye(x.size)])
        # the ends of a step are about zero, and apart
        ends = np.minimum(low - x, 0.0) * sizes, np.maximum(high - x, 0.0) * sizes + 1e-300
        step = held_inside(damped, np.concatenate([rows, np.zeros(x.size)]), *ends) / sizes
        ahead, now = rows + slope @ step, float(rows @ rows)
        if now - ahead @ ahead < STEADY * now:
            break
        there = np.clip(x + step, low, high)
        beyond = residual(there)
        if not beyond @ beyond < now:  # neither where it is not finite
            damping *= 10
            continue
        x, rows, damping = there, beyond, damping / 10
        slope = slopes(x)
    return x, float(rows @ rows)


def covariance_root(covariance: Array) -> Array:
    """A matrix R with R R' the covariance, of rounding's negative eigenvalues freed."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def chi2_beside(gap: Array, root: Array) -> float:
    """g' (I + R R')^-1 g by Woodbury's formula: R has few columns, g may be long.

    Examples
    --------
    >>> import numpy as np
    >>> chi2_beside(np.array([2.0, 1.0]), np.array([[1.0], [0.0]]))
    3.0
    """
    inner = root.T @ gap
    return float(gap @ gap - inner @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ root, inner))
