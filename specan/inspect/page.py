"""What every page has: a header with buttons, its settings in the address, a line of progress, work beside it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any, ClassVar

from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import Button, Div, InlineStyleSheet, LayoutDOM, Plot, Spacer

from specan.errors import RequestError, SpecanError
from specan.inspect.look import TEMPLATE, THEMES, WIDGETS, BrowserLink, Busy, dark_toggle
from specan.inspect.view import InAddress
from specan.inspect.work import Work

LABELS = {"txt": "Save numbers", "png": "PNG", "svg": "SVG"}


class Page:
    """One browser window.

    Parameters
    ----------
    document : Document
    title : str
    views : type of InAddress
        The settings that stand in the address.
    **status
        Layout of the line of progress.
    """

    kind: ClassVar[str]  # what is shown
    saves: ClassVar[tuple[str, ...]] = ("png", "svg")

    def __init__(self, document: Document, title: str, views: type[InAddress], **status: Any) -> None:
        self.document, self._title = document, title
        self._style = InlineStyleSheet(css=WIDGETS)
        document.template, document.theme, document.title = TEMPLATE, THEMES[False], f"{title} - specan"
        self.link = BrowserLink()
        self.status = Busy(document, "status", sizing_mode="stretch_width", **status)
        self._works: list[Work] = []
        self.work = self.worker(self._failed)
        context = document.session_context
        asked = context.request.arguments if context is not None and context.request else {}
        self.view: Any = views()
        self.refused = ""  # stands until something else is chosen
        try:
            self.view = views.from_arguments(asked)
        except RequestError as fault:
            self.refused = str(fault)
        document.on_session_destroyed(self._closed)

    def _closed(self, context: Any) -> None:
        for work in self._works:
            work.close()

    def worker(self, failed: Callable[[str], None]) -> Work:
        """A thread beside the page, which ends with it."""
        self._works.append(Work(self.document, self._told, failed))
        return self._works[-1]

    def dressed(self, part: Any) -> Any:
        """A part that has the style of the page, figures aside."""
        for inside in part.select({"type": LayoutDOM}):
            if not isinstance(inside, Plot) and self._style not in inside.stylesheets:
                inside.stylesheets = [self._style, *inside.stylesheets]
        return part

    def show_page(self, *parts: Any, **styles: str) -> None:
        """The parts under the header."""
        body = column(
            self._header(), *parts, *self.link.widgets, sizing_mode="stretch_width",
            styles={"padding": "0 8px 6px", "box-sizing": "border-box", **styles},
            css_classes=["tall"] if "height" in styles else [],
        )  # fmt: skip
        self.document.add_root(self.dressed(body))

    def _header(self) -> Any:
        """Name of the program and of what is shown on the left, the buttons on the right."""
        presses: list[tuple[str, str, Callable[[], None]]] = [
            *((LABELS[kind], f"save-{kind}", lambda kind=kind: self._save(kind)) for kind in self.saves),
            (
                "Copy numbers",
                "copy-numbers",
                lambda: self._copy(self._numbers(), "The numbers are on the clipboard."),
            ),
            ("Copy command", "copy-command", lambda: self._copy(self._command())),
        ]
        buttons: list[Any] = []
        for label, name, press in presses:
            buttons.append(Button(label=label, name=name))
            buttons[-1].on_click(partial(self._pressed, press))
        text = (
            '<h1><span style="color:var(--accent);font-size:15px">specan</span>'
            f'<span style="color:var(--soft);font-weight:400"> &nbsp;{self.kind}&nbsp; </span>'
            f"{escape(self._title)}</h1>"
        )
        name = Div(
            text=text, styles={"white-space": "nowrap", "overflow": "hidden", "text-overflow": "ellipsis"}
        )
        return row(
            name, Spacer(sizing_mode="stretch_width"), *buttons, dark_toggle(self.document),
            sizing_mode="stretch_width", css_classes=["folds"],
            styles={"align-items": "center", "border-bottom": "2px solid var(--accent)", "margin-bottom": "5px"},
        )  # fmt: skip

    def _pressed(self, press: Callable[[], None]) -> None:
        try:
            press()
        except SpecanError as fault:
            self._failed(str(fault))

    def _copy(self, text: str, said: str = "") -> None:
        self.link.copy(text)
        self.status.end(said or text)

    def _told(self, part: float) -> None:
        """Show the progress of the work."""

    def _failed(self, message: str) -> None:
        """Show what went wrong."""
        self.status.end(message, "error")

    def _save(self, kind: str) -> None:
        raise NotImplementedError

    def _numbers(self) -> str:
        raise NotImplementedError

    def _command(self) -> str:
        raise NotImplementedError
