"""The bar on top of every page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from bokeh.layouts import row
from bokeh.models import Div, Spacer

KEYS = (
    "Keys: 1 to 7 tabs, n save numbers, p save PNG, v save SVG, c copy numbers, l copy the command line, "
    "d dark or light."
)
STUDY_KEYS = "Keys: p save PNG, v save SVG, c copy numbers, l copy the command line, d dark or light."


def header(title: str, kind: str, buttons: Sequence[Any]) -> Any:
    """Name of the program and of what is shown on the left, buttons on the right."""
    text = (
        '<span style="font-weight:700;color:var(--accent);font-size:15px">specan</span>'
        f'<span style="color:var(--soft)"> &nbsp;{escape(kind)}&nbsp; </span><b>{escape(title)}</b>'
    )
    name = Div(text=text, styles={"white-space": "nowrap", "overflow": "hidden", "text-overflow": "ellipsis"})
    return row(
        name, Spacer(sizing_mode="stretch_width"), *buttons, sizing_mode="stretch_width",
        styles={"align-items": "center", "border-bottom": "2px solid var(--accent)", "margin-bottom": "5px"},
    )  # fmt: skip
