"""Whether formulas agree with the units that are declared around them, by evaluating them with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.model import Model
from specan.models.parameter import Parameter
from specan.models.user_code import place_of
from specan.units import base_unit, same_dimension, with_unit

_EXPONENTS = {-2, -1, -0.5, 0, 0.5, 1, 1.5, 2, 3, 4}  # numbers that a formula has without a unit


def check_units(model: Model, conditions: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Evaluate every quantity and effect once with units; returns what could not be checked.

    A formula with bare numbers, or with a parameter that has no unit, may hide a unit: it is not judged.

    Raises
    ------
    RequestError
        A formula without any gives another dimension than is declared; file and line are named.
    """
    row = {name: np.asarray(values)[len(values) // 2] for name, values in conditions.items()}
    with np.errstate(all="ignore"):
        known = model.assemble().evaluate(row)
    units = {
        **{n: q.unit for n, q in model.quantities.items()},
        **{n: c.unit for n, c in model.conditions.items()},
    }
    unchecked: list[str] = []

    def read(names: Sequence[str]) -> list[Any]:
        return [with_unit(known[name], units[name]) for name in names]

    for name, node in model.quantities.items():
        if not node.reads or node.collection or node.opaque or node.axes:
            continue
        _judge(name, node.function, read(node.reads), node.parameters, {name: node.unit}, unchecked)
    for name, effect in model.effects.items():
        if effect.at or effect.joins or any(r not in known.values for r in effect.reads):
            continue
        wanted = {**{q: units[q] for q in effect.adds_to}, **dict.fromkeys(effect.scales, "1")}
        _judge(name, effect.function, read(effect.reads), effect.parameters, wanted, unchecked)
    if not unchecked:
        return ()
    return (f"units could not be checked in {', '.join(unchecked)}: bare numbers may hide a unit",)


def _own(parameters: Mapping[str, Parameter]) -> dict[str, Any]:
    return {
        n: with_unit(p.si.default, p.unit if p.as_declared or p.unit == "1" else base_unit(p.unit))
        for n, p in parameters.items()
    }


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
        given = function(*arguments, **_own(parameters))
        parts = given if isinstance(given, dict) else dict.fromkeys(wanted, given)
        wrong = [(q, same_dimension(parts[q], unit)) for q, unit in wanted.items()]
        found = next((f"{q!r} in {said}, declared is {wanted[q] or '1'}" for q, said in wrong if said), "")
    except Exception as fault:  # the unit library raises many kinds; a formula may not work with units at all
        if type(fault).__name__ != "DimensionalityError":
            unchecked.append(name)
            return
        found = f"terms that do not fit each other ({fault})"
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
