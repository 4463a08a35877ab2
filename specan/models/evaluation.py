"""The values of a graph of quantities with some effects switched on, for conditions and parameter values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

from specan.errors import ComputationError, RequestError, SpecanError, nearest
from specan.models.effect import Effect, Parameter, ParameterName, Use
from specan.models.from_function import place_of, users_mistake
from specan.models.loops import FixedPoint, components, cut
from specan.models.quantity import Condition, Quantity
from specan.units import convert

BASE = "base"  # the name of the part of a quantity that is not an effect's


class Parts(Protocol):
    """What of a model takes part in an evaluation; see `specan.models.model.Model`."""

    @property
    def conditions(self) -> Mapping[str, Condition]: ...  # noqa: D102
    @property
    def quantities(self) -> Mapping[str, Quantity]: ...  # noqa: D102
    @property
    def effects(self) -> Mapping[str, Effect]: ...  # noqa: D102
    @property
    def axes(self) -> Mapping[str, tuple[str, ...]]: ...  # noqa: D102
    @property
    def base_order(self) -> Mapping[str, int]: ...  # noqa: D102


class _Call:
    """How one function of a quantity or an effect is called: what it reads, and its parameters by their full names."""

    def __init__(self, of: Quantity | Effect, key: str) -> None:
        self.of, self.key, self.function, self.reads = of, key, of.function, tuple(of.reads)
        self.parameters = tuple((name, f"{key}.{name}") for name in of.parameters)

    def tell(self, fault: Exception, known: Collection[str]) -> None:
        """Raise what is a user's mistake as such."""
        missing = next((name for name in self.reads if name not in known), None)
        if missing is not None:
            raise RequestError(
                f"{self.of.name!r} reads {missing!r}, which the data do not have",
                remedy=f"add {missing} to the data",
            ) from None
        _tell(fault, self.of)


@dataclass(frozen=True)
class Evaluator:
    """Quantities, conditions and effects with a set of effects switched on."""

    model: Parts
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
        after: Evaluation | None = None,
        changed: Iterable[str] = (),
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
        after : Evaluation, optional
            An evaluation at the same conditions from which only the parameters named in `changed`
            differ: what does not depend on them is taken over. A derivative by a microphone's gain
            then costs no sound field.
        changed : iterable of str
            Full names of those parameters.

        Raises
        ------
        ComputationError
            A loop that an effect closes does not settle.
        """
        parameters = {**self.defaults, **(values or {})}
        known: dict[str, Any] = dict(self._condition_defaults)
        known.update(conditions)
        parts: dict[str, Mapping[str, Any]] = {}
        taken, steps = self._schedule(
            self._plan, None if wanted is None else tuple(wanted), None if after is None else tuple(changed)
        )
        if after is not None:
            known.update({name: after.values[name] for name in taken if name in after.values})
            parts.update({name: after.parts[name] for name in taken if name in after.parts})
        for loop, order, guessed in steps:
            if guessed:
                self._settle(loop, order, guessed, known, parameters, parts)
            else:
                self._value(loop[0], known, parameters, parts)
        return Evaluation(known, parts)

    # --- how it is done -----------------------------------------------------------------------

    @cached_property
    def _condition_defaults(self) -> dict[str, float]:
        return {
            name: float(convert(c.default, c.column_unit or c.unit, c.unit))
            for name, c in self.model.conditions.items()
            if c.default is not None
        }

    @cached_property
    def _acting(self) -> dict[str, list[Use]]:
        """Uses that change each quantity, in identifier order."""
        acting: dict[str, list[Use]] = {name: [] for name in self.model.quantities}
        for use in self.uses:
            for name in self.model.effects[use.name].changes:
                acting[name].append(use)
        return acting

    @cached_property
    def _reads(self) -> dict[str, tuple[str, ...]]:
        """Quantities that each quantity depends on, effects included."""
        quantities = self.model.quantities
        return {
            name: tuple(
                r
                for r in dict.fromkeys(
                    (
                        *node.reads,
                        *(r for use in self._acting[name] for r in self.model.effects[use.name].reads),
                    )
                )
                if r in quantities
            )
            for name, node in quantities.items()
        }

    @cached_property
    def _plan(self) -> list[tuple[list[str], list[str], tuple[str, ...]]]:
        """Quantities in the order of evaluation; of a loop also the order in which it is walked, and what is guessed.

        Those of one loop are together, in the base's order.
        """
        order = self.model.base_order
        if all(order[read] < order[name] for name, reads in self._reads.items() for read in reads):
            return [([name], [name], ()) for name in order]  # no effect makes a loop
        parts = [sorted(part, key=order.__getitem__) for part in components(self._reads)]
        return [(part, *cut(part, self._reads)) for part in parts]

    @cached_property
    def _schedules(self) -> dict[Any, tuple[list[str], list[Any]]]:
        return {}

    def _schedule(
        self, plan: list[Any], wanted: tuple[str, ...] | None, changed: tuple[str, ...] | None
    ) -> tuple[list[str], list[Any]]:
        """Quantities that are taken over from an evaluation before, and parts of the plan that are worked out."""
        if (wanted, changed) not in self._schedules:
            needed: set[str] = set(self._reads) if wanted is None else set()
            stack = list(wanted or ())
            while stack:  # what is wanted, and what it rests on
                name = stack.pop()
                if name not in needed and name in self._reads:
                    needed.add(name)
                    stack.extend(self._reads[name])
            touched = set(self._reads) if changed is None else self.downstream(changed)
            steps = [step for step in plan if touched.intersection(step[0])]
            self._schedules[wanted, changed] = (
                [name for step in plan if not touched.intersection(step[0]) for name in step[0]],
                [step for step in steps if needed.intersection(step[0])],
            )
        return self._schedules[wanted, changed]

    @cached_property
    def _calls(self) -> dict[str, tuple[_Call, list[tuple[Use, Effect, _Call]]]]:
        """Of each quantity the call of the base, and those of the effects that act on it."""
        effects = self.model.effects
        calls = {use: _Call(effects[use.name], str(use)) for use in self.uses}
        return {
            name: (_Call(node, name), [(use, effects[use.name], calls[use]) for use in self._acting[name]])
            for name, node in self.model.quantities.items()
        }

    @cached_property
    def _downstream_cache(self) -> dict[tuple[str, ...], frozenset[str]]:
        return {}

    def downstream(self, changed: tuple[str, ...]) -> frozenset[str]:
        """Quantities that depend on any of the parameters."""
        if changed not in self._downstream_cache:
            touched: set[str] = set()
            for parameter in changed:
                owner = ParameterName(parameter).owner
                if owner in self.model.quantities:
                    touched.add(owner)
                else:
                    touched.update(self.model.effects[Use.parse(owner).name].changes)
            for part, _, _ in self._plan:  # what is read comes first, so one pass suffices
                if any(not touched.isdisjoint(self._reads[name]) or name in touched for name in part):
                    touched.update(part)
            self._downstream_cache[changed] = frozenset(touched)
        return self._downstream_cache[changed]

    def read_by(self, touched: frozenset[str]) -> frozenset[str]:
        """Other quantities that some of them read directly."""
        return frozenset(r for name in touched for r in self._reads[name]) - touched

    def _value(
        self,
        name: str,
        known: dict[str, Any],
        parameters: Mapping[str, Any],
        parts: dict[str, Mapping[str, Any]],
    ) -> None:
        """(base + what is added) x what scales it; or the base collection and what joins it."""
        # Functions are called here and in `_settle`, not through a helper: it would cost at every evaluation of a fit.
        base, acting = self._calls[name]
        given = map(known.__getitem__, base.reads)
        try:
            if base.parameters:
                found = base.function(*given, **{own: parameters[full] for own, full in base.parameters})
            else:
                found = base.function(*given)
        except Exception as fault:
            base.tell(fault, known)
            raise
        contributions = {BASE: found}
        for use, effect, call in acting:
            given = map(known.__getitem__, call.reads)
            try:
                found = call.function(*given, **{own: parameters[full] for own, full in call.parameters})
            except Exception as fault:
                call.tell(fault, known)
                raise
            if len(effect.changes) > 1:
                found = found[name]
            if effect.at:
                found = (use.at, found) if name in effect.joins else self._spread(use, effect, name, found)
            contributions[call.key] = found
        if not acting:
            known[name], parts[name] = contributions[BASE], contributions
            return
        try:
            known[name] = self._combined(name, contributions)
        except ValueError:
            raise self._of_another_shape(name, contributions) from None
        parts[name] = contributions

    def _combined(self, name: str, contributions: Mapping[str, Any]) -> Any:
        total, factor = contributions[BASE], None
        for _, effect, call in self._calls[name][1]:
            given = contributions[call.key]
            if name in effect.joins:
                total = (*total, given)
            elif name in effect.adds_to:
                total = total + given
            else:
                factor = given if factor is None else factor * given
        return total if factor is None else total * factor

    def _of_another_shape(self, name: str, contributions: Mapping[str, Any]) -> RequestError:
        """The error that names the contribution which does not go with the quantity."""
        import numpy as np

        size = np.shape(contributions[BASE])
        for use in self._acting[name]:
            shape = np.shape(contributions[str(use)])
            if shape not in ((), size):
                place = place_of(self.model.effects[use.name].function)
                return RequestError(
                    f"{place}: {use} gives the shape {shape} for {name!r}, which has the shape {size}",
                    expected="one value a row",
                )
        return RequestError(f"what acts on {name!r} has other shapes than it", expected="one value a row")

    def _spread(self, use: Use, effect: Effect, name: str, given: Any) -> Any:
        """Put one element's contribution into an array over the axis; neutral elsewhere."""
        import numpy as np

        axis = self.model.axes[effect.at]
        given = np.asarray(given)
        rest = np.zeros if name in effect.adds_to else np.ones
        whole = rest((len(axis), *given.shape), dtype=np.result_type(given, float))
        whole[axis.index(use.at)] = given
        return whole

    def _settle(
        self,
        loop: list[str],
        order: list[str],
        guessed: tuple[str, ...],
        known: dict[str, Any],
        parameters: Mapping[str, Any],
        parts: dict[str, Mapping[str, Any]],
    ) -> None:
        """Solve a loop from the values without effects; see `specan.models.loops`."""
        import numpy as np

        for name in loop:
            base = self._calls[name][0]
            try:
                own = {own: parameters[full] for own, full in base.parameters}
                known[name] = base.function(*map(known.__getitem__, base.reads), **own)
            except Exception as fault:
                base.tell(fault, known)
                raise
        point = FixedPoint({name: known[name] for name in guessed})
        with np.errstate(all="ignore"):  # a loop that runs away is told below, once
            while point.goes_on:
                known.update(point.guess)
                for name in order:
                    self._value(name, known, parameters, parts)
                point.take({name: known[name] for name in guessed})
        if point.settled:
            return
        raise ComputationError(
            f"the loop through {', '.join(loop)} does not settle",
            expected="a fixed point within 200 iterations",
            remedy="reduce the effect that closes it (" + ", ".join(map(str, self.uses)) + ")",
        )


def varying(rows: Iterable[Mapping[str, Any]], least: float = 5e-4) -> frozenset[str]:
    """Conditions that take several values over some data: a spread of more than `least` of the largest.

    Of an oil temperature 0.2 K: the viscosity differs by 1 %, which repeats within 0.2 % tell. A dependence that is
    held at a default then looks like an effect; one that is free and hardly determined costs nothing.

    Examples
    --------
    >>> sorted(varying([{"speed": [100.0, 200.0], "oil_level": [1.0]}, {"oil_level": [0.6]}]))
    ['oil_level', 'speed']
    """
    import numpy as np

    spans: dict[str, tuple[float, float]] = {}
    for conditions in rows:
        for name, values in conditions.items():
            finite = np.asarray(values, dtype=float)
            finite = finite[np.isfinite(finite)]
            if finite.size:
                low, high = spans.get(name, (np.inf, -np.inf))
                spans[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
    return frozenset(n for n, (low, high) in spans.items() if high - low > least * max(abs(low), abs(high)))


@dataclass(frozen=True)
class Evaluation:
    """Values of all quantities, and what each effect contributed to them."""

    values: Mapping[str, Any]
    parts: Mapping[str, Mapping[str, Any]]

    def __getitem__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise RequestError(f"no quantity {name!r}", remedy=nearest(name, self.values)) from None

    def contributions(self, name: str) -> Mapping[str, Any]:
        """Contribution of the base and of every effect to a quantity (terms, and factors as factors)."""
        return self.parts[name]


def _tell(fault: Exception, owner: Quantity | Effect) -> None:
    """Raise what is a user's mistake, in the function of a quantity or an effect, as such; leave other faults."""
    mistake = None if isinstance(fault, SpecanError) else users_mistake(fault, owner.function, owner.name)
    if mistake is not None:
        raise mistake from fault
