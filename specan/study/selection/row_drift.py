"""Readings that move with the order of the rows: a drift that a table without times hides as scatter of repeats."""

from __future__ import annotations

import numpy as np

from specan.study.observation.table import TableObservation
from specan.study.selection.f_test import LACK_OF_FIT
from specan.study.selection.refits import Refit
from specan.units import printed_unit

TIME = "elapsed_time"
LEAST_DOF = 8.0  # of the differences between repeats, below which no drift is told


def drift_over_rows(base: Refit) -> str:
    """A sentence where repeats of the same conditions differ the more the further they lie apart in the table.

    Only differences between repeats are looked at, so that the order of the conditions plays no part: the slope of
    what the model leaves over the number of the row, both about the means of their replicate groups, in Student's
    test. Empty where the table holds the time (then a drift is an effect like any other), where nothing is repeated
    and where nothing drifts.
    """
    problem, observation = base.problem, base.problem.observations[0]
    if len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return ""
    if observation.lines is None or observation.replicate_group is None or TIME in observation.available:
        return ""
    from scipy.special import stdtr

    _, index, counts = np.unique(observation.replicate_group, return_inverse=True, return_counts=True)
    rows = observation.lines - observation.lines.min()
    span = float(np.ptp(rows))
    weight = 1.0 / observation.sigma
    mass = np.bincount(index, weight**2)

    def centred(column: np.ndarray) -> np.ndarray:
        return np.asarray(column - (np.bincount(index, weight**2 * column) / mass)[index]) * weight

    left = centred(observation.measured - problem.predictions(base.fit.theta)[0])
    order = centred(rows / max(span, 1.0))
    dof, size = float(np.sum(counts - 1)) - 1, float(order @ order)
    if dof < LEAST_DOF or size <= 0:
        return ""
    slope = float(order @ left) / size
    error = float(np.sqrt(max(float(np.sum((left - slope * order) ** 2)), 1e-300) / dof / size))
    chance = 2 * float(stdtr(dof, -abs(slope) / error))
    if chance >= LACK_OF_FIT:
        return ""
    measured = problem.assembly.model.observables[str(observation.observable[0])]
    unit = f" {printed_unit(measured.unit)}".rstrip()
    return (
        f"repeats of the same conditions move by {slope:+.2g}{unit} from the first row to the last (p = {chance:.1g}): "
        "a zero that drifts, or a machine that changes; give elapsed_time_s for each row, and both are tested"
    )
