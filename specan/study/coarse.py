"""Fits that find their way from afar: all lines equally uncertain, by much at first, then by less.

A resonance that is half a bandwidth off pulls a sharp fit anywhere: into instruments beyond their certificates,
into another minimum. Seen with an uncertainty of a third of the sound field's level, peaks only have to lie near
each other, and certificates weigh more than lines; where that fit ends, one with less begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from specan.errors import ComputationError
from specan.study.descent import descend
from specan.study.observation import Array
from specan.study.problem import Problem

STAGES = (20.0, 5.0)  # per cent of the RMS over microphones


def coarse(problem: Problem, percent: float = STAGES[-1], values: Mapping[str, Any] | None = None) -> Problem:
    """The problem on few lines of recordings, each known to so many per cent of the level around it.

    No windows are in it; where values of a fit are given, what the windows do to that fit is taken off the data.
    """
    seen = problem.observations
    if values is not None:
        seen = tuple(o.unfolded(problem.assembly, problem.seen_by(o, values)) for o in seen)
    return problem.over([o.coarse(percent) for o in seen])


def coarse_fit(problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},)) -> dict[str, Any]:
    """SI values where a fit in stages ends, the best of several starts.

    Raises
    ------
    ComputationError
        No start leads anywhere.
    """
    views = [coarse(problem, percent) for percent in STAGES]
    best: tuple[float, Array] | None = None
    reason = ""
    for values in starts:
        try:
            chi2, theta = _staged(views, problem.start(values))
        except ComputationError as fault:
            reason = fault.found
            continue
        if best is None or chi2 < best[0]:
            best = chi2, theta
    if best is None:
        raise ComputationError(
            f"a first fit failed: {reason}", remedy="give other start values or narrower bounds"
        )
    return problem.values_at(best[1])


def _staged(views: Sequence[Problem], theta: Array) -> tuple[float, Array]:
    chi2 = float("inf")
    for view in views:
        found = descend(view, theta)
        chi2, theta = found.chi2, found.theta
    return chi2, theta
