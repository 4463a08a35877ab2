"""Parts of every page: header, tables, a line that says what is being done, and what only the browser can do."""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from bokeh.layouts import row
from bokeh.models import CustomJS, Div, Spacer, TextInput

if TYPE_CHECKING:
    from bokeh.document import Document

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


_TICK_MS = 1000
_SILENT_S = 2.0  # seconds are not counted before


class Busy:
    """A text of the page; one that `folds` takes no room while there is nothing to say."""

    def __init__(self, document: Document, name: str, folds: bool = False, **layout: Any) -> None:
        self.div = Div(text="", name=name, visible=not folds, **layout)
        self._folds = folds
        self._document = document
        self._text, self._since = "", 0.0
        self._tick: Any = None

    def begin(self, text: str) -> None:
        """Say what is being done from now on."""
        self._text, self._since = text, time.monotonic()
        self._show()
        if self._tick is None:
            self._tick = self._document.add_periodic_callback(self._show, _TICK_MS)

    def go_on(self, text: str) -> None:
        """Another part of the same work: the time goes on."""
        self._text = text
        self._show()

    def end(self, text: str = "", kind: str = "") -> None:
        """It is done; or it failed."""
        if self._tick is not None:
            self._document.remove_periodic_callback(self._tick)
            self._tick = None
        self.div.text = notice(text, kind) if text else ""
        self.div.visible = bool(text) or not self._folds

    def _show(self) -> None:
        self.div.visible = True
        passed = time.monotonic() - self._since
        self.div.text = notice(
            f"{self._text} ..." + (f" {passed:.0f} s" if passed > _SILENT_S else ""), "busy"
        )


_ADDRESS = (
    "window.history.replaceState(null, '', cb_obj.value ? '?' + cb_obj.value : window.location.pathname)"
)
_SAVE = """
if (!cb_obj.value) return;
const file = JSON.parse(cb_obj.value);
const bytes = Uint8Array.from(atob(file.content), c => c.charCodeAt(0));
const link = document.createElement('a');
link.href = URL.createObjectURL(new Blob([bytes], {type: file.kind}));
link.download = file.name;
document.body.appendChild(link); link.click(); link.remove();
setTimeout(() => URL.revokeObjectURL(link.href), 1000);
"""
_COPY = """
if (!cb_obj.value) return;
const text = JSON.parse(cb_obj.value).text;
const fall = () => { const t = document.createElement('textarea'); t.value = text; document.body.appendChild(t);
  t.select(); document.execCommand('copy'); t.remove(); };
(navigator.clipboard?.writeText(text) ?? Promise.reject()).catch(fall);
"""
KINDS = {"txt": "text/plain;charset=utf-8", "png": "image/png", "svg": "image/svg+xml"}


class BrowserLink:
    """Invisible widgets that pass texts to the browser."""

    def __init__(self) -> None:
        self._address, self._save = TextInput(visible=False), TextInput(visible=False)
        self._copied = TextInput(visible=False, name="copied")
        self._copied.js_on_change("value", CustomJS(code=_COPY))
        self._address.js_on_change("value", CustomJS(code=_ADDRESS))
        self._save.js_on_change("value", CustomJS(code=_SAVE))
        self._count = 0
        self.widgets = [self._address, self._save, self._copied]

    def address(self, query: str) -> None:
        """Write the settings into the address; the page stays."""
        self._address.value = query

    def save(self, name: str, content: bytes) -> None:
        """Hand a file to the browser's downloads."""
        self._count += 1  # the same file twice is two changes
        kind = KINDS[name.rpartition(".")[2]]
        text = base64.b64encode(content).decode()
        self._save.value = json.dumps({"name": name, "kind": kind, "content": text, "number": self._count})

    def copy(self, text: str) -> None:
        """Put a text on the clipboard."""
        self._count += 1
        self._copied.value = json.dumps({"text": text, "number": self._count})
