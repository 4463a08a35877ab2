"""What could be missing: every effect that the data can speak about, at every place where it may act."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from specan.models import Effect, Model, Parameter, Use
from specan.models.parameter import ParameterName
from specan.study.estimation.problem import Problem


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

    @property
    def count(self) -> int:
        """Number of parameters that the candidate costs: its own, and those whose prior is removed."""
        return len(self.own)

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
    return found, {name: why for name, why in sorted(not_testable.items()) if not _has(problem, name)}


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
        if effect.at == own.at and (name in own.aliases or use.name in effect.aliases)
    ]


def _has(problem: Problem, name: str) -> bool:
    return any(use.name == name and use not in problem.nuisances for use in problem.assembly.uses)


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
