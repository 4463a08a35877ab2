"""From what a study file says to the fitting problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from specan.errors import RequestError, require_known
from specan.models import Model, Parameter, Use, varying
from specan.models.effect import ParameterName
from specan.study.estimation.problem import Problem
from specan.study.observation import Array, Observation
from specan.study.selection.candidates import grouped_by
from specan.study.study_file import EffectEntry, ParameterEntry, StudyFile
from specan.units import convert, scale_to


def assemble(model: Model, content: StudyFile, observations: Sequence[Observation]) -> Problem:
    """The problem that a study file describes.

    Raises
    ------
    RequestError
        An effect or parameter that the model does not have, a unit that does not fit, a value outside
        its own bounds.
    """
    model = grouped_by(model, observations)
    for entry in content.effect:
        require_known(entry.use.name, model.effects, f"study.toml names the effect {entry.name!r}")
    model = _with_axes(model, content)
    assembly = model.assemble(entry.use for entry in content.effect)
    said = dict(content.parameters)
    for effect in content.effect:
        said |= {ParameterName.of(effect.use, name): entry for name, entry in effect.parameters.items()}
    known = assembly.parameters
    for name in said:
        require_known(name, known, f"study.toml names the parameter {name!r}")
    nuisances = {entry.use: entry for entry in content.effect if entry.role == "nuisance"}
    priors = _priors(model, nuisances)
    values, domains = _said(said, known)
    for use in nuisances:
        for name, value in model.effects[use.name].neutral_si.items():
            values.setdefault(ParameterName.of(use, name), value)
    determined = assembly.free(varying(o.conditions for o in observations))
    instruments = {str(use) for use in nuisances}
    free = []
    for name in known:
        if ParameterName(name).owner in instruments:
            chosen = name in priors
        elif name in said and said[name].fixed is not None:
            chosen = not said[name].fixed
        else:
            chosen = name in determined
        if chosen:
            free.append(name)
    return Problem(assembly, tuple(observations), tuple(free), values, priors, domains)


def _with_axes(model: Model, content: StudyFile) -> Model:
    """The model with parameters made vectors where the study says ``per``."""
    for effect in content.effect:
        for name, entry in effect.parameters.items():
            known = model.effects[effect.use.name]
            if entry.per is None or name not in known.parameters:
                continue
            axes = ["recording", *model.axes]
            require_known(
                entry.per or "recording", axes, f"study.toml: {effect.name}.{name} is per {entry.per!r}"
            )
            changed = {**known.parameters, name: replace(known.parameters[name], per=entry.per)}
            model = model.with_effect(replace(known, parameters=changed))
    return model


def _priors(model: Model, nuisances: Mapping[Use, EffectEntry]) -> dict[str, tuple[float, float]]:
    priors: dict[str, tuple[float, float]] = {}
    for use, entry in nuisances.items():
        effect = model.effects[use.name]
        given = {n: p.prior_sd for n, p in entry.parameters.items() if p.prior_sd is not None}
        if entry.prior_sd is not None:
            open_ = [n.parameter for n in model.nuisances if n.effect == str(use)] or list(effect.neutral)
            if len(open_) != 1:
                raise RequestError(
                    f"study.toml: prior_sd of {entry.name} could mean {' or '.join(open_)}",
                    remedy="give it in the parameter: parameters.NAME = {prior_sd = ...}",
                )
            given.setdefault(open_[0], entry.prior_sd)
        if not given:
            raise RequestError(
                f"study.toml: the nuisance {entry.name} has no prior_sd", remedy='give one, or role = "model"'
            )
        for name, sd in given.items():
            require_known(
                name, effect.neutral, f"study.toml: {entry.name}.{name} has no neutral value to hold it at"
            )
            parameter = effect.parameters[name]
            unit = entry.parameters[name].unit if name in entry.parameters else None
            width = sd * scale_to(unit or parameter.unit, parameter.unit)
            priors[ParameterName.of(use, name)] = effect.prior_si(name, width)
    return priors


def _said(
    said: Mapping[str, ParameterEntry], known: Mapping[str, Parameter]
) -> tuple[dict[str, Any], dict[str, tuple[float, float]]]:
    values: dict[str, Any] = {}
    domains: dict[str, tuple[float, float]] = {}
    for name, entry in said.items():
        parameter = known[name]

        def si(value: float, unit: str = entry.unit or parameter.unit, to: Parameter = parameter) -> float:
            return to.to_si(float(convert(value, unit, to.unit)) if unit != to.unit else value)

        if entry.value is not None:
            given = entry.value
            values[name] = np.array([si(v) for v in given]) if isinstance(given, tuple) else si(given)
        if entry.low is not None or entry.high is not None:
            low = parameter.si.lower if entry.low is None else si(entry.low)
            high = parameter.si.upper if entry.high is None else si(entry.high)
            if not low < high:
                raise RequestError(
                    f"study.toml: {name} goes from {entry.low} to {entry.high}", expected="low < high"
                )
            domains[name] = (low, high)
    return values, domains


def held_for_want_of_variation(problem: Problem) -> dict[str, tuple[str, ...]]:
    """Parameters that are held because conditions that they need do not vary, with those conditions."""
    varied = varying(o.conditions for o in problem.observations)
    return {
        name: tuple(c for c in parameter.needs if c not in varied)
        for name, parameter in problem.assembly.parameters.items()
        if not parameter.fixed and name not in problem.free and any(c not in varied for c in parameter.needs)
    }


def calibration_priors(problem: Problem) -> dict[str, tuple[float, str]]:
    """Standard uncertainty and unit of each instrument error that is held by its prior."""
    found = {}
    for name, (mean, sd) in problem.priors.items():
        parameter = problem.assembly.parameters[name]
        found[name] = (abs(parameter.from_si(mean + sd) - parameter.from_si(mean)), parameter.unit)
    return found


def undetermined(problem: Problem, theta: Array) -> list[ParameterName]:
    """Parameters that these data do not determine beside the others; holding them takes nothing away.

    Of the parameters that only act together a dimensionless one (an exponent) is named first, since it
    is the sizes that a fit needs.
    """
    names, found = list(problem.names), []
    least = 1e-6  # singular value, over the largest, below which a direction is not determined
    told = problem.n_data + problem.n_priors  # a known range determines nothing
    jacobian = problem.jacobian(theta)[:told] * problem.scale
    units = {n: problem.assembly.parameters[n.whole].unit for n in names}
    while names:
        place = [problem.names.index(n) for n in names]
        size = np.linalg.norm(jacobian[:, place], axis=0)
        idle = [n for n, s in zip(names, size, strict=True) if s < least]
        if idle:
            worst = idle[-1]
        else:
            _, s, vt = np.linalg.svd(jacobian[:, place] / size, full_matrices=False)
            if s[-1] > least * s[0]:
                break
            share = np.abs(vt[-1])
            together = [n for n, v in zip(names, share, strict=True) if v > 0.05 * share.max()]
            worst = max(together, key=lambda n: (units[n] == "1", names.index(n)))
        found.append(worst)
        names.remove(worst)
    return found
