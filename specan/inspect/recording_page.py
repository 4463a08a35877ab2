"""The page of one recording: channels on the left, waveform above, tabs below."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bokeh.layouts import column, row
from bokeh.models import Button, Checkbox, Div, MultiSelect, NumericInput, RadioButtonGroup

from specan.errors import RequestError, SpecanError
from specan.inspect.browser_link import BrowserLink
from specan.inspect.envelope import read_overviews
from specan.inspect.kept_bands import KeptBands
from specan.inspect.opened import Opened
from specan.inspect.plots import Curve, plain
from specan.inspect.sheets import notice, sheet
from specan.inspect.superseded import Tell
from specan.inspect.tabs.fft import FftTab
from specan.inspect.tabs.frf import FrfTab
from specan.inspect.tabs.info import InfoTab
from specan.inspect.tabs.levels import LevelsTab
from specan.inspect.tabs.octave import OctaveTab
from specan.inspect.tabs.spectrogram import SpectrogramTab
from specan.inspect.tabs.tab import Found, Tab, text_of
from specan.inspect.view import View
from specan.inspect.waveform_view import WaveformView
from specan.inspect.work import Work

if TYPE_CHECKING:
    from bokeh.document import Document

Write = Callable[[Any, Path], None]
FIRST_CHANNELS = 4  # on screen when nothing else is said
_SETTLE_MS = 60  # a pan sends many ranges; one drawing answers them


class RecordingPage:
    """Everything on the page of one browser window.

    Parameters
    ----------
    document : Document
    opened : Opened
    kept : KeptBands
        Shared by all windows.
    writers : mapping of str to callable
        For each tab, how its command writes its numbers to a file.
    """

    def __init__(
        self, document: Document, opened: Opened, kept: KeptBands, writers: Mapping[str, Write]
    ) -> None:
        self.document, self.opened, self.writers = document, opened, writers
        self.link = BrowserLink()
        self.status = Div(text="", name="status", height=20)
        self.readout = Div(text="", name="readout", sizing_mode="stretch_width")
        self.refused = ""
        self.view = self._first_view()
        self.work = Work(document, self._told, self._failed)
        self.drawing = Work(document, self._told, self._failed)
        view = self.view
        self.tabs: dict[str, Tab] = {
            tab.name: tab
            for tab in (
                OctaveTab(opened, view, self.change, kept), FftTab(opened, view, self.change),
                FrfTab(opened, view, self.change), LevelsTab(opened, view, self.change),
                SpectrogramTab(opened, view, self.change), InfoTab(opened, view, self.change),
            )
        }  # fmt: skip
        levels = self.tabs["levels"]
        assert isinstance(levels, LevelsTab)
        levels.partly = lambda found, view: self.work.later(lambda: levels.draw(found, view))
        self.found: Found = []
        self.waveform = WaveformView(opened, view, self._moved, self._chosen)
        self._moving = False
        self._lay_out()
        document.on_session_destroyed(self._closed)
        self._refresh_waveform()
        self._refresh()

    def _closed(self, context: Any) -> None:
        self.work.close()
        self.drawing.close()

    # --- what is on the page ----------------------------------------------------------------------

    def _first_view(self) -> View:
        context = self.document.session_context
        arguments = context.request.arguments if context is not None and context.request else {}
        try:
            view = View.from_arguments(arguments)
        except RequestError as fault:
            # Stands until something else is chosen.
            self.refused, view = str(fault), View()
        known = list(self.opened.keys)
        shown = [key for key in view.channel if key in known]
        if not shown:
            first = [k for k in known if not k.startswith("2:")][:FIRST_CHANNELS]
            second = [f"2:{k}" for k in first if f"2:{k}" in known]
            shown = [*first, *second]
        return view.but(channel=tuple(shown))

    def _lay_out(self) -> None:
        view = self.view
        keys = self.opened.keys
        texts = [(key, plain(self.opened.text(n, f"{c.name}  [{c.unit}]"))) for key, (n, c) in keys.items()]
        self._channels = MultiSelect(
            title="Channels (Ctrl, Shift: several)", options=texts, value=list(view.channel),
            size=min(max(len(texts), 4), 28), width=210, name="channels",
        )  # fmt: skip
        self._channels.on_change("value", lambda a, old, new: self.change(channel=tuple(new)))
        self._start = NumericInput(
            title="Section from / s", value=view.start, mode="float", width=100, name="start"
        )
        self._stop = NumericInput(title="to / s", value=view.stop, mode="float", width=100, name="stop")
        self._start.on_change("value", lambda a, old, new: self.change(start=new or 0.0))
        self._stop.on_change("value", lambda a, old, new: self.change(stop=new))
        self._cursor = NumericInput(
            title="Cursor / Hz", value=view.cursor, mode="float", width=100, name="cursor"
        )
        self._cursor.on_change("value", lambda a, old, new: self.change(cursor=new))
        harmonics = Checkbox(label="harmonics", active=view.harmonics, name="harmonics")
        harmonics.on_change("active", lambda a, old, new: self.change(harmonics=new))
        for tab in self.tabs.values():
            for figure in tab.figures:
                figure.sheet.on_event("tap", lambda event, of=figure.frequency_at: self._tapped(of(event)))
        # Only the tab in front is in the document: figures without a size cost the browser dearly.
        self._front = RadioButtonGroup(
            labels=[tab.title for tab in self.tabs.values()],
            active=list(self.tabs).index(view.tab),
            name="tabs",
        )
        self._front.on_change("active", lambda a, old, new: self.change(tab=list(self.tabs)[new]))
        self._body = column(*self._of_tab(), sizing_mode="stretch_width")
        buttons = []
        for text, kind in (("Save numbers", "txt"), ("Save PNG", "png"), ("Save SVG", "svg")):
            button = Button(label=text, width=100, name=f"save-{kind}")
            button.on_click(lambda kind=kind: self._save(kind))
            buttons.append(button)
        title = " with ".join(r.label for r in self.opened.recordings)
        left = column(
            Div(text=f"<b>{notice(title)}</b>", width=210, styles={"overflow-wrap": "anywhere"}),
            self._channels, row(self._start, self._stop), row(self._cursor), harmonics, *buttons, width=220,
        )  # fmt: skip
        right = column(
            self.waveform.sheet,
            self._front,
            self.status,
            self._body,
            self.readout,
            sizing_mode="stretch_width",
        )
        self.document.add_root(column(row(left, right, sizing_mode="stretch_width"), *self.link.widgets,
                                      sizing_mode="stretch_width"))  # fmt: skip
        self.document.title = f"{title} - specan"

    def _of_tab(self) -> list[Any]:
        tab = self.tabs[self.view.tab]
        return [row(*tab.controls), *tab.body] if tab.controls else list(tab.body)

    # --- what a person does -----------------------------------------------------------------------

    def change(self, **changes: Any) -> None:
        """Other settings: address, waveform, results follow."""
        try:
            view = self.view.but(**changes)
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
            self.tabs[view.tab].settings_of(view)
            self._body.children = self._of_tab()
        self.waveform.show_section(view)
        self._start.value, self._stop.value, self._cursor.value = view.start, view.stop, view.cursor
        beside = {"cursor", "harmonics", "low", "high"}
        if view.model_dump(exclude=beside) == old.model_dump(exclude=beside):
            self._show_cursor()
        else:
            self._refresh()

    def _tapped(self, frequency: float) -> None:
        self.change(cursor=float(f"{frequency:.6g}"))

    def _chosen(self, start_s: float, stop_s: float) -> None:
        whole = start_s <= 0.0 and stop_s >= self.opened.duration_s
        self.change(start=0.0 if whole else round(start_s, 6), stop=None if whole else round(stop_s, 6))

    def _moved(self, low: float, high: float) -> None:
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

        def show(curves: list[Curve]) -> None:
            self.waveform.draw(curves, view)

        def compute(tell: Tell) -> list[Curve]:
            waiting = [w for _, w in self.waveform.waveforms(view) if w.needs_overview(*visible)]
            if waiting:

                def told(part: float) -> bool:
                    partly = self.waveform.curves(view, *visible)
                    self.drawing.later(lambda: show(partly))
                    return tell(part)

                read_overviews(waiting, _now_and_then(tell, told))
            return self.waveform.curves(view, *visible)

        self.waveform.show_section(view)
        self.drawing.ask(compute, show)

    def _refresh(self) -> None:
        view, tab = self.view, self.tabs[self.view.tab]

        def show(found: Found) -> None:
            self.found = found
            self.status.text = notice(self.refused, "error") if self.refused else _notes(found)
            tab.draw(found, view)
            self._show_cursor()

        self.work.ask(lambda tell: tab.compute(view, tell), show)

    def _show_cursor(self) -> None:
        view, tab = self.view, self.tabs[self.view.tab]
        for figure in tab.figures:
            figure.cursor(view.cursor, view.harmonics)
        rows = []
        if view.cursor is not None and self.found:
            count = 10 if view.harmonics else 1
            rows = [r for k in range(1, count + 1) for r in tab.at(self.found, k * view.cursor)]
        self.readout.text = sheet(["At the cursor", "Hz", ""], rows) if rows else ""

    def _told(self, part: float) -> None:
        self.status.text = notice(f"Reading: {100 * part:.0f} %", "busy")

    def _failed(self, message: str) -> None:
        self.status.text = notice(message, "error")

    def _save(self, kind: str) -> None:
        tab, view = self.tabs[self.view.tab], self.view
        if not self.found:
            self._failed("There is nothing to save on this tab.")
            return
        for number, found in self.found:
            result = found["numbers"] if isinstance(found, dict) else found
            stem = Path(self.opened.recordings[number].label).stem
            try:
                content = self._content(tab, kind, result)
            except SpecanError as fault:
                self._failed(str(fault))
                return
            self.link.save(f"{stem}_{view.tab}.{kind}", content)

    def _content(self, tab: Tab, kind: str, result: Any) -> bytes:
        if kind == "txt":
            if tab.name not in self.writers:
                raise RequestError(f"there are no numbers of {tab.title} to save")
            return text_of(self.writers[tab.name], result)
        figure = tab.picture(result)
        if figure is None:
            raise RequestError(
                f"{tab.title} is saved as a picture with the tool beside the figure, as PNG",
                remedy="press the disk there",
            )
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, dpi=150)
        return stream.getvalue()


def _notes(found: Found) -> str:
    results = [r["numbers"] if isinstance(r, dict) else r for _, r in found]
    notes = dict.fromkeys(note for r in results for note in getattr(r, "notes", ()))
    warned = [
        f"{name}: {', '.join(words)}"
        for r in results
        for name, words in zip(r.channels, getattr(r, "flags", ()))
        if words
    ]
    return notice("; ".join([*notes, *warned]), "error" if warned else "")


def _now_and_then(tell: Tell, told: Callable[[float], bool], every: int = 8) -> Tell:
    """Every so many pieces the picture as far as it is known, else the progress alone."""
    count = 0

    def both(part: float) -> bool:
        nonlocal count
        count += 1
        return told(part) if count % every == 0 else tell(part)

    return both
