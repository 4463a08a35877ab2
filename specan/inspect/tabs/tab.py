"""What every tab is to the page: settings in, a result computed aside, drawn when it is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Protocol

import numpy as np
from bokeh.models import NumericInput, Select
from numpy.typing import NDArray

from specan.data.recording import Recording
from specan.errors import RequestError
from specan.inspect.opened import Chosen, Opened
from specan.inspect.view import View, settings_of
from specan.inspect.work import Heard, Tell
from specan.report.panels import Drawing, joined
from specan.result import RecordingResult
from specan.schema import Kind, parse

Change = Callable[..., None]
Found = list[tuple[int, Any]]  # number of the recording, and its result


class Spectral(Protocol):
    """A figure over frequency, with a cursor."""

    sheet: Any

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Show the cursor there."""

    def frequency_at(self, event: Any) -> float:
        """Of a click."""


class Tab:
    """One tab.

    Attributes
    ----------
    name, title : str
        In the address, and on the page.
    controls : list
        Widgets above the figures.
    body : list
        Figures and texts.
    side : list
        Texts beside the figures.
    figures : list of Spectral
        Those that show the cursor.
    figure_view : str
        Which figure of a result is saved; see `specan.report.figures`.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    figure_view = ""

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        self.opened, self.change = opened, change
        self.controls: list[Any] = []
        self.body: list[Any] = []
        self.side: list[Any] = []
        self.figures: list[Spectral] = []
        self._widgets: dict[str, Select | NumericInput] = {}

    def compute(self, view: View, tell: Tell) -> Found:
        """The result; runs beside the page and may take a while."""
        raise NotImplementedError

    def drawing(self, result: Any, view: View) -> Drawing:
        """What the figures show of one result: what ``--plot`` of the verb shows."""
        raise NotImplementedError

    def drawn(self, found: Found, view: View) -> Drawing:
        """What they show of all results, with the names of the channels on the page."""
        return joined([self.drawing(r, view).named(partial(self.opened.text, n)) for n, r in found])

    def draw(self, found: Found, view: View) -> None:
        """Show results."""
        raise NotImplementedError

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Channel, frequency and value at the cursor."""
        return []

    def add_figure(self, figure: Spectral) -> None:
        """A figure over frequency: it shows the cursor, and a click on it or a drag moves the cursor."""
        self.figures.append(figure)
        for span in figure.sheet.select({"name": "cursor-line"}):
            span.on_change("location", partial(self._dragged, figure, span))
        figure.sheet.on_event(
            "tap", lambda event: self.change(cursor=float(f"{figure.frequency_at(event):.6g}"))
        )

    def _dragged(self, figure: Spectral, span: Any, attribute: str, old: float, new: float) -> None:
        if [new] != span.tags and new > 0:
            self.change(cursor=float(f"{figure.frequency_at(SimpleNamespace(x=new, y=new)):.6g}"))

    # --- for the tabs -----------------------------------------------------------------------------

    def choice(self, view: View, field: str, title: str, options: Sequence[Any], width: int = 110) -> Select:
        """A list of values of a setting."""
        texts = [option if isinstance(option, tuple) else (str(option), str(option)) for option in options]
        widget = Select(title=title, value=str(getattr(view, field)), options=texts, width=width, name=field)
        kind = type(View.model_fields[field].default)

        def changed(attribute: str, old: str, new: str) -> None:
            self.change(**{field: kind(new) if kind is int else new})

        widget.on_change("value", changed)
        self.controls.append(widget)
        self._widgets[field] = widget
        return widget

    def number(
        self, view: View, field: str, title: str, width: int = 90, mode: str = "float", placeholder: str = ""
    ) -> NumericInput:
        """A setting that is a number."""
        widget = NumericInput(
            title=title,
            value=getattr(view, field),
            mode=mode,
            width=width,
            name=field,
            placeholder=placeholder,
        )
        widget.on_change("value", lambda attribute, old, new: self.change(**{field: new}))
        self.controls.append(widget)
        self._widgets[field] = widget
        return widget

    def settings_of(self, view: View) -> None:
        """Show settings that another tab has changed."""
        for field, widget in self._widgets.items():
            value = getattr(view, field)
            widget.value = value if isinstance(widget, NumericInput) else str(value)

    def settings(self, view: View, chosen: Chosen, kind: type[Kind], **own: Any) -> Kind:
        """Settings of an analysis, for what is on screen."""
        return parse(kind, {**settings_of(view, self.name), "channels": chosen.patterns, **own}, self.name)

    def of_each(
        self, view: View, tell: Tell, analyse: Callable[[Chosen, Recording], Any], least: str = "a channel"
    ) -> Found:
        """What `analyse` finds of the channels on screen, by recording and rate; `tell` hears of the reading."""
        chosen = self.opened.chosen(view.channel)
        if not chosen:
            raise RequestError("no channel is chosen", remedy=f"choose {least} on the left")
        return [(one.number, analyse(one, Heard.of(one.recording, tell))) for one in chosen]


def nearest_line(frequencies: NDArray[np.float64], wanted: float) -> int:
    """Number of the line closest to a frequency."""
    return int(np.argmin(np.abs(frequencies - wanted)))


def text_of(result: RecordingResult) -> bytes:
    """What a command writes to a file."""
    import tempfile

    from specan.io.result_file import write_result

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "numbers.txt"
        write_result(result, path)
        return path.read_bytes()
