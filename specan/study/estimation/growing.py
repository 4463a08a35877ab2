"""Starts for models that are integrated, where a fit ends far from the recording.

Over a whole recording the sum of squares of a model that drifts out of step has minima everywhere (Voss, Timmer and
Kurths 2004, Int. J. Bifurcation Chaos 14:1905). Over its first moments it has few. What fits these is the start for
a little longer, and so on to the end, if the effects are the right ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from specan.errors import ComputationError
from specan.study.estimation.levenberg_marquardt import NotSettledError, descend
from specan.study.estimation.problem import Problem
from specan.study.observation.time import TimeObservation

# Assumed, as are the 10 samples for each parameter of the first moments, and the 5 models that go on to the end.
FAR = 0.5  # of the RMS of what is measured, from which a straight line from a fit leads nowhere
LONGER = 1.4  # each part than the one before, and models that go on


class Grown(NamedTuple):
    """Values of parameters, the share of the recordings that they were fitted to, and chi-square over that."""

    values: dict[str, Any]
    share: float
    chi2: float


def growing(problem: Problem, values: Mapping[str, Any]) -> dict[str, Any] | None:
    """Values at which a fit of longer and longer parts ends; None where the model is near the measurement at these."""
    return grown([problem])[0].values if far(problem, values) else None


def grown(problems: Sequence[Problem]) -> list[Grown]:
    """Fits of longer and longer parts of the same recordings by several models, of which ever fewer go on."""
    theta, found = [p.start() for p in problems], [Grown({}, 0.0, np.inf) for _ in problems]
    observations = [o for o in problems[0].observations if isinstance(o, TimeObservation)]
    rows, most = sum(o.n for o in observations), max(1, *(t.size for t in theta))
    parts, running = int(np.log(max(rows / (10 * most), 1)) / np.log(LONGER)), list(range(len(problems)))
    for share in LONGER ** -np.arange(parts, -1, -1.0):
        kept = tuple(o.beginning(share) for o in observations)
        for k in running:
            chi2 = np.inf
            try:
                best = descend(replace(problems[k], observations=kept), theta[k])
                theta[k], chi2 = best.theta, best.chi2
            except NotSettledError as fault:
                theta[k], chi2 = fault.reached.theta, fault.reached.chi2
            except ComputationError:
                pass
            found[k] = Grown(problems[k].values_at(theta[k]), share, chi2)
        running = sorted(running, key=lambda k: found[k].chi2)[: max(5, int(len(running) / LONGER))]
    return found


def far(problem: Problem, values: Mapping[str, Any]) -> bool:
    """Whether a model leaves much of the recordings at some values."""
    theta = problem.start(values)
    for o, predicted in zip(problem.observations, problem.predictions(theta), strict=True):
        for rows in map(np.concatenate, o.chains.values() if isinstance(o, TimeObservation) else ()):
            error = np.mean((o.measured - predicted)[rows] ** 2)
            if not error < FAR**2 * np.var(o.measured[rows]):
                return True
    return False
