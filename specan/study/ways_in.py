"""Where the fit of a changed model sets out: what was fitted before, and sizes and shapes for what is new.

A resonator declared at 150 Hz does not find its own resonance at 230 Hz by going downhill. What is new is
therefore tried over the range of its shapes first, as a candidate of a diagnosis is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.study.candidates import candidates
from specan.study.coarse import coarse, coarse_fit
from specan.study.fit import fit
from specan.study.plan import plan
from specan.study.problem import Problem
from specan.study.refit import Refit, start_from
from specan.study.score import Scored, best_of_each, different, score
from specan.study.traces import Known, traces

STARTS = 3


def ways_in(problem: Problem, new: Sequence[Use], known: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """SI values to start from: the problem's own, and those known with several ways for the uses that are new."""
    starts: list[Mapping[str, Any]] = [{}, known] if known else [{}]
    if not new or not problem.resonant:
        return starts
    lean = problem
    for use in new:
        lean = lean.without(use)
    try:
        values = coarse_fit(lean, [known])
    except ComputationError:  # without what is new nothing fits: the declared values must do
        return starts
    view = coarse(lean)
    base = Refit(frozenset(), view, fit(view, start=values))
    found = list(ways(base, new).values())
    for k in range(max((len(w) for w in found), default=0)):
        starts.append(start_from(base, [w[min(k, len(w) - 1)] for w in found], problem))
    return starts


def ways(refit: Refit, uses: Sequence[Use]) -> dict[Use, list[Scored]]:
    """Traces of few candidates over all of their shapes: the best of each, and others that lie apart."""
    known: Known = {}
    found = [c for c in candidates(refit.problem)[0] if c.use in uses]
    if not found:
        return {}
    points = plan(refit.problem, refit.fit, found, known)
    scored = score(refit.linear, traces(refit.problem, refit.fit, found, points, known), refit.weights)
    return {use: different(items, STARTS) for use, items in best_of_each(scored).items()}


def kept_values(problem: Problem, table: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """SI values by the name of the parameter out of a step's table by the name of the element.

    What the problem no longer has is left out.
    """
    elements: dict[str, dict[str, float]] = {}
    for name, row in table.items():
        plain = name.split("[")[0]
        if plain in problem.free:
            elements.setdefault(plain, {})[name] = problem.assembly.parameters[plain].to_si(row["value"])
    found: dict[str, Any] = {}
    for plain, own in elements.items():
        names = [f"{plain}[{e}]" for e in problem.elements.get(plain, ())] or [plain]
        if all(name in own for name in names):
            found[plain] = np.array([own[n] for n in names]) if plain in problem.elements else own[plain]
    return found
