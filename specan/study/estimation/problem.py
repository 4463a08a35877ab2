"""The fitting problem: a model with some effects, observations, which parameters are free, and what is known of them.

This is what every other part of the study engine works on. In short::

    problem = base_problem(model, observations)          # specan.study.selection.candidates
    result = fit(problem)                                # specan.study.estimation.fit
    richer = problem.with_uses([Use("seal-drag")])       # its parameters free, at their defaults
    problem.residual(theta)       # V^(-1/2) (predicted - measured), then priors and known ranges
    problem.jacobian(theta)       # derivative of that residual: the Gauss-Newton step is -(J'J)^-1 J'r
    richer.start(result.values)   # a start that keeps what was fitted

An instrument effect that is in the problem as a nuisance (held by its prior) becomes a candidate by `with_uses`: the
use loses its priors and its parameters are free; `without` gives them their priors back.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import require_known
from specan.models import Assembly, Use, varying
from specan.models.effect import ParameterName
from specan.study.estimation.linear import STEP, stencil
from specan.study.observation import Array, Observation, Strategy

SHARE = 0.25  # standard deviation of a tail over the range


@dataclass(frozen=True, eq=False)
class PseudoMeasurements:
    """What is known beforehand, as rows of a residual that follow the data: priors, then known ranges with soft tails.

    A range says where such machines were found; it is knowledge, no law. Inside it every value is as good as
    another. Outside, the pull (value - end) / sd is a residual like any other: sd is a quarter of the range, as for
    one of plus and minus two standard deviations (GUM, JCGM 100:2008, 4.3.5 and 6.3.3). A quantity that is known to
    be positive is known to that share of itself: below its range, sd is at most a quarter of the lower end, so that
    "none at all" is four standard deviations away. Infinite ends pull nowhere. A prior is a range whose ends are its
    mean.

    Attributes
    ----------
    order : array of int
        Element of theta of each row; the first `priors` have a prior.
    low, high : array
        Ends, SI.
    below, above : array
        Standard deviations outside of them.

    Examples
    --------
    >>> import numpy as np
    >>> known = PseudoMeasurements.of(np.arange(2), np.empty((0, 2)), np.array([[0.01, 0.12], [0.3, 1.5]]), np.ones(2))
    >>> known.residual(np.array([0.175, 0.0])).round(2)
    array([ 2., -4.])
    """

    order: NDArray[np.intp]
    priors: int
    low: Array
    high: Array
    below: Array
    above: Array

    @classmethod
    def of(cls, order: NDArray[np.intp], priors: Array, ranges: Array, size: Array) -> PseudoMeasurements:
        """Of priors (mean, sd) and ranges (low, high); `size` serves for the width of a range that is open."""
        (mean, sd), (low, high) = priors.T, ranges.T
        width = np.where(np.isfinite(high - low) & (high > low), high - low, size / SHARE)
        below = SHARE * np.where(low > 0, np.minimum(low, width), width)
        return cls(
            order, mean.size, np.append(mean, low), np.append(mean, high), np.append(sd, below),
            np.append(sd, SHARE * width),
        )  # fmt: skip

    def residual(self, theta: Array) -> Array:
        """Standard deviations by which values lie off their mean or outside of their range, with their sign."""
        values = theta[self.order]
        under, over = np.minimum(values - self.low, 0.0), np.maximum(values - self.high, 0.0)
        return np.asarray(under / self.below + over / self.above, dtype=float)

    def jacobian(self, theta: Array) -> Array:
        """Derivative of `residual`."""
        values = theta[self.order]
        pulled = (values > self.high) | (np.arange(values.size) < self.priors)
        slopes = np.where(values < self.low, 1 / self.below, np.where(pulled, 1 / self.above, 0.0))
        return np.asarray(slopes[:, None] * np.eye(values.size)[self.order])


@dataclass(frozen=True, eq=False)
class Problem:
    """Observations, a model, its free parameters and what is known about them beforehand.

    Attributes
    ----------
    assembly : Assembly
        The model with its effects switched on, nuisances included.
    observations : tuple of Observation
    free : tuple of str
        Full names of the parameters that are fitted (``churning.exponent``).
    values : mapping
        SI values: those of the parameters that are held, and starts for the others.
    priors : mapping
        ``{name: (mean, standard deviation)}`` in SI: priors of instrument errors, from their calibration.
    domains : mapping
        ``{name: (low, high)}`` in SI where a study narrows or widens the parameter's own domain.
    unheld : frozenset of str
        Parameters that are not held by their known ranges, to see what the data alone would take.
    one_sided : bool
        Derivatives by one-sided differences, at half the price.
    """

    assembly: Assembly
    observations: tuple[Observation, ...]
    free: tuple[str, ...]
    values: Mapping[str, Any] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    domains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    unheld: frozenset[str] = frozenset()
    one_sided: bool = False

    def __post_init__(self) -> None:
        for name in (*self.free, *self.values, *self.priors, *self.domains):
            require_known(name, self.assembly.parameters, f"the model has no parameter {name!r}")

    # --- names and sizes ----------------------------------------------------------------------

    @cached_property
    def elements(self) -> dict[str, tuple[str, ...]]:
        """Elements of each parameter that is a vector: ``{"gain-error.gain": ("Channel 1", ...)}``."""
        found = {}
        for name, parameter in self.assembly.parameters.items():
            if parameter.per == "recording":
                found[name] = self.recordings
            elif parameter.per and parameter.per not in self.assembly.model.groups:
                found[name] = tuple(self.assembly.model.axes[parameter.per])
        return found

    @cached_property
    def nuisances(self) -> frozenset[Use]:
        """Uses that stand for instrument errors held by a prior."""
        return frozenset(Use.parse(ParameterName(name).owner) for name in self.priors)

    @cached_property
    def recordings(self) -> tuple[str, ...]:
        """Recordings of all observations, in their order."""
        return tuple(dict.fromkeys(r for o in self.observations for r in o.recordings))

    @cached_property
    def names(self) -> tuple[ParameterName, ...]:
        """Name of every element of theta: ``churning.exponent``, ``gain-error.gain[Channel 3]``."""
        known = self.elements
        return tuple(ParameterName(name).at(e) for name in self.free for e in known.get(name, ("",)))

    @cached_property
    def _owner(self) -> tuple[str, ...]:
        return tuple(name for name in self.free for _ in self.elements.get(name, ("",)))

    @cached_property
    def n_data(self) -> int:
        """Number of measured values."""
        return sum(o.n for o in self.observations)

    @cached_property
    def observable_rows(self) -> dict[str, NDArray[np.bool_]]:
        """Which measured rows hold each observable."""
        names = [np.broadcast_to(getattr(o, "observable", o.name), o.n) for o in self.observations]
        together = np.concatenate(names).astype(str)
        return {name: together == name for name in dict.fromkeys(together.tolist())}

    @cached_property
    def strategy(self) -> Strategy:
        """How it is fitted and searched: frugally where rows are many."""
        own = [o.strategy for o in self.observations]
        frugal = self.n_data > 2000 or any(one.frugal for one in own)
        return Strategy(
            frugal,
            *(any(getattr(one, name) for one in own) for name in ("continuation", "linearised_covariance")),
        )

    @cached_property
    def n_effective(self) -> float:
        """Number of independent values that the data are worth."""
        return float(sum(o.n_effective for o in self.observations))

    @cached_property
    def noise_dof(self) -> float:
        """Degrees of freedom of the noise estimate over all observations (Satterthwaite)."""
        total = sum(o.n for o in self.observations)
        spread = sum((o.n / total) ** 2 / o.noise_dof for o in self.observations)
        return 1 / spread if spread > 0 else float("inf")

    @cached_property
    def pure_error_dof(self) -> float:
        """Degrees of freedom that only compare repeats with each other."""
        return float(sum(o.pure_error_dof for o in self.observations))

    @cached_property
    def n_priors(self) -> int:
        """Number of priors: pseudo-measurements with a mean, which follow the data."""
        return self.pseudo.priors

    @cached_property
    def pseudo_rows(self) -> dict[str, int]:
        """Row of every pseudo-measurement by its name: priors by their element, then known ranges."""
        names = [self.names[i] for i in self.pseudo.order]
        return {n if k < self.n_priors else f"range of {n}": self.n_data + k for k, n in enumerate(names)}

    # --- from theta to values ------------------------------------------------------------------

    def values_at(self, theta: Array) -> dict[str, Any]:
        """SI value of every parameter, those held and linked included."""
        theta = np.asarray(theta, dtype=float)
        own = {name: theta[at] if isinstance(at, slice) else float(theta[at]) for name, at in self._places}
        return {**self._held, **own}

    def of_elements(self, values: Mapping[str, float]) -> dict[str, Any]:
        """SI value of each parameter out of those of its elements; of none that lacks some."""
        found: dict[str, Any] = {}
        for whole in dict.fromkeys(ParameterName(name).whole for name in values):
            names = [whole.at(e) for e in self.elements.get(whole, ("",))]
            if all(name in values for name in names):
                own = np.array([values[name] for name in names])
                found[whole] = own if whole in self.elements else float(own[0])
        return found

    @cached_property
    def _places(self) -> list[tuple[str, int | slice]]:
        """Where each free parameter is in theta: one place, or those of its elements."""
        ends = np.cumsum([len(self.elements.get(name, ("",))) for name in self.free]).tolist()
        return [
            (name, slice(first, end) if name in self.elements else first)
            for name, first, end in zip(self.free, [0, *ends], ends, strict=False)
        ]

    @cached_property
    def _held(self) -> dict[str, Any]:
        held = {}
        for name, default in self.assembly.defaults.items():
            value = self.values.get(name, default)
            if name in self.elements and np.ndim(value) == 0:
                value = np.full(len(self.elements[name]), float(value))
            held[name] = value
        return held

    def start(self, values: Mapping[str, Any] | None = None) -> Array:
        """Theta at the start values (declared defaults, a study's own), or at `values` where they have it."""
        parts = [np.empty(0)]
        for name in self.free:
            value = (values or {}).get(name, self._held[name])
            size = len(self.elements.get(name, ("",)))
            parts.append(np.broadcast_to(np.asarray(value, dtype=float), (size,)))
        theta = np.concatenate(parts)
        low, high = self.bounds
        return np.clip(theta, low, high)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper end of the domain of theta."""
        ends = [self.domain(name) for name in self._owner]
        return np.array([e[0] for e in ends]), np.array([e[1] for e in ends])

    def domain(self, name: str) -> tuple[float, float]:
        """Where a parameter may go, SI."""
        si = self.assembly.parameters[name].si
        return self.domains.get(name, (si.lower, si.upper))

    def plausible(self, name: str) -> tuple[float, float]:
        """Where a parameter is expected, SI; an amplitude of an effect beyond the base also where it vanishes.

        A leak that is smaller than those one usually finds is a leak nevertheless.
        """
        si, model = self.assembly.parameters[name].si, self.assembly.model
        owner, own = ParameterName(name).owner, ParameterName(name).own
        acting = {str(use): use for use in self.assembly.uses}
        base = {*model.base_effects, *(form for forms in model.other_forms.values() for form in forms)}
        if owner not in acting or owner in base:
            return si.min, si.max
        neutral = model.effects[acting[owner].name].neutral_si.get(own, si.min)
        return min(si.min, neutral), max(si.max, neutral)

    @cached_property
    def scale(self) -> Array:
        """Typical size of each element of theta: the prior's width, a quarter of the range, the default."""
        return np.array([self._size(name) for name in self._owner])

    def _size(self, name: str) -> float:
        si = self.assembly.parameters[name].si
        if name in self.priors:
            return self.priors[name][1]
        if np.isfinite(si.max - si.min) and si.max > si.min:
            return float(min(si.max - si.min, 4 * abs(si.default) or np.inf)) / 4
        return abs(si.default) or 1.0

    # --- residual ------------------------------------------------------------------------------

    def residual(self, theta: Array) -> Array:
        """V^(-1/2) (predicted - measured) of every observation, then the pseudo-measurements.

        These are (theta - mean) / sd of the priors, and the pulls of the known ranges.
        """
        predicted = zip(self.observations, self.predictions(theta), strict=True)
        parts = [o.whiten(one - o.measured) for o, one in predicted]
        return np.concatenate([*parts, self.pseudo.residual(np.asarray(theta, dtype=float))])

    def jacobian(self, theta: Array, steps: Array | None = None, order: int = 2) -> Array:
        """Derivative of `residual`, one column for each element of theta; see `sensitivities`."""
        slopes = self.sensitivities(theta, steps, order)
        white = [o.whiten(slope) for o, slope in zip(self.observations, slopes, strict=True)]
        return np.concatenate([*white, self.pseudo.jacobian(np.asarray(theta, dtype=float))], axis=0)

    def sensitivities(self, theta: Array, steps: Array | None = None, order: int = 2) -> list[Array]:
        """Derivative of `predictions`, one matrix (n, len(theta)) an observation, by finite differences.

        With `steps`, one for each element of theta, they are of the given order, 2 or 4.
        """
        theta = np.asarray(theta, dtype=float)
        if not theta.size:
            return [np.empty((o.n, 0)) for o in self.observations]
        low, high = self.bounds
        if steps is None:
            steps = STEP * np.maximum(self.scale, np.abs(theta))
            order = 1 if self.strategy.frugal or self.one_sided else 2
        points, weights = stencil(theta, steps, low, high, order)
        many = [self.values_at(p) for p in points]
        return [
            o.predict_many(self.assembly, [self.seen_by(o, v) for v in many]) @ weights
            for o in self.observations
        ]

    def predictions(self, theta: Array) -> list[Array]:
        """What the model expects in place of `measured`, one vector an observation."""
        values = self.values_at(theta)
        return [o.predict(self.assembly, self.seen_by(o, values)) for o in self.observations]

    def plain(self, theta: Array) -> list[Array]:
        """Predictions as they are shown: of the fitted model, without what `predict` allows for its declared errors."""
        values = self.values_at(theta)
        return [o.plain(self.assembly, self.seen_by(o, values)) for o in self.observations]

    def whiten(self, array: Array) -> Array:
        """V^(-1/2) of all observations on an array over the `n_data` measured rows (no priors)."""
        *parts, _ = self.split(array)
        return np.concatenate([o.whiten(part) for o, part in zip(self.observations, parts, strict=True)])

    def split(self, array: Array) -> list[Array]:
        """Rows of a residual or Jacobian: one part an observation, the priors' last."""
        return np.split(array, np.cumsum([o.n for o in self.observations]))

    def settled(self, theta: Array) -> bool:
        """Whether predictions are exact enough at some place; if not, they are from then on."""
        values = self.values_at(theta)
        looked_at = [o.settled(self.assembly, self.seen_by(o, values)) for o in self.observations]
        return all(looked_at)

    def seen_by(self, observation: Observation, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Values as one observation sees them: of vectors over recordings its own elements, or their mean."""
        own = [name for name in self._per_recording if name in values]
        if not own or observation.recordings == self.recordings:
            return values
        if not set(observation.recordings) <= set(self.recordings):
            return {**values, **{n: np.full(len(observation.recordings), np.mean(values[n])) for n in own}}
        index = [self.recordings.index(r) for r in observation.recordings]
        return {**values, **{name: values[name][index] for name in own}}

    @cached_property
    def _per_recording(self) -> tuple[str, ...]:
        return tuple(n for n, p in self.assembly.parameters.items() if p.per == "recording")

    # --- what is known beforehand -----------------------------------------------------------------

    @cached_property
    def pseudo(self) -> PseudoMeasurements:
        """Priors and known ranges as rows of the residual."""
        held = [i for i, owner in enumerate(self._owner) if owner in self.priors]
        ranged = [i for i, owner in enumerate(self._owner) if owner not in self.priors]
        prior = [self.priors[self._owner[i]] for i in held]
        owners = [self._owner[i] for i in ranged]
        ends = [(-np.inf, np.inf) if o in self.unheld else self.plausible(o) for o in owners]
        priors, ranges = (np.array(pairs, dtype=float).reshape(-1, 2) for pairs in (prior, ends))
        return PseudoMeasurements.of(np.array(held + ranged, np.intp), priors, ranges, self.scale[ranged])

    def pulls(self, theta: Array) -> dict[ParameterName, float]:
        """Standard deviations by which each element without a prior leaves its known range."""
        pulls = self.pseudo.residual(np.asarray(theta, dtype=float)).tolist()
        names = [self.names[i] for i in self.pseudo.order]
        return dict(list(zip(names, pulls, strict=True))[self.n_priors :])

    def pulled(self, residual: Array) -> float:
        """Chi-square that a residual owes to known ranges, and not to data or priors."""
        return float(np.sum(residual[self.n_data + self.n_priors :] ** 2))

    # --- other problems ------------------------------------------------------------------------

    def subsampled(self, theta: Array) -> Problem:
        """The problem on part of its rows, with the residual that the whole has at theta; itself where they are few."""
        most = 5000  # rows of a subsample
        if self.n_data <= most:
            return self
        values, share = self.values_at(theta), most / self.n_data
        seen = [(o, self.seen_by(o, values), round(share * o.n)) for o in self.observations]
        return self.over([o.subsample(self.assembly, own, rows) for o, own, rows in seen])

    def with_uses(self, uses: Iterable[Use | str]) -> Problem:
        """Add effects, their parameters free as far as declared and varied; a nuisance loses its prior."""
        new = [Use.parse(u) if isinstance(u, str) else u for u in uses]
        assembly = self.assembly.model.assemble({*self.assembly.uses, *new})
        varied = varying(o.conditions for o in self.observations)
        own = [n for n in assembly.free(varied) if ParameterName(n).owned_by(new)]
        return replace(
            self,
            assembly=assembly,
            free=tuple(dict.fromkeys([*self.free, *own])),
            priors={n: p for n, p in self.priors.items() if not ParameterName(n).owned_by(new)},
        )

    def holding(self, values: Mapping[str, float]) -> Problem:
        """Hold parameters at given SI values instead of fitting them."""
        return replace(
            self,
            free=tuple(n for n in self.free if n not in values),
            values={**self.values, **values},
            priors={n: p for n, p in self.priors.items() if n not in values},
        )

    def over(self, observations: Sequence[Observation]) -> Problem:
        """The same model and parameters on other observations."""
        return replace(self, observations=tuple(observations))
