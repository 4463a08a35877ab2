"""Fits that find their way from afar: all lines equally uncertain, by much at first, then by less.

A resonance that is half a bandwidth off pulls a sharp fit anywhere: into instruments beyond their certificates,
into another minimum. Seen with an uncertainty of a third of the sound field's level, peaks only have to lie near
each other, and certificates weigh more than lines; where that fit ends, one with less begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from specan.errors import ComputationError
from specan.study.estimation.levenberg_marquardt import LED, descend_a_little, led_lowest
from specan.study.estimation.problem import Problem
from specan.study.observation import Array

STAGES = (20.0, 5.0)  # per cent of the RMS over channels
GO_ON = 2  # of several starts
ENOUGH = 8  # Jacobians a stage: what a fit still gains then, such uncertainties do not tell from nothing


def coarse(problem: Problem, percent: float = STAGES[-1], values: Mapping[str, Any] | None = None) -> Problem:
    """The problem on few lines of recordings, each known to so many per cent of the level around it.

    No windows are in it; where values of a fit are given, what the windows do to that fit is taken off the data.
    """
    seen = problem.observations
    if values is not None:
        seen = tuple(o.unfolded(problem.assembly, problem.seen_by(o, values)) for o in seen)
    return problem.over([o.coarse(percent) for o in seen])


def coarse_fit(
    problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},), rough: bool = False
) -> dict[str, Any]:
    """SI values where a fit in stages ends, the best of several starts.

    Of many starts the two that some Jacobians lead lowest go on. A coarse view is blind to small effects: of starts,
    and of what it makes of them, that meet it equally well, a sketch with the windows chooses; not where a `rough` fit
    will do.

    Raises
    ------
    ComputationError
        No start leads anywhere.
    """
    first, last = (coarse(problem, percent) for percent in STAGES)
    near: list[Array] = []
    reason = ""
    for values in starts:
        try:
            few = LED if len(starts) > GO_ON else ENOUGH
            near.append(descend_a_little(first, problem.start(values), few))
        except ComputationError as fault:
            reason = fault.found
    near = sorted(near, key=lambda theta: _chi2(first, theta))[:GO_ON]
    try:
        theta = descend_a_little(last, led_lowest(last, near), ENOUGH)
    except ComputationError as fault:
        raise ComputationError(
            f"a first fit failed: {reason or fault.found}",
            remedy="give other start values or narrower bounds",
        ) from fault
    if len(starts) == 1 or rough:
        return problem.values_at(theta)
    plain = coarse(problem, values=problem.values_at(theta))  # what windows do would hide a small effect
    given = [problem.start(values) for values in starts]
    reached = [
        (_chi2(plain, t), t) for t in (theta, *given, *(descend_a_little(plain, t, LED) for t in near))
    ]
    met = max(min(chi2 for chi2, _ in reached), plain.n_data)
    return problem.values_at(_nearest(problem, [t for chi2, t in reached if chi2 <= met]))


def _nearest(problem: Problem, thetas: Sequence[Array]) -> Array:
    """That of several places from where some Jacobians lead lowest, each on a sketch of its own."""
    if len(thetas) == 1:
        return thetas[0]
    reached: list[tuple[float, Array]] = []
    for theta in thetas:
        sketch = problem.sketched(theta)
        there = descend_a_little(sketch, theta, LED)
        reached.append((_chi2(sketch, there), there))
    return min(reached, key=lambda r: r[0])[1]


def _chi2(problem: Problem, theta: Array) -> float:
    """Sum of squares; infinite where the model has no value, which is no reason to give up the other starts."""
    try:
        residual = problem.residual(theta)
    except ComputationError:
        return float("inf")
    return float(residual @ residual)
