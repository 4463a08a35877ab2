"""A model brought near the data by whatever means, for covariances that depend on where the field is.

No verdict comes from here: the covariance is taken about the field that was found, and then every candidate is
looked at anew. Only which of them are looked at first is taken over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from specan.models import Use
from specan.study.candidates import candidates
from specan.study.coarse import coarse, coarse_fit
from specan.study.fit import fit
from specan.study.linearised import about
from specan.study.plan import plan
from specan.study.problem import Problem
from specan.study.refit import FAR, Refit, Refits
from specan.study.score import Scored, best_of_each, score
from specan.study.traces import Known, traces
from specan.study.ways_in import ways

TRIED = 4  # candidates that are refitted
MOST = 2  # effects
LIKELY = 2  # effects that a search should look at first


@dataclass(frozen=True, eq=False)
class Approach:
    """Where a search sets out.

    Attributes
    ----------
    base : Refit
        Fitted with covariances about a field that is near the measured one.
    likely : tuple of Use
        What came nearest by itself, the nearest first, and what the nearest pair has besides.
    """

    base: Refit
    likely: tuple[Use, ...] = ()


def approached(start: Refit, progress: Callable[[str], None]) -> Approach:
    """Look for a field near the measured one, where the base is far from it."""
    if not start.problem.about_model or start.reduced < FAR:
        return Approach(start)
    progress("looking for a field that is near the measured one")
    tried = _tried(start.problem)
    near = min(tried, key=lambda r: r.bic(1.0))
    single = sorted((r for r in tried if len(r.uses) == 1), key=lambda r: r.bic(1.0))
    likely = [*(use for r in single[:LIKELY] for use in r.uses), *sorted(near.uses)]
    return Approach(seen_about(start, near), tuple(dict.fromkeys(likely)))


def seen_about(start: Refit, near: Refit) -> Refit:
    """The base with covariances about the field of another fit, fitted."""
    problem = about(start.problem, near.problem.assembly, near.problem.values_at(near.fit.theta))
    return replace(start, problem=problem, fit=fit(problem, start=start.fit.theta))


def _tried(problem: Problem) -> list[Refit]:
    """Sets of up to two effects that a greedy search on a coarse view fits, the empty one included."""
    view = coarse(problem)
    best = Refit(frozenset(), view, fit(view, start=coarse_fit(problem)))
    refits = Refits(best)
    for _ in range(MOST):
        found, _ = candidates(best.problem)
        known: Known = {}
        points = plan(best.problem, best.fit, found, known)
        scored = best_of_each(
            score(best.linear, traces(best.problem, best.fit, found, points, known), best.weights)
        )
        order = sorted(scored.values(), key=lambda items: _promised(best, items[0]))[:TRIED]
        better = best
        for items in order:
            refit = refits.fit(
                best, [[item] for item in ways(best, [items[0].use]).get(items[0].use, items[:1])]
            )
            if refit is not None and refit.bic(1.0) < better.bic(1.0):
                better = refit
            if better.reduced < 1:  # within the few per cent of the view
                return list(refits.done.values())
        if better is best:
            break
        best = better
    return list(refits.done.values())


def _promised(best: Refit, item: Scored) -> float:
    count = item.amplitudes + len(item.trace.shapes)
    return -item.gain + count * float(np.log(best.problem.n_effective))
