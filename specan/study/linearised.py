"""Covariances that depend on where the model is, taken about a fit.

A microphone that stands two millimetres off reads the gradient of the field there: how much that is, only a fitted
model tells. The covariance is linearised about one fit, and then stays the same for every model that is
compared, so that chi-squares can be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from specan.models import Assembly
from specan.study.coarse import coarse_fit
from specan.study.problem import Problem


def linearised(problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},)) -> Problem:
    """The problem with covariances about a coarse fit of its own, and a start there; itself where they depend on none.

    Parameters
    ----------
    problem : Problem
    starts : sequence of mapping
        SI values from which the coarse fit sets out; those that lack stand as the problem has them.
    """
    if not problem.about_model:
        return problem
    values = coarse_fit(problem, starts)
    near = about(problem, problem.assembly, values)
    return replace(near, values={**near.values, **{name: values[name] for name in near.free}})


def about(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Problem:
    """The problem with covariances about a model at given values."""
    return problem.over([o.about(assembly, problem.seen_by(o, values)) for o in problem.observations])
