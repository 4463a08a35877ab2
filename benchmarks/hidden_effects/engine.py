"""The study engine as the bench asks it, and what its own fit says that the data could know."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from open_tables import read_tables

from hidden_effects.cases import Case
from specan.models import Model, Use
from specan.models.effect import ParameterName
from specan.study.diagnose import diagnose as find_missing
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.explanations import Form, forms_of
from specan.study.evidence.promises import Promise
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import EffectSet, Refit, Refits
from specan.units import convert
from specan.worm_gear.model.build import build
from truth.worm_gear import TruthCase

STARTS = 3  # of the fit of the base
RIVALS = 6  # wrong candidates that are refitted over each form of the base
SHOWS = 10.0  # lambda from which D is measured: below, the right effect cannot be told from nothing either


def diagnose(case: Case, directory: Path) -> dict[str, Any]:
    """Verdict on a measurement, as ``study diagnose --json`` gives it."""
    return find_missing(_problem(directory, case.without)).to_dict()


def measure(case: Case, truth: TruthCase, directory: Path, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """lambda, D, conditional lambda and the planted sizes, from refits of noise-free data, whatever the verdict is.

    Every published form of the base that fits better than the declared one is tried with every effect: the data know
    an effect as far as no form leaves less without it.

    Returns
    -------
    dict
        ``lambda``: least chi-square that a form of the base leaves. ``left``: least that the true candidates leave.
        ``d``: least that a wrong candidate leaves beyond that (single effects that show; of an effect outside the
        catalogue every candidate is wrong, and the truth leaves nothing). Of the wrong ones the `RIVALS` that promise
        most are refitted. ``rival``: which.
        ``conditional_lambda``: least that one of a pair alone leaves beyond both.
        ``planted``: amplitude that each true candidate takes, in the unit of its parameter.
    """
    problem = _noise_free(_problem(directory), truth)
    forms = [_Form(form) for form in forms_of(problem, fit(problem, starts=STARTS))]
    least = min(form.base.fit.chi2 for form in forms)
    found = {"lambda": least, "left": None, "d": None, "rival": None, "conditional_lambda": None}
    found["planted"] = {}
    names = frozenset(Use(name) for name in case.truth)
    if not case.effects:
        return found
    found["planted"] = {use.name: _amplitude(_lowest(form.single(use) for form in forms)) for use in names}
    pairs = len(names) > 1
    right = _lowest(form.pair(names) if pairs else form.of(names) for form in forms)
    if names and right is None:  # the base is collinear with it whole
        return found
    found["left"] = right.fit.chi2 if right is not None else 0.0  # the truth itself leaves nothing
    if pairs and right is not None:
        alone = _lowest(form.single(use) for form in forms for use in names)
        found["conditional_lambda"] = min(least, alone.fit.chi2 if alone else least) - right.fit.chi2
    elif not pairs and least >= SHOWS:
        rival = _lowest(form.single(use) for form in forms for use in form.promising(names))
        found["rival"] = None if rival is None else str(next(iter(rival.uses)))
        found["d"] = min(least, rival.fit.chi2 if rival else least) - found["left"]
    return found


class _Form:
    """A published form of the base, and refits of effects over it."""

    def __init__(self, form: Form) -> None:
        self.base = Refit(frozenset(), form.problem, form.fit)
        self.refits = Refits(self.base)
        self.promises = {one.use: one for one in form.catalogue.promises(form.marginal)}

    def single(self, use: Use) -> Refit | None:
        """One effect over it; None where the base is collinear with it."""
        if use not in self.promises:
            return None
        return self.refits.fit(self.base, frozenset({use}), self.promises[use].starts)

    def pair(self, names: EffectSet) -> Refit | None:
        """Both effects, from the fit of either."""
        starts = []
        for first in sorted(names):
            one = self.single(first)
            if one is not None and {*names} <= {*self.promises}:
                other = self.promises[next(iter(names - {first}))]
                starts.append({**one.fit.values, **self._own(other, names - {first})})
        return self.refits.fit(self.base, names, starts) if starts else None

    def _own(self, promise: Promise, uses: EffectSet) -> dict[str, Any]:
        return {n: v for n, v in promise.starts[0].items() if ParameterName(n).owned_by(uses)}

    def of(self, names: EffectSet) -> Refit | None:
        return self.single(next(iter(names))) if names else None

    def promising(self, names: EffectSet) -> list[Use]:
        """Wrong candidates by what they promise."""
        wrong = [use for use in self.promises if use not in names]
        return sorted(wrong, key=lambda use: -self.promises[use].ln_gain)[:RIVALS]


def _lowest(refits: Iterable[Refit | None]) -> Refit | None:
    return min(
        (refit for refit in refits if refit is not None), key=lambda refit: refit.fit.chi2, default=None
    )


def _problem(directory: Path, without: Iterable[str] = ()) -> Problem:
    model = _model((directory / "rig.toml").read_text(encoding="utf-8"), tuple(without))
    return base_problem(model, read_tables(model, [directory / "measurement.csv"]).fitted)


@cache
def _model(rig: str, without: Sequence[str]) -> Model:
    model = build(tomllib.loads(rig))
    return replace(
        model,
        effects={name: effect for name, effect in model.effects.items() if name not in without},
        nuisances=tuple(n for n in model.nuisances if n.effect not in without),
    )


def _noise_free(problem: Problem, truth: TruthCase) -> Problem:
    """Covariance and certificates of the noisy data; readings without noise at the conditions that really ran."""
    (observation,) = problem.observations
    ideal: Mapping[str, Any] = truth.noise_free
    measured, conditions = observation.measured.copy(), dict(observation.conditions)
    for column in ("input_torque", "efficiency"):
        rows = observation.observable == column
        measured[rows] = ideal["input_torque_Nm" if column == "input_torque" else column][rows]
    for name, condition in problem.assembly.model.conditions.items():
        if condition.column in ideal and name in conditions:
            conditions[name] = convert(ideal[condition.column], condition.column_unit, condition.unit)
    return problem.over([replace(observation, measured=measured, conditions=conditions)])


def _amplitude(refit: Refit | None) -> float | None:
    """Size of the one effect that was added, of its first amplitude, in its declared unit."""
    if refit is None:
        return 0.0
    (use,) = refit.uses
    effect = refit.problem.assembly.model.effects[use.name]
    name = next(n for n in effect.parameters if n in effect.neutral)
    parameter, value = effect.parameters[name], refit.fit.values[f"{use}.{name}"]
    return abs(float(parameter.from_si(value)) - effect.neutral[name])
