"""What every tab is to the page: settings in, a result computed aside, drawn when it is there."""

from __future__ import annotations

import re
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
from specan.inspect.view import ANALYSES, OF_TABS, View, written
from specan.inspect.work import Tell, heard
from specan.report.figures import description_of
from specan.report.panels import Drawing, joined
from specan.result import RecordingResult
from specan.schema import parse

Change = Callable[..., None]
Found = list[tuple[int, Any]]  # number of the recording, and its result


class Tab:
    """One tab: its controls, the analysis that it makes, and the figure of the report that it draws.

    Attributes
    ----------
    name, title : str
        In the address, and on the page.
    verb : str
        The one that gives the same.
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
    verb: ClassVar[str]
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
        self._titles: dict[str, str] = {}
        self._begun: Any = OF_TABS[self.name](**(view.settings if view.tab == self.name else {}))
        self.body: list[Any] = []
        if self.tip is not None:
            self.plots = Plots(self.add_figure if self.readings else None, hertz=self.hertz, tip=self.tip)
            self.body = [self.plots.body]
        self.add_controls()

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
        kind = ANALYSES[self.name]
        own = {name: value for name, value in self.given(view).items() if name in kind.model_fields}
        section = {"channels": chosen.patterns, "start_s": view.start, "stop_s": view.stop}
        settings: Any = parse(kind, {**own, **section}, self.name)
        return settings(recording)

    def given(self, view: View) -> dict[str, Any]:
        """Settings of the analysis and of what is drawn, where they are not as usual."""
        return dict(view.settings)

    def commands(self, view: View) -> list[str]:
        """What gives the same on the command line, one for each recording on screen.

        Examples
        --------
        >>> from specan.inspect.opened import Opened
        >>> from specan.io.open import open_recording
        >>> from specan.inspect.tabs import OctaveTab
        >>> opened = Opened((open_recording("sample_data/recordings/knock.tdms"),))
        >>> view = View(channel=("Measurement/Mic 1",)).but(fraction=12)
        >>> OctaveTab(opened, view, print).commands(view)
        ["specan octave sample_data/recordings/knock.tdms --channel 'Measurement/Mic 1' --fraction 12"]
        """
        section = {"start": view.start or None, "stop": view.stop}
        options = [
            word
            for name, value in {**self.given(view), **section}.items()
            if value is not None
            for word in ((option_of(name),) if value is True else (option_of(name), written(value)))
        ]
        lines = []
        for one in self.opened.chosen(self.keys(view)):
            channels = [word for name in one.patterns for word in ("--channel", name)]
            lines.append(self.opened.command(one.number, self.verb, [*channels, *options]))
        return lines

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

    def add_controls(self) -> None:
        """What can be chosen on this tab."""

    def choice(
        self, name: str, title: str, options: Sequence[Any], width: int = 110, usual: str = ""
    ) -> None:
        """A list of values of a setting; `usual` is shown where none is chosen."""
        texts = [option if isinstance(option, tuple) else (str(option), str(option)) for option in options]
        value = written(getattr(self._begun, name)) or usual
        self._control(Select(title=title, value=value, options=texts, width=width), name)

    def channel_choice(self, name: str, title: str, otherwise: str, width: int = 170) -> None:
        """A list of all channels by their names; `otherwise` is what holds without a choice."""
        names = dict.fromkeys(c.label for _, c in self.opened.keys.values())
        self.choice(name, title, [("", otherwise), *((one, plain(one)) for one in names)], width)

    def number(self, name: str, title: str, width: int = 90, mode: str = "float", usual: str = "") -> None:
        """A setting that is a number."""
        value = getattr(self._begun, name)
        widget = NumericInput(title=title, value=value, mode=mode, width=width, placeholder=usual)
        self._control(widget, name)

    def _control(self, widget: Any, name: str) -> None:
        widget.name = name
        widget.on_change("value", lambda a, old, new: self.change(**{name: new}))
        self.controls.append(widget)
        self._titles[name] = widget.title

    def worded(self, message: str) -> str:
        """A message with the titles of the controls in place of options.

        Examples
        --------
        >>> from specan.inspect.opened import Opened
        >>> from specan.inspect.tabs import OrdersTab
        >>> OrdersTab(Opened(()), View(), print).worded("state the speed of the shaft with --speed HZ")
        "state the speed of the shaft with 'Speed / Hz'"
        """
        titles = {option_of(name): title for name, title in self._titles.items()}

        def title(option: re.Match[str]) -> str:
            return f"'{titles[option[1]]}'" if option[1] in titles else option[0]

        return re.sub(r"(--[a-z-]+)(?: [A-Z]+\b)?(?: \(\w+= in Python\))?", title, message)


# Options that are not called as the setting of the analysis.
_OPTIONS = {"n_exponential": "blocks", "speed_hz": "speed", "pulses_per_turn": "pulses"}


def option_of(name: str) -> str:
    """The option of a verb that is a setting."""
    return f"--{_OPTIONS.get(name, name)}".replace("_", "-")


def text_of(result: RecordingResult) -> bytes:
    """What a command writes to a file."""
    import tempfile

    from specan.io.export_file import write_result

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "numbers.txt"
        write_result(result, path)
        return path.read_bytes()
