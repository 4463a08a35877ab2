"""What a model, an effect, a quantity is, as plain values: for a table, for JSON, for a page.

And a rig file to begin with: what a model may be told, with its units, as commented TOML.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.errors import RequestError, require_known
from specan.models.chosen_model import span
from specan.models.effect import Effect, Parameter
from specan.models.model import Model
from specan.models.quantity import Quantity
from specan.result import picked
from specan.units import convert, printed_unit


def describe_model(model: Model) -> dict[str, Any]:
    """Everything that a model is made of."""
    nodes = {"conditions": "column column_unit default doc", "observables": "quantity unit doc"}
    return {
        **picked(model, "name title notes"),
        **{kind: {n: picked(c, of) for n, c in getattr(model, kind).items()} for kind, of in nodes.items()},
        **picked(model, "base_effects"),
        "effects": {e.name: _effect(model, e) for e in model.effects.values()},
        "quantities": {q.name: _quantity(model, q) for q in model.quantities.values()},
        **picked(model, "axes unsuited"),
    }


def describe_part(model: Model, name: str) -> dict[str, Any]:
    """What an effect changes, its parameters and where it holds; or what a quantity reads and what changes it.

    Raises
    ------
    RequestError
        There is none of that name; the nearest is offered.
    """
    if name in model.unsuited:
        raise RequestError(f"{name} is not an effect of this rig: {model.unsuited[name]}")
    known = [*model.effects, *model.quantities]
    require_known(name, known, f"{model.name} has no effect or quantity {name!r}")
    effect = model.effects.get(name)
    return _effect(model, effect) if effect else _quantity(model, model.quantities[name])


def _effect(model: Model, effect: Effect) -> dict[str, Any]:
    names = "name instrument explanation adds_to scales joins reads at needs aliases separate_by reference"
    return picked(effect, names) | {
        "in_base": effect.name in model.base_effects,
        "parameters": _parameters(effect.parameters, effect.neutral),
        "valid": {
            name: dict(zip(("low", "high", "unit"), v, strict=True)) for name, v in effect.valid.items()
        },
    }


def _quantity(model: Model, quantity: Quantity) -> dict[str, Any]:
    return picked(quantity, "name unit doc axes reads reference") | {
        "parameters": _parameters(quantity.parameters, {}),
        "changed_by": [e.name for e in model.effects.values() if quantity.name in e.changes],
    }


def _parameters(parameters: Mapping[str, Parameter], neutral: Mapping[str, float]) -> dict[str, Any]:
    return {
        name: picked(p, "default unit domain fixed per needs doc")
        | {"plausible": [p.min, p.max], "neutral": neutral.get(name)}
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
