"""Problems out of a model: its base with the instrument errors that it holds by a prior; and without an effect.

problem = base_problem(model, observations)          # base effects, nuisances with their priors
without(problem, "power-law")                        # an instrument error gets its prior back
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from specan.errors import RequestError, nearest
from specan.models import Model, Use, varying
from specan.models.groups import grouped
from specan.models.parameter import ParameterName
from specan.study.estimation.problem import Problem
from specan.study.observation import Observation


def base_problem(
    model: Model, observations: Sequence[Observation], uses: Iterable[Use | str] | None = None
) -> Problem:
    """Model with its base effects (or `uses`), every parameter free, its nuisances under their priors.

    Parameters
    ----------
    model : Model
    observations : sequence of Observation
    uses : iterable of Use or str, optional
        Effects instead of the model's base effects.
    """
    model = grouped_by(model, observations)
    assembly = model.assemble(model.base_effects if uses is None else uses)
    free = assembly.free(varying(o.conditions for o in observations))
    return _with_nuisances(Problem(assembly, tuple(observations), free))


def grouped_by(model: Model, observations: Iterable[Observation]) -> Model:
    """The model with the names of the groups that the observations hold."""
    names: dict[str, dict[str, None]] = {}
    for one in observations:
        for axis, own in getattr(one, "groups", {}).items():
            names.setdefault(axis, {}).update(dict.fromkeys(own))
    return grouped(model, {axis: tuple(own) for axis, own in names.items()})


def without(problem: Problem, use: Use | str) -> Problem:
    """Take an effect out; an instrument error gets its prior back."""
    use = Use.parse(use) if isinstance(use, str) else use
    if use not in problem.assembly.uses:
        raise RequestError(
            f"{use} is not in the model", remedy=nearest(str(use), map(str, problem.assembly.uses))
        )
    model = problem.assembly.model
    own = {name for name in problem.assembly.parameters if ParameterName(name).owned_by([use])}
    out = replace(
        problem,
        assembly=model.assemble(u for u in problem.assembly.uses if u != use),
        free=tuple(n for n in problem.free if n not in own),
        values={n: v for n, v in problem.values.items() if n not in own},
        priors={n: p for n, p in problem.priors.items() if n not in own},
        domains={n: d for n, d in problem.domains.items() if n not in own},
        links={n: o for n, o in problem.links.items() if n not in own and o not in own},
        nuisances=problem.nuisances - {use},
    )
    has_prior = use not in problem.nuisances and any(str(use) == n.effect for n in model.nuisances)
    return _with_nuisances(out, only=use) if has_prior else out


def _with_nuisances(problem: Problem, only: Use | None = None) -> Problem:
    """Add the model's instrument errors that have a prior and are not in the problem yet.

    An error that the data cannot show at all (its conditions are missing) stays out.
    """
    model = problem.assembly.model
    available = set().union(*(o.available for o in problem.observations)) if problem.observations else set()
    untestable = model.not_testable(available)
    priors, free, new = dict(problem.priors), list(problem.free), set()
    values = dict(problem.values)
    for nuisance in model.nuisances:
        use = Use.parse(nuisance.effect)
        if use in problem.assembly.uses or use.name in untestable or (only and use != only):
            continue
        effect = model.effects[use.name]
        parameter = effect.parameters[nuisance.parameter]
        mean = effect.neutral_si[nuisance.parameter]
        sd = abs(parameter.to_si(effect.neutral[nuisance.parameter] + nuisance.prior_sd) - mean)
        name = ParameterName.of(use, nuisance.parameter)
        priors[name], values[name] = (mean, sd), mean
        free.append(name)
        new.add(use)
    for use in new:  # parameters without a prior rest where the effect vanishes
        for own, value in model.effects[use.name].neutral_si.items():
            values.setdefault(ParameterName.of(use, own), value)
    return replace(
        problem,
        assembly=model.assemble({*problem.assembly.uses, *new}),
        free=tuple(free),
        values=values,
        priors=priors,
        nuisances=problem.nuisances | new,
    )
