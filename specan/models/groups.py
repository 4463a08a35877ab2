"""Groups of rows that may differ: specimens, days, operators - and parameters with one value each.

A group is a column of names. It is a condition whose value is the number of the name. A parameter that is declared
``per`` a group has one value for each name; of every other parameter of the base there is a candidate effect that
says: it differs between the groups.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from specan.errors import RequestError, nearest
from specan.models.effect import Effect, Parameter
from specan.models.from_function import Instead
from specan.models.quantity import Condition, Quantity, SettingError, of_parameter

ModelT = TypeVar("ModelT", bound=Any)  # a `specan.models.model.Model`, which this module is a part of
NodeT = TypeVar("NodeT", Quantity, Effect)
START = 0.1  # share of a parameter's range at which a fit begins to look for a difference


def with_groups(model: ModelT, axes: Sequence[str]) -> ModelT:
    """The model with columns of names that its tables hold, by which parameters may differ.

    The parameters of its quantities become quantities of their own, so that effects can act on them.

    Raises
    ------
    RequestError
        A name that means something else already.
    """
    new = [axis for axis in axes if axis not in model.groups]
    if not new:
        return model
    for axis in new:
        if axis in model.conditions or axis in model.quantities:
            raise RequestError(f"{axis!r} is a group and something else", remedy="rename one")
    groups = {
        axis: Condition(
            axis,
            "1",
            f"Name of the {axis}.",
            axis,
            "1",
            usual_setting=SettingError(absolute=1e-9),
            group=True,
        )
        for axis in new
    }
    quantities: dict[str, Quantity] = {}
    for node in model.quantities.values():
        apart, parameters = _set_apart(node, model)
        quantities |= parameters
        quantities[node.name] = apart
    return replace(
        model, conditions={**model.conditions, **groups}, quantities=quantities, groups=(*model.groups, *new)
    )


def _set_apart(node: Quantity, model: Any) -> tuple[Quantity, dict[str, Quantity]]:
    """A quantity that reads its free parameters as quantities, and these."""
    chosen = {n: p for n, p in node.parameters.items() if not p.fixed}
    if node.is_parameter or not chosen or not node.comparable:
        return node, {}
    taken = {*model.quantities, *model.conditions}
    names = {n: n if n not in taken else f"{node.name}_{n}" for n in chosen}
    own = {new: of_parameter(new, chosen[old]) for old, new in names.items()}
    kept = {n: p for n, p in node.parameters.items() if n not in chosen}
    count, old_names = len(node.reads), list(names)

    def function(*given: Any, **parameters: Any) -> Any:
        return node.function(*given[:count], **dict(zip(old_names, given[count:], strict=True)), **parameters)

    return replace(
        node, function=Instead(function, node.function), reads=(*node.reads, *names.values()), parameters=kept
    ), own


def grouped(model: ModelT, elements: Mapping[str, Sequence[str]]) -> ModelT:
    """The model for groups of known names: parameters per group, and effects by which others may differ.

    Parameters
    ----------
    model : Model
        With `groups` declared; see `with_groups`.
    elements : mapping
        ``{"specimen": ("A", "B")}``.
    """
    for axis in model.groups:
        names = tuple(elements.get(axis, ()))
        if not names or model.group_elements.get(axis) == names:
            continue
        model = _expanded(model, axis, names)
    return model


def _expanded(model: ModelT, axis: str, names: tuple[str, ...]) -> ModelT:
    quantities = {n: _one_each(node, axis, names) for n, node in model.quantities.items()}
    effects = {n: _one_each(effect, axis, names) for n, effect in model.effects.items()}
    if len(names) > 1:
        for node in model.quantities.values():
            if node.is_parameter and not node.parameters["value"].per:
                effect = _differs(node, axis, names)
                effects.setdefault(effect.name, effect)
    return replace(
        model, quantities=quantities, effects=effects, group_elements={**model.group_elements, axis: names}
    )


def _one_each(node: NodeT, axis: str, names: tuple[str, ...]) -> NodeT:
    """A quantity or an effect of which parameters per group have one scalar for each name."""
    vectors = [n for n, p in node.parameters.items() if p.per == axis]
    if not vectors:
        return node
    parameters: dict[str, Parameter] = {}
    neutral: dict[str, float] = {}
    for n, parameter in node.parameters.items():
        each = {n: parameter}
        if n in vectors:
            doc = parameter.doc or n
            each = {_of(n, name, names): replace(parameter, per="", doc=f"{doc} of {name}") for name in names}
        parameters |= each
        if isinstance(node, Effect) and n in node.neutral:
            neutral |= dict.fromkeys(each, node.neutral[n])
    apart: dict[str, Any] = {"neutral": neutral} if isinstance(node, Effect) else {}
    function = _gathering(node.function, vectors, names)
    return replace(node, function=function, reads=(*node.reads, axis), parameters=parameters, **apart)


def _gathering(
    function: Callable[..., Any], vectors: Sequence[str], names: tuple[str, ...]
) -> Callable[..., Any]:
    """The function with one argument for each name of a group, from which each row takes its own."""

    def gathered(*given: Any, **parameters: Any) -> Any:
        codes = given[-1]
        for vector in vectors:
            values = [parameters.pop(_of(vector, name, names)) for name in names]
            parameters[vector] = _row_by_row(codes, values)
        return function(*given[:-1], **parameters)

    return Instead(gathered, function)


def _row_by_row(codes: Any, values: Sequence[Any]) -> Any:
    """Value of each row's group; a group that was never fitted has their mean."""
    number = np.asarray(codes).astype(int)
    known = [np.broadcast_to(np.asarray(v, dtype=float), number.shape) for v in values]
    whole = np.stack([*known, np.mean(known, axis=0)])
    place = np.where((number >= 0) & (number < len(values)), number, len(values))
    return np.take_along_axis(whole, place[None], axis=0)[0] if number.ndim else whole[place]


def _of(parameter: str, name: str, names: Sequence[str]) -> str:
    """Name of a parameter's value for one name of a group: ``slope_A``; the name alone for a quantity's own value."""
    plain = identifiers(names)[list(names).index(name)]
    return plain if parameter == "value" else f"{parameter}_{plain}"


def identifiers(names: Sequence[str]) -> list[str]:
    """Names as parts of a parameter's name: letters, digits and underscores, all different.

    Examples
    --------
    >>> identifiers(["A", "No. 2", "No-2", "0.5"])
    ['A', 'No__2', 'No_2', '0_5']
    """
    plain: list[str] = []
    for name in names:
        one = re.sub(r"\W", "_", name)
        while one in plain:
            one += "_"
        plain.append(one)
    return plain


def _differs(node: Quantity, axis: str, names: tuple[str, ...]) -> Effect:
    """The candidate that a parameter is not the same in every group: offsets from the first one's."""
    parameter = node.parameters["value"]
    low, high = parameter.domain
    width = parameter.max - parameter.min
    start = START * (width if np.isfinite(width) and width > 0 else abs(parameter.default) or 1.0)
    reach, limit = (w if np.isfinite(w) and w > 0 else np.inf for w in (width, high - low))
    others = identifiers(names)[1:]
    offset = replace(
        parameter, default=start, min=-reach, max=reach, lower=-limit, upper=limit, fixed=False, needs=(),
        doc=f"{node.name.replace('_', ' ')} less that of {names[0]}",
    )  # fmt: skip

    def differs(codes: Any, **offsets: float) -> Any:
        return _row_by_row(codes, [0.0, *(offsets[o] for o in others)])

    return Effect(
        name=f"{re.sub(r'[^a-z0-9]+', '-', node.name.lower()).strip('-')}-differs-between-{axis.lower()}s",
        function=differs,
        reads=(axis,),
        parameters={
            o: replace(offset, doc=f"{offset.doc}: {name}") for o, name in zip(others, names[1:], strict=True)
        },
        adds_to=(node.name,),
        neutral=dict.fromkeys(others, 0.0),
        explanation=f"The parameter {node.name} differs between the {axis}s: {', '.join(names)}.",
        separate_by=f"measure the same {axis} under all conditions",
    )


def check_groups(model: Any) -> None:
    """Refuse a parameter per something that is nothing."""
    known = ("recording", *model.axes, *model.groups)
    nodes = (*model.quantities.values(), *model.effects.values())
    for parameter in (p for node in nodes for p in node.parameters.values()):
        if parameter.per and parameter.per not in known:
            raise RequestError(
                f"a parameter ({parameter.doc or 'undocumented'}) is declared per {parameter.per!r}, "
                "which is not a group",
                expected=f'groups=("{parameter.per}",)', remedy=nearest(parameter.per, known),
            )  # fmt: skip
