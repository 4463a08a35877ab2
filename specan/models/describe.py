"""What a model, an effect, a quantity is, as plain values: for a table, for JSON, for a page.

And a rig file to begin with: what a model may be told, with its units, as commented TOML.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.chosen_model import span
from specan.models.effect import Effect, Parameter
from specan.models.model import Model
from specan.models.quantity import Quantity
from specan.units import convert, printed_unit


def describe_model(model: Model) -> dict[str, Any]:
    """Everything that a model is made of."""
    return {
        "name": model.name,
        "title": model.title,
        "notes": list(model.notes),
        "conditions": {
            c.name: _plain(c, ("column", "column_unit", "default", "doc")) for c in model.conditions.values()
        },
        "observables": {
            o.name: _plain(o, ("quantity", "unit", "doc")) for o in model.observables.values()
        },
        "base_effects": list(model.base_effects),
        "effects": {e.name: describe_effect(model, e) for e in model.effects.values()},
        "quantities": {q.name: describe_quantity(model, q) for q in model.quantities.values()},
        "axes": {name: list(elements) for name, elements in model.axes.items()},
        "unsuited": dict(model.unsuited),
    }  # fmt: skip


def describe_effect(model: Model, effect: Effect) -> dict[str, Any]:
    """An effect as a mapping: what it changes, its parameters and where it holds."""
    names = (
        "name", "instrument", "explanation", "adds_to", "scales", "joins", "reads", "at", "needs", "aliases",
        "separate_by", "reference",
    )  # fmt: skip
    return _plain(effect, names) | {
        "in_base": effect.name in model.base_effects,
        "parameters": _parameters(effect.parameters, effect.neutral),
        "valid": {name: {"low": v[0], "high": v[1], "unit": v[2]} for name, v in effect.valid.items()},
    }


def describe_quantity(model: Model, quantity: Quantity) -> dict[str, Any]:
    """A quantity as a mapping: what it reads and what changes it."""
    return _plain(quantity, ("name", "unit", "doc", "axes", "reads", "reference")) | {
        "parameters": _parameters(quantity.parameters, {}),
        "changed_by": [e.name for e in model.effects.values() if quantity.name in e.changes],
    }


def _plain(one: object, names: Sequence[str]) -> dict[str, Any]:
    """Some attributes; lists for tuples."""
    found = {name: getattr(one, name) for name in names}
    return {name: list(v) if isinstance(v, tuple) else v for name, v in found.items()}


def find_part(model: Model, name: str) -> Effect | Quantity:
    """The effect or quantity of a name; the nearest is offered where there is none."""
    part = model.effects.get(name) or model.quantities.get(name)
    if name in model.unsuited:
        raise RequestError(f"{name} is not an effect of this rig: {model.unsuited[name]}")
    if part is None:
        known = [*model.effects, *model.quantities]
        raise RequestError(f"{model.name} has no effect or quantity {name!r}", remedy=nearest(name, known))
    return part


def _parameters(parameters: Mapping[str, Parameter], neutral: Mapping[str, float]) -> dict[str, Any]:
    names = ("default", "unit", "domain", "fixed", "per", "needs", "doc")
    return {
        name: _plain(p, names) | {"plausible": [p.min, p.max], "neutral": neutral.get(name)}
        for name, p in parameters.items()
    }


def rig_template(model: Model, example: Mapping[str, Any]) -> str:
    """The text of a rig file.

    Parameters
    ----------
    model : Model
    example : mapping
        The content of its example rig; for a model that states none, limits and uncertainties are written from its
        conditions and observables.

    Examples
    --------
    >>> from specan.models.catalogue import example_model, example_rig
    >>> rig_template(example_model("worm-gear"), example_rig("worm-gear")).splitlines()[0]
    '# Rig file of the model worm-gear. The numbers are an example: replace them with your own.'
    """
    import tomlkit

    lines = [f"# Rig file of the model {model.name}. The numbers are an example: replace them with your own."]
    content = {key: value for key, value in example.items() if key not in ("limits", "uncertainty")}
    if content:
        lines += ["", tomlkit.dumps(content).strip()]
    tables = {
        "limits": ("Lowest and highest value of each condition, in the unit of its column.", _limits),
        "uncertainty": ("Standard uncertainties, in the unit of each column.", _uncertainties),
    }
    for name, (said, usual) in tables.items():
        if not example or name in example:
            given = tomlkit.dumps(dict(example.get(name, {}))).strip().splitlines()
            lines += ["", f"# {said}", f"[{name}]", *(given or usual(model))]
    return "\n".join(lines) + "\n"


def _limits(model: Model) -> list[str]:
    lines = []
    for condition in model.conditions.values():
        known, remark = condition.name in model.rig.limits, _remark(condition.column_unit)
        ends = "[{:.9g}, {:.9g}]".format(*span(model, condition.name)) if known else "[0.0, 1.0]"
        lines.append(f"{'' if known else '# '}{condition.column} = {ends}{remark}")
    return lines


def _uncertainties(model: Model) -> list[str]:
    lines = []
    for observable in model.observables.values():
        unit = observable.column_unit or observable.unit
        known = model.rig.reading.get(observable.name)
        if known is None:
            lines.append(f"# {observable.header} = 0.1{_remark(unit)}: of one reading")
        else:
            size = float(convert(known, observable.unit, unit) - convert(0.0, observable.unit, unit))
            lines.append(f"{observable.header} = {size:.9g}{_remark(unit)}: of one reading")
    for condition in model.conditions.values():
        lines.append(
            f"# {condition.column}_setting = 0.1{_remark(condition.column_unit)}: of setting it anew"
        )
        lines.append(f"# {condition.column}_setting_percent = 1.0  # the same as a percentage of its value")
    lines.append("# model_discrepancy_percent = 0.5  # expected error of the model's prediction")
    return lines


def _remark(unit: str) -> str:
    return f"  # {printed_unit(unit)}" if printed_unit(unit) else "  # a number"
