"""How a model predicts conditions that it was not fitted to: each level of each operating variable in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.study.estimation.fit import Fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.linear import Projection
from specan.study.estimation.prediction_error import ObservableError, errors_of
from specan.study.estimation.problem import Problem
from specan.study.observation.table import TableObservation

MOST_LEVELS = 12  # blocks of one operating variable
MOST_ROWS = 400  # above which the fits cost more than the verdict


def left_out_errors(problem: Problem, fit: Fit) -> list[ObservableError]:
    """Errors of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The model is fitted anew without every block, and predicts it. None where nothing can be left out, where a fit
    without a block fails, and where rows are many. The observable with most values comes first.
    """
    observation = problem.observations[0]
    blocks = left_out_blocks(problem)
    if not blocks or len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return []
    if problem.strategy.frugal or observation.n > MOST_ROWS:
        return []
    (slopes,), predicted = problem.sensitivities(fit.theta), []
    for block in blocks:
        kept = np.ones(observation.n, dtype=bool)
        kept[block] = False
        rest = problem.over([observation.without(block)])
        if rest.n_data + rest.n_priors < len(rest.names):
            return []
        try:
            near = [rest.observations[0].whiten(slopes[kept]), fit.jacobian[problem.n_data :]]
            theta = descend(rest, fit.theta, np.concatenate(near)).theta
        except ComputationError:
            return []
        predicted.append(problem.over([observation.take(~kept)]).predictions(theta)[0])
    rows = np.concatenate(blocks)
    return errors_of(
        problem, observation.observable[rows], np.concatenate(predicted), observation.measured[rows]
    )


def left_out_blocks(problem: Problem) -> list[NDArray[np.intp]]:
    """Rows that cross-validation leaves out together, numbered over all observations."""
    found, first = [], 0
    for observation in problem.observations:
        found += [rows + first for rows in blocks(observation.labels)]
        first += observation.n
    return found


def blocks(labels: Mapping[str, NDArray[Any]]) -> list[NDArray[np.intp]]:
    """Rows at every level of every operating variable, one after the other.

    Random subsets would leak, since neighbouring lines and repeats share their errors. A variable
    with many values is cut into twelve groups of neighbours.
    """
    found = []
    for values in labels.values():
        levels, index = np.unique(np.asarray(values), return_inverse=True)
        if levels.size > MOST_LEVELS:
            index = index * MOST_LEVELS // levels.size
        groups = [np.flatnonzero(index == level) for level in np.unique(index)]
        found += groups if len(groups) > 2 else []
    return found


def left_out_score(fit: Projection, left_out: Sequence[NDArray[np.intp]], dispersion: float = 1.0) -> float:
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
