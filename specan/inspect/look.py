"""How the page looks, light and dark, and its common parts: header, tables, status line, links of the browser."""

from __future__ import annotations

import base64
import json
import re
import time
from html import escape
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.models import CustomJS, Div, TextInput, Toggle
from bokeh.themes import Theme

from specan.report.figure_style import COLOURS as PRINTED

# Black and white would vanish on one of the two backgrounds: grey in the place of black.
COLOURS = (*PRINTED[:6], "#8b8f98")

# What the browser has: the document's own style, whose custom properties pass into the shadow roots of widgets,
_BROWSER = Path(__file__).with_name("browser")
TEMPLATE = (_BROWSER / "page.html").read_text(encoding="utf-8")
_LIGHT, _DARK = (dict(re.findall(r"--(\w+): (#\w+)", root)) for root in re.findall(r":root.*", TEMPLATE))
# the widgets' style, and scripts that save and copy.
WIDGETS, _SAVE, _COPY = (
    (_BROWSER / name).read_text(encoding="utf-8") for name in ("widgets.css", "save.js", "copy.js")
)
PANEL = {
    "background": "var(--panel)",
    "--under": "var(--panel)",
    "border": "1px solid var(--line)",
    "border-radius": "6px",
    "padding": "6px",
}


def share(weight: int = 1, **more: str) -> dict[str, str]:
    """Style of a part that takes a share of the height, or of the width, and may be smaller than what it holds."""
    return {"flex": f"{weight} 1 0", "min-height": "0", **more}


GROWS = share() | {"min-width": "0"}


def _theme(colours: dict[str, str]) -> Theme:
    text = (_BROWSER / "theme.json").read_text(encoding="utf-8")
    for name, value in colours.items():
        text = text.replace(f'"{name}"', f'"{value}"')
    return Theme(json=json.loads(text))


THEMES = {False: _theme(_LIGHT), True: _theme(_DARK)}
_CLASS = "document.documentElement.classList.toggle('dark', cb_obj.active);"
_PREFERRED = "if (window.matchMedia('(prefers-color-scheme: dark)').matches) toggle.active = true;"


def dark_toggle(document: Document) -> Toggle:
    """Button that changes between light and dark; at first as the browser prefers."""
    toggle = Toggle(label="Dark", name="dark", width=52)
    toggle.js_on_change("active", CustomJS(code=_CLASS))

    def changed(attribute: str, old: bool, new: bool) -> None:
        document.theme = THEMES[new]

    toggle.on_change("active", changed)
    document.js_on_event("document_ready", CustomJS(args={"toggle": toggle}, code=_PREFERRED))
    return toggle


def folded(title: str, content: str) -> str:
    """Markup that opens with a click on its title."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def notice(text: str, kind: str = "") -> str:
    """A line of text; a warning stands out."""
    colour = {"error": "var(--wrong)", "busy": "var(--accent)"}.get(kind, "var(--soft)")
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
