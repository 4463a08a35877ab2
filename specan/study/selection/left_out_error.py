"""Error on conditions that were left out, in the unit of the measurement: cross-validation that a person can read."""

from __future__ import annotations

import numpy as np

from specan.errors import ComputationError
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.prediction_error import ObservableError, errors_of
from specan.study.observation.table import TableObservation
from specan.study.selection.acceptance import left_out_blocks
from specan.study.selection.refits import Refit

MOST_ROWS = 400  # above which the refits cost more than the verdict


def left_out_error(refit: Refit) -> ObservableError | None:
    """Error of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The model is fitted anew without every block, and predicts it. None where nothing can be left out, where a fit
    without a block fails, and where rows are many.
    """
    problem, observation = refit.problem, refit.problem.observations[0]
    blocks = left_out_blocks(problem)
    if not blocks or len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return None
    if not problem.strategy.secondary_refits or observation.n > MOST_ROWS:
        return None
    (slopes,), predicted = problem.sensitivities(refit.fit.theta), []
    for block in blocks:
        kept = np.ones(observation.n, dtype=bool)
        kept[block] = False
        rest = problem.over([observation.take(kept)])
        if rest.n_data + rest.n_priors < len(rest.names):
            return None
        try:
            near = [rest.observations[0].whiten(slopes[kept]), refit.fit.jacobian[problem.n_data :]]
            theta = descend(rest, refit.fit.theta, np.concatenate(near)).theta
        except ComputationError:
            return None
        predicted.append(problem.over([observation.take(~kept)]).predictions(theta)[0])
    rows = np.concatenate(blocks)
    return errors_of(
        problem, observation.observable[rows], np.concatenate(predicted), observation.measured[rows]
    )[0]
