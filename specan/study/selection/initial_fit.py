"""A first fit near the data, for covariances that depend on where the field is.

No verdict comes from here: the covariance is taken about the field that was found, and then every candidate is
looked at anew. Only which of them are looked at first, and where their fits begin, is taken over.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.models.kept import each_anew
from specan.study.estimation.continuation import JACOBIANS, about, continuation_fit, down_weighted
from specan.study.estimation.fit import describe, fit
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import confounded_with
from specan.study.selection.refits import (
    POOR_FIT,
    PRUNING_FACTOR,
    EffectSet,
    Refit,
    Refits,
    start_from,
)
from specan.study.selection.starting_values import scan_promising, scan_shapes

Led = tuple[float, dict[str, Any]]  # chi-square with the price of the parameters, and SI values


@dataclass(frozen=True, eq=False)
class InitialFit:
    """Where a search sets out.

    Attributes
    ----------
    base : Refit
        Fitted with covariances about a field that is near the measured one.
    likely : tuple of Use
        What came nearest, the nearest first.
    known : mapping
        SI values that led near the data, by the set of effects that was added.
    found : set of Use
        The set that the covariances are about.
    left : float
        Reduced chi-square that the nearest effect leaves on the down-weighted view.
    """

    base: Refit
    likely: tuple[Use, ...] = ()
    known: Mapping[EffectSet, Mapping[str, Any]] = field(default_factory=dict)
    found: EffectSet = frozenset()
    left: float = 0.0


def initial_fit(start: Refit, progress: Callable[[str, float], None]) -> InitialFit:
    """Look for a field near the measured one, where the base is far from it.

    Single effects are fitted to few, uncertain lines; those that come near, to all lines.
    """
    if not start.problem.strategy.linearised_covariance or start.fit.reduced_chi2 < POOR_FIT:
        return InitialFit(start)
    refits = _singles(start.problem, progress)
    base, near = refits.base, _nearest(refits)
    # 0.7: share of the base's chi-square on the down-weighted view that may be left by what is nearer
    if near.fit.chi2 > 0.7 * base.fit.chi2:  # the base is as near as the view can tell
        return InitialFit(start)
    sets = {
        uses: r for uses, r in refits.done.items() if uses and r.fit.chi2 < PRUNING_FACTOR * near.fit.chi2
    }
    led = _on_all_lines(start, near, sets)
    order = sorted(led, key=lambda uses: led[uses][0])
    return InitialFit(
        with_covariances_about(start, order[0], led[order[0]][1]),
        tuple(use for uses in order for use in uses),
        {uses: values for uses, (_, values) in led.items()},
        order[0],
        near.fit.reduced_chi2,
    )


def _singles(problem: Problem, progress: Callable[[str, float], None]) -> Refits:
    """Rough fits of the model with single effects, to few, uncertain lines."""
    text = "searching for a field close to the measured one"
    progress(text, 0.1)
    values = continuation_fit(problem)
    view = down_weighted(problem, values=values)
    base = Refit(frozenset(), view, fit(view, start=values))
    refits, found = Refits(base, rough=True), scan_promising(base)

    def look(use: Use) -> None:
        progress(f"{text}: with {use}", 0.4)
        richer = refits.with_uses([use])
        items = found.get(use) or scan_shapes(base, [use]).get(use, [])
        if items:
            refits.fit(base, frozenset({use}), [start_from(base, [item], richer) for item in items])

    counts: Counter[str] = Counter()
    for use in sorted(found, key=lambda use: base.promised(found[use][0])):
        counts[use.name] += 1
        # 6, 2: candidates that promise most, and at most so many of one effect
        if counts[use.name] <= 2 and len(refits.done) <= 6:
            look(use)
    for use in _nearest(refits).uses:
        # What is easily taken for it, and the same elsewhere: opposite ends are alike from afar.
        alike = [other for other in found if other.name == use.name]
        for other in (*alike, *confounded_with(problem.assembly.model, use)):
            look(other)
    return refits


def _nearest(refits: Refits) -> Refit:
    return min(refits.done.values(), key=lambda r: r.bic(1.0))


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
            # 5: Jacobians of a subsample
            theta = descend_steps(subsample, theta, 5)
        chi2 = float(np.sum(subsample.residual(theta) ** 2)) * problem.n_data / subsample.n_data
        return chi2 + refit.count * price, whole.values_at(theta)

    def on_all(uses: EffectSet) -> Led:
        whole = problems[uses]
        theta = descend_steps(whole, whole.start(subsampled[uses][1]), JACOBIANS)
        return float(np.sum(whole.residual(theta) ** 2)) + sets[uses].count * price, whole.values_at(theta)

    subsampled = dict(zip(sets, each_anew(on_a_subsample, list(sets)), strict=True))
    # 3: effects that are led on over all lines, and that a search looks at first
    likeliest = sorted(sets, key=lambda uses: subsampled[uses][0])[:3]
    return dict(zip(likeliest, each_anew(on_all, likeliest), strict=True))


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
        # 2: covariances about the field of a set: the second is about where the first leads
        for _ in range(2):
            problem = about(problem, problem.assembly, problem.values_at(theta))
            theta = descend_steps(problem, theta, JACOBIANS)
        return replace(refit, problem=problem, fit=describe(problem, theta))
    return refit
