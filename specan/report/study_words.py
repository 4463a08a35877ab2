"""Short texts on a study's errors, for figures, the report and the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from specan.study.history import Step, error_pairs
from specan.study.study import Study
from specan.units import spoken


def state_of(study: Study) -> list[str]:
    """What a figure of a study says of the model and of how well it fits."""
    effects = ", ".join(study.model_effects) or study.model.words.ideal
    errors = "; ".join(
        f"RMS error of {e.observable.replace('_', ' ')} {spoken(e.rms, unit=e.unit)} "
        f"({spoken(e.relative_rms, digits=2)} %)"
        for e in study.errors
    )
    chi2 = f"chi²/n {study.shown.reduced_chi2:.3g}, " if study.data.known else ""
    return [f"Model: {effects}", chi2 + errors]


def allowed_for(study: Study) -> str:
    """``model discrepancy of 0.5 % of the losses allowed for``; nothing where none is declared."""
    parts = [
        f"{of:g} % of {quantity} ({name})" for name, (quantity, of) in study.model.rig.discrepancies.items()
    ]
    if percent := study.data.discrepancy_percent:
        parts.insert(0, f"{percent:g} % of the {study.model.words.discrepancy_of}")
    return f"model discrepancy of {', '.join(parts)} allowed for" if parts else ""


def falls(before: Step, after: Step) -> str:
    """``Fitted: 0.0276 to 0.0065 Nm (-77 %); held out: 0.03 to 0.0072 Nm (-76 %)``."""
    texts = [f"{data.replace('-', ' ')}: {fall_text(a, b)}" for data, a, b in error_pairs(before, after)]
    whole = "; ".join(texts)
    return whole[:1].upper() + whole[1:]


def fall_text(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """``0.0276 to 0.0065 Nm (-77 %)``; of one and the same error, its value."""
    if before == after or not before["value"]:
        return spoken(after["value"], unit=after["unit"])
    change = 100 * (after["value"] / before["value"] - 1)
    return f"{spoken(before['value'], after['value'], unit=after['unit'])} ({change:+.0f} %)"
