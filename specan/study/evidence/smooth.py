"""Smooth functions over the operating variables: what an equation may err by, and what no equation describes.

Their values have the covariance exp(-d^2 / 2), d the distance of two operating points in units of a length, each
variable on a scale of 0 to 1 over its measured range.
"""

from __future__ import annotations

import numpy as np

from specan.study.data.setpoints import operating
from specan.study.data.table_covariance import stretched
from specan.study.estimation.problem import Problem
from specan.study.observation import Array


def operating_variables(problem: Problem) -> list[Array]:
    """Those that vary, of all measured rows."""
    names = operating(problem.assembly.model, problem.observations[0].conditions)
    each = [
        np.concatenate([np.asarray(o.conditions[name], float) for o in problem.observations])
        for name in names
        if all(name in o.conditions for o in problem.observations)
    ]
    return [x for x in each if np.ptp(x) > 0]


def operating_points(problem: Problem) -> Array:
    """Operating variables of all measured rows, each from 0 to 1 over its range; shape (n, d)."""
    columns = [stretched(x, float(x.min()), float(x.max())) for x in operating_variables(problem)]
    return np.stack(columns, axis=1) if columns else np.zeros((problem.n_data, 0))


def kernel_root(points: Array, length: float) -> Array:
    """Columns R with R R' the covariance of a smooth function, by pivoted Cholesky decomposition.

    Parameters
    ----------
    points : array, shape (n, d)
    length : float
        Over which the function changes, in ranges of a variable.

    Examples
    --------
    >>> import numpy as np
    >>> root = kernel_root(np.linspace(0, 1, 50)[:, None], 0.5)
    >>> root.shape[1] < 10, bool(np.all(np.abs(np.sum(root**2, axis=1) - 1) < 1e-3))
    (True, True)
    """
    left = np.ones(points.shape[0])
    columns: list[Array] = []
    # 1e-3: of the variance, that a root may leave out
    # 100: columns of a root
    while left.max() > 1e-3 and len(columns) < 100:
        k = int(np.argmax(left))
        column = np.exp(-0.5 * np.sum(((points - points[k]) / length) ** 2, axis=1))
        for other in columns:
            column = column - other * other[k]
        column /= np.sqrt(left[k])
        columns.append(column)
        left = np.maximum(left - column**2, 0.0)
    return np.stack(columns, axis=1)
