"""A verdict and a study's errors in words, the same on the terminal, in figures, in the report and on the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from specan.units import printed_unit

if TYPE_CHECKING:
    from specan.study.history import Step
    from specan.study.study import Study
    from specan.study.verdict import Diagnosis

VERDICTS = {
    "effect": "Missing: {names}.",
    "group": "Missing: {names}; these data cannot tell which.",
    "nothing-missing": "Nothing is missing, as far as these data can tell.",
    "fits-only-if": "It fits, but only with values outside what is known.",
    "unknown-effect": "Something is missing that is not on the list of effects.",
    "cannot-tell": "These data cannot tell.",
}
# Nothing-missing where the data alone would rather take values that contradict what is known.
WITHIN_WHAT_IS_KNOWN = "Nothing is missing if the values are as known; the data alone would take others."


def headline(found: Diagnosis) -> str:
    """The verdict as one sentence: ``Missing: windage or seal-drag; these data cannot tell which.``"""
    return headline_of(found.to_json())


def headline_of(content: Mapping[str, Any]) -> str:
    """The same from what ``study diagnose --json`` prints.

    Examples
    --------
    >>> headline_of({"verdict": "group", "alternatives": [["windage"], ["seal-drag", "churning"]]})
    'Missing: windage or seal-drag with churning; these data cannot tell which.'
    """
    if content["verdict"] == "nothing-missing" and content.get("other_form"):
        return f"Nothing is missing with {content['other_form']}."
    if content["verdict"] == "nothing-missing" and content.get("unknown_possible"):
        return WITHIN_WHAT_IS_KNOWN
    names = " or ".join(" with ".join(members) for members in content["alternatives"])
    return VERDICTS[content["verdict"]].format(names=names)


def reason(content: Mapping[str, Any]) -> str:
    """Why, as a sentence; empty where nothing is said."""
    text = str(content.get("reason") or "")
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def state_of(study: Study) -> list[str]:
    """What a figure of a study says of the model and of how well it fits."""
    effects = ", ".join(study.model_effects) or study.model.words.ideal
    errors = "; ".join(
        f"RMS error of {e.observable.replace('_', ' ')} {e.rms:.3g} {printed_unit(e.unit)} ({e.relative_rms:.2g} %)"
        for e in study.errors
    )
    chi2 = f"chi²/n {study.shown.reduced_chi2:.3g}, " if study.data.known else ""
    return [f"Model: {effects}", chi2 + errors]


def history_sentence(steps: Sequence[Step]) -> str:
    """``Fitted: 0.0276 to 0.0065 Nm (-77 %). Held out: 0.03 to 0.0072 Nm (-76 %).``"""
    texts = []
    for attribute, text in (("fit_error", "Fitted"), ("held_out_error", "Held out")):
        errors = [e for s in steps if (e := getattr(s, attribute)) is not None]
        if errors:
            texts.append(f"{text}: {fall_text(errors[0], errors[-1])}.")
    return " ".join(texts)


def fall_text(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """``0.0276 to 0.0065 Nm (-77 %)``; of one and the same error, its value."""
    unit = f" {printed_unit(after['unit'])}".rstrip()
    if before == after or not before["value"]:
        return f"{after['value']:.3g}{unit}"
    change = 100 * (after["value"] / before["value"] - 1)
    return f"{before['value']:.3g} to {after['value']:.3g}{unit} ({change:+.0f} %)"
