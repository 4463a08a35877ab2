"""A model made linear: derivatives of what it predicts, and what is left of a residual that its parameters absorb.

A stencil is points around a place, and the weights that make derivatives of what a model predicts there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from specan.arrays import Real

SETTLED = 1e-10  # the same of a linear problem, and of steps
STEP = 1e-4  # of a parameter's scale, for central differences: truncation and rounding both near 1e-8

# Offsets in steps, their weights, and the weight of the centre, of first, second and fourth order: in the middle, and
# at a lower end. Taylor's theorem; Abramowitz & Stegun, table 25.2.
_Rule = tuple[tuple[int, ...], tuple[float, ...], float]
_RULES: dict[int, tuple[_Rule, _Rule]] = {
    1: (((1,), (1.0,), -1.0), ((1,), (1.0,), -1.0)),
    2: (((-1, 1), (-0.5, 0.5), 0.0), ((1, 2), (2.0, -0.5), -1.5)),
    4: (
        ((-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12), 0.0),
        ((1, 2, 3, 4), (4.0, -3.0, 4 / 3, -1 / 4), -25 / 12),
    ),
}


def stencil(theta: Real, steps: Real, low: Real, high: Real, order: int) -> tuple[list[Real], Real]:
    """Points around theta, itself first, and the weights that make derivatives of predictions there.

    Central differences of second or fourth order, one-sided where a bound is near; plain one-sided ones of first order:
    what they err by, the step's share of the parameter's width, no step of a fit and no interval shows.

    Parameters
    ----------
    steps : array
        One for each element of theta; shortened where the bounds are near each other.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.array([np.inf])
    >>> points, weights = stencil(np.array([1.0]), np.array([1e-3]), -none, none, 4)
    >>> derivative = np.exp(np.array(points)[:, 0]) @ weights
    >>> bool(abs(derivative[0] - np.e) < 1e-12)
    True
    """
    steps = np.minimum(steps, (high - low) / 8)  # four of them fit between one end and the middle
    steps = (theta + steps) - theta
    points, columns = [theta], []
    for k, step in enumerate(steps):
        reach = order // 2 * step
        inside, at_an_end = _RULES[order]
        central = low[k] <= theta[k] - reach and theta[k] + max(reach, step) <= high[k]
        offsets, outside, centre = inside if central else at_an_end
        side = -step if not central and theta[k] + max(offsets) * step > high[k] else step
        columns.append((len(points), centre / side, np.array(outside) / side))
        for offset in offsets:
            points.append(theta.copy())
            points[-1][k] += offset * side
    weights = np.zeros((len(points), theta.size))
    for k, (first, centre, outside) in enumerate(columns):
        weights[0, k], weights[first : first + outside.size, k] = centre, outside
    return points, weights


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

    residual: Real
    basis: Real

    @classmethod
    def of(cls, residual: Real, jacobian: Real) -> Projection:
        """Linearise; columns that add nothing to the others are left out of the basis."""
        return cls(residual, orthonormal(jacobian))

    @property
    def rank(self) -> int:
        """Number of parameter combinations that the data determine."""
        return int(self.basis.shape[1])

    def project_out(self, columns: Real) -> Real:
        """Part of a vector, or of each column, that no change of the parameters can produce.

        Examples
        --------
        >>> import numpy as np
        >>> line = np.column_stack([np.ones(3), [-1.0, 0.0, 1.0]])
        >>> Projection.of(np.zeros(3), line).project_out(np.array([0.0, 1.0, 2.0])).round(12) + 0.0
        array([0., 0., 0.])
        """
        return columns - self.basis @ (self.basis.T @ columns)


def orthonormal(columns: Real, tolerance: float = 1e-9) -> Real:
    """Orthonormal basis of the span of the columns, each counted at its own scale."""
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 0] / norms[norms > 0]
    if not columns.size:
        return np.zeros((columns.shape[0], 0))
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > tolerance * values[0]])


def held_inside(columns: Real, residual: Real, low: Real, high: Real) -> Real:
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
    bounds = low, np.maximum(high, np.nextafter(low, np.inf))  # apart
    found = lsq_linear(columns, -residual, bounds, method="bvls", tol=SETTLED, max_iter=10 * low.size)
    return np.asarray(np.clip(found.x, low, high))


def least_inside(
    residual: Callable[[Real], Real], slopes: Callable[[Real], Real], x: Real, low: Real, high: Real
) -> tuple[Real, float]:
    """The minimum inside bounds that descents lead to (Branch, Coleman & Li 1999), and the sum of squares there.

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
    bounds = low, np.maximum(high, np.nextafter(low, np.inf))  # apart
    inside = np.clip(x, *bounds)
    # 1e-9: share of the sum of squares below which a step is the last
    found = least_squares(residual, inside, slopes, bounds, x_scale="jac", ftol=1e-9, xtol=SETTLED)
    return found.x, float(2 * found.cost)


def covariance_root(covariance: Real) -> Real:
    """A matrix R with R R' the covariance, of rounding's negative eigenvalues freed."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def chi2_beside(gap: Real, root: Real) -> float:
    """g' (I + R R')^-1 g by Woodbury's formula: R has few columns, g may be long.

    Examples
    --------
    >>> import numpy as np
    >>> chi2_beside(np.array([2.0, 1.0]), np.array([[1.0], [0.0]]))
    3.0
    """
    inner = root.T @ gap
    return float(gap @ gap - inner @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ root, inner))
