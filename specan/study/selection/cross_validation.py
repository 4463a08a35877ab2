"""Blocked cross-validation: how well a fit predicts conditions that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from specan.study.estimation.projection import Projection

Array = NDArray[np.float64]
MOST_LEVELS = 12  # blocks of one operating variable


def blocks(labels: Mapping[str, Array], n_data: int) -> list[NDArray[np.intp]]:
    """Rows that are left out together: every level of every operating variable, one after the other.

    Random subsets would leak, since neighbouring lines and repeats share their errors. A variable
    with many values is cut into twelve groups of neighbours.

    Parameters
    ----------
    labels : mapping
        Values of the operating variables, one a row.
    n_data : int
        Number of data rows (those of priors follow them and are never left out).
    """
    found = []
    for values in labels.values():
        values = np.asarray(values)[:n_data]
        levels, index = np.unique(values, return_inverse=True)
        if levels.size > MOST_LEVELS:
            index = index * MOST_LEVELS // levels.size
        groups = [np.flatnonzero(index == level) for level in np.unique(index)]
        found += groups if len(groups) > 2 else []
    return found


def score(fit: Projection, left_out: Sequence[NDArray[np.intp]], dispersion: float = 1.0) -> float:
    """Minus twice the log predictive density of all left-out blocks, up to a constant.

    Without block b, linearised, the residual of b is (I - H_bb)^-1 r_b with covariance
    (I - H_bb)^-1, so that no refit is needed:

        S_b = r_b^T (I - H_bb)^-1 r_b / dispersion - ln det(I - H_bb).

    A direction that only block b determines is given a weak prior instead of an infinite variance.
    """
    total = 0.0
    for rows in left_out:
        part, residual = fit.basis[rows], fit.residual[rows]
        values, vectors = np.linalg.eigh(part.T @ part)
        left = np.clip(1.0 - values, 1e-3, 1.0)
        along = (part @ vectors).T @ residual
        total += float(residual @ residual + np.sum(along**2 / left)) / dispersion - float(
            np.sum(np.log(left))
        )
    return total


def gain(
    base: Projection, extended: Projection, left_out: Sequence[NDArray[np.intp]], dispersion: float = 1.0
) -> float:
    """Score of the base less that of the extended fit; positive where the extension predicts better."""
    return score(base, left_out, dispersion) - score(extended, left_out, dispersion)
