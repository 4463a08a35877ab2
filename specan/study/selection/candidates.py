"""Problems out of a model: its base, without an effect, and with each effect that could be missing.

problem = base_problem(model, observations)          # base effects, instrument errors held by their priors
without(problem, "power-law")                        # an instrument error gets its prior back
found, not_testable = candidates(problem)            # every effect that the data can speak about, wherever it may act
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from specan.errors import require_known
from specan.models import Effect, Model, Parameter, Use, varying
from specan.models.effect import ParameterName
from specan.models.groups import grouped
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
    require_known(str(use), map(str, problem.assembly.uses), f"{use} is not in the model")
    model = problem.assembly.model
    own = {name for name in problem.assembly.parameters if ParameterName(name).owned_by([use])}
    out = replace(
        problem,
        assembly=model.assemble(u for u in problem.assembly.uses if u != use),
        free=tuple(n for n in problem.free if n not in own),
        values={n: v for n, v in problem.values.items() if n not in own},
        priors={n: p for n, p in problem.priors.items() if n not in own},
        domains={n: d for n, d in problem.domains.items() if n not in own},
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
        name = ParameterName.of(use, nuisance.parameter)
        priors[name] = model.effects[use.name].prior_si(nuisance.parameter, nuisance.prior_sd)
        values[name] = priors[name][0]
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
    )


@dataclass(frozen=True, eq=False)
class Candidate:
    """One use of an effect that a problem lacks, or an instrument error whose prior is removed.

    Attributes
    ----------
    extended : Problem
        The problem with the use in it, all of its parameters free.
    """

    use: Use
    base: Problem
    extended: Problem

    @cached_property
    def effect(self) -> Effect:
        """The effect used."""
        return self.base.assembly.model.effects[self.use.name]

    @cached_property
    def own(self) -> tuple[ParameterName, ...]:
        """Free elements of theta that belong to the use."""
        return tuple(n for n in self.extended.names if n.owner == str(self.use))

    @cached_property
    def amplitudes(self) -> tuple[ParameterName, ...]:
        """Those at whose neutral value the effect vanishes."""
        return tuple(n for n in self.own if n.own in self.effect.neutral)

    @cached_property
    def shapes(self) -> tuple[ParameterName, ...]:
        """The others: without an amplitude they mean nothing."""
        return tuple(n for n in self.own if n not in self.amplitudes)

    @cached_property
    def without_prior(self) -> tuple[ParameterName, ...]:
        """Elements that the base fits under a prior and the candidate without."""
        return tuple(n for n in self.own if n.whole in self.base.priors)

    def neutral(self, name: str) -> float:
        """Value of an amplitude at which the effect vanishes, SI."""
        return self.effect.neutral_si[ParameterName(name).own]

    def parameter(self, name: str) -> Parameter:
        """Declaration of an own element."""
        return self.effect.parameters[ParameterName(name).own]

    def plausible(self, name: str) -> tuple[float, float]:
        """Plausible range of an own element, inside its domain, SI; finite."""
        si = self.parameter(name).si
        low, high = self.extended.domain(ParameterName(name).whole)
        reach = 3.0 * (abs(si.default) or 1.0)
        ends = (max(si.min, low, -1e300), min(si.max, high, 1e300))
        return (
            ends[0] if ends[0] > -1e299 else min(si.default - reach, ends[1]),
            ends[1] if ends[1] < 1e299 else max(si.default + reach, ends[0]),
        )


def candidates(problem: Problem) -> tuple[list[Candidate], dict[str, str]]:
    """Candidates of a problem, and the effects that its data cannot test with the reason.

    Parameters
    ----------
    problem : Problem
        With the effects that are already in the model.

    Returns
    -------
    candidates : list of Candidate
        In the order of their names.
    not_testable : dict
        ``{"running-in": "needs elapsed_time"}``
    """
    model = problem.assembly.model
    available = set().union(*(o.available for o in problem.observations))
    not_testable = model.not_testable(available)
    uses = {*model.candidates(problem.assembly), *problem.nuisances}
    found = []
    for use in sorted(uses):
        if use.name in not_testable or not _can_be_seen(problem, use):
            continue
        candidate = Candidate(use, problem, problem.with_uses([use]))
        if not candidate.amplitudes:
            not_testable[use.name] = "all of its amplitudes are held fixed"
            continue
        found.append(candidate)
    have = {use.name for use in problem.assembly.uses if use not in problem.nuisances}
    return found, {name: why for name, why in sorted(not_testable.items()) if name not in have}


def _can_be_seen(problem: Problem, use: Use) -> bool:
    """Whether rows are kept of the element that a use acts at, where elements are the channels of the data.

    The gain of a channel that is held out changes no fitted value: no candidate, and nothing invisible either.
    """
    model = problem.assembly.model
    labels = [o.labels["channel"] for o in problem.observations if "channel" in o.labels]
    if not use.at or not labels:
        return True
    seen = {str(name) for names in labels for name in np.unique(names)}
    elements = {str(e) for e in model.axes.get(model.effects[use.name].at, ())}
    return not seen <= elements or str(use.at) in seen


def confounded_with(model: Model, use: Use) -> list[Use]:
    """What the catalogue itself says is easily taken for an effect, at its place."""
    own = model.effects[use.name]
    return [
        replace(use, name=name)
        for name, effect in model.effects.items()
        if bool(effect.at) == bool(own.at)
        and (not use.at or use.at in model.axes[effect.at])
        and (name in own.aliases or use.name in effect.aliases)
    ]


def grid(low: float, high: float, count: int) -> np.ndarray:
    """Places of a shape parameter: even steps, or even ratios where the range spans a factor of 5.

    Examples
    --------
    >>> grid(1.0, 100.0, 3).round(6)
    array([  1.,  10., 100.])
    """
    if low > 0 and high / low > 5:
        return np.geomspace(low, high, count)
    return np.linspace(low, high, count)
