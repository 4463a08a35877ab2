"""Models that are rates: states with their rates of change, inputs that are recorded, signals that are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.errors import RequestError, nearest
from specan.models.effect import Effect, Parameter, Use
from specan.models.from_function import fields_from_functions, users_mistake
from specan.models.quantity import Condition, Observable, Quantity, constant, of_parameter, rig_statement
from specan.units import is_compatible, scale_to

KIND = "time"  # of measurement
TIME = "time"
MEASURED = "measured"  # of a state's start
FEW = 15  # samples whose slope tells how quickly a piece begins
UNSIZED = (
    "effects of the shelf have ranges for values of about 1; give a recording to set them (--measurement)"
)


@dataclass(frozen=True)
class State:
    """A quantity that a model integrates; its rate is the function of its name with a d before it.

    Attributes
    ----------
    unit : str
        The rate is in this unit per second.
    start : float, Parameter or "measured"
        Its value when a recording begins. A Parameter with ``per="recording"`` is fitted for each of them; "measured"
        takes the first value of the channel of that name.
    rate : callable, optional
        Of a state that an effect brings: its rate, a function of quantities and of the effect's parameters.
    reads : tuple of str
        Quantities that `rate` reads, in the order of its arguments; by default the names of these.

    Examples
    --------
    >>> State("mm", start=Parameter(0.0, "mm", min=-5, max=5, per="recording")).unit
    'mm'
    """

    unit: str
    start: float | str | Parameter = 0.0
    rate: Callable[..., Any] | None = None
    reads: tuple[str, ...] = ()


@dataclass(frozen=True)
class Signal:
    """A channel that is compared with a state or another quantity of a model of rates.

    Attributes
    ----------
    unit : str
    uncertainty : float, optional
        Standard deviation of the channel's noise, in `unit`. The data tell it where it is not given, and correct it by
        and by where it is.
    channel : str
        Name of the channel; by default that of the observable.
    """

    unit: str
    uncertainty: float | None = None
    channel: str = ""


@dataclass(frozen=True)
class Unsized:
    """Effects of the shelf for names of a model, whose usual sizes a recording tells.

    Attributes
    ----------
    make : callable
        The function of the shelf.
    named : mapping
        Of each argument the name, and the quantity whose size goes with it.
    arguments : mapping
        All arguments.
    """

    make: Callable[..., Any]
    named: Mapping[str, tuple[str, str]]
    arguments: Mapping[str, Any]

    def effects(self, sizes: Mapping[str, float], units: Mapping[str, str]) -> list[Effect]:
        """Effects for these sizes; of one where none is known yet."""
        given = {}
        for argument, (name, quantity) in self.named.items():
            if quantity not in units:
                raise RequestError(f"the model has no {name!r}", remedy=nearest(name, units))
            given[argument] = name, sizes.get(quantity, 1.0), units[quantity]
        return list(self.make(**{**self.arguments, **given}))


@dataclass(frozen=True)
class Rates:
    """What makes a model one of rates.

    Attributes
    ----------
    states : mapping
        Of the model without effects.
    inputs : mapping
        Name of the quantity to name of the condition that is recorded.
    scales : mapping
        Of each observable that is a state: its unit in that of the state.
    unsized : tuple of Unsized
        Effects whose ranges a recording tells.
    tolerances : dict
        Change of a state that a single reading does not show.
    exact : bool
        Whether states are integrated to a billionth of their RMS, whatever the noise: a simulation.
    window_s : float, optional
        Pieces in which recordings are compared, each with its own start.
    """

    states: Mapping[str, State]
    inputs: Mapping[str, str]
    scales: Mapping[str, float] = field(default_factory=dict)
    unsized: tuple[Unsized, ...] = ()
    tolerances: dict[str, float] = field(default_factory=dict)
    exact: bool = False
    window_s: float | None = None

    def allow(self, noise: Mapping[str, float]) -> None:
        """Take the noise of observables, in their unit, for what a single reading does not show."""
        for name, size in noise.items():
            if name in self.scales:
                self.tolerances.setdefault(name, size * self.scales[name])

    def sized(self, model: Any, recordings: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> Any:
        """The model with effects of the shelf for its sizes in recordings: conditions and measured values of each.

        What is not measured is what the model answers at its starting values, times what was measured over that.

        Raises
        ------
        RequestError
            A size is nothing, or not finite.
        """
        if not self.unsized:
            return model
        names = {pair for one in self.unsized for pair in one.named.values()}
        sizes = self._sizes(model, recordings, {name for _, name in names})
        for name, size in sizes.items():
            if not (np.isfinite(size) and size > 0):
                raise RequestError(
                    f"{name} is {size:g} in the model's response at its starting values",
                    remedy=f'change these, or give the shelf its usual size: ("{name}", 5, "{_units(model)[name]}")',
                )
        made = [effect for one in self.unsized for effect in one.effects(sizes, _units(model))]
        return replace(model.with_effect(*made), notes=())

    def _sizes(
        self,
        model: Any,
        recordings: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]],
        names: Iterable[str],
    ) -> dict[str, float]:
        own = {name: model.effects[Use.parse(name).name] for name in model.base_effects}
        base = replace(model, effects=own).assemble(model.base_effects)
        with np.errstate(all="ignore"):
            found = [base.evaluate(conditions) for conditions, _ in recordings]
        shown = {
            o.quantity: [own[n] for _, own in recordings if n in own] for n, o in model.observables.items()
        }
        told = {name: _usual_size(parts) for name, parts in shown.items() if parts}
        ratio = float(np.mean([told[n] / _usual_size([one[n] for one in found]) for n in told] or 1.0))
        scale = {name: 1.0 if name in self.inputs else ratio for name in names}
        return {n: told.get(n) or scale[n] * _usual_size([one[n] for one in found]) for n in names}

    def in_pieces(self, model: Any, recordings: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> Any:
        """The model with a start of every state that each piece of a recording tells.

        A state that is measured, or whose change is, starts near what its first samples show.
        """
        conditions: dict[str, Condition] = {}
        starts, sizes = {}, self._sizes(model, recordings, self.states)
        for name, state in self.states.items():
            size = sizes[name] if np.isfinite(sizes[name]) and sizes[name] > 0 else 1.0
            start = Parameter(
                0.0, state.unit, min=-size, max=size, lower=-100 * size, upper=100 * size, per="recording",
                as_declared=True,
            )  # fmt: skip
            found = of_parameter(f"{name}_start", start, f"{name} when a piece begins.")
            if name in self.scales or self._moving(model, name):
                first = _first(name, state.unit)
                conditions[first.name] = first
                found = replace(found, function=lambda first, *, value: first + value, reads=(first.name,))
            starts[found.name] = replace(found, unit=state.unit)
        return replace(
            model,
            quantities={**model.quantities, **starts},
            conditions={**model.conditions, **conditions},
        )

    def _moving(self, model: Any, name: str) -> list[str]:
        """States that are measured and whose rate is this one."""
        of = {x: model.quantities[f"d{x}"] for x in self.scales}
        return [x for x, node in of.items() if node.reads == (name,) and not node.parameters]

    def firsts(self, model: Any, time: Any, measured: Mapping[str, Any]) -> dict[str, float]:
        """What the first samples show of the states that start from them."""
        found = {}
        for name in self.states:
            if f"{name}_first" not in model.conditions:
                continue
            value, unit = 1.0, self.states[name].unit
            if name in measured:
                value = float(measured[name][0]) * scale_to(model.observables[name].unit, unit)
            for x in [] if name in measured else self._moving(model, name)[:1]:
                few = slice(0, FEW)
                slope = np.polyfit(time[few] - time[0], measured[x][few] * self.scales[x], 2)[1]
                value = float(slope / model.quantities[f"d{x}"].function(1.0))
            found[f"{name}_first"] = value
        return found

    def states_of(self, assembly: Any) -> dict[str, State]:
        """States of the model and of the effects that are on."""
        found = dict(self.states)
        for use in assembly.uses:
            found |= assembly.model.effects[use.name].states
        return found

    def trajectories(
        self, assembly: Any, conditions: Mapping[str, Any], many: Sequence[Mapping[str, Any]]
    ) -> Iterator[dict[str, Any]]:
        """States over the times of a recording, for several sets of parameter values."""
        shape, solver = np.shape(conditions[TIME]), assembly.model.solver
        program = solver.program(assembly)
        # sets whose states are held at a time: compiled, they march one after the other, and as columns if not
        size = 8 if program.switched else 128
        for first in range(0, len(many), size):
            try:
                found = solver.march(assembly, conditions, many[first : first + size])
            except Exception as fault:  # of a formula, where it is not compiled
                if mistake := users_mistake(fault):
                    raise mistake from fault
                raise
            for states in np.moveaxis(found, 2, 0):
                yield {name: one.reshape(shape) for name, one in zip(program.states, states, strict=True)}


def _usual_size(parts: Sequence[Any]) -> float:
    """Size that 95 % of the samples stay below."""
    return float(np.quantile(np.abs(np.concatenate([np.atleast_1d(p) for p in parts])), 0.95))


def _units(model: Any) -> dict[str, str]:
    return {name: node.unit for name, node in {**model.quantities, **model.rates.states}.items()}


def fields_from_rates(
    functions: Sequence[Callable[..., Any]],
    states: Mapping[str, State],
    inputs: Mapping[str, Any],
    observables: Mapping[str, Any],
    more: Mapping[str, Any],
    window_s: float | None = None,
) -> dict[str, Any]:
    """Fields of a model made of rates; `more` are parameters, units and effects as `fields_from_functions` takes them.

    Raises
    ------
    RequestError
        A state without a rate, an observable that is nothing known or in another unit.
    """
    _check_rates(functions, states)
    units = {f"d{name}": f"{state.unit}/s" for name, state in states.items()} | more["units"]
    channels = {name: f"{name}_channel" for name in inputs}
    input_units = {name: given if isinstance(given, str) else given[0] for name, given in inputs.items()}
    known = {name: state.unit for name, state in states.items()} | units | input_units
    signals = {name: _signal(name, given, known) for name, given in observables.items()}
    all_known = known | {f"{name}_measured": one.unit for name, one in signals.items()}
    unsized = tuple(one for one in more["effects"] if isinstance(one, Unsized))
    given = [one.effects({}, all_known) if isinstance(one, Unsized) else [one] for one in more["effects"]]
    effects = [effect for some in given for effect in some]
    _check_units(effects, all_known)
    conditions = _conditions(states, known, channels)
    others = [
        *(_passed_on(n, known[n], f"The input {n}.", channel) for n, channel in channels.items()),
        *(part for n, signal in signals.items() for part in _of_sensor(n, signal.unit, known[n])),
    ]
    # what the functions may read beside each other
    stated = [*states.items(), *(one for e in effects for one in e.states.items())]
    asked = {**{n: state.unit for n, state in stated}, **{node.name: node.unit for node in others}}
    beside = {n: Condition(n, unit, n) for n, unit in asked.items()}
    more = {**more, "units": units, "effects": effects, "uncertainty": {}}
    fields = fields_from_functions(functions, {**conditions, **beside}, {}, more)
    measured = {
        name: Observable(
            name, f"{name}_measured", one.unit, f"{name} as it is measured.", column=one.channel or name,
            column_unit=one.unit, kind=KIND,
        )
        for name, one in signals.items()
    }  # fmt: skip
    noise = {name: one.uncertainty for name, one in signals.items() if one.uncertainty is not None}
    scales = {n: scale_to(one.unit, states[n].unit) for n, one in signals.items() if n in states}
    rates = Rates(states, channels, scales, unsized, window_s=window_s)
    rates.allow(noise)
    starts = [_start_of(name, state) for name, state in states.items()]
    return fields | {
        "conditions": conditions,
        "observables": measured,
        "quantities": fields["quantities"] | {node.name: node for node in (*others, *starts)},
        "rig": rig_statement({"uncertainty": noise}, (), measured.values()),
        "rates": rates,
        "notes": (UNSIZED,) if unsized else (),
    }


def _check_rates(functions: Sequence[Callable[..., Any]], states: Mapping[str, State]) -> None:
    for name in states:
        if f"d{name}" not in {f.__name__ for f in functions}:
            raise RequestError(
                f"the state {name!r} has no rate",
                expected=f"a function d{name}",
                remedy="write one, and pass it",
            )


def _check_units(effects: Sequence[Effect], known: Mapping[str, str]) -> None:
    for effect in effects:
        for name, unit in effect.units.items():
            if name in known and known[name] != unit:
                raise RequestError(
                    f"the effect {effect.name!r} was made for {name} in {unit}, which is in {known[name]}",
                    remedy=f"give its usual size in {known[name]}",
                )


def _conditions(
    states: Mapping[str, State], known: Mapping[str, str], channels: Mapping[str, str]
) -> dict[str, Condition]:
    """Time, the recorded inputs, and first values of channels that states start from."""
    found = [
        Condition(TIME, "s", "Time since the recording began.", TIME, "s", varies=False),
        *(Condition(c, known[n], f"Recorded {n}.", n, known[n], label=n) for n, c in channels.items()),
        *(_first(n, known[n]) for n, state in states.items() if state.start == MEASURED),
    ]
    return {condition.name: condition for condition in found}


def _first(name: str, unit: str) -> Condition:
    first = f"{name}_first"
    return Condition(first, unit, f"First value of {name}.", first, unit, 0.0, varies=False)


def _signal(name: str, given: Any, known: Mapping[str, str]) -> Signal:
    signal = (
        given if isinstance(given, Signal) else Signal(*(given if isinstance(given, tuple) else (given,)))
    )
    if name not in known:
        raise RequestError(
            f"the observable {name!r} is neither a state nor a quantity", remedy="give its unit in units="
        )
    if not is_compatible(known[name], signal.unit):
        raise RequestError(
            f"the observable {name!r} is in {signal.unit}", expected=f"a unit like {known[name]}"
        )
    return signal


def _of_sensor(name: str, unit: str, from_unit: str) -> tuple[Quantity, Quantity]:
    """What a sensor is given, and what it shows: faults of it act on the second."""
    there = f"{name}_at_sensor"
    return (
        _passed_on(there, unit, f"{name} in the unit of its sensor.", name, scale_to(from_unit, unit)),
        _passed_on(f"{name}_measured", unit, f"{name} as it is measured.", there),
    )


def _passed_on(name: str, unit: str, doc: str, of: str, scale: float = 1.0) -> Quantity:
    return Quantity(name, unit, doc, lambda value: value * scale, (of,), {})


def _start_of(name: str, state: State) -> Quantity:
    """The quantity that a state starts from."""
    doc = f"{name} when a recording begins."
    if isinstance(state.start, Parameter):
        unit = state.unit if state.start.unit == "1" else state.start.unit
        start = replace(state.start, as_declared=True, unit=unit)
        return replace(of_parameter(f"{name}_start", start, doc), unit=state.unit)
    if state.start == MEASURED:
        return _passed_on(f"{name}_start", state.unit, doc, f"{name}_first")
    return constant(f"{name}_start", float(state.start), state.unit, doc)
