"""A model brought near the data by whatever means, for covariances that depend on where the field is.

No verdict comes from here: the covariance is taken about the field that was found, and then every candidate is
looked at anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from specan.study.candidates import candidates
from specan.study.fit import fit
from specan.study.linearised import about
from specan.study.plan import plan
from specan.study.refit import Refit, Refits
from specan.study.score import Scored, best_of_each, score
from specan.study.thinning import thinned
from specan.study.traces import Known, traces

FAR = 1.5  # reduced chi-square above which the field is not where the base model has it
NEAR = 5.0  # and below which a field that was found is near enough
TRIED = 3  # candidates that are refitted
MOST = 2  # effects


def approached(start: Refit, progress: Callable[[str], None]) -> Refit:
    """The base with covariances about a field that is near the measured one, fitted; itself where it is near."""
    if not start.problem.about_model or start.reduced < FAR:
        return start
    progress("looking for a field that is near the measured one")
    near = _near(thinned(start))
    problem = about(start.problem, near.problem.assembly, near.problem.values_at(near.fit.theta))
    return replace(start, problem=problem, fit=fit(problem, start=start.fit.theta))


def _near(seen: Refit) -> Refit:
    """The best set of up to two effects that a greedy search on the sketch finds."""
    refits, best = Refits(seen), seen
    for _ in range(MOST):
        found, _ = candidates(best.problem)
        known: Known = {}
        points = plan(best.problem, best.fit, found, known)
        scored = best_of_each(
            score(best.linear, traces(best.problem, best.fit, found, points, known), best.weights)
        )
        order = sorted(scored.values(), key=lambda items: _promised(best, items[0]))[:TRIED]
        tried = [refits.fit(best, [[items[0]]]) for items in order]
        better = min((r for r in tried if r is not None), key=lambda r: r.bic(1.0), default=best)
        if better.bic(1.0) >= best.bic(1.0):
            break
        best = better
        if best.reduced < NEAR:
            break
    return best


def _promised(best: Refit, item: Scored) -> float:
    count = item.amplitudes + len(item.trace.shapes)
    return -item.gain + count * float(np.log(best.problem.n_effective))
