"""What a model, an effect, a quantity is, as plain values: for a table, for JSON, for a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.effect import Effect
from specan.models.model import Model
from specan.models.parameter import Parameter
from specan.models.quantity import Quantity


def describe_model(model: Model) -> dict[str, Any]:
    """Everything that a model is made of."""
    return {
        "name": model.name,
        "title": model.title,
        "notes": list(model.notes),
        "conditions": {
            c.name: {
                "column": c.column, "column_unit": c.column_unit, "default": c.default, "doc": c.doc,
            }
            for c in model.conditions.values()
        },
        "observables": {
            o.name: {"quantity": o.quantity, "unit": o.unit, "doc": o.doc} for o in model.observables.values()
        },
        "base_effects": list(model.base_effects),
        "effects": {e.name: describe_effect(model, e) for e in model.effects.values()},
        "quantities": {q.name: describe_quantity(model, q) for q in model.quantities.values()},
        "axes": {name: list(elements) for name, elements in model.axes.items()},
        "unsuited": dict(model.unsuited),
    }  # fmt: skip


def describe_effect(model: Model, effect: Effect) -> dict[str, Any]:
    """Everything that an effect declares."""
    return {
        "name": effect.name,
        "in_base": effect.name in model.base_effects,
        "instrument": effect.instrument,
        "explanation": effect.explanation,
        "adds_to": list(effect.adds_to),
        "scales": list(effect.scales),
        "joins": list(effect.joins),
        "reads": list(effect.reads),
        "at": effect.at,
        "parameters": _parameters(effect.parameters, effect.neutral),
        "valid": {name: {"low": v[0], "high": v[1], "unit": v[2]} for name, v in effect.valid.items()},
        "needs": list(effect.needs),
        "aliases": list(effect.aliases),
        "separate_by": effect.separate_by,
        "reference": effect.reference,
    }


def describe_quantity(model: Model, quantity: Quantity) -> dict[str, Any]:
    """What a quantity is, what it reads, and which effects change it."""
    return {
        "name": quantity.name,
        "unit": quantity.unit,
        "doc": quantity.doc,
        "axes": list(quantity.axes),
        "reads": list(quantity.reads),
        "reference": quantity.reference,
        "parameters": _parameters(quantity.parameters, {}),
        "changed_by": [e.name for e in model.effects.values() if quantity.name in e.changes],
    }


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
    return {
        name: {
            "default": p.default,
            "unit": p.unit,
            "plausible": [p.min, p.max],
            "domain": list(p.domain),
            "neutral": neutral.get(name),
            "fixed": p.fixed,
            "per": p.per,
            "needs": list(p.needs),
            "doc": p.doc,
        }
        for name, p in parameters.items()
    }
