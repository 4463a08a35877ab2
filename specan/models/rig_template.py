"""A rig file to begin with: what a model may be told, with its units, as commented TOML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.models.model import Model
from specan.units import convert, printed_unit


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
    >>> from specan.models.catalogue import example_model
    >>> from specan.models.worm_gear.example import EXAMPLE_RIG
    >>> rig_template(example_model("worm-gear"), EXAMPLE_RIG).splitlines()[0]
    '# What is known of a set-up of the model worm-gear. The numbers are those of an example: put in your own.'
    """
    import tomlkit

    lines = [
        f"# What is known of a set-up of the model {model.name}. "
        "The numbers are those of an example: put in your own."
    ]
    content = {key: value for key, value in example.items() if key not in ("limits", "uncertainty")}
    if content:
        lines += ["", tomlkit.dumps(content).strip()]
    if not example or "limits" in example:
        lines += [
            "",
            "# From where to where each condition can be set, in the unit of its column.",
            "[limits]",
        ]
        lines += _given(example.get("limits", {})) or _limits(model)
    if not example or "uncertainty" in example:
        lines += ["", "# Standard uncertainties, in the unit of each column.", "[uncertainty]"]
        lines += _given(example.get("uncertainty", {})) or _uncertainties(model)
    return "\n".join(lines) + "\n"


def _given(table: Mapping[str, Any]) -> list[str]:
    import tomlkit

    return tomlkit.dumps(dict(table)).strip().splitlines() if table else []


def _limits(model: Model) -> list[str]:
    lines = []
    for condition in model.conditions.values():
        ends = model.rig.limits.get(condition.name)
        if ends is None:
            lines.append(f"# {condition.column} = [0.0, 1.0]{_remark(condition.column_unit)}")
            continue
        low, high = (float(convert(end, condition.unit, condition.column_unit)) for end in ends)
        lines.append(f"{condition.column} = [{low:.9g}, {high:.9g}]{_remark(condition.column_unit)}")
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
    lines.append(
        "# model_discrepancy_percent = 0.5  # of the model's prediction: how right it is expected to be"
    )
    return lines


def _remark(unit: str) -> str:
    return f"  # {printed_unit(unit)}" if printed_unit(unit) else "  # a number"
