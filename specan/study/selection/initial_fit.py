"""A first fit near the data, for covariances that depend on where the field is.

No verdict comes from here: the covariance is taken about the field that was found, and then every candidate is
looked at anew. Only which of them are looked at first, and where their fits begin, is taken over.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.continuation import STAGES, about, continuation_fit, down_weighted
from specan.study.estimation.fit import describe, fit
from specan.study.estimation.levenberg_marquardt import SCREENING_JACOBIANS, descend_steps
from specan.study.estimation.problem import Problem
from specan.study.processes import each
from specan.study.selection.candidates import candidates, confounded_with
from specan.study.selection.refits import (
    FORM_TOLERANCE,
    POOR_FIT,
    PRUNING_FACTOR,
    EffectSet,
    Refit,
    Refits,
    start_from,
)
from specan.study.selection.score_test import Scored, best_of_each, different, score
from specan.study.selection.signatures import Known, signatures
from specan.study.selection.starting_values import PLACES, planned_points, scan_promising, scan_shapes

SCANNED = 6  # candidates that are looked at over all of their shapes, beside the best place of every effect
SCREENED, PER_EFFECT = 8, 2  # of them that are followed for some steps, and at most so many of one effect
SCREENING_STARTS = 2  # signatures of each
AT_ONCE = 4  # of those that promise most without having been looked at over all of their shapes
REFITTED = 4  # of those, that are refitted
CLEAR = 0.7  # share of the base's chi-square on the down-weighted view that may be left by what is nearer
MOST_REFITTED = 7  # with those that are easily taken for the best so far
SURE = 0.05  # reduced chi-square on the down-weighted view below which nothing else is tried
MOST = 2  # effects
# Shares of a diagnosis that are over when this begins, when it refits and when it ends: of its time for two fields
# with a damped boundary, of six and of twelve receivers
BEGINS, REFITS, NEAR = 0.08, 0.6, 0.7
LIKELY = 3  # sets that are led on over all lines, and that a search looks at first
SUBSAMPLE_JACOBIANS = 5  # Jacobians of a subsample
JACOBIANS = 3  # of all lines, from where a subsample leads
ABOUT_ITSELF = 2  # covariances about the field of a set: the second is about where the first leads

Led = tuple[float, dict[str, Any]]  # chi-square with the price of the parameters, and SI values


@dataclass(frozen=True, eq=False)
class InitialFit:
    """Where a search sets out.

    Attributes
    ----------
    base : Refit
        Fitted with covariances about a field that is near the measured one.
    likely : tuple of Use
        What came nearest by itself, the nearest first, and what the nearest pair has besides.
    known : mapping
        SI values that led near the data, by the set of effects that was added.
    found : set of Use
        The set that the covariances are about.
    left : float
        Reduced chi-square that the nearest set leaves on the down-weighted view.
    """

    base: Refit
    likely: tuple[Use, ...] = ()
    known: Mapping[EffectSet, Mapping[str, Any]] = field(default_factory=dict)
    found: EffectSet = frozenset()
    left: float = 0.0


def initial_fit(
    start: Refit,
    progress: Callable[[str, float], None],
) -> InitialFit:
    """Look for a field near the measured one, where the base is far from it."""
    if not start.problem.strategy.linearised_covariance or start.reduced < POOR_FIT:
        return InitialFit(start)

    def trying(text: str, share: float) -> None:
        progress(f"looking for a field that is near the measured one{text}", share)

    led: dict[EffectSet, Led] = {}

    def met(refit: Refit) -> bool:
        chi2, values = _on_all_lines(start, refit, {refit.uses: refit})[refit.uses]
        led[refit.uses] = chi2, values
        return chi2 < POOR_FIT * start.problem.n_data

    trying("", BEGINS)
    tried = _tried(start.problem, trying, met)
    bare = next(r for r in tried if not r.uses)
    near = min(tried, key=lambda r: r.bic(1.0))
    if near.chi2 > CLEAR * bare.chi2:  # the base is as near as the view can tell
        return InitialFit(start)
    beside = [r for r in tried if len(r.uses) == 1 and r.chi2 < PRUNING_FACTOR * near.chi2]
    known = {r.uses: r.problem.values_at(r.fit.theta) for r in tried if r.uses}
    sets = {r.uses: r for r in [*beside, near]}
    reached = led if {*led} == {*sets} else _on_all_lines(start, near, sets)
    found = min(reached, key=lambda uses: reached[uses][0])
    values = {uses: v for uses, (_, v) in reached.items()}
    single = sorted((uses for uses in values if len(uses) == 1), key=lambda uses: uses != found)
    likely = dict.fromkeys(use for uses in [*single, near.uses] for use in sorted(uses))
    return InitialFit(
        with_covariances_about(start, found, values[found]),
        tuple(likely),
        {**known, **values},
        found,
        near.reduced,
    )


def _on_all_lines(start: Refit, near: Refit, sets: Mapping[EffectSet, Refit]) -> dict[EffectSet, Led]:
    """Where some steps on all lines lead the likeliest of some sets, with covariances about the nearest.

    What seems nearest to the few lines of a down-weighted view, which has no windows, need not be the field. A
    subsample has them: it says which sets are worth the steps.
    """
    problem = about(start.problem, near.problem.assembly, near.problem.values_at(near.fit.theta))
    price = float(np.log(problem.n_effective))
    problems = {uses: problem.with_uses(sorted(uses)) for uses in sets}

    def on_a_subsample(uses: EffectSet) -> Led:
        refit = sets[uses]
        whole, values = problems[uses], refit.problem.values_at(refit.fit.theta)
        theta = whole.start(values)
        subsample = whole.subsampled(theta)
        with suppress(ComputationError):  # it stays where the down-weighted view has it
            theta = descend_steps(subsample, theta, SUBSAMPLE_JACOBIANS)
        chi2 = float(np.sum(subsample.residual(theta) ** 2)) * problem.n_data / subsample.n_data
        return chi2 + refit.count * price, whole.values_at(theta)

    def on_all(uses: EffectSet) -> Led:
        whole = problems[uses]
        theta = descend_steps(whole, whole.start(subsampled[uses][1]), JACOBIANS)
        return float(np.sum(whole.residual(theta) ** 2)) + sets[uses].count * price, whole.values_at(theta)

    subsampled = dict(zip(sets, each(on_a_subsample, list(sets)), strict=True))
    likeliest = sorted(sets, key=lambda uses: subsampled[uses][0])[:LIKELY]
    return dict(zip(likeliest, each(on_all, likeliest), strict=True))


def with_covariances_about(start: Refit, uses: EffectSet, values: Mapping[str, Any]) -> Refit:
    """The base with covariances about the field of a model with further effects, fitted."""
    problem = about(start.problem, start.problem.with_uses(sorted(uses)).assembly, values)
    return replace(start, problem=problem, fit=fit(problem, start=start.fit.theta))


def about_itself(refit: Refit) -> Refit:
    """A set with covariances about its own field: what its parameters and intervals are told from.

    About the field of the base, or of a nearby set, what is declared of receivers acts otherwise than in the field that
    was found, and takes a part of an effect, the displacement of a receiver above all.
    """
    if not refit.problem.strategy.linearised_covariance:
        return refit
    problem, theta = refit.problem, refit.fit.theta
    with suppress(ComputationError):  # what was found stays as it is
        for _ in range(ABOUT_ITSELF):
            problem = about(problem, problem.assembly, problem.values_at(theta))
            theta = descend_steps(problem, theta, JACOBIANS)
        return replace(refit, problem=problem, fit=describe(problem, theta))
    return refit


def _tried(
    problem: Problem,
    trying: Callable[[str, float], None],
    met: Callable[[Refit], bool],
) -> list[Refit]:
    """Sets of up to two effects that a greedy search on a down-weighted view fits, the empty one included."""
    values = continuation_fit(problem)
    view = down_weighted(problem, values=values)
    best = Refit(frozenset(), view, fit(view, start=values))
    refits = Refits(best, rough=True)
    for _ in range(MOST):
        found, _ = candidates(best.problem)
        known: Known = {}
        points = planned_points(best, found, known)
        scored = best_of_each(
            score(best.linear, signatures(best.problem, best.fit, found, points, known), best.weights)
        )

        def say(use: Use) -> None:
            trying(f": with {use}", REFITS)

        better = _evident(refits, best, scored, say)
        if better is not None and met(better):  # what is much like it is compared with it by the search
            break
        better = _best_of_few(refits, better or best, best, scored, say)
        if better is best or better.reduced < 1:  # within the few per cent of the view
            break
        best = better
    return list(refits.done.values())


def _evident(
    refits: Refits, best: Refit, scored: Mapping[Use, Sequence[Scored]], trying: Callable[[Use], None]
) -> Refit | None:
    """The set with one effect more that meets the view from what few signatures promise; None where none does.

    Then only what is much like it has to be looked at over all of its shapes. Effects at one place may be anywhere else
    as well: of them the best of a few places is no beginning.
    """
    effects = best.problem.assembly.model.effects
    order = sorted(scored, key=lambda use: best.promised(scored[use][0]))
    everywhere = [use for use in order if not {*PLACES} & {*effects[use.name].parameters}]
    few = {use: different(scored[use], SCREENING_STARTS) for use in _of_several_names(everywhere)[:AT_ONCE]}
    for use in _screened(best, few)[:1]:
        trying(use)
        refit = _fit(Refits(refits.base, rough=True), best, few[use])
        if refit is not None and _leaves_its_form(best, refit):
            refits.done[refit.uses] = refit
            return refit
    return None


def _best_of_few(
    refits: Refits,
    better: Refit,
    best: Refit,
    scored: Mapping[Use, Sequence[Scored]],
    trying: Callable[[Use], None],
) -> Refit:
    """The best set with one effect more than `best`, of those that promise most and of what is easily taken for them.

    `better` is one that meets the view already, or `best` itself.
    """
    closer: dict[Use, list[Scored]] = {}
    looked_at = {*better.uses - best.uses}
    if better is best:
        closer = scan_promising(best, scored, SCANNED)
        queue = _of_several_names(sorted(closer, key=lambda use: best.promised(closer[use][0])))
        queue = _screened(best, {use: closer[use] for use in queue})[:REFITTED]
    else:
        queue = [other for use in looked_at for other in confounded_with(best.problem.assembly.model, use)]
    while queue and better.reduced > SURE and len(looked_at) < MOST_REFITTED:
        use = queue.pop(0)
        if use in looked_at or use not in scored or not _may_win(best, better, use):
            continue
        looked_at.add(use)
        trying(use)
        items = closer.get(use) or scan_shapes(best, [use]).get(use) or scored[use][:1]
        refit = _fit(refits, best, items)
        if refit is not None and refit.bic(1.0) < better.bic(1.0):
            better = refit
            queue = [
                *_elsewhere(refits, best, better, scored),
                *confounded_with(best.problem.assembly.model, use),
                *queue,
            ]
    return better


def _fit(refits: Refits, best: Refit, items: Sequence[Scored]) -> Refit | None:
    """Fit a set with one effect more, from its signatures."""
    uses = best.uses | {items[0].use}
    problem = refits.with_uses(uses)
    return refits.fit(best, uses, [start_from(best, [item], problem) for item in items])


def _elsewhere(refits: Refits, start: Refit, better: Refit, scored: Iterable[Use]) -> list[Use]:
    """The same effect at the other element where it does best, with its values, where it does not meet the view.

    At opposite ends it changes every resonance by the same amount to first order, the square of the mode's shape: from
    afar the promises of the two hardly differ. The refit there begins at the same values.
    """
    (found,) = better.uses - start.uses
    if better.reduced <= 1 or not found.at or start.problem.assembly.model.effects[found.name].instrument:
        return []
    values = better.problem.values_at(better.fit.theta)
    reached: dict[Use, tuple[float, dict[str, Any]]] = {}
    for use in scored:
        if use.name == found.name and use != found:
            there = {
                f"{use}.{ParameterName(n).own}" if ParameterName(n).owned_by({found}) else n: v
                for n, v in values.items()
            }
            whole = start.problem.with_uses(sorted({*start.uses, use}))
            with suppress(ComputationError):
                reached[use] = float(np.sum(whole.residual(whole.start(there)) ** 2)), there
    best = sorted(reached, key=lambda use: reached[use][0])[:1]
    refits.known = {**refits.known, **{start.uses | {use}: reached[use][1] for use in best}}
    return best


def _leaves_its_form(start: Refit, better: Refit) -> bool:
    """Whether a set meets a view to its uncertainty, and leaves no more than what its form may."""
    return better.reduced <= 1 and better.chi2 <= FORM_TOLERANCE**2 * start.chi2


def _may_win(start: Refit, better: Refit, use: Use) -> bool:
    """Whether a candidate may still come first: where a set leaves what its form may, only what is much like it."""
    if better is start or not _leaves_its_form(start, better):
        return True
    (found,) = better.uses - start.uses
    return use.name == found.name or use in confounded_with(start.problem.assembly.model, found)


def _of_several_names(order: Sequence[Use]) -> list[Use]:
    """The first few uses, few of one effect among them: at opposite ends it promises much the same."""
    counts: Counter[str] = Counter()
    queue = []
    for use in order:
        counts[use.name] += 1
        if counts[use.name] <= PER_EFFECT:
            queue.append(use)
    return queue[:SCREENED]


def _screened(best: Refit, found: Mapping[Use, Sequence[Scored]]) -> list[Use]:
    """Candidates in the order of what a few Jacobians on the most uncertain view leave of each.

    What a signature promises is a line drawn from afar; some steps cost a tenth of a refit and tell more.
    """

    def left(use: Use) -> float:
        whole = best.problem.with_uses([*sorted(best.uses), use])
        view = down_weighted(whole, STAGES[0])
        names = {str(other) for other in (*best.uses, use)}
        reached = [np.inf]
        for item in found[use][:SCREENING_STARTS]:
            values = start_from(best, [item], whole)
            own = {name: v for name, v in values.items() if ParameterName(name).owner in names}
            with suppress(ComputationError):  # another start may do
                theta = descend_steps(view, view.start(own), SCREENING_JACOBIANS)
                reached.append(float(np.sum(view.residual(theta) ** 2)))
        return min(reached)

    by_use = dict(zip(found, each(left, list(found)), strict=True))
    return sorted(by_use, key=lambda use: by_use[use])
