"""What every tab is to the page: settings in, a result computed aside, drawn when it is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from bokeh.models import NumericInput, Select

from specan.data.recording import Recording
from specan.errors import RequestError
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Plots, Spectral, plain
from specan.inspect.view import View, settings_of, with_labels
from specan.inspect.work import Tell, heard
from specan.report.figures import description_of
from specan.report.panels import Drawing, joined
from specan.result import RecordingResult
from specan.schema import Settings, parse

Change = Callable[..., None]
Found = list[tuple[int, Any]]  # number of the recording, and its result


class Tab:
    """One tab: its controls, the analysis that it makes, and the figure of the report that it draws.

    Attributes
    ----------
    name, title : str
        In the address, and on the page.
    kind : type of Settings
        The analysis.
    needs : str
        What has to be chosen for it.
    tip : tuple of str, or None
        Names of the values at the mouse; None where no panels are drawn.
    readings : mapping
        What is said at the cursor: attribute of the result to the form of its value.
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
    kind: ClassVar[type[Settings]]
    needs: ClassVar[str] = "a channel"
    tip: ClassVar[tuple[str, str] | None] = ("Hz", "dB")
    hertz: ClassVar[bool] = True
    readings: ClassVar[dict[str, str]] = {}
    figure_view = ""

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        self.opened, self.change = opened, change
        self.controls: list[Any] = []
        self.side: list[Any] = []
        self.figures: list[Spectral] = []
        self._widgets: dict[str, Select | NumericInput] = {}
        self.body: list[Any] = []
        if self.tip is not None:
            self.plots = Plots(self.add_figure if self.readings else None, hertz=self.hertz, tip=self.tip)
            self.body = [self.plots.body]
        self.add_controls(view)

    # --- the result -------------------------------------------------------------------------------

    def compute(self, view: View, tell: Tell) -> Found:
        """What is found in the channels on screen, by recording and rate; `tell` hears of the reading.

        Runs beside the page and may take a while.
        """
        chosen = self.opened.chosen(self.keys(view))
        if not chosen:
            raise RequestError("no channel is chosen", remedy=f"choose {self.needs} on the left")
        return [(one.number, self.analyse(view, one, heard(one.recording, tell))) for one in chosen]

    def keys(self, view: View) -> Sequence[str]:
        """Of the channels that are analysed."""
        return view.channel

    def analyse(self, view: View, chosen: Chosen, recording: Recording) -> Any:
        """The result of some channels."""
        given = {**settings_of(view, self.name), "channels": chosen.patterns, **self.more(view, chosen)}
        settings: Any = parse(self.kind, given, self.name)
        return settings(recording)

    def more(self, view: View, chosen: Chosen) -> dict[str, Any]:
        """Settings that do not stand in the view as they are."""
        return {}

    # --- on the page ------------------------------------------------------------------------------

    def drawing(self, result: Any, view: View) -> Drawing:
        """What is drawn of a result."""
        return description_of(result)

    def drawn(self, found: Found, view: View) -> Drawing:
        """One drawing of all results; channels have the name of their recording where there are two."""
        return joined([self.drawing(r, view).named(partial(self.opened.text, n)) for n, r in found])

    def draw(self, found: Found, view: View) -> None:
        """Show results."""
        self.plots.draw(self.drawn(found, view))

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Channel, frequency and values of the line at the cursor."""
        rows = []
        for number, r in found:
            axis = getattr(r, r.dimensions[1])
            if (line := self.line(r, axis, frequency)) is None:
                continue
            known = r.values_over()
            values = {key: known.get(key, getattr(r, key, None)) for key in self.readings}
            units = getattr(r, "value_units", r.units)
            for row, name in enumerate(r.channels):
                said = [
                    form.format((found[row] if np.ndim(found) > 1 else found)[line], unit=units[row])
                    for form, found in zip(self.readings.values(), values.values(), strict=True)
                    if found is not None
                ]
                hertz = axis[line] / self.per_hertz(r)
                rows.append((self.opened.text(number, name), f"{hertz:.6g}", "\n".join(filter(None, said))))
        return rows

    def line(self, result: Any, axis: Any, frequency: float) -> int | None:
        """Number of the line at a frequency: the nearest."""
        return int(np.argmin(np.abs(axis - frequency * self.per_hertz(result))))

    def per_hertz(self, result: Any) -> float:
        """What 1 Hz is on the axis."""
        return 1.0

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

    # --- controls ----------------------------------------------------------------------------------

    def add_controls(self, view: View) -> None:
        """What can be chosen on this tab."""

    def choice(self, view: View, field: str, title: str, options: Sequence[Any], width: int = 110) -> None:
        """A list of values of a setting."""
        texts = [option if isinstance(option, tuple) else (str(option), str(option)) for option in options]
        whole = type(View.model_fields[field].default) is int
        value = str(getattr(view, field))
        self._control(
            Select(title=title, value=value, options=texts, width=width), field, int if whole else None
        )

    def channel_choice(self, view: View, field: str, title: str, otherwise: str, width: int = 170) -> None:
        """A list of all channels by their names; `otherwise` is what holds without a choice."""
        names = dict.fromkeys(c.label for _, c in self.opened.keys.values())
        self.choice(view, field, title, [("", otherwise), *((name, plain(name)) for name in names)], width)

    def number(
        self, view: View, field: str, title: str, width: int = 90, mode: str = "float", placeholder: str = ""
    ) -> None:
        """A setting that is a number."""
        value = getattr(view, field)
        self._control(
            NumericInput(title=title, value=value, mode=mode, width=width, placeholder=placeholder), field
        )

    def _control(self, widget: Any, field: str, kind: Callable[[Any], Any] | None = None) -> None:
        widget.name = field
        widget.on_change("value", lambda a, old, new: self.change(**{field: kind(new) if kind else new}))
        self.controls.append(widget)
        self._widgets[field] = widget

    def worded(self, message: str) -> str:
        """A message with the names that its controls have here."""
        return with_labels(message, self.name, {field: w.title for field, w in self._widgets.items()})

    def settings_of(self, view: View) -> None:
        """Show settings that another tab has changed."""
        for field, widget in self._widgets.items():
            value = getattr(view, field)
            widget.value = value if isinstance(widget, NumericInput) else str(value)


def text_of(result: RecordingResult) -> bytes:
    """What a command writes to a file."""
    import tempfile

    from specan.io.export_file import write_result

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "numbers.txt"
        write_result(result, path)
        return path.read_bytes()
