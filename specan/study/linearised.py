"""Covariances that depend on where the model is, taken about a fit.

A microphone that stands two millimetres off reads the gradient of the field there: how much that is, only a fitted
model tells. The covariance is linearised about one fit, and then stays the same for every model that is
compared, so that chi-squares can be.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.models import Assembly
from specan.study.fit import fit
from specan.study.problem import Problem


def linearised(problem: Problem) -> Problem:
    """The problem with covariances about a fit of its own; itself where they depend on none."""
    if not problem.about_model:
        return problem
    return about(problem, problem.assembly, problem.values_at(fit(problem).theta))


def about(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Problem:
    """The problem with covariances about a model at given values."""
    return problem.over([o.about(assembly, problem.seen_by(o, values)) for o in problem.observations])
