"""Tables of the page: every cell is text, never markup."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any


def sheet(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table as HTML.

    Examples
    --------
    >>> "<b>" in sheet(["channel"], [["<b>Mic 1</b>"]])
    False
    """
    head = "".join(f"<th>{escape(str(h))}</th>" for h in header)
    body = "".join(
        "<tr>" + "".join(f"<td{_long(str(v))}>{escape(str(v))}</td>" for v in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _long(text: str) -> str:
    return ' class="long"' if len(text) > 40 else ""


def folded(title: str, content: str) -> str:
    """Markup that opens with a click on its title."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def notice(text: str, kind: str = "") -> str:
    """A line of text; a warning stands out."""
    colour = {"error": "#c0392b", "busy": "var(--accent)"}.get(kind, "var(--soft)")
    return f'<span style="color:{colour}">{escape(text)}</span>'
