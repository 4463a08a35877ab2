"""The values of a model's quantities with some effects switched on, for conditions and parameter values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np

from specan.errors import ComputationError, RequestError, SpecanError, nearest
from specan.models.effect import Effect, Parameter, ParameterName, Use
from specan.models.from_function import place_of, users_mistake
from specan.models.quantity import Quantity
from specan.result import gathered
from specan.units import convert

TOLERANCE = 1e-13  # relative change in going once around

State = dict[str, Any]


def ordered(reads: Mapping[str, Sequence[str]]) -> tuple[list[str], tuple[str, ...]]:
    """Nodes of a graph, those that are read first coming first; and those whose values must be guessed for it.

    Of every circle the node is guessed through which the most ways lead.

    Examples
    --------
    >>> ordered({"a": ["b"], "b": ["c"], "c": []})
    (['c', 'b', 'a'], ())
    >>> ordered({"a": ["c"], "b": ["a"], "c": ["b"], "d": ["b"]})
    (['c', 'd', 'a', 'b'], ('b',))
    """
    guessed: list[str] = []
    while True:
        left = {node: [r for r in names if r not in guessed] for node, names in reads.items()}
        try:
            return list(TopologicalSorter(left).static_order()), tuple(guessed)
        except CycleError as fault:
            read_by = {node: sum(node in names for names in left.values()) for node in fault.args[1]}
            guessed.append(max(read_by, key=lambda node: (read_by[node] * len(left[node]), node)))


def reached(start: Iterable[str], edges: Mapping[str, Sequence[str]]) -> set[str]:
    """Nodes that can be reached along the edges, those at the start included.

    Examples
    --------
    >>> sorted(reached(["a"], {"a": ["b"], "b": ["a"], "c": ["a"]}))
    ['a', 'b']
    """
    found: set[str] = set()
    left = list(start)
    while left:
        node = left.pop()
        if node not in found:
            found.add(node)
            left.extend(edges.get(node, ()))
    return found


def fixed_point(around: Callable[[State], State], guess: Mapping[str, Any]) -> bool:
    """Go around a loop, ``x -> around(x)``, until it leads to where it began; whether it did within 200 rounds.

    Each element takes its own secant step (Aitken 1926): the change from one round to the next tells the loop's
    gain q, and 1/(1-q) of the plain step leads to where it ends. A loop that swings is damped that way, one that
    contracts slowly is sped up. A gain above one has no stable fixed point: the plain step then runs away.

    Examples
    --------
    >>> import numpy as np
    >>> last = {}
    >>> fixed_point(lambda x: last.update(x=np.cos(x["x"])) or dict(last), {"x": np.float64(1.0)})
    True
    >>> round(float(last["x"]), 12)
    0.739085133215
    """
    x: State = {name: np.asarray(value) for name, value in guess.items()}
    before: tuple[State, State] | None = None
    # one that runs away is told once; an element that has arrived does not move
    with np.errstate(all="ignore"):
        for _ in range(200):
            new = around(x)
            gap = {name: new[name] - x[name] for name in x}
            sizes = {name: np.abs(new[name]) + np.abs(x[name]) + 1e-300 for name in x}
            worst = max(float(np.max(np.abs(gap[name]) / sizes[name])) for name in x)
            if worst < TOLERANCE or not np.isfinite(worst):
                return worst < TOLERANCE
            factor = _steps(x, gap, *before) if before else dict.fromkeys(x, 1.0)
            before, x = (x, gap), {name: x[name] + factor[name] * gap[name] for name in x}
    return False


def _steps(x: State, gap: State, x_before: State, gap_before: State) -> State:
    """Factor of the plain step for each element, from the slope of the gap between two rounds."""
    factors = {}
    for name in x:
        factor = (x_before[name] - x[name]) / (gap[name] - gap_before[name])
        size = np.abs(factor)
        limited = factor * np.clip(size, 0.05, 10.0) / size  # of the plain iteration's step
        factors[name] = np.where(np.isfinite(size) & (np.real(factor) > 0), limited, 1.0)
    return factors


BASE = "base"  # the name of the part of a quantity that is not an effect's


class _Call:
    """How one function of a quantity or an effect is called: what it reads, and its parameters by their full names."""

    def __init__(self, of: Quantity | Effect, key: str) -> None:
        self.of, self.key, self.function, self.reads = of, key, of.function, tuple(of.reads)
        self.parameters = tuple((name, f"{key}.{name}") for name in of.parameters)

    def __call__(self, known: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        """The function's value; what is a user's mistake is raised as such."""
        try:
            own = {name: parameters[full] for name, full in self.parameters}
            found = self.function(*map(known.__getitem__, self.reads), **own)
            return np.asarray(found) if isinstance(found, list) else found
        except (Exception, SystemExit) as fault:
            missing = next((name for name in self.reads if name not in known), None)
            if missing is not None:
                raise RequestError(
                    f"{self.of.name!r} reads {missing!r}, which the data do not have",
                    remedy=f"add {missing} to the data",
                ) from None
            if not isinstance(fault, SpecanError):
                mistake = users_mistake(fault, self.of.name, self.function)
                if mistake is not None:
                    raise mistake from fault
            raise


@dataclass(frozen=True)
class Assembly:
    """A model with a set of effects switched on; evaluated for conditions and parameter values."""

    model: Any
    uses: tuple[Use, ...]

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Every parameter by its full name (``churning.exponent``, ``wall-impedance@z1.mass``)."""
        found: dict[str, Parameter] = {
            ParameterName.of(node.name, name): parameter
            for node in self.model.quantities.values()
            for name, parameter in node.parameters.items()
        }
        for use in self.uses:
            effect = self.model.effects[use.name]
            found |= {ParameterName.of(use, name): parameter for name, parameter in effect.parameters.items()}
        return found

    @cached_property
    def neutral(self) -> dict[str, float]:
        """SI values at which every effect of the assembly vanishes."""
        return {
            ParameterName.of(use, name): value
            for use in self.uses
            for name, value in self.model.effects[use.name].neutral_si.items()
        }

    @cached_property
    def validity(self) -> dict[str, tuple[float, float]]:
        """SI range of each quantity within which all effects hold: the intersection of theirs."""
        ranges: dict[str, tuple[float, float]] = {}
        for use in self.uses:
            for name, (low, high, unit) in self.model.effects[use.name].valid.items():
                node = self.model.quantities.get(name) or self.model.conditions.get(name)
                si = node.unit if node else unit
                old = ranges.get(name, (float("-inf"), float("inf")))
                ranges[name] = (max(old[0], convert(low, unit, si)), min(old[1], convert(high, unit, si)))
        return ranges

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """SI default of every parameter."""
        return {name: parameter.si.default for name, parameter in self.parameters.items()}

    def free(self, varying: Collection[str]) -> tuple[str, ...]:
        """Parameters that a fit sets free, where only some conditions take several values (see `varying`)."""
        return tuple(
            name
            for name, parameter in self.parameters.items()
            if not parameter.fixed and all(needed in varying for needed in parameter.needs)
        )

    def evaluate(
        self,
        conditions: Mapping[str, Any],
        values: Mapping[str, Any] | None = None,
        wanted: Sequence[str] | None = None,
    ) -> Evaluation:
        """Evaluate for SI conditions (arrays) and SI parameter values (defaults where none is given).

        Parameters
        ----------
        conditions : mapping
            ``{name: array}``; a missing condition takes its default.
        values : mapping, optional
            ``{"effect.parameter": value}``; a vector for a parameter with an axis.
        wanted : sequence of str, optional
            Quantities to evaluate, with what they read; all by default.

        Raises
        ------
        ComputationError
            A loop that an effect closes does not converge.
        """
        return next(self.evaluate_many(conditions, [values or {}], wanted))

    def evaluate_many(
        self,
        conditions: Mapping[str, Any],
        many: Iterable[Mapping[str, Any]],
        wanted: Sequence[str] | None = None,
    ) -> Iterator[Evaluation]:
        """Evaluate for several sets of parameter values at the same conditions, the first of them in full.

        Of the others only what depends on a parameter that differs from the first set: a derivative by a receiver's
        gain then costs no sound field. Arguments as in `evaluate`.
        """
        if self.model.rates is None:
            yield from self.pointwise(conditions, many, wanted)
            return
        many = list(many)
        for values, states in zip(many, self.model.rates.trajectories(self, conditions, many), strict=True):
            yield next(self.pointwise({**conditions, **states}, [values], wanted))

    def pointwise(
        self,
        conditions: Mapping[str, Any],
        many: Iterable[Mapping[str, Any]],
        wanted: Sequence[str] | None = None,
    ) -> Iterator[Evaluation]:
        """The same where states, if there are any, are among the conditions."""
        quantities = None if wanted is None else tuple(wanted)
        first: Evaluation | None = None
        start: Mapping[str, Any] = {}
        for values in many:
            parameters = {**self.defaults, **values}
            found = Evaluation({**self._condition_defaults, **conditions}, {})
            changed = (
                None if first is None else tuple(n for n, v in values.items() if not _same(start.get(n), v))
            )
            kept, steps = self._schedule(quantities, changed)
            if first is not None:
                found.values.update({name: first.values[name] for name in kept if name in first.values})
                found.parts.update({name: first.parts[name] for name in kept if name in first.parts})
            for step in steps:
                if len(step) > 1 or step[0] in self._plan[1]:
                    self._settle(step, found, parameters)
                else:
                    self._value(step[0], found, parameters)
            if first is None:
                first, start = found, parameters
            yield found

    # --- how it is done -----------------------------------------------------------------------

    @cached_property
    def _condition_defaults(self) -> dict[str, float]:
        return {
            name: float(convert(c.default, c.column_unit or c.unit, c.unit))
            for name, c in self.model.conditions.items()
            if c.default is not None
        }

    @cached_property
    def _calls(self) -> dict[str, tuple[_Call, list[tuple[Use, Effect, _Call]]]]:
        """Of each quantity the call of the base, and those of the effects that act on it, in identifier order."""
        effects = [(use, self.model.effects[use.name]) for use in self.uses]
        calls = [(use, effect, _Call(effect, str(use))) for use, effect in effects]
        return {
            name: (_Call(node, name), [one for one in calls if name in one[1].changes])
            for name, node in self.model.quantities.items()
        }

    @cached_property
    def _reads(self) -> dict[str, list[str]]:
        """Quantities that each quantity depends on, effects included."""
        found = {}
        for name, (base, acting) in self._calls.items():
            names = [*base.reads, *(r for _, _, call in acting for r in call.reads)]
            found[name] = [r for r in dict.fromkeys(names) if r in self.model.quantities]
        return found

    @cached_property
    def _plan(self) -> tuple[list[tuple[str, ...]], tuple[str, ...]]:
        """Quantities in the order of evaluation, those of loops together; and those that are guessed to go around."""
        reads = self._reads
        order, guessed = ordered(reads)
        readers = gathered((read, name) for name, names in reads.items() for read in names)
        below, above = reached(guessed, readers), reached(guessed, reads)
        loop = tuple(name for name in order if name in below & above)
        steps: list[tuple[str, ...]] = [(name,) for name in order if name not in below]
        steps += [loop] if loop else []
        return steps + [(name,) for name in order if name in below - above], guessed

    @cached_property
    def _schedule(self) -> Callable[..., tuple[list[str], list[tuple[str, ...]]]]:
        return cache(self._scheduled)

    def _scheduled(
        self, wanted: tuple[str, ...] | None, changed: tuple[str, ...] | None
    ) -> tuple[list[str], list[tuple[str, ...]]]:
        """Quantities that do not depend on what has changed, and steps of the plan that are worked out."""
        needed = set(self._reads) if wanted is None else reached(wanted, self._reads)
        touched = set(self._reads)
        if changed is not None:
            owners = {ParameterName(name).owner for name in changed}
            touched = {
                name
                for name, (base, acting) in self._calls.items()
                if base.key in owners or any(call.key in owners for _, _, call in acting)
            }
            for step in self._plan[0]:  # what is read comes first, so one pass suffices
                if any(name in touched or not touched.isdisjoint(self._reads[name]) for name in step):
                    touched.update(step)
        kept = [name for name in self._reads if name not in touched]
        return kept, [s for s in self._plan[0] if touched.intersection(s) and needed.intersection(s)]

    def _value(self, name: str, into: Evaluation, parameters: Mapping[str, Any]) -> None:
        """(base + what is added) x what scales it; or the base collection and what joins it."""
        base, acting = self._calls[name]
        total, factor = base(into.values, parameters), None
        into.parts[name] = contributions = {BASE: total}
        for use, effect, call in acting:
            found = call(into.values, parameters)
            if len(effect.changes) > 1:
                found = found[name]
            if effect.at:
                found = (use.at, found) if name in effect.joins else self._spread(use, effect, name, found)
            contributions[call.key] = found
        try:
            for _, effect, call in acting:
                if name in effect.joins:
                    total = (*total, contributions[call.key])
                elif name in effect.adds_to:
                    total = total + contributions[call.key]
                else:
                    factor = contributions[call.key] if factor is None else factor * contributions[call.key]
            into.values[name] = total if factor is None else total * factor
        except (ValueError, TypeError):
            raise self._misfit(name, contributions) from None

    def _misfit(self, name: str, contributions: Mapping[str, Any]) -> RequestError:
        """The error that names the contribution which does not go with the quantity."""
        size = np.shape(contributions[BASE])
        for use, effect, call in self._calls[name][1]:
            given = contributions[call.key]
            shape, kind = np.shape(given), np.asarray(given).dtype.kind
            if kind not in "biufc":
                return RequestError(
                    f"{place_of(effect.function)}: {use} gives {given!r}", expected="one number per row"
                )
            if shape not in ((), size):
                return RequestError(
                    f"{place_of(effect.function)}: {use} gives the shape {shape} for {name!r}, "
                    f"which has the shape {size}",
                    expected="one value per row",
                )
        return RequestError(f"the effects on {name!r} have another shape", expected="one value per row")

    def _spread(self, use: Use, effect: Effect, name: str, given: Any) -> Any:
        """Put one element's contribution into an array over the axis; neutral elsewhere."""
        axis = self.model.axes[effect.at]
        given = np.asarray(given)
        rest = np.zeros if name in effect.adds_to else np.ones
        whole = rest((len(axis), *given.shape), dtype=np.result_type(given, float))
        whole[axis.index(use.at)] = given
        return whole

    def _settle(self, loop: tuple[str, ...], into: Evaluation, parameters: Mapping[str, Any]) -> None:
        """Solve a loop from the values without effects."""
        guessed, known = self._plan[1], into.values
        for name in self.model.base_order:
            if name in loop:
                known[name] = self._calls[name][0](known, parameters)

        def around(guess: Mapping[str, Any]) -> dict[str, Any]:
            known.update(guess)
            for name in loop:
                self._value(name, into, parameters)
            return {name: known[name] for name in guessed}

        if not fixed_point(around, {name: known[name] for name in guessed}):
            raise ComputationError(
                f"the loop through {', '.join(sorted(loop))} does not converge",
                expected="a fixed point within 200 iterations",
                remedy="reduce the effect that closes it (" + ", ".join(map(str, self.uses)) + ")",
            )


def _same(old: Any, new: Any) -> bool:
    if old is new:
        return True
    if type(old) is type(new) is float:
        return bool(old == new)
    return np.array_equal(old, new)


def varying(rows: Iterable[Mapping[str, Any]]) -> frozenset[str]:
    """Conditions that take several values over some data: a spread of more than 5e-4 of the largest.

    Of an oil temperature 0.2 K: the viscosity differs by 1 %, which repeats within 0.2 % tell. A dependence that is
    held at a default then looks like an effect; one that is free and hardly determined costs nothing.

    Examples
    --------
    >>> sorted(varying([{"speed": [100.0, 200.0], "oil_level": [1.0]}, {"oil_level": [0.6]}]))
    ['oil_level', 'speed']
    """
    spans: dict[str, tuple[float, float]] = {}
    for conditions in rows:
        for name, values in conditions.items():
            finite = np.asarray(values, dtype=float)
            finite = finite[np.isfinite(finite)]
            if finite.size:
                low, high = spans.get(name, (np.inf, -np.inf))
                spans[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
    return frozenset(n for n, (low, high) in spans.items() if high - low > 5e-4 * max(abs(low), abs(high)))


@dataclass(frozen=True)
class Evaluation:
    """Values of all quantities, and what each effect contributed to them."""

    values: dict[str, Any]
    parts: dict[str, Mapping[str, Any]]

    def __getitem__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise RequestError(f"no quantity {name!r}", remedy=nearest(name, self.values)) from None

    def contributions(self, name: str) -> Mapping[str, Any]:
        """Contribution of the base and of every effect to a quantity (terms, and factors as factors)."""
        return self.parts[name]
