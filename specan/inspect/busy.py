"""A line that says what is being done, and for how long already."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from bokeh.models import Div

from specan.inspect.sheets import notice

if TYPE_CHECKING:
    from bokeh.document import Document

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
