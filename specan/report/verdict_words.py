"""A verdict in words, the same on the terminal, in figures, in the report and on the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
