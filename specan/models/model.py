"""A model: quantities, conditions, the effects it knows, and what is measured of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Any

from specan.errors import RequestError, require_known
from specan.models.effect import Effect, Use
from specan.models.evaluation import Assembly
from specan.models.from_function import PREFIX, as_declared, fields_from_functions, name_of, title_of
from specan.models.groups import check_groups, with_groups
from specan.models.quantity import Condition, Observable, Quantity, RigStatement, TableRules, rig_statement
from specan.models.rates import Rates, State, fields_from_rates

if TYPE_CHECKING:
    from specan.models.march import Solver


@dataclass(frozen=True)
class Nuisance:
    """An instrument error that every fit of a study carries, held by its certificate.

    `effect` names the effect whose parameter follows a normal law about its neutral value with the
    standard deviation `prior_sd`, in the parameter's unit. Of several recordings each has its own where `per_recording`
    says so.
    """

    effect: str
    parameter: str
    prior_sd: float
    source: str = ""
    per_recording: bool = False


@dataclass(frozen=True)
class Words:
    """What a model calls its own things, in sentences that a study prints.

    Attributes
    ----------
    ideal : str
        The model without effects: ``the ideal machine``.
    discrepancy_of : str
        What the declared discrepancy is a percentage of: the part of the reading that the effects make.
    remedy_uncertainty : str
        An example of stating a reading's uncertainty in the rig file.
    vary : str
        What to vary in a measurement in which nothing varies.
    what_else : str
        What else could be asked where nothing is left to decide; ``{study}`` stands for the study's directory.
    """

    ideal: str = "the model without effects"
    discrepancy_of: str = "prediction"
    remedy_uncertainty: str = ""
    vary: str = "conditions"
    what_else: str = ""


@dataclass(frozen=True)
class Model:
    """A graph of quantities with the effects that may change it.

    Attributes
    ----------
    name, title : str
        What users type, and what it is in a few words.
    conditions, quantities, effects, observables : mapping
        By name.
    axes : mapping
        Elements of each axis: ``{"wall": ("x0", "x1", ...), "microphone": ("Mic 1", ...)}``.
    base_effects : tuple of str
        Effects that a new study starts with.
    other_forms : mapping
        Other published forms of the same part as a base effect, by its name: taken in its place, never beside it,
        and never called missing.
    nuisances : tuple of Nuisance
        Instrument errors with a certificate.
    rig : RigStatement
        Limits of the conditions and uncertainties of instruments and settings.
    words : Words
        What the model calls its own things.
    table_rules : TableRules, optional
        What its tables obey, and which of their columns follow from others.
    for_kinds : mapping
        What it tells a kind of measurement of its own: ``{kind: statement}``, which only that kind's module reads.
    settings : mapping
        The checked rig file, for the model's own simulation and figures; a study never reads it.
    law : str
        Quantity on which a law is looked for when something unknown is missing, beside those of the observables.
    unsuited : mapping
        Effects that such models know and this rig rules out: ``{name: reason}``.
    notes : tuple of str
        What a user should know before a study starts: size, cost.
    groups : tuple of str
        Columns of names by which parameters may differ; see `specan.models.groups`.
    group_elements : mapping
        Their names, once a measurement has told them.
    declared_units : bool
        Its functions receive numbers in the declared units of conditions and parameters, not in SI.
    rates : Rates, optional
        States that it integrates, of a model that `from_rates` makes.
    """

    name: str
    title: str
    conditions: Mapping[str, Condition]
    quantities: Mapping[str, Quantity]
    effects: Mapping[str, Effect]
    observables: Mapping[str, Observable]
    base_effects: tuple[str, ...] = ()
    other_forms: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    nuisances: tuple[Nuisance, ...] = ()
    axes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rig: RigStatement = field(default_factory=RigStatement)
    words: Words = field(default_factory=Words)
    table_rules: TableRules | None = None
    for_kinds: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    law: str = ""
    unsuited: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    declared_units: bool = False
    rates: Rates | None = None
    groups: tuple[str, ...] = ()
    group_elements: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = {*self.quantities, *self.conditions, *(self.rates.states if self.rates else ())}
        for node in self.quantities.values():
            _require_known(node.name, node.reads, known)
        for effect in self.effects.values():
            of_states = [r for state in effect.states.values() for r in state.reads]
            _require_known(effect.name, (*effect.reads, *of_states), known | set(effect.states))
            _require_known(effect.name, effect.changes, set(self.quantities))
            if effect.at:
                lacking = (
                    f"the effect {effect.name!r} acts at one {effect.at}, an axis that {self.name} lacks"
                )
                require_known(effect.at, self.axes, lacking)
        self.base_order  # noqa: B018 - says which quantities depend on each other in a loop
        for observable in self.observables.values():
            _require_known(observable.name, (observable.quantity,), set(self.quantities))
            node = self.quantities[observable.quantity]
            if node.unit != observable.unit:
                raise RequestError(
                    f"the observable {observable.name!r} is in {observable.unit}, its quantity "
                    f"{node.name!r} in {node.unit}",
                    expected="the unit of the quantity",
                    remedy="declare that unit, and the unit of a table's column as column_unit",
                )

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "none"
        return f"<Model: {self.name}, observables {', '.join(self.observables)}, effects {effects}>"

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of measurement that the model can be compared with: ``("table",)``."""
        return tuple(dict.fromkeys(o.kind for o in self.observables.values()))

    @property
    def is_own(self) -> bool:
        """Whether it is a user's: made of functions, or of a file."""
        return self.declared_units or any(
            str(getattr(q.function, "__module__", "")).startswith(PREFIX) for q in self.quantities.values()
        )

    def with_effect(self, *more: Effect) -> Model:
        """The same model with further effects in its catalogue (a user's own).

        Parameters
        ----------
        *more : Effect
            Effects; one of a known name takes its place.

        Returns
        -------
        Model
            A new one.
        """
        own = [as_declared(e) for e in more] if self.declared_units else more
        return replace(self, effects={**self.effects, **{e.name: e for e in own}})

    def with_constants(self, values: Mapping[str, Any]) -> Model:
        """The model with other values of quantities that are constant.

        Parameters
        ----------
        values : mapping
            Names of quantities and their values, in their units.

        Returns
        -------
        Model
            All else is as it was.
        """
        changed = {name: replace(self.quantities[name], function=lambda v=v: v) for name, v in values.items()}
        return replace(self, quantities={**self.quantities, **changed})

    def with_rig(self, rig: Mapping[str, Any]) -> Model:
        """The same model with what a rig file says of limits and uncertainties, which comes first.

        Parameters
        ----------
        rig : mapping
            The parsed rig file.

        Returns
        -------
        Model
            A new one.

        Raises
        ------
        RequestError
            The rig says more than that, or names what the model does not have.
        """
        if unknown := [key for key in rig if key not in ("limits", "uncertainty")]:
            raise RequestError(
                f"the rig has {unknown[0]!r}, which this model does not read",
                expected="[limits] and [uncertainty]",
                remedy="put it below one of them, or correct the name; a built-in model is given its rig by load_model",
            )
        said = rig_statement(rig, self.conditions.values(), self.observables.values())
        names = ("limits", "setting", "reading", "reading_percent")
        first: dict[str, Any] = {name: {**getattr(self.rig, name), **getattr(said, name)} for name in names}
        percent = said.discrepancy_percent or self.rig.discrepancy_percent
        return replace(self, rig=replace(self.rig, **first, discrepancy_percent=percent))

    @classmethod
    def from_function(
        cls,
        function: Callable[..., Any],
        *parts: Callable[..., Any],
        conditions: Mapping[str, Any],
        observables: Mapping[str, Any],
        parameters: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
        effects: Sequence[Effect] = (),
        base_effects: Sequence[str] = (),
        uncertainty: Mapping[str, float] | None = None,
        groups: Sequence[str] = (),
        name: str = "",
        title: str = "",
    ) -> Model:
        """Make a model of plain functions, in the units that they are written in.

        Each function is a quantity of its own name; its arguments are conditions, parameters, and other functions.
        All of them, effects too, receive and return numbers in the declared units; nothing is converted to SI.
        *An effect can act on quantities that have a name*: to let one act on a part of a formula, split that part
        off as a function of its own and read it by its name.

        Parameters
        ----------
        function : callable
            What is measured as a function of conditions and parameters, for arrays.
        *parts : callable
            Further functions that it, or an effect, reads.
        conditions : mapping
            ``{name: unit}``, ``{name: (unit, lowest, highest)}`` or ``{name: Condition}``. A table holds a condition
            in the column of that name: ``flow``, or ``flow [l/s]`` in another unit.
        observables : mapping
            ``{name: unit}`` or ``{name: (unit, standard uncertainty of a reading)}`` of functions that are measured;
            ``{name: Frf(unit, response=, reference=)}`` of transfer functions over the condition ``frequency``.
        parameters : mapping, optional
            ``{name: value}``, ``(value, low, high)``, ``(value, low, high, unit)``, ``dict(value=, min=, max=, vary=,
            unit=)`` or a Parameter. An argument with a default in the signature need not be named.
        units : mapping, optional
            Units of the functions in `parts`.
        effects : sequence of Effect, optional
            Candidates that may be missing; see `specan.models.effect.effect`.
        base_effects : sequence of str, optional
            Those that a new study begins with.
        uncertainty : mapping, optional
            What ``[uncertainty]`` of a rig file may hold, see `specan.models.quantity.rig_statement`.
        groups : sequence of str, optional
            Columns of names, ``("specimen",)``: a parameter declared ``Parameter(..., per="specimen")`` has one value
            for each, and of every other one it is asked whether it differs.
        name, title : str, optional
            What users type, and what it is in a few words; by default made of the function's name and docstring.

        Returns
        -------
        Model
            With the functions as quantities.

        Raises
        ------
        RequestError
            An argument that is nothing known, a unit that is none, a circle.

        Examples
        --------
        >>> import numpy as np
        >>> def cooling(time, start, rate):
        ...     return 20 + (start - 20) * np.exp(-rate * time)
        >>> model = Model.from_function(
        ...     cooling, conditions={"time": ("min", 0, 60)}, observables={"cooling": ("degC", 0.1)},
        ...     parameters={"start": (90, 60, 100), "rate": (0.05, 0.01, 0.2)},
        ... )
        >>> found = model.assemble().evaluate({"time": np.array([0.0, 20.0])})
        >>> found["cooling"].round(1).tolist()
        [90.0, 45.8]
        """
        more = {"parameters": parameters or {}, "units": units or {}, "effects": effects}
        more["uncertainty"] = uncertainty or {}
        fields = fields_from_functions((function, *parts), conditions, observables, more)
        first = next(iter(observables))
        name = name or name_of(function) or first
        title = title or title_of(function) or first
        made = cls(
            name, title, **fields, base_effects=tuple(base_effects), declared_units=True,
            words=Words(discrepancy_of=fields["observables"][first].quantity.replace("_", " ")),
        )  # fmt: skip
        made = with_groups(made, [groups] if isinstance(groups, str) else groups)
        check_groups(made)
        return made

    @classmethod
    def from_rates(
        cls,
        *functions: Callable[..., Any],
        states: Mapping[str, State],
        inputs: Mapping[str, Any],
        observables: Mapping[str, Any],
        parameters: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
        effects: Sequence[Effect] = (),
        base_effects: Sequence[str] = (),
        window_s: float | None = None,
        name: str = "",
        title: str = "",
    ) -> Model:
        """Make a model of rates of change, which is compared with a recording itself.

        The function ``dx`` gives the rate of the state ``x``, per second. Its arguments are states, inputs, ``time``,
        parameters and other functions, as in `from_function`; so an effect can act on any term of it that has a name.
        What an observable ``x`` reads is the quantity ``x_measured``, on which effects of the sensor act.

        Parameters
        ----------
        *functions : callable
            Rates, and what they or effects read.
        states : mapping
            ``{name: State(unit, start=)}``.
        inputs : mapping
            ``{name: unit}`` of recorded channels.
        observables : mapping
            ``{name: Signal(unit, uncertainty)}`` of states or functions.
        parameters, units : mapping, optional
            As in `from_function`.
        effects : sequence of Effect, optional
            What may be missing.
        base_effects : sequence of str, optional
            Those of them that the model has.
        window_s : float, optional
            Recordings are compared in pieces of this length, each with a start of its own: for runs that are chaotic,
            or so long that what nobody measured drives them away.
        name, title : str
            As in `from_function`.

        Returns
        -------
        Model
            Whose measurements are recordings.

        Examples
        --------
        >>> import numpy as np
        >>> from specan.models import Signal, State
        >>> def dx(x, force, rate):
        ...     return rate * (force - x)
        >>> model = Model.from_rates(
        ...     dx, states={"x": State("N")}, inputs={"force": "N"}, observables={"x": Signal("N", 0.01)},
        ...     parameters={"rate": (2.0, 0.1, 10, "1/s")},
        ... )
        >>> found = model.assemble().evaluate({"time": np.linspace(0, 1, 101), "force_channel": np.ones(101)})
        >>> float(found["x"][-1].round(4))
        0.8647
        """
        more = {"parameters": parameters or {}, "units": units or {}, "effects": effects}
        return cls(
            name or name_of(functions[0]) or next(iter(observables)),
            title or title_of(functions[0]) or "a model of rates",
            **fields_from_rates(functions, states, inputs, observables, more, window_s),
            base_effects=tuple(base_effects),
            declared_units=True,
        )

    def assemble(self, uses: Iterable[Use | str] = ()) -> Assembly:
        """Switch effects on.

        Parameters
        ----------
        uses : iterable of Use or str
            Effects with their places: ``wall-impedance@z1``.

        Returns
        -------
        Assembly
            The model with exactly these effects.

        Raises
        ------
        RequestError
            An effect or a place that this model does not have.
        """
        parsed = {Use.parse(u) if isinstance(u, str) else u for u in uses}
        for use in parsed:
            if use.name in self.unsuited:
                raise RequestError(f"{use.name} is not an effect of this rig: {self.unsuited[use.name]}")
            require_known(use.name, self.effects, f"{self.name} has no effect {use.name!r}")
            effect = self.effects[use.name]
            if effect.at and use.at not in self.axes[effect.at]:
                raise RequestError(
                    f"{use} names no {effect.at} of this rig",
                    expected=f"one of {', '.join(self.axes[effect.at])}",
                )
            if use.at and not effect.at:
                raise RequestError(
                    f"{use.name} acts everywhere, not at {use.at!r}", remedy=f"use {use.name!r}"
                )
        return self._assembly(tuple(sorted(parsed)))

    @cached_property
    def base_order(self) -> list[str]:
        """Quantities in the order of evaluation, where no effect acts."""
        reads = {n: [r for r in q.reads if r in self.quantities] for n, q in self.quantities.items()}
        try:
            return list(TopologicalSorter(reads).static_order())
        except CycleError as fault:
            circle = ", ".join(sorted(set(fault.args[1])))
            raise RequestError(
                f"the quantities {circle} of {self.name} depend on each other in a loop"
            ) from None

    @cached_property
    def solver(self) -> Solver:
        """What integrates its states."""
        from specan.models.march import Solver

        return Solver(self)

    @cached_property
    def _assembly(self) -> Callable[[tuple[Use, ...]], Assembly]:
        """What assembles: a search asks for the same ones again, and each knows its order of evaluation."""
        return cache(partial(Assembly, self))

    def candidates(self, assembly: Assembly) -> tuple[Use, ...]:
        """Uses of effects that the assembly lacks, one for each element of the axis they act at.

        Parameters
        ----------
        assembly : Assembly
            The model with the effects that it has.

        Returns
        -------
        tuple of Use
            In the order of their names.
        """
        uses = []
        there = {use.name for use in assembly.uses}
        parts = [{name, *others} for name, others in self.other_forms.items()]
        taken = set().union(*(part for part in parts if part & there))
        for effect in self.effects.values():
            if effect.name in taken:
                continue
            elements = self.axes[effect.at] if effect.at else ("",)
            uses += [Use(effect.name, element) for element in elements]
        return tuple(use for use in sorted(uses) if use not in assembly.uses)

    def not_testable(self, available: Iterable[str]) -> dict[str, str]:
        """Effects whose conditions the data lack: ``{"running-in": "needs elapsed_time"}``.

        Parameters
        ----------
        available : iterable of str
            Conditions that the data hold.

        Returns
        -------
        dict
            Reason by name of the effect.
        """
        readable = set(available) | {n for n, c in self.conditions.items() if c.default is not None}
        known = set(available) | {n for n in readable if n in self.conditions and self.conditions[n].known}
        missing = {}
        for effect in self.effects.values():
            reads = {r for r in effect.reads if r in self.conditions and r not in readable}
            lacking = sorted(reads | {w for w in effect.needs if w not in known and w not in self.quantities})
            if lacking:
                missing[effect.name] = "needs " + ", ".join(lacking)
        return missing


def _require_known(owner: str, names: Iterable[str], known: set[str]) -> None:
    for name in names:
        require_known(name, known, f"{owner!r} names the quantity {name!r}, which does not exist")
