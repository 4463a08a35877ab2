"""Parts of a self-contained page: every text is shown as text, figures lie inside, no outside address."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from specan import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 0.8em 0; } td, th { padding: 0.2em 0.8em; text-align: left;
border-bottom: 1px solid #ddd; } td.n { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; } .verdict { font-size: 1.25em; border-left: 0.3em solid #0072B2; padding-left: 0.6em; }
pre { background: #f5f5f5; padding: 0.8em; overflow-x: auto; } tr.grey { color: #888; }
"""


def page(title: str, parts: Iterable[str]) -> str:
    """The whole page; `parts` are HTML, `title` is text."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="generator" content="specan {__version__}">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def table(header: Sequence[str], rows: Iterable[Sequence[Any]], grey: Sequence[bool] | None = None) -> str:
    """A table; rows marked in `grey` stand back."""
    lines = ["<table><tr>" + "".join(f"<th>{escape(h)}</th>" for h in header) + "</tr>"]
    for k, row in enumerate(rows):
        kind = ' class="grey"' if grey is not None and grey[k] else ""
        lines.append(f"<tr{kind}>" + "".join(_cell(value) for value in row) + "</tr>")
    return "\n".join([*lines, "</table>"])


def _cell(value: Any) -> str:
    text = str(value)
    number = isinstance(value, (int, float)) or text.lstrip("+-")[:1].isdigit()
    return f'<td class="n">{escape(text)}</td>' if number and len(text) < 12 else f"<td>{escape(text)}</td>"


def bullets(items: Iterable[str]) -> str:
    """A list."""
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def picture(figure: Figure, text: str) -> str:
    """A figure inside the page."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    data = base64.b64encode(stream.getvalue()).decode()
    return f'<p><img alt="{escape(text)}" src="data:image/png;base64,{data}"></p>'
