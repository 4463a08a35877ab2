"""How a model predicts conditions that it was not fitted to: each level of each operating variable in turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.study.estimation.fit import Fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.prediction_error import ObservableError, errors_of
from specan.study.estimation.problem import Problem
from specan.study.observation.table import TableObservation


def left_out_errors(problem: Problem, fit: Fit) -> list[ObservableError]:
    """Errors of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The model is fitted anew without every block, and predicts it. None where nothing can be left out, where a fit
    without a block fails, and where rows are many. The observable with most values comes first.
    """
    observation, *others = problem.observations
    if others or not isinstance(observation, TableObservation):
        return []
    left_out = blocks(observation.labels)
    # 400: rows above which the fits cost more than the verdict
    if not left_out or problem.strategy.frugal or observation.n > 400:
        return []
    (slopes,), predicted = problem.sensitivities(fit.theta), []
    for block in left_out:
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
    rows = np.concatenate(left_out)
    return errors_of(
        problem, observation.observable[rows], np.concatenate(predicted), observation.measured[rows]
    )


def blocks(labels: Mapping[str, NDArray[Any]]) -> list[NDArray[np.intp]]:
    """Rows at every level of every operating variable, one after the other.

    Random subsets would leak, since neighbouring lines and repeats share their errors. A variable
    with many values is cut into twelve groups of neighbours.
    """
    most = 12  # blocks of one operating variable
    found = []
    for values in labels.values():
        levels, index = np.unique(np.asarray(values), return_inverse=True)
        if levels.size > most:
            index = index * most // levels.size
        groups = [np.flatnonzero(index == level) for level in np.unique(index)]
        found += groups if len(groups) > 2 else []
    return found
