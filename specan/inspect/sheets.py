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
    head = "".join(
        f'<th style="text-align:left;padding:2px 14px 2px 0">{escape(str(h))}</th>' for h in header
    )
    body = "".join(
        "<tr>" + "".join(f'<td style="padding:1px 14px 1px 0">{escape(str(v))}</td>' for v in row) + "</tr>"
        for row in rows
    )
    return f'<table style="border-collapse:collapse;font-size:13px"><tr>{head}</tr>{body}</table>'


def notice(text: str, kind: str = "") -> str:
    """A line of text; a warning stands out."""
    colour = {"error": "#a33", "busy": "#0072B2"}.get(kind, "#444")
    return f'<span style="color:{colour}">{escape(text)}</span>'
