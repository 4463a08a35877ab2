"""A first evaluation of a user's own model: finite, of the right shape, repeatable, in time.

And whether its formulas agree with the units that are declared around them, by evaluating them with units.
"""

from __future__ import annotations

import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from inspect import signature
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.effect import Parameter
from specan.models.evaluation import Evaluation
from specan.models.from_function import PREFIX, place_of
from specan.models.model import Assembly, Model
from specan.units import convert, same_dimension, with_unit

LIMIT_S = 60.0  # of one evaluation: a diagnosis takes hundreds

Conditions = Mapping[str, NDArray[np.float64]]

_EXPONENTS = {-2, -1, -0.5, 0, 0.5, 1, 1.5, 2, 3, 4}  # numbers that a formula has without a unit


def try_model(assembly: Assembly, conditions: Conditions) -> None:
    """Evaluate a model with chosen effects twice and see that it keeps what every study rests on.

    Parameters
    ----------
    assembly : Assembly
    conditions : mapping
        Arrays of one length, as the model's functions receive them.

    Raises
    ------
    RequestError
        File and line of the function that gives values that are not finite or of another shape, that takes too long,
        or gives other values when it is called again.
    """
    given = {name: np.array(values) for name, values in conditions.items()}
    for values in given.values():
        values.flags.writeable = False  # a function that writes into its arguments fails at that line

    def evaluate() -> Evaluation:
        with np.errstate(all="ignore"):
            return assembly.evaluate(given)

    first = _in_time(evaluate)
    _check_values(assembly.model, first, given)
    second = evaluate()
    for name, node in assembly.model.quantities.items():
        if not node.comparable or name not in first.values:
            continue
        if not np.array_equal(first.values[name], second.values[name], equal_nan=True):
            raise RequestError(
                f"{place_of(node.function)}: {name!r} gives other values when it is called again",
                expected="the same values for the same conditions and parameters",
                remedy="take randomness and counters out of the model",
            )


def _in_time(evaluate: Callable[[], Evaluation]) -> Evaluation:
    """The result, or an error that says in which line of a user's file the time ran out, as in a loop without end."""
    answer: Future[Evaluation] = Future()

    def work() -> None:
        try:
            answer.set_result(evaluate())
        except BaseException as fault:
            answer.set_exception(fault)

    worker = threading.Thread(target=work, daemon=True)  # a daemon: it does not keep the program from ending
    worker.start()
    worker.join(LIMIT_S)
    if answer.done():
        return answer.result()
    frame, place = sys._current_frames().get(worker.ident or 0), "the model"
    while frame is not None and place == "the model":
        if str(frame.f_globals.get("__name__", "")).startswith(PREFIX):
            place = f"{frame.f_code.co_filename}, line {frame.f_lineno}"
        frame = frame.f_back
    raise RequestError(
        f"{place}: one evaluation of the model takes longer than {LIMIT_S:g} s",
        expected="well under a second, since a diagnosis takes hundreds",
        remedy="make it faster, or give the study a table of its results",
    )


def _check_values(model: Model, found: Evaluation, conditions: Conditions) -> None:
    size = next((v.size for v in conditions.values()), 1)
    tabled = {o.quantity for o in model.observables.values() if o.kind == "table"}
    nodes = [
        (name, node)
        for name, node in ((name, model.quantities[name]) for name in model.base_order)
        if node.comparable and not node.axes and name in found.values
    ]
    if model.rates:  # what fails first makes everything fail that comes later
        nodes.sort(key=lambda one: _first_wrong(found.values[one[0]]))
    for name, node in nodes:
        values, what = found.values[name], f"{place_of(node.function)}: {name!r}"
        if values is None:
            raise RequestError(f"{what} returns nothing", remedy="return its value")
        try:
            numbers = np.asarray(values, dtype=complex)
        except (TypeError, ValueError):
            raise RequestError(f"{what} gives {type(values).__name__}, which is not a number") from None
        if numbers.shape not in ((), (size,)):
            raise RequestError(
                f"{what} gives the shape {numbers.shape} for {size} rows",
                expected=f"one value per row, the shape ({size},)",
            )
        if name in tabled and np.iscomplexobj(values):
            raise RequestError(
                f"{what} gives complex numbers, and is declared as a column of a table",
                expected="real numbers",
                remedy=f'a transfer function is declared as observables={{"{name}": Frf(unit, response=, reference=)}}',
            )
        wrong = ~np.isfinite(numbers)
        if np.any(wrong):
            raise RequestError(
                f"{what} is not finite in {int(np.sum(wrong))} of {numbers.size} rows"
                + _first_place(model, conditions, wrong),
                remedy="correct the equation, or narrow the limits to where it holds",
            )


def _first_wrong(values: Any) -> int:
    wrong = np.append(~np.isfinite(np.ravel(values)), True)
    return int(np.argmax(wrong))


def _first_place(model: Model, conditions: Conditions, wrong: NDArray[np.bool_]) -> str:
    if not wrong.ndim or not conditions:
        return ""
    row = int(np.argmax(wrong))
    places = []
    for name, values in conditions.items():
        known = model.conditions[name]
        shown = convert(float(values[row]), known.unit, known.column_unit or known.unit)
        places.append(f"{known.column or name} = {shown:.6g}")
    return ", the first at " + ", ".join(places)


def check_units(model: Model, conditions: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Evaluate every quantity and effect once with units; returns what could not be checked.

    A formula with bare numbers, or with a parameter that has no unit, may hide a unit: it is not judged.

    Raises
    ------
    RequestError
        A formula without any gives another dimension than is declared; file and line are named.
    """
    row = {name: np.asarray(values)[len(values) // 2] for name, values in conditions.items()}
    known, units = _with_units(model, row, ())
    unchecked: list[str] = []
    for name, node in model.quantities.items():
        if not (node.reads and node.comparable) or node.axes:
            continue
        given = [known[read] for read in node.reads]
        _judge(name, node.function, given, node.parameters, {name: node.unit}, unchecked)
    for name, effect in model.effects.items():
        there = _with_units(model, row, [name])[0] if effect.states else known
        if effect.at or effect.joins or any(r not in there for r in effect.reads):
            continue
        wanted = {**{q: units[q] for q in effect.adds_to}, **dict.fromkeys(effect.scales, "1")}
        _judge(name, effect.function, [there[r] for r in effect.reads], effect.parameters, wanted, unchecked)
        for own, state in effect.states.items():
            taken = {n: p for n, p in effect.parameters.items() if n in signature(state.rate).parameters}
            given = [there[r] for r in state.reads]
            _judge(f"d{own}", state.rate, given, taken, {own: f"{state.unit}/s"}, unchecked)
    said = f"units could not be checked in {', '.join(unchecked)}: bare numbers may hide a unit"
    return (said,) if unchecked else ()


def _with_units(
    model: Model, row: Mapping[str, Any], effects: Sequence[str]
) -> tuple[dict[str, Any], dict[str, str]]:
    """What is known at one place, with units; and these."""
    assembly = model.assemble(effects)
    with np.errstate(all="ignore"):
        found = assembly.evaluate(row)
    nodes: dict[str, Any] = {**model.conditions, **model.quantities}
    nodes |= model.rates.states_of(assembly) if model.rates else {}
    units = {n: node.unit for n, node in nodes.items() if n in found.values}
    return {n: with_unit(np.asarray(found[n]), unit) for n, unit in units.items()}, units


def _judge(
    name: str,
    function: Any,
    arguments: Sequence[Any],
    parameters: Mapping[str, Parameter],
    wanted: Mapping[str, str],
    unchecked: list[str],
) -> None:
    """Refuse what contradicts its units; note what may hide one."""
    plain = getattr(function, "function", function)
    try:
        own = {n: with_unit(p.si.default, p.received_unit) for n, p in parameters.items()}
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # a unit that is taken off, as by np.asarray
            given = function(*arguments, **own)
        parts = given if isinstance(given, dict) else dict.fromkeys(wanted, given)
        wrong = [(q, same_dimension(parts[q], unit)) for q, unit in wanted.items()]
        found = next((f"{q!r} in {said}, declared is {wanted[q] or '1'}" for q, said in wrong if said), "")
    except Exception as fault:  # the unit library raises many kinds; a formula may not work with units at all
        into_a_number = traceback.extract_tb(fault.__traceback__)[-1].name.startswith(
            "__"
        )  # float(), math.sqrt()
        if type(fault).__name__ != "DimensionalityError" or into_a_number:
            unchecked.append(name)
            return
        found = f"terms with different units ({fault})"
    if not found:
        return
    if any(p.unit in ("1", "") for p in parameters.values()) or _has_bare_numbers(plain):
        unchecked.append(name)
        return
    raise RequestError(
        f"{place_of(function)}: the formula of {name!r} gives {found}",
        remedy="correct the formula or a declared unit",
    )


def _has_bare_numbers(function: Any) -> bool:
    """Whether a formula holds numbers, of its own or of its file, that may have a unit."""
    code: CodeType | None = getattr(function, "__code__", None)
    if code is None:
        return True
    numbers = [c for c in code.co_consts if isinstance(c, (int, float)) and not isinstance(c, bool)]
    outside = [function.__globals__.get(n) for n in code.co_names]
    return (
        any(c not in _EXPONENTS for c in numbers)
        or any(isinstance(v, (int, float, np.ndarray)) and not isinstance(v, bool) for v in outside)
        or bool(code.co_freevars)
    )
