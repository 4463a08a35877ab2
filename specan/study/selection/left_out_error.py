"""Error on conditions that were left out, in the unit of the measurement: cross-validation that a person can read."""

from __future__ import annotations

import numpy as np

from specan.study.estimation.prediction_error import ObservableError, errors_of
from specan.study.observation.table import TableObservation
from specan.study.selection.acceptance import left_out_blocks
from specan.study.selection.refits import Refit


def left_out_error(refit: Refit) -> ObservableError | None:
    """Error of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The fit without a block follows from the whole one by one linear step, as in `cross_validation`. None where
    nothing can be left out, and where an evaluation of the model is dear.
    """
    problem, fit = refit.problem, refit.fit
    blocks = left_out_blocks(problem)
    observation = problem.observations[0]
    if problem.dear or not blocks or len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return None
    (slopes,), (predicted,) = problem.sensitivities(fit.theta), problem.predictions(fit.theta)
    low, high = problem.bounds()
    rows, values = [], []
    for block in blocks:
        kept = np.setdiff1d(np.arange(fit.residual.size), block)
        columns = fit.jacobian[kept] * problem.scale
        step, *_ = np.linalg.lstsq(columns, -fit.residual[kept], rcond=1e-8)
        theta = np.clip(fit.theta + step * problem.scale, low, high)
        rows.append(block)
        values.append(predicted[block] + slopes[block] @ (theta - fit.theta))
    chosen = np.concatenate(rows)
    return errors_of(problem, observation.observable[chosen], np.concatenate(values), observation.measured[chosen])[0]
