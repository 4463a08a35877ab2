"""Covariances that depend on where the model is, taken about a fit.

A receiver that stands two millimetres off reads the gradient of the field there: how much that is, only a fitted
model tells. The covariance is linearised about one fit, and then stays the same for every model that is
compared, so that chi-squares can be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from specan.models import Assembly
from specan.study.estimation.continuation import continuation_fit
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem

JACOBIANS = 3  # of all lines, about whose end the covariance is taken


def linearised(problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},)) -> Problem:
    """The problem with covariances about a fit of its own, and a start there; itself where they depend on none.

    A continuation fit is not near enough, because it does not see the windows: a receiver's gain, say, would act on
    another field than its calibration's uncertainty does, and seem to be known better than the calibration.
    From there all lines are fitted by a few steps, and the covariances taken about that.

    Parameters
    ----------
    problem : Problem
    starts : sequence of mapping
        SI values from which the continuation fit sets out; those that lack stand as the problem has them.
    """
    if not problem.strategy.linearised_covariance:
        return problem
    values: Mapping[str, Any] = continuation_fit(problem, starts)
    near = about(problem, problem.assembly, values)
    theta = descend_steps(near, near.start(values), JACOBIANS)
    values = problem.values_at(theta)
    return replace(
        about(problem, problem.assembly, values),
        values={**problem.values, **{name: values[name] for name in problem.free}},
    )


def about(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Problem:
    """The problem with covariances about a model at given values."""
    return problem.over([o.about(assembly, problem.seen_by(o, values)) for o in problem.observations])
