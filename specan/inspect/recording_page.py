"""The page of one recording: channels on the left, waveform above, tabs below."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import (
    Checkbox,
    CustomJS,
    Div,
    MultiSelect,
    NumericInput,
    RadioButtonGroup,
    ScrollBox,
    TextInput,
)

from specan.data.calibration import stated
from specan.errors import RequestError, SpecanError
from specan.inspect.look import GROWS, PANEL, notice
from specan.inspect.opened import Opened
from specan.inspect.page import Page
from specan.inspect.plots import plain
from specan.inspect.tab import Found, Tab, text_of
from specan.inspect.tabs import TABS
from specan.inspect.view import View
from specan.inspect.waveform_view import WaveformView
from specan.inspect.work import Tell
from specan.report.figure_style import image
from specan.report.figures import figure_of
from specan.report.html_page import table
from specan.report.panels import Panel
from specan.report.waveform import read_overviews
from specan.result import first_of, gathered
from specan.units import printed_unit

FIRST_CHANNELS = 4  # on screen when nothing else is said
_LEFT, _RIGHT = 214, 270  # px
_FILTER = """const text = cb_obj.value_input.toLowerCase();
list.options = all.filter(([key, label]) => label.toLowerCase().includes(text));"""
_SETTLE_MS = 60  # a pan sends many ranges; one drawing answers them


class RecordingPage(Page):
    """Everything on the page of one recording, or of two.

    Parameters
    ----------
    document : Document
    opened : Opened
    """

    kind, saves = "recording", ("txt", "png", "svg")

    def __init__(self, document: Document, opened: Opened) -> None:
        super().__init__(
            document, " with ".join(r.label for r in opened.recordings), View, styles={"min-height": "20px"}
        )
        self.opened = opened
        self.readout = Div(text="", name="readout", sizing_mode="stretch_width")
        self.drawing = self.worker(self._failed)
        self.view = view = self._with_channels(self.view)
        self.tabs: dict[str, Tab] = {kind.name: kind(opened, view, self.change) for kind in TABS}
        self._settings: dict[str, Mapping[str, Any]] = {}  # of each tab that was in front
        self.found: Found = []
        self.waveform = WaveformView(opened, view, self._moved, self._chosen)
        self._moving = False
        self._lay_out()
        self._refresh_waveform()
        self._refresh()

    # --- what is on the page ----------------------------------------------------------------------

    def _with_channels(self, view: View) -> View:
        """The first channels where the address names none."""
        known = list(self.opened.keys)
        shown = [key for key in view.channel if key in known]
        if not shown:
            first = [k for k in known if not k.startswith("2:")][:FIRST_CHANNELS]
            second = [f"2:{k}" for k in first if f"2:{k}" in known]
            shown = [*first, *second]
        return view.but(channel=tuple(shown))

    def _lay_out(self) -> None:
        view = self.view
        # Only the tab in front is in the document: figures without a size cost the browser dearly.
        self._front = RadioButtonGroup(
            labels=[tab.title for tab in self.tabs.values()],
            active=list(self.tabs).index(view.tab),
            name="tabs",
            css_classes=["tabs"],
        )
        self._front.on_change("active", lambda a, old, new: self.change(tab=list(self.tabs)[new]))
        self._controls = row(
            *self.tabs[view.tab].controls, styles={"flex-wrap": "wrap"}, sizing_mode="stretch_width"
        )
        self._body = column(sizing_mode="stretch_both", styles=GROWS, css_classes=["front"])
        self._side = column(self.readout, sizing_mode="stretch_width")
        middle = column(
            self.waveform.sheet, self._front, self._controls, self.status.div, self._body,
            sizing_mode="stretch_both", styles=GROWS, css_classes=["whole", "middle"],
        )  # fmt: skip
        self._right = ScrollBox(
            child=self._side, width=_RIGHT, sizing_mode="stretch_height", styles=PANEL,
            css_classes=["whole"],
        )  # fmt: skip
        main = row(
            self._left(), middle, self._right, sizing_mode="stretch_both", styles={**GROWS, "gap": "8px"},
            css_classes=["stacked"],
        )  # fmt: skip
        self.show_page(main, height="100vh")
        for tab in self.tabs.values():
            for part in (*tab.controls, *tab.body, *tab.side):
                self.dressed(part)

    def _left(self) -> Any:
        view, keys = self.view, self.opened.keys
        texts = [
            (key, plain(self.opened.text(n, f"{c.label}  [{printed_unit(c.unit)}]".removesuffix("  []"))))
            for key, (n, c) in keys.items()
        ]
        self._channels = MultiSelect(
            title="Channels (Ctrl, Shift: several)", options=texts, value=list(view.channel),
            size=min(max(len(texts), 4), 28), width=_LEFT - 24, name="channels", sizing_mode="stretch_height",
            stylesheets=["select[multiple].bk-input { height: 100% !important; }"],
        )  # fmt: skip
        search = TextInput(title="Filter channels", width=_LEFT - 24, name="filter")
        search.js_on_change(
            "value_input", CustomJS(args={"list": self._channels, "all": texts}, code=_FILTER)
        )
        self._channels.on_change("value", lambda a, old, new: self.change(channel=tuple(new)))
        titles = {"start": "Section from / s", "stop": "to / s", "cursor": "Cursor / Hz"}
        self._numbers_of = {
            name: NumericInput(title=title, value=getattr(view, name), mode="float", width=90, name=name)
            for name, title in titles.items()
        }
        for name, widget in self._numbers_of.items():
            widget.on_change("value", lambda a, old, new, name=name: self.change(**{name: new}))
        start, stop, cursor = self._numbers_of.values()
        harmonics = Checkbox(label="harmonics", active=view.harmonics, name="harmonics", margin=(20, 0, 0, 4))
        harmonics.on_change("active", lambda a, old, new: self.change(harmonics=new))
        return column(
            search, self._channels, row(start, stop), row(cursor, harmonics),
            Div(text=notice(f"Calibration: {self.opened.calibration}"), width=_LEFT - 24, name="calibration"),
            width=_LEFT, sizing_mode="stretch_height", styles=PANEL, css_classes=["whole", "channels"],
        )  # fmt: skip

    def _show_tab(self) -> None:
        """Put the figures of the tab in front into the page; they have something to show now."""
        tab = self.tabs[self.view.tab]
        if self._body.children != tab.body:
            self._body.children = list(tab.body)
        self._right.visible = bool(tab.side or tab.figures)
        side = [self.readout, *tab.side]
        if self._side.children != side:
            self._side.children = side

    def _wait(self) -> None:
        """Without figures, which have nothing to show yet."""
        self._controls.children = list(self.tabs[self.view.tab].controls)
        self._body.children, self._side.children = [], [self.readout]

    # --- what a person does -----------------------------------------------------------------------

    def change(self, **changes: Any) -> None:
        """Other settings: address, waveform, results follow."""
        self._settings[self.view.tab] = self.view.settings
        try:
            view = self.view.but(**{**self._settings.get(changes.get("tab", ""), {}), **changes})
        except SpecanError as fault:
            self._failed(str(fault))
            return
        if view == self.view:
            return
        old, self.view, self.refused = self.view, view, ""
        self.link.address(view.query)
        if view.channel != old.channel:
            self._refresh_waveform()
        if view.tab != old.tab:
            self.found = []
            self.readout.text = ""
            self._wait()
        self.waveform.show_section(view)
        for name, widget in self._numbers_of.items():
            widget.value = getattr(view, name)
        beside = {"cursor", "harmonics", "low", "high"}
        if view.model_dump(exclude=beside) == old.model_dump(exclude=beside):
            self._show_cursor()
        else:
            self._refresh()

    def _chosen(self, start_s: float, stop_s: float) -> None:
        whole = start_s <= 0.0 and stop_s >= self.opened.duration_s
        self.change(start=0.0 if whole else round(start_s, 6), stop=None if whole else round(stop_s, 6))

    def _moved(self) -> None:
        if self._moving:
            return
        self._moving = True

        def settled() -> None:
            self._moving = False
            low, high = self.waveform.visible
            self.change(low=float(f"{low:.8g}"), high=float(f"{high:.8g}"))
            self._refresh_waveform()

        self.document.add_timeout_callback(settled, _SETTLE_MS)

    # --- work -------------------------------------------------------------------------------------

    def _refresh_waveform(self) -> None:
        view, visible = self.view, self.waveform.visible

        def compute(tell: Tell) -> Panel:
            waiting = [w for _, w in self.waveform.waveforms(view) if w.needs_overview(*visible)]
            read_overviews(waiting, tell)
            return self.waveform.curves(view, *visible)

        self.waveform.show_section(view)
        self.drawing.ask(compute, self.waveform.draw)

    def _refresh(self) -> None:
        view, tab = self.view, self.tabs[self.view.tab]

        def show(found: Found) -> None:
            self.found = found
            said, kind = (self.refused, "error") if self.refused else _notes(found)
            self.status.end(tab.worded(said), kind)
            if found:
                tab.draw(found, view)
            self._show_tab()
            self._show_cursor()

        self.status.begin(f"{tab.title}: computing")
        self.work.ask(lambda tell: tab.compute(view, tell), show)

    def _show_cursor(self) -> None:
        view, tab = self.view, self.tabs[self.view.tab]
        for figure in tab.figures:
            figure.cursor(view.cursor, view.harmonics)
        rows = []
        if view.cursor is not None and self.found and tab.figures:
            count = 10 if view.harmonics else 1
            rows = [r for k in range(1, count + 1) for r in tab.at(self.found, k * view.cursor)]
        hint = notice("Click into a figure: the values at that frequency are shown here.")
        self.readout.text = table(["Cursor", "Hz", ""], rows) if rows else hint if tab.figures else ""

    def _told(self, part: float) -> None:
        self.status.go_on(f"{self.tabs[self.view.tab].title}: reading, {100 * part:.0f} %")

    def _failed(self, message: str) -> None:
        super()._failed(self.tabs[self.view.tab].worded(message))

    def _save(self, kind: str) -> None:
        for number, content in self._contents(kind):
            self.link.save(
                f"{Path(self.opened.recordings[number].label).stem}_{self.view.tab}.{kind}", content
            )

    def _numbers(self) -> str:
        return "\n".join(content.decode() for _, content in self._contents("txt"))

    def _command(self) -> str:
        return "\n".join(self.tabs[self.view.tab].commands(self.view))

    def _contents(self, kind: str) -> list[tuple[int, bytes]]:
        """Numbers or figure of each result on the tab, as its verb gives them."""
        tab = self.tabs[self.view.tab]
        if not self.found:
            raise RequestError("there is nothing to save on this tab", remedy="choose another tab")
        contents = []
        for number, found in self.found:
            result = stated(found, self.opened.recordings[number])
            drawn = kind != "txt"
            content = image(figure_of(result, tab.figure_view), kind) if drawn else text_of(result)
            contents.append((number, content))
        return contents


def _notes(found: Found) -> tuple[str, str]:
    results: list[Any] = [r for _, r in found]
    notes = dict.fromkeys(note for r in results for note in getattr(r, "notes", ()))
    flags = gathered((", ".join(f), name) for r in results for name, f in zip(r.channels, r.flags) if f)
    warned = [f"{first_of(names, 4)}: {words}" for words, names in flags.items()]
    return "; ".join([*notes, *warned]), "error" if warned else ""
