"""A model made of plain functions: their arguments are conditions, parameters and each other's results."""

from __future__ import annotations

import inspect
import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from specan.errors import RequestError, require_known
from specan.models.effect import Effect, Parameter, check_function
from specan.models.quantity import (
    KIND,
    Condition,
    Frf,
    Observable,
    Quantity,
    Reading,
    of_parameter,
    rig_statement,
)
from specan.units import base_unit

_FORMS = "a number, (value, low, high), (value, low, high, unit), or dict(value=, min=, max=, vary=, unit=)"

# Rows in the order in which they were read, where a table tells it.
READ_AT = Condition(
    "elapsed_time", "s", "Time since the first reading.", "elapsed_time", "s", float("nan"), varies=False
)


def fields_from_functions(
    functions: Sequence[Callable[..., Any]],
    conditions: Mapping[str, Any],
    observables: Mapping[str, Any],
    more: Mapping[str, Any],
) -> dict[str, Any]:
    """Fields of the model that `specan.models.model.Model.from_function` makes; `more` are its other arguments."""
    named = _named(functions, observables)
    known = {name: _condition(name, given) for name, given in conditions.items()}
    if not any(isinstance(given, Frf) for given in observables.values()):
        known.setdefault(READ_AT.name, READ_AT)
    measured = {name: _observable(name, given, named[name]) for name, given in observables.items()}
    starts = {name: _parameter(name, given) for name, given in more["parameters"].items()}
    for function in named.values():
        # with a starting value, as lmfit takes them
        for argument in inspect.signature(function).parameters.values():
            if argument.default is not inspect.Parameter.empty and argument.name not in {*known, *named}:
                starts.setdefault(argument.name, _parameter(argument.name, argument.default))
    _check_names(named, known, starts)
    effects = [as_declared(effect) for effect in more["effects"]]
    shared = _shared(named, starts, effects)
    quantities = {name: of_parameter(name, starts[name]) for name in shared}
    for name, function in named.items():
        own = {p: starts[p] for p in _arguments(function) if p in starts and p not in shared}
        reads = tuple(a for a in _arguments(function) if a not in own)
        for read in reads:
            require_known(
                read,
                [*known, *starts, *named],
                f"{place_of(function)}: {name!r} reads {read!r}, which is not a condition and no parameter",
                expected="each argument in conditions=, in parameters=, or a function of that name",
            )
        unit = _unit_of(name, measured, more["units"])
        doc = (inspect.getdoc(function) or name).split("\n")[0]
        quantities[name] = Quantity(name, unit, doc, _by_name(function, reads), reads, own)
    rig = {
        "limits": {n: list(given[1:3]) for n, given in conditions.items() if _is_span(given)},
        "uncertainty": {**_stated(observables), **more["uncertainty"]},
    }
    statement = rig_statement(rig, known.values(), measured.values())
    return {
        "conditions": known,
        "quantities": quantities,
        "effects": {effect.name: effect for effect in effects},
        "observables": measured,
        "rig": replace(statement, discrepancies=_discrepancies(observables, named)),
    }


def _by_name(function: Callable[..., Any], reads: tuple[str, ...]) -> Instead:
    """The function called with its arguments by name, in whatever order it declares them."""
    return Instead(lambda *given, **own: function(**dict(zip(reads, given, strict=True)), **own), function)


def as_declared(effect: Effect) -> Effect:
    """The effect with parameters that it receives in the units that they are declared in."""
    return replace(effect, parameters={n: replace(p, as_declared=True) for n, p in effect.parameters.items()})


def name_of(function: Callable[..., Any]) -> str:
    """Name of the file that a user's function comes from; empty for one that comes from elsewhere."""
    module = str(function.__module__)
    return module.removeprefix(f"{PREFIX}model_") if module.startswith(PREFIX) else ""


def title_of(function: Callable[..., Any]) -> str:
    """First line of what a user's file, or else the function, says of itself."""
    file = getattr(function, "__globals__", {})
    own = file.get("__doc__") if str(function.__module__).startswith(PREFIX) else None
    return ((own or function.__doc__ or "").strip().split("\n")[0]).rstrip(".")


def _named(functions: Sequence[Callable[..., Any]], observables: Mapping[str, Any]) -> dict[str, Any]:
    """Functions by the names of their quantities; a single unknown one is called by the observable."""
    for function in functions:
        check_function(function, "Model.from_function")
    named = {function.__name__: function for function in functions}
    lacking = [name for name in observables if name not in named]
    free = [name for name in named if name not in observables]
    if len(lacking) == 1 and functions[0].__name__ in free:
        named = {lacking[0]: functions[0], **{f.__name__: f for f in functions[1:]}}
        lacking = []
    if lacking:
        raise RequestError(
            f"the observable {lacking[0]!r} has no function",
            expected=f"a function of that name beside {', '.join(named)}",
            remedy="return one quantity per function",
        )
    return named


def _check_names(named: Mapping[str, Any], known: Mapping[str, Any], starts: Mapping[str, Any]) -> None:
    for name in named:
        if name in known or name in starts:
            raise RequestError(f"{name!r} names a function and something else", remedy="rename one")
    for name in starts:
        if name in known:
            raise RequestError(
                f"{name!r} is a condition and a parameter", remedy="leave it out of parameters="
            )


def _arguments(function: Callable[..., Any]) -> list[str]:
    kinds = inspect.Parameter
    found = []
    for name, argument in inspect.signature(function).parameters.items():
        if argument.kind not in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY):
            raise RequestError(
                f"{place_of(function)}: *args, **kwargs and positional-only arguments hide what is read",
                remedy="name the arguments",
            )
        found.append(name)
    return found


def _shared(
    named: Mapping[str, Any], starts: Mapping[str, Parameter], effects: Sequence[Effect]
) -> list[str]:
    """Parameters that several functions read, or an effect: each a quantity of its own."""
    readers = [set(_arguments(function)) for function in named.values()]
    readers += [{*effect.reads, *effect.changes} for effect in effects]
    acted = {name for effect in effects for name in (*effect.reads, *effect.changes)}
    return [n for n in starts if n in acted or sum(n in names for names in readers) > 1]


def _stated(observables: Mapping[str, Any]) -> dict[str, float]:
    """Uncertainties that are beside the observables' units, as a rig file would say them."""
    found = {}
    for name, given in observables.items():
        if isinstance(given, tuple) and len(given) > 1:
            found[name] = given[1]
        elif isinstance(given, (Frf, Reading)):
            percent = given.percent if isinstance(given, Reading) else given.uncertainty_percent
            said = {name: given.uncertainty, f"{name}_percent": percent}
            found |= {key: value for key, value in said.items() if value is not None}
    return found


def _discrepancies(observables: Mapping[str, Any], named: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
    """How wrong the model itself may be, of the observables that say it."""
    stated = {n: g.discrepancy for n, g in observables.items() if isinstance(g, Reading) and g.discrepancy}
    for name, (quantity, _) in stated.items():
        require_known(
            quantity,
            named,
            f"the discrepancy of {name!r} is one of {quantity!r}, which is no function of the model",
        )
    return stated


def _is_span(given: Any) -> bool:
    return isinstance(given, tuple) and len(given) == 3


def _condition(name: str, given: Any) -> Condition:
    if isinstance(given, Condition):
        return given
    if not isinstance(given, str) and not _is_span(given):
        raise RequestError(
            f"the condition {name!r} is {given!r}", expected="a unit, or (unit, lowest, highest)"
        )
    unit = given if isinstance(given, str) else given[0]
    _require_unit(unit, f"the condition {name!r}")
    return Condition(name, unit, name.replace("_", " "), name, unit)


def _observable(name: str, given: Any, function: Callable[..., Any]) -> Observable:
    if isinstance(given, Observable):
        return given
    unit = (
        given.unit if isinstance(given, (Frf, Reading)) else given[0] if isinstance(given, tuple) else given
    )
    if not isinstance(unit, str):
        raise RequestError(
            f"the observable {name!r} is {given!r}",
            expected="a unit, (unit, uncertainty), Reading(unit, ...) or Frf(unit, ...)",
        )
    _require_unit(unit, f"the observable {name!r}")
    doc = (inspect.getdoc(function) or name).split("\n")[0]
    if isinstance(given, Frf):
        return Observable(
            name, name, unit, doc, column=name, column_unit=unit, kind=KIND,
            response=given.response or name, reference=given.reference, averages=given.averages or 0.0,
        )  # fmt: skip
    return Observable(name, name, unit, doc, column=name, column_unit=unit)


def _unit_of(name: str, measured: Mapping[str, Observable], units: Mapping[str, str]) -> str:
    declared = units.get(name)
    if name in measured:
        unit = measured[name].unit
        if declared is not None and declared != unit:
            raise RequestError(
                f"the observable {name!r} is in {unit}, its function in {declared}", expected="one unit"
            )
        return unit
    if declared is not None:
        _require_unit(declared, f"the quantity {name!r}")
    return declared or "1"


def _require_unit(unit: str, owner: str) -> None:
    try:
        base_unit(unit)
    except RequestError as fault:
        raise RequestError(f"{owner}: {fault.found}", expected=fault.expected) from None


def _parameter(name: str, given: Any) -> Parameter:
    if isinstance(given, Parameter):
        made = replace(given, as_declared=True)
    else:
        made = Parameter(**_as_words(name, given), doc=name.replace("_", " "), as_declared=True)
    _require_unit(made.unit, f"the parameter {name!r}")
    return made


def _as_words(name: str, given: Any) -> dict[str, Any]:
    """Keyword arguments of a Parameter from what a user wrote."""
    if isinstance(given, Mapping):
        unknown = set(given) - {"value", "min", "max", "vary", "unit"}
        if "value" in given and not unknown:
            low, high = given.get("min", -math.inf), given.get("max", math.inf)
            return {
                "default": float(given["value"]), "min": low, "max": high, "unit": given.get("unit", "1"),
                "fixed": not given.get("vary", True),
            }  # fmt: skip
    elif isinstance(given, (int, float)) and not isinstance(given, bool):
        return {"default": float(given)}
    elif isinstance(given, tuple) and len(given) in (3, 4) and all(_is_number(v) for v in given[:3]):
        unit = given[3] if len(given) == 4 else "1"
        return {"default": given[0], "min": given[1], "max": given[2], "unit": unit}
    raise RequestError(f"the parameter {name!r} is {given!r}", expected=_FORMS)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


PREFIX = "specan_user_"  # of the module names under which users' files are loaded


# Of a function of single numbers that was given an array.
_OF_ARRAYS = ("truth value of an array", "0-dimensional arrays", "length-1 arrays")
_ARRAYS = (
    "functions receive arrays, one value per row: use numpy's, np.sqrt for math.sqrt and np.where for if"
)


def users_mistake(fault: BaseException, name: str = "", function: Any = None) -> RequestError | None:
    """An exception as a mistake in the user's file that it comes from; None if it comes from none.

    Parameters
    ----------
    fault : Exception
        What was raised.
    name : str
        Identifier of the quantity or effect, for the message; by default that of its function.
    function : callable, optional
        That was called, whose own line is named where a compiled one tells none.
    """
    frames = traceback.walk_tb(fault.__traceback__)
    places = [(f.f_code, n) for f, n in frames if str(f.f_globals.get("__name__")).startswith(PREFIX)]
    if not places and str(getattr(function, "__module__", "")).startswith(PREFIX):
        places = [(code, code.co_firstlineno) for code in [getattr(function, "__code__", None)] if code]
    if not places:
        return None
    (code, _), (_, line) = places[0], places[-1]
    return RequestError(
        f"{code.co_filename}, line {line}: {name or code.co_name!r} fails ({type(fault).__name__}: {fault})",
        remedy=_ARRAYS if any(text in str(fault) for text in _OF_ARRAYS) else "correct that line",
    )


class Instead:
    """What is called in place of a user's own function; messages name that one's file and line."""

    def __init__(self, function: Callable[..., Any], own: Callable[..., Any]) -> None:
        self._called = function
        self.function = getattr(own, "function", own)
        self.__code__ = getattr(own, "__code__", None)
        self.__module__ = str(own.__module__)

    def __call__(self, *given: Any, **parameters: Any) -> Any:
        """Its value."""
        return self._called(*given, **parameters)


def place_of(function: Any) -> str:
    """File and line of a function, for messages."""
    function = getattr(function, "function", function)
    code = getattr(function, "__code__", None)
    return f"{code.co_filename}, line {code.co_firstlineno}" if code else repr(function)
