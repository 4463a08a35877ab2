"""Parts of a self-contained page: every text is shown as text, figures lie inside, no outside address."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from specan import __version__
from specan.report.figure_style import image
from specan.result import Sheet

STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")


def page(title: str, parts: Iterable[str]) -> str:
    """The whole page; `parts` are HTML, `title` is text."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="generator" content="specan {__version__}">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body><main>\n"
        # What is too wide is scrolled; the keyboard does so where it has the focus.
        + re.sub("<(table|pre)", r'<\1 tabindex="0"', "\n".join(parts))
        + "\n</main></body></html>\n"
    )


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table, without the columns that hold nothing; without rows there is none.

    Examples
    --------
    >>> "<b>" in table(["channel"], [["<b>Mic 1</b>"]]), "held out" in table(["step", "held out"], [[0, ""]])
    (False, False)
    >>> table(["parameter", "value"], [])
    ''
    """
    columns = [[str(value) for value in column] for column in zip(*rows, strict=True)]
    heads = [*header, *[""] * (len(columns) - len(header))]
    kept = [(head, column) for head, column in zip(heads, columns) if any(column)]
    kinds = [' class="n"' * all(map(_NUMBER.fullmatch, filter(None, column))) for _, column in kept]
    head = _line((f"th{kind}" if name else "td", name) for kind, (name, _) in zip(kinds, kept, strict=True))
    lines = zip(*(column for _, column in kept), strict=True)
    body = (_line((f"td{kind}", text) for kind, text in zip(kinds, line, strict=True)) for line in lines)
    whole = [f"<table><thead>{head * any(header)}</thead><tbody>", *body, "</tbody></table>"]
    return "\n".join(whole * bool(kept))


def shown(sheet: Sheet) -> str:
    """The table of a result."""
    return table(sheet.header, sheet.rows)


# A number, perhaps with what follows in brackets or a unit.
_NUMBER = re.compile(r"(< )?[-+]?[\d.]+(e[-+]?\d+)?( (\(.*\)|\S+))?")


def _line(cells: Iterable[tuple[str, str]]) -> str:
    """Cells of a tag with its attributes and a text."""
    return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag[:2]}>" for tag, text in cells) + "</tr>"


def bar(part: float) -> str:
    """A bar of a part of 1."""
    return (
        '<span style="display:inline-block;width:60px;height:7px;background:var(--line);border-radius:3px">'
        f'<span style="display:block;width:{60 * min(part, 1.0):.0f}px;height:7px;background:var(--accent);'
        'border-radius:3px"></span></span>'
    )


def bullets(items: Iterable[str]) -> str:
    """A list."""
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def picture(figure: Figure, text: str) -> str:
    """A figure inside the page."""
    width = round(96 * float(figure.get_size_inches()[0]))  # on the screen as large as on paper
    data = base64.b64encode(image(figure, "png", 130)).decode()
    return f'<p><img alt="{escape(text)}" width="{width}" src="data:image/png;base64,{data}"></p>'
