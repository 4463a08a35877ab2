"""Starts for models that are integrated, where a fit ends far from the recording.

Over a whole recording the sum of squares of a model that drifts out of step has minima everywhere (Voss, Timmer and
Kurths 2004, Int. J. Bifurcation Chaos 14:1905). Over its first moments it has few, of which starts from several shapes
of an effect find the lowest. What fits these is the start for a little longer, and so on to the end, if the effects are
the right ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from specan.errors import ComputationError
from specan.study.estimation.levenberg_marquardt import Minimum, NotSettledError, descend
from specan.study.estimation.problem import Problem
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation
from specan.study.selection.candidates import grid

# Assumed, as are the 10 samples for each parameter of the first moments, the 5 models that go on to the end, and:
SHAPES = 9  # places of a shape
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
    found = [Grown({}, 0.0, np.inf) for _ in problems]
    observations = [o for o in problems[0].observations if isinstance(o, TimeObservation)]
    rows, most = sum(o.n for o in observations), max(1, *(p.start().size for p in problems))
    parts, running = int(np.log(max(rows / (10 * most), 1)) / np.log(LONGER)), list(range(len(problems)))
    begun = [_beginnings(p) for p in problems]
    for share in LONGER ** -np.arange(parts, -1, -1.0):
        kept = tuple(o.beginning(share) for o in observations)
        for k in running:
            part = replace(problems[k], observations=kept)
            chi2, theta = min((_descended(part, start) for start in begun[k]), key=lambda one: one[0])
            begun[k], found[k] = [theta], Grown(problems[k].values_at(theta), share, chi2)
        running = sorted(running, key=lambda k: found[k].chi2)[: max(5, int(len(running) / LONGER))]
    return found


def _beginnings(problem: Problem) -> list[Array]:
    """The usual values, and those with one shape of an effect elsewhere in its plausible range."""
    assembly, starts = problem.assembly, [problem.start()]
    for use in assembly.uses:
        effect = assembly.model.effects[use.name]
        for name in (f"{use}.{own}" for own in effect.parameters if own not in effect.neutral):
            if name in problem.free:
                starts += [problem.start({name: v}) for v in grid(*problem.plausible(name), SHAPES)]
    return starts


def _descended(problem: Problem, theta: Array) -> tuple[float, Array]:
    """Chi-square and place that a descent comes to."""
    try:
        best: Minimum = descend(problem, theta)
    except NotSettledError as fault:
        best = fault.reached
    except ComputationError:
        return np.inf, theta
    return best.chi2, best.theta


def far(problem: Problem, values: Mapping[str, Any]) -> bool:
    """Whether a model leaves much of the recordings at some values."""
    theta = problem.start(values)
    for o, predicted in zip(problem.observations, problem.predictions(theta), strict=True):
        for rows in map(np.concatenate, o.chains.values() if isinstance(o, TimeObservation) else ()):
            error = np.mean((o.measured - predicted)[rows] ** 2)
            if not error < FAR**2 * np.var(o.measured[rows]):
                return True
    return False
