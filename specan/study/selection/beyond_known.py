"""Effects of a size beyond what is known of them, which the data alone would take.

A known range pulls at a size outside of it, and the set that a search finds best has paid for its pulls. A real size
may lie beyond the range all the same, and then another effect of a known size that looks much like it is named. So
every single effect that improves the model is fitted once more with its sizes free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from specan.errors import ComputationError
from specan.models.effect import ParameterName
from specan.study.estimation.fit import describe
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.pulls import Pull, pulls
from specan.study.selection.refits import Refit
from specan.study.selection.score_test import different
from specan.study.selection.search import STARTS, Search

MOST_BEYOND = 10.0  # times the largest size known: what would need a larger one is ruled out by what is known


def refit_promising(search: Search) -> None:
    """Refit every single effect whose score promises to improve the base, where a refit is cheap.

    A score is taken along a straight line. Where an effect and a part of the base multiply each other, as a preload and
    the factor of bearing friction, it promises less than half of what the refit gives.
    """
    step = search.step(search.base)
    if not search.base.problem.strategy.secondary_refits:
        return
    for items in step.by_use.values():
        if step.start.promised(items[0]) < 0:
            search.refits.fit(step.seen, [[item] for item in different(items, STARTS)])


def sizes_beyond(search: Search, sets: Sequence[Refit]) -> list[tuple[Refit, tuple[Pull, ...]]]:
    """Single effects outside a verdict that meet the data as well as its best set, with a size beyond what is known.

    As well is a BIC within 6 of the best, pulls of its own sizes not counted. Beside the fit stand those sizes, none
    more than an order of magnitude beyond.
    """
    best, found = search.best, []
    if not search.base.problem.strategy.secondary_refits:
        return []
    least = best.bic(best.dispersion)
    for refit in search.refits.of_size(1):
        if refit in sets or refit.uses <= best.uses:
            continue
        free = _with_free_sizes(refit)
        if free is None or free.bic(best.dispersion) - least >= DECISIVE:
            continue
        held = replace(free, problem=refit.problem)
        outside = tuple(p for p in pulls(held) if p.too_far and _is_size(refit, p.parameter))
        if outside and all(abs(p.value) <= MOST_BEYOND * max(map(abs, p.known)) for p in outside):
            found.append((free, outside))
    return sorted(found, key=lambda one: one[0].bic(best.dispersion))


def _with_free_sizes(refit: Refit) -> Refit | None:
    """The same set with own sizes that no range holds; None where none is pulled, or no fit is found."""
    if not any(pull.pull for pull in pulls(refit) if _is_size(refit, pull.parameter)):
        return None
    sizes = frozenset(name.whole for name in refit.problem.names if _is_size(refit, name))
    problem = replace(refit.problem, unheld=sizes)
    try:
        reached = descend(problem, refit.fit.theta)
    except ComputationError:
        return None
    return replace(
        refit, problem=problem, fit=describe(problem, reached.theta, reached.residual, reached.jacobian)
    )


def _is_size(refit: Refit, name: ParameterName) -> bool:
    """Whether a parameter is an amplitude of an added effect."""
    effects = refit.problem.assembly.model.effects
    return any(name.owner == str(use) and name.own in effects[use.name].neutral for use in refit.uses)
