"""Starts for models that are integrated, where a fit ends far from the recording.

Over a whole recording the sum of squares of a model that drifts out of step has minima everywhere (Voss, Timmer and
Kurths 2004, Int. J. Bifurcation Chaos 14:1905). Over its first moments it has few. What fits these is the start for
twice as long, and so on to the end, if the effects are the right ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.models.rates import TIME
from specan.study.estimation.levenberg_marquardt import NotSettledError, descend
from specan.study.estimation.problem import Problem
from specan.study.observation.time import TimeObservation

FAR = 0.5  # of the RMS of what is measured, from which a straight line from a fit leads nowhere
LEAST = 10  # samples for each parameter, of the first moments


def growing(problem: Problem, values: Mapping[str, Any]) -> tuple[dict[str, Any], float] | None:
    """The same as `grown`; None where the model is near the measurement at these values."""
    recordings = [o for o in problem.observations if isinstance(o, TimeObservation)]
    return grown(problem) if any(far(o, problem, values) for o in recordings) else None


def grown(problem: Problem) -> tuple[dict[str, Any], float]:
    """Values of parameters that a fit of longer and longer parts of the recordings ends at, and chi-square there."""
    observations = [o for o in problem.observations if isinstance(o, TimeObservation)]
    theta, rows = problem.start(), sum(o.n for o in observations)
    halvings = int(np.log2(max(rows / (LEAST * max(theta.size, 1)), 1)))
    for share in 0.5 ** np.arange(halvings, -1, -1.0):
        kept = tuple(o.take(_beginning(o, share)) for o in observations)
        try:
            theta = descend(replace(problem, observations=kept), theta).theta
        except NotSettledError as fault:
            theta = fault.reached.theta
        except ComputationError:
            continue
    return problem.values_at(theta), float(np.sum(problem.residual(theta) ** 2))


def far(o: TimeObservation, problem: Problem, values: Mapping[str, Any]) -> bool:
    """Whether a model leaves much of a recording at some values."""
    error = o.measured - o.predict(problem.assembly, problem.values_at(problem.start(values)))
    rows = [np.concatenate(chains) for chains in o.chains.values()]
    return not all(np.mean(error[own] ** 2) < FAR**2 * np.var(o.measured[own]) for own in rows)


def _beginning(o: TimeObservation, share: float) -> NDArray[np.bool_]:
    """Rows in a share of each recording."""
    found = np.zeros(o.n, bool)
    for rows in (rows for chains in o.chains.values() for rows in chains):
        time = o.conditions[TIME][rows]
        found[rows[time - time[0] <= share * (time[-1] - time[0])]] = True
    return found
