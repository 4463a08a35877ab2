"""Fits that find their way from afar: all lines equally uncertain, by much at first, then by less.

A resonance that is half a bandwidth off pulls a sharp fit anywhere: into instruments beyond their certificates,
into another minimum. Seen with an uncertainty of a third of the sound field's level, peaks only have to lie near
each other, and certificates weigh more than lines; where that fit ends, one with less begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from specan.errors import ComputationError
from specan.study.descent import descend, led_lowest
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
    first, last = (coarse(problem, percent) for percent in STAGES)
    near: list[Array] = []
    reason = ""
    for values in starts:
        try:
            near.append(descend(first, problem.start(values)).theta)
        except ComputationError as fault:
            reason = fault.found
    try:
        return problem.values_at(descend(last, led_lowest(last, near)).theta)
    except ComputationError as fault:
        raise ComputationError(
            f"a first fit failed: {reason or fault.found}",
            remedy="give other start values or narrower bounds",
        ) from fault
