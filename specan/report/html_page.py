"""Parts of a self-contained page: every text is shown as text, figures lie inside, no outside address."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from specan import __version__
from specan.report.figure_style import image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from specan.result import Sheet

STYLE = """
:root { --ink: #1d2530; --soft: #5b6675; --line: #dfe4ea; --accent: #0072B2; --paper: #fff; --panel: #f6f8fa; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ee; --soft: #a3adba; --line: #3a4350; --accent: #56B4E9;
--paper: #161b22; --panel: #1f2630; } }
body { font: 15px/1.55 system-ui, "Segoe UI", sans-serif; max-width: 62em; margin: 1.4em auto; padding: 0 1em;
color: var(--ink); background: var(--paper); }
h1 { font-size: 1.6em; margin: 0 0 0.2em; } h2 { font-size: 1.25em; margin: 1.6em 0 0.4em;
border-bottom: 1px solid var(--line); padding-bottom: 0.2em; } h3 { font-size: 1.05em; margin: 1.2em 0 0.3em; }
table { border-collapse: collapse; margin: 0.8em 0; font-size: 0.92em; }
td, th { padding: 0.2em 0.8em; text-align: left; border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; background: #fff; border-radius: 4px; }
.verdict { font-size: 1.15em; border-left: 0.3em solid var(--accent); margin: 0.5em 0; padding: 0.1em 0 0.1em 0.7em; }
pre { background: var(--panel); padding: 0.8em; overflow-x: auto; font-size: 0.85em; } tr.grey { color: var(--soft); }
@media (max-width: 40em) { table { display: block; overflow-x: auto; } td, th { padding: 0.2em 0.5em; } }
@page { size: A4; margin: 16mm; }
@media print { :root { --ink: #000; --soft: #444; --line: #bbb; --paper: #fff; --panel: #fff; }
body { max-width: none; margin: 0; font-size: 9pt; line-height: 1.35; }
h1, h2, h3, p, table { margin-top: 0.4em; margin-bottom: 0.4em; } h2, h3 { break-after: avoid; }
img { max-height: 78mm; width: auto; } .sheet { break-before: page; }
img, tr, table[style] { break-inside: avoid; } td, th { padding: 0.1em 0.6em; } }
"""


def page(title: str, parts: Iterable[str]) -> str:
    """The whole page; `parts` are HTML, `title` is text."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="generator" content="specan {__version__}">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def table(header: Sequence[str], rows: Iterable[Sequence[Any]], grey: Sequence[bool] | None = None) -> str:
    """A table; rows marked in `grey` stand back.

    Examples
    --------
    >>> "<b>" in table(["channel"], [["<b>Mic 1</b>"]])
    False
    """
    lines = ["<table><tr>" + "".join(f"<th>{escape(h)}</th>" for h in header) + "</tr>"]
    for k, row in enumerate(rows):
        kind = ' class="grey"' if grey is not None and grey[k] else ""
        lines.append(f"<tr{kind}>" + "".join(_cell(value) for value in row) + "</tr>")
    return "\n".join([*lines, "</table>"])


def shown(sheet: Sheet) -> str:
    """A table of a result."""
    return table(sheet.header, sheet.rows)


# A number, perhaps with what follows in brackets or a unit.
_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?( (\(.*\)|\S+))?")


def _cell(value: Any) -> str:
    text = str(value)
    number = isinstance(value, (int, float)) or _NUMBER.fullmatch(text) is not None
    return f'<td class="n">{escape(text)}</td>' if number and len(text) < 12 else f"<td>{escape(text)}</td>"


def bar(part: float, colour: str = "var(--accent)") -> str:
    """A bar of a part of 1."""
    return (
        '<span style="display:inline-block;width:60px;height:7px;background:var(--line);border-radius:3px">'
        f'<span style="display:block;width:{60 * min(part, 1.0):.0f}px;height:7px;background:{colour};'
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
