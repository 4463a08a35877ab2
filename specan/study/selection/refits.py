"""Full refits of a problem with further effects, each set of effects once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.continuation import ENOUGH, continuation_fit
from specan.study.estimation.fit import Fit, describe
from specan.study.estimation.levenberg_marquardt import (
    STALL_TOLERANCE,
    Minimum,
    NotSettledError,
    best_screened,
    descend,
    descend_steps,
    unit,
)
from specan.study.estimation.linear import Projection
from specan.study.estimation.problem import Problem
from specan.study.selection.signatures import Scored, with_rows_of
from specan.units import spoken

# Standard deviations beyond which a fit holds only with a value that contradicts what is known: three, as for an
# outlier of a normal law (p = 0.003).
TOO_FAR = 3.0


@dataclass(frozen=True)
class Pull:
    """One fitted value beside what was known of it.

    Attributes
    ----------
    parameter : str
    value : float
    known : tuple of float
        Range known beforehand, in `unit`.
    pull : float
        Standard deviations by which the value lies outside, with its sign.
    at_bound : bool
        The value rests on an end of its domain: the data would go further. At zero only where that lies outside the
        range: many a part may be nothing.
    """

    parameter: ParameterName
    value: float
    known: tuple[float, float]
    pull: float
    unit: str
    at_bound: bool

    @property
    def range(self) -> str:
        """What was known, as a person reads it."""
        ends = [end for end in self.known if np.isfinite(end)]
        side = "" if len(ends) > 1 else "above " if np.isfinite(self.known[0]) else "below "
        return side + spoken(*ends, unit=self.unit)

    @property
    def text(self) -> str:
        """``mu = 0.22, known 0.01 to 0.12``."""
        bound = ", at the end of its domain" if self.at_bound else ""
        return f"{self.parameter} = {spoken(self.value, unit=self.unit, digits=2)}, known {self.range}{bound}"


def pulls(refit: Refit) -> tuple[Pull, ...]:
    """Every value outside of what was known of it, the worst first."""
    found = [_pull(refit, name) for name in refit.fit.names]
    outside = [p for p in found if abs(p.pull) > 0 or p.at_bound]
    return tuple(sorted(outside, key=lambda p: (abs(p.pull) <= TOO_FAR and not p.at_bound, -abs(p.pull))))


def shown(found: tuple[Pull, ...]) -> tuple[Pull, ...]:
    """Those that a person is told of."""
    outside = [p for p in found if not p.known[0] <= p.value <= p.known[1] or p.at_bound]
    # 1.0: pulls below this are no news
    return tuple(p for p in outside if abs(p.pull) >= 1.0 or p.at_bound)


def what_would_tell(refit: Refit) -> str:
    """Operating variables of the model that the data hold at one value: varying them determines more.

    ``a second load, a second viscosity``; empty where all vary.
    """
    problem = refit.problem
    constant = []
    for name, condition in problem.assembly.model.conditions.items():
        if not condition.varies or condition.unit == "s":
            continue
        values = [o.conditions[name] for o in problem.observations if name in o.conditions]
        if all(np.ptp(v) <= 1e-9 * np.max(np.abs(v), initial=0.0) for v in values):
            constant.append(condition.column.rpartition("_")[0].replace("_", " ") or name)
    # 2: operating variables that are named, in the model's order
    return ", ".join(f"a second {name}" for name in constant[:2])


def _pull(refit: Refit, name: ParameterName) -> Pull:
    problem, fit = refit.problem, refit.fit
    plain = name.whole
    parameter = problem.assembly.parameters[plain]
    value = float(fit.theta[fit.names.index(name)])
    if plain in problem.priors:
        mean, sd = problem.priors[plain]
        # coverage factor 2
        known, pull = (mean - 2 * sd, mean + 2 * sd), (value - mean) / sd
    else:
        known, pull = problem.plausible(plain), problem.pulls(fit.theta)[name]
    owner = problem.assembly.model.effects.get(Use.parse(name.owner).name)
    # Relative errors of instruments, and those under a certificate, are given in percent.
    relative = parameter.unit == "1" and (plain in problem.priors or (owner is not None and owner.instrument))
    share, unit = (100.0, "percent") if relative else (1.0, parameter.unit)
    shown, low, high = (share * parameter.from_si(one) for one in (value, *known))
    outside = not known[0] <= value <= known[1]
    at_bound = name in fit.at_bound and (outside or value != 0)
    return Pull(name, shown, (low, high), pull, unit, at_bound)


EffectSet = frozenset[Use]

POOR_FIT = 1.5  # reduced chi-square above which a base is too far from the data to set out from
PRUNING_FACTOR = 3.0  # times the best chi-square so far, beyond what an equation may be off


@dataclass(frozen=True, eq=False)
class Refit:
    """A problem with some effects added, fitted.

    Attributes
    ----------
    uses : frozenset of Use
        What was added to the base.
    """

    uses: EffectSet
    problem: Problem
    fit: Fit

    @property
    def count(self) -> int:
        """Parameters that were added, those whose prior is removed included."""
        added = {str(use) for use in self.uses}
        return sum(name.owner in added for name in self.problem.names)

    @cached_property
    def linear(self) -> Projection:
        """The fit linearised; parameters that change nothing there are left out."""
        columns = self.fit.jacobian
        # 1e-3: change of the whitened residual by a parameter's typical size below which it is on a plateau
        moves = np.linalg.norm(columns, axis=0) * self.problem.scale > 1e-3
        return Projection.of(self.fit.residual, columns[:, moves])

    @property
    def dof(self) -> float:
        """Degrees of freedom that are left, without those that only compare repeats."""
        return self.fit.dof - self.problem.pure_error_dof

    @property
    def poor_fit(self) -> bool:
        """Whether it is so far from peaks that nothing may be concluded from its parameters."""
        return self.problem.strategy.continuation and self.fit.reduced_chi2 > POOR_FIT

    def bic(self, dispersion: float) -> float:
        """Chi-square in units of `dispersion` plus the price of the added parameters."""
        return self.fit.chi2 / dispersion + self.count * float(np.log(self.problem.n_effective))


@dataclass(eq=False)
class Refits:
    """Fits of sets of effects over one base, kept.

    Attributes
    ----------
    known : mapping
        SI values near the minimum of some sets, from where they are begun.
    rough : bool
        Nothing is concluded from the fits: some steps do for a minimum.
    failed : set
        Sets whose fit did not converge from any start.
    """

    base: Refit
    known: Mapping[EffectSet, Mapping[str, Any]] = field(default_factory=dict)
    rough: bool = False
    done: dict[EffectSet, Refit] = field(default_factory=dict)
    failed: set[EffectSet] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.done[frozenset()] = self.base

    def with_uses(self, uses: Iterable[Use]) -> Problem:
        """The base with effects."""
        return self.base.problem.with_uses(sorted(uses))

    def fit(self, start: Refit, uses: EffectSet, starts: Sequence[Mapping[str, Any]]) -> Refit | None:
        """Fit a set that contains a fitted one.

        A descent that ends above a fit with fewer effects has missed the minimum: it is begun anew from there.

        Parameters
        ----------
        start : Refit
            A set that it contains.
        uses : frozenset of Use
        starts : sequence of mapping
            SI values to start from.

        Returns
        -------
        Refit or None
            None where no start converged.
        """
        if uses in self.done or uses in self.failed:
            return self.done.get(uses)
        problem = self.with_uses(uses)
        known = [dict(self.known[uses])] if uses in self.known else []
        starts = known or self._continuation_start(start, problem, uses, starts) or starts
        near = _nearer(problem, starts) if start.poor_fit else starts
        best = self._pruned_minimum(uses, problem, near)
        if best is None:
            best, nested = self._lowest(problem, near, start), self._best_within(uses)
            if best is None or best.chi2 > nested.fit.chi2 + STALL_TOLERANCE * unit(problem, best.chi2):
                best = self._lowest(problem, [start_nested(nested, starts[0], problem)], nested)
        if best is None:
            self.failed.add(uses)
            return None
        fitted = describe(problem, best.theta, best.residual, best.jacobian)
        self.done[uses] = Refit(uses, problem, fitted)
        return self.done[uses]

    def lowered(self, uses: EffectSet) -> list[EffectSet]:
        """Parts of a fitted set that had missed their minimum: from where the set was led they fall lower."""
        return [part for part in [*self.done] if part and part < uses and self._lower(part, self.done[uses])]

    def _lower(self, part: EffectSet, more: Refit) -> bool:
        """Fit a part of a larger set anew from the values of that, where a linear step from there promises less."""
        fewer = self.done[part]
        problem, chi2 = fewer.problem, fewer.fit.chi2
        values = {**fewer.fit.values, **more.fit.values}
        column = {name: k for k, name in enumerate(more.fit.names)}
        known = [column[name] for name in problem.names if name in column]
        slopes = more.fit.jacobian[: problem.n_data, known]
        least = chi2 - STALL_TOLERANCE * unit(problem, chi2)
        try:
            there = problem.residual(problem.start(values))[: problem.n_data]
            left = there - slopes @ np.linalg.lstsq(slopes, there, rcond=1e-9)[0]
            best = self._lowest(problem, [values], None) if left @ left < least else None
        except ComputationError:  # the part stays where it is
            return False
        if best is None or best.chi2 >= least or _level(problem, best) > _level(problem, fewer.fit):
            return False
        fitted = describe(problem, best.theta, best.residual, best.jacobian)
        self.done[part] = replace(fewer, fit=fitted)
        return True

    def _continuation_start(
        self, start: Refit, problem: Problem, uses: EffectSet, starts: Sequence[Mapping[str, Any]]
    ) -> list[dict[str, Any]]:
        """A start from a continuation fit, where what the set has wrong has dragged its parameters away."""
        if not start.poor_fit:
            return []
        own = [{n: v for n, v in s.items() if ParameterName(n).owner in map(str, uses)} for s in starts]
        try:
            if self.rough:
                return [continuation_fit(problem, own, True)]
            return [{**self._not_dragged, **one} for one in own]
        except ComputationError:  # the other starts may do better
            return []

    @cached_property
    def _not_dragged(self) -> dict[str, Any]:
        """Values of the base on few, uncertain lines, which what is missing drags away less."""
        return continuation_fit(self.base.problem)

    def _pruned_minimum(
        self, uses: EffectSet, problem: Problem, near: Sequence[Mapping[str, Any]]
    ) -> Minimum | None:
        """Where an expensive refit was led, if that is so bad that its exact minimum is of no interest.

        A subsample has the windows of the place where it began: some steps on all lines come before the judgement.
        """
        if not problem.strategy.frugal or len(near) > 1:
            return None
        others = [r.fit.chi2 for other, r in self.done.items() if len(other) <= len(uses)]
        if self._best_within(uses).fit.chi2 <= min(others):
            return None
        theta = problem.start(near[0])
        # Jacobians of all lines before a set is given up, each with the multiple of the best chi-square beyond which no
        # more are spent on it: windows that a subsample has from elsewhere change a response by some per cent, where
        # the noise is some tenths of one.
        for jacobians, hopeless in ((0, 1000.0), (1, 100.0), (2, 0.0)):
            theta = descend_steps(problem, theta, jacobians)
            chi2, best = float(np.sum(problem.residual(theta) ** 2)), min(others)
            # 0.2: share of its signature to which the equation of an effect is trusted
            if chi2 <= PRUNING_FACTOR * best + 0.2**2 * max(self.base.fit.chi2 - best, 0.0):
                return None  # near enough for an exact minimum, or an exact equation, to help
            if chi2 > hopeless * best:
                break
        return _minimum(problem, theta)

    def _lowest(
        self, problem: Problem, starts: Sequence[Mapping[str, float | Real]], fewer: Refit | None
    ) -> Minimum | None:
        """Lowest minimum that a descent from one of the starts reaches; None where none does.

        `fewer` is a fit with fewer effects, whose slopes serve where new ones are expensive.
        """
        try:  # most of several starts lead astray slowly
            theta = best_screened(problem, [problem.start(values) for values in starts])
            if self.rough:
                return _minimum(problem, descend_steps(problem, theta, ENOUGH))
            return descend(problem, theta, _slopes(fewer, problem, theta))
        except NotSettledError as fault:
            return fault.reached
        except ComputationError:
            return None

    def _best_within(self, uses: EffectSet) -> Refit:
        """The best fit so far that a set contains: with the other effects at nothing the set is as good."""
        return min((r for part, r in self.done.items() if part < uses), key=lambda r: r.fit.chi2)


def _nearer(problem: Problem, starts: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """The start that leads lowest on a subsample about the last one, led there, where the base is far off."""
    seen = problem.subsampled(problem.start(starts[-1]))
    if seen.n_data == problem.n_data:
        return starts
    try:
        there = descend(seen, best_screened(seen, [problem.start(values) for values in starts]))
    except ComputationError:  # the whole data may do better
        return starts
    return [problem.values_at(there.theta)]


def _level(problem: Problem, one: Minimum | Fit) -> float:
    """-2 ln of the probability of the data about a minimum, its parameters known to their typical sizes."""
    slope = one.jacobian * problem.scale
    volume = np.linalg.slogdet(np.eye(problem.scale.size) + slope.T @ slope)[1]
    return float(one.chi2 + volume)


def _minimum(problem: Problem, theta: Real) -> Minimum:
    residual = problem.residual(theta)
    return Minimum(theta, residual, problem.jacobian(theta), float(residual @ residual))


def _slopes(fewer: Refit | None, problem: Problem, theta: Real) -> Real | None:
    """First Jacobian where an exact one is expensive: of a fit with fewer effects, and slopes of new parameters."""
    if fewer is None or not problem.strategy.frugal or fewer.poor_fit:
        return None
    known = {name: fewer.fit.jacobian[:, k] for k, name in enumerate(fewer.fit.names)}
    here = problem.residual(theta)
    low, high = problem.bounds
    columns = []
    for k, name in enumerate(problem.names):
        if name in known and name.whole in fewer.problem.free:
            columns.append(with_rows_of(known[name], fewer.problem, problem))
            continue
        # 1e-3: step as a share of a parameter's typical size
        step, moved = 1e-3 * problem.scale[k], theta.copy()
        there = theta[k] + step if theta[k] + step <= high[k] else theta[k] - step
        moved[k] = np.clip(there, low[k], high[k])
        columns.append((problem.residual(moved) - here) / (moved[k] - theta[k]))
    return np.column_stack(columns)


def start_nested(
    nested: Refit, near: Mapping[str, float | Real], problem: Problem
) -> dict[str, float | Real]:
    """Values of a fit with fewer effects, those that it lacks at nothing and with the shapes of `near`."""
    known = nested.problem.assembly.uses
    nothing = {n: v for n, v in problem.assembly.neutral.items() if not ParameterName(n).owned_by(known)}
    return {**near, **nested.fit.values, **nothing}


def start_from(start: Refit, members: Iterable[Scored], problem: Problem) -> dict[str, float | Real]:
    """Values to start a refit from: the linearised refit of everything along the signatures."""
    members = list(members)
    fitted, size = start.fit, start.problem.scale
    columns = np.column_stack([fitted.jacobian * size, *(s.signature.columns for s in members)])
    step, *_ = np.linalg.lstsq(columns, -fitted.residual, rcond=1e-9)
    low, high = start.problem.bounds
    theta = np.clip(fitted.theta + step[: size.size] * size, low, high)
    values: dict[str, float | Real] = dict(start.problem.values_at(theta))
    moved: dict[str, float] = {}
    _, *parts = np.split(step, np.cumsum([size.size, *(s.amplitudes for s in members)]))
    for member, multiples in zip(members, parts, strict=False):
        inside = np.clip(multiples, *member.signature.multiplier_bounds)
        moved |= member.signature.moved(start.problem, theta, inside)
    return values | problem.of_elements(moved)
