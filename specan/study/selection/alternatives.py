"""Which explanations the data cannot distinguish; other published forms of the base; sizes beyond what is known.

D is the chi-square that a rival leaves on the noise-free data of another: the criterion of T-optimal designs
(Atkinson & Fedorov 1975, Biometrika 62:57) on the measured design. With D = 9 one is mistaken for the other in
7 % of cases, with D = 0 they are aliases.

Catalogues and standards describe the same part differently (bearings: SKF, Palmgren, ISO). Which form a machine
follows is not known beforehand, so a misfit that another form removes is no missing effect.

A known range pulls at a size outside of it, and the set that a search finds best has paid for its pulls. A real size
may lie beyond the range all the same, and then another effect of a known size that looks much like it is named. So
every single effect that improves the model is fitted once more with its sizes free.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.linear import Projection, held_inside
from specan.study.selection.acceptance import DECISIVE, complete, incomplete
from specan.study.selection.candidates import candidates, confounded_with
from specan.study.selection.refits import FORM_TOLERANCE, EffectSet, Refit
from specan.study.selection.score_test import best_of_each, different, score, score_pairs
from specan.study.selection.search import STARTS, Search
from specan.study.selection.starting_values import scan_shapes

DISTINGUISHABLE = 10.0  # D below which two explanations are not distinguished
WIDE = 30.0  # D of the linearised distance within which a rival is refitted


def distance(truth: Refit, rival: Refit) -> float:
    """Chi-square that the rival leaves on what the truth predicts, one step inside its bounds from its fit."""
    gap = rival.fit.residual * rival.weights - truth.residual_like(rival)
    if not rival.fit.at_bound:
        return rival.linear.free_chi2(gap)
    size = rival.problem.scale
    low, high = rival.problem.bounds()
    ends = np.minimum((low - rival.fit.theta) / size, 0.0), np.maximum((high - rival.fit.theta) / size, 0.0)
    columns = rival.fit.jacobian * rival.weights[:, None] * size
    left = gap + columns @ held_inside(columns, gap, *ends)
    return float(left @ left)


def seen_from(base: Refit, best: Refit) -> Refit:
    """The base model at the parameters of another fit, and what it lacks there.

    Its residual is that against the best fit's noise-free prediction, so that scores of candidates from
    here say what each of them leaves of it: chi-square to a linear refit less gain = D.
    """
    problem = base.problem
    theta = problem.start(best.fit.values)
    here = replace(
        base.fit,
        theta=theta,
        values=problem.values_at(theta),
        residual=problem.residual(theta),
        jacobian=problem.jacobian(theta),
    )
    return replace(base, fit=here)


def refit_rivals(search: Search) -> None:
    """Refit sets as large as the best one that the linearised distance does not rule out."""
    best = search.step(search.best).seen
    there = seen_from(search.step(search.base).seen, best)
    found, _ = candidates(there.problem)
    gap = there.fit.residual * there.weights - best.residual_like(there)
    noise_free = replace_residual(there.linear, gap)
    scored = score(noise_free, search.tried_at(there, found), there.weights)
    whole = noise_free.free_chi2(gap)
    if len(best.uses) == 1:
        options = [(whole - items[0].chi2_reduction, [items[0]]) for items in best_of_each(scored).values()]
    else:
        options = [
            (whole - pair.chi2_reduction, [pair.first, pair.second])
            for pair in score_pairs(noise_free, scored)
        ]
    options.sort(key=lambda option: option[0])
    strategy = search.best.problem.strategy
    limit = WIDE * best.dispersion
    if strategy.frugal:  # then the search has refitted few, and none for its place in the ranking
        limit = max(limit, min(_left_by_form(search), incomplete(search.best)))
    near = [members for d, members in options[: 3 if strategy.frugal else 8] if d < limit]
    if strategy.frugal and len(search.best.uses) == 1:  # first: what is refitted here is not refitted below
        declared = [
            use
            for use in confounded_with(there.problem.assembly.model, *search.best.uses)
            if (done := search.refits.done.get(frozenset({use}))) is None or done.chi2 > best.chi2 + WIDE
        ]
        for items in scan_shapes(there, declared).values():
            search.refits.fit(there, [[item] for item in items], again=True)
    for members in near:
        search.refits.fit(there, [members])
    if len(best.uses) == 2 and strategy.continuation:
        for kept in sorted(best.uses):
            _exchange_second(search, kept)
            _exchange_first(search, kept)
        _exchange_both(search)


def _exchange_second(search: Search, first: Use) -> None:
    """Refit the best pair with its second effect exchanged for what promises as much beside the first."""
    part = search.steps.get(frozenset({first}))
    (second,) = search.best.uses - {first}
    if part is None or second not in part.by_use:
        return
    least = part.by_use[second][0].chi2_reduction - DISTINGUISHABLE * search.best.dispersion
    near = [use for use, items in part.by_use.items() if use != second and items[0].chi2_reduction > least]
    for use in near[: 3 if search.best.problem.strategy.frugal else 8]:
        search.refits.fit(part.seen, [part.by_use[use][:1]])


def _exchange_first(search: Search, first: Use) -> None:
    """Refit the best pair with its first effect exchanged for what explains as much alone."""
    best, alone = search.best, search.refits.done.get(frozenset({first}))
    scored = search.step(search.base)
    if alone is None:
        return
    for rival in search.refits.of_size(1):
        uses = rival.uses | (best.uses - {first})
        behind = rival.bic(best.dispersion) - alone.bic(best.dispersion)
        if (
            rival.uses <= best.uses
            or behind > DECISIVE
            or complete(alone, rival)
            or not uses <= {*scored.by_use}
        ):
            continue
        _refit_joined(search, rival, rival.uses, best, best.uses - {first})


def _exchange_both(search: Search) -> None:
    """Refit the pairs of what does as well in the place of the first effect, and of the second of the best pair."""
    best, (first, second) = search.best, sorted(search.best.uses)
    near = [
        r for r in search.refits.of_size(2) if r.bic(best.dispersion) - best.bic(best.dispersion) < DECISIVE
    ]
    for one, other in product(near, near):
        if one.uses & best.uses != {first} or other.uses & best.uses != {second}:
            continue
        kept, taken = one.uses - best.uses, other.uses - best.uses
        if kept != taken and kept | taken <= {*search.step(search.base).by_use}:
            _refit_joined(search, one, kept, other, taken)


def _refit_joined(search: Search, one: Refit, kept: EffectSet, other: Refit, taken: EffectSet) -> None:
    """Refit some effects of one set with some of another, from the values that each has there."""
    scored, uses = search.step(search.base), kept | taken
    own = {n: v for n, v in other.fit.values.items() if ParameterName(n).owned_by(taken)}
    start = one.problem.values_at(one.fit.theta)
    start = {n: v for n, v in start.items() if not ParameterName(n).owned_by(one.uses - kept)}
    search.refits.known = {**search.refits.known, uses: {**start, **own}}
    search.refits.fit(scored.seen, [[scored.by_use[use][0] for use in sorted(uses)]])


def replace_residual(linear: Projection, residual: np.ndarray) -> Projection:
    """The same tangent plane with another residual."""
    return Projection(residual, linear.basis)


def alternatives(search: Search) -> list[Refit]:
    """Sets that the data cannot distinguish from the best, best first; the best alone where they can."""
    best = search.best
    if not best.uses:
        return []
    refit_rivals(search)
    rivals = [
        refit
        for uses, refit in search.refits.done.items()
        if uses and uses != best.uses and not uses > best.uses and len(uses) <= len(best.uses)
    ]
    kept = [r for r in rivals if _indistinguishable(search, best, r)]
    return [best, *sorted([*kept, *search.extensions], key=lambda r: r.bic(best.dispersion))]


def _indistinguishable(search: Search, best: Refit, rival: Refit) -> bool:
    """BIC as good as the best one's, or a distance below 10 while the data do not rule the rival out.

    As good is within 6, and within what an equation that is not exact may cost the right effect.
    """
    if search.believable(best) and not search.believable(rival):  # it is named beside them, with its values
        return False
    if len(rival.uses) > 1 and not search.needs_all(rival):
        return False
    if complete(best, rival):
        return False
    behind = rival.bic(best.dispersion) - best.bic(best.dispersion)
    if best.problem.strategy.continuation and len(rival.uses) < len(best.uses):
        return behind < DECISIVE  # what it would be with the further effect has been fitted
    if behind < DECISIVE + _left_by_form(search, best.uses & rival.uses) / best.dispersion:
        return True
    there, back = distance(best, rival) / best.dispersion, distance(rival, best) / best.dispersion
    off = (rival.chi2 - best.chi2) / best.dispersion
    return (there < DISTINGUISHABLE and off < _as_far_as(there)) or (
        back < DISTINGUISHABLE and behind < DISTINGUISHABLE
    )


def _left_by_form(search: Search, common: EffectSet = frozenset()) -> float:
    """Chi-square that an equation which is not exact may leave of what it explains beyond what is common to rivals."""
    best, strategy = search.best, search.best.problem.strategy
    known = search.refits.done.get(common) if strategy.continuation else None
    explained = (known or search.base).chi2 - best.chi2
    left = search.steps[common].acceptance.left_by_form if known and common in search.steps else 0.0
    return left + FORM_TOLERANCE**2 * min(explained, strategy.explained_limit * best.problem.n_effective)


def _as_far_as(distance_there: float) -> float:
    """Chi-square by which a rival at this distance may lie behind in one of twenty samples: D + 2 sd."""
    return distance_there + 4 * float(np.sqrt(max(distance_there, 1.0)))


def refit_promising(search: Search) -> None:
    """Refit every single effect whose score promises to improve the base, where a refit is cheap.

    A score is taken along a straight line. Where an effect and a part of the base multiply each other, as a preload and
    the factor of bearing friction, it promises less than half of what the refit gives.
    """
    step = search.step(search.base)
    if search.base.problem.strategy.frugal:
        return
    for items in step.by_use.values():
        if step.start.promised(items[0]) < 0:
            search.refits.fit(step.seen, [[item] for item in different(items, STARTS)])
