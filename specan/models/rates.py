"""Models that are rates: states with their rates of change, inputs that are recorded, signals that are measured."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.errors import RequestError
from specan.models.effect import Effect, Parameter
from specan.models.quantity import Condition, Observable, Quantity
from specan.units import is_compatible, scale_to

if TYPE_CHECKING:
    from specan.models.march import Solver

KIND = "time"  # of measurement
TIME = "time"
MEASURED = "measured"  # of a state's start
SECONDS = "s"


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
class Rates:
    """What makes a model one of rates.

    Attributes
    ----------
    states : mapping
        Of the model without effects.
    inputs : mapping
        Name of the quantity to name of the condition that is recorded.
    tolerances : mapping
        Change of a state that no reading shows.
    solvers : dict
        Filled when they are needed.
    """

    states: Mapping[str, State]
    inputs: Mapping[str, str]
    tolerances: Mapping[str, float] = field(default_factory=dict)
    solvers: dict[int, tuple[Any, Solver]] = field(default_factory=dict, compare=False, repr=False)

    def solver(self, model: Any) -> Solver:
        """The solver of a model: one for each set of effects that it knows."""
        from specan.models.march import Solver

        if id(model) not in self.solvers:
            self.solvers[id(model)] = model, Solver(model)
        return self.solvers[id(model)][1]


class WithStates:
    """What an assembly of a model of rates knows of its states."""

    model: Any
    uses: Any
    _calls: Any
    _reads: Any

    @cached_property
    def states(self) -> dict[str, State]:
        """States of the model and of the effects that are on."""
        found = dict(self.model.rates.states)
        for use in self.uses:
            found |= self.model.effects[use.name].states
        return found

    @cached_property
    def moved_by_states(self) -> frozenset[str]:
        """Quantities that depend on a state."""
        moved: set[str] = set()
        while True:
            more = {
                name
                for name, (base, acting) in self._calls.items()
                if name not in moved
                and any(
                    r in moved or r in self.states
                    for call in (base, *(c for *_, c in acting))
                    for r in call.reads
                )
            }
            if not more:
                return frozenset(moved)
            moved |= more

    @cached_property
    def reached_from_rates(self) -> frozenset[str]:
        """Quantities that the rates depend on."""
        waiting = ["d" + name for name, state in self.states.items() if state.rate is None]
        waiting += [r for state in self.states.values() for r in state.reads if r in self._reads]
        found: set[str] = set()
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting += self._reads[name]
        return frozenset(found)

    def trajectories(
        self: Any, conditions: Mapping[str, Any], many: Sequence[Mapping[str, Any]]
    ) -> list[dict[str, Any]]:
        """States over the times of a recording, for several sets of parameter values."""
        times = np.atleast_1d(np.asarray(conditions[TIME], float))
        one = np.ndim(conditions[TIME]) == 0

        def drives_of(
            names: Sequence[str], states: Mapping[str, State], many: Sequence[Mapping[str, Any]]
        ) -> tuple[Any, Any]:
            own = [f"{name}_start" for name in states if name in self.model.rates.states]
            wanted = [name for name in (*names, *own) if name in self.model.quantities]
            drives = np.zeros((max(len(names), 1), times.size, len(many)))
            starts = np.zeros((len(states), len(many)))
            for k, found in enumerate(self.pointwise(conditions, many, wanted)):
                for i, name in enumerate(names):
                    drives[i, :, k] = found[name]
                for i, (name, state) in enumerate(states.items()):
                    start: Any = found[f"{name}_start"] if f"{name}_start" in own else state.start
                    starts[i, k] = np.ravel(start)[0]
            return drives, starts

        if times.size == 1:
            _, starts = drives_of([], self.states, many)
            return [
                {name: starts[i, k] if one else starts[i, k : k + 1] for i, name in enumerate(self.states)}
                for k in range(len(many))
            ]
        solver = self.model.rates.solver(self.model)
        found = solver.march(self, times, drives_of, many)
        names = list(solver._fast(self)[0].states if solver._fast(self) else self.states)
        return [{name: found[i, :, k] for i, name in enumerate(names)} for k in range(len(many))]


def parts_of_rates(
    functions: Sequence[Callable[..., Any]],
    states: Mapping[str, State],
    inputs: Mapping[str, Any],
    observables: Mapping[str, Any],
    units: Mapping[str, str],
) -> dict[str, Any]:
    """What `Model.from_function` is given for the functions of a model of rates."""
    named = {f.__name__: f for f in functions}
    for name in states:
        if f"d{name}" not in named:
            raise RequestError(
                f"the state {name!r} has no rate",
                expected=f"a function d{name}",
                remedy="write one, and pass it",
            )
    conditions: dict[str, Condition] = {
        TIME: Condition(TIME, SECONDS, "Time since the recording began.", TIME, SECONDS, varies=False)
    }
    units = {f"d{name}": f"{state.unit}/s" for name, state in states.items()} | dict(units)
    made: list[Callable[..., Any]] = []
    channels = {}
    for name, given in inputs.items():
        unit = given if isinstance(given, str) else given[0]
        channel = f"{name}_channel"
        conditions[channel] = Condition(channel, unit, f"Recorded {name}.", name, unit, label=name)
        channels[name] = channel
        units[name] = unit
        made.append(_same(name, channel, f"The input {name}."))
    known = {name: state.unit for name, state in states.items()} | units
    for name in [name for name, state in states.items() if state.start == MEASURED]:
        first = f"{name}_first"
        conditions[first] = Condition(
            first, known[name], f"First value of {name}.", first, known[name], 0.0, varies=False
        )
    measured = {}
    for name, given in observables.items():
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
        there, scale = f"{name}_at_sensor", scale_to(known[name], signal.unit)
        made.append(_same(there, name, f"{name} in the unit of its sensor.", scale))
        made.append(_same(f"{name}_measured", there, f"{name} as it is measured."))
        units[there] = signal.unit
        measured[f"{name}_measured"] = Observable(
            name, f"{name}_measured", signal.unit, f"{name} as it is measured.", column=signal.channel or name,
            column_unit=signal.unit, kind=KIND,
        )  # fmt: skip
        units[f"{name}_measured"] = signal.unit
    return {
        "functions": (*functions, *made), "conditions": conditions, "units": units, "observables": measured,
        "inputs": channels,
    }  # fmt: skip


def _same(name: str, of: str, doc: str, scale: float = 1.0) -> Callable[..., Any]:
    """A function of one argument that gives it back, in another unit."""

    def function(value: Any) -> Any:
        return value * scale

    function.__name__, function.__doc__ = name, doc
    function.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [inspect.Parameter(of, inspect.Parameter.POSITIONAL_OR_KEYWORD)]
    )
    return lambda_by_name(function, of)


def lambda_by_name(function: Callable[..., Any], of: str) -> Callable[..., Any]:
    """A function of one argument as one that takes it by its name, whatever that is."""

    def by_name(*given: Any, **named: Any) -> Any:
        return function(*given, *named.values())

    by_name.__name__, by_name.__doc__ = function.__name__, function.__doc__
    by_name.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    by_name.function = function  # type: ignore[attr-defined]
    return by_name


def start_of(name: str, state: State) -> Quantity:
    """The quantity that a state starts from."""
    doc = f"{name} when a recording begins."
    if isinstance(state.start, Parameter):
        own = replace(
            state.start, as_declared=True, unit=state.start.unit if state.start.unit != "1" else state.unit
        )

        def value(*, value: float) -> float:
            return value

        return Quantity(
            f"{name}_start", state.unit, f"{name} when a recording begins.", value, (), {"value": own}
        )
    if state.start == MEASURED:
        return Quantity(f"{name}_start", state.unit, doc, lambda first: first, (f"{name}_first",), {})
    start = float(state.start)
    return Quantity(f"{name}_start", state.unit, doc, lambda: start, (), {})


def with_reads(effect: Effect) -> Effect:
    """The effect with what the rates of its states read."""
    own = {
        name: state if state.reads or state.rate is None else replace(
            state, reads=tuple(a for a in inspect.signature(state.rate).parameters if a not in effect.parameters)
        )
        for name, state in effect.states.items()
    }  # fmt: skip
    return replace(effect, states=own)


def stated_noise(observables: Mapping[str, Any]) -> dict[str, float]:
    """Standard deviations of the channels' noise that are given."""
    return {
        n: g.uncertainty
        for n, g in observables.items()
        if isinstance(g, Signal) and g.uncertainty is not None
    }


def tolerances(states: Mapping[str, State], observables: Mapping[str, Any]) -> dict[str, float]:
    """A tenth of the noise of states that are measured."""
    return {
        name: 0.1 * sd * scale_to(observables[name].unit, states[name].unit)
        for name, sd in stated_noise(observables).items()
        if name in states
    }
