"""The waveform above the tabs: pans and zooms over any length, and takes the time section from the mouse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.events import Reset, SelectionGeometry
from bokeh.models import BoxAnnotation, BoxSelectTool

from specan.data.channel import Channel
from specan.inspect.envelope import Waveform
from specan.inspect.opened import Opened
from specan.inspect.plots import Band, Curve, Lines
from specan.inspect.view import View

COLUMNS = 1500  # of the screen


class WaveformView:
    """Figure and kept waveforms.

    Parameters
    ----------
    moved : callable
        Called with the new visible times.
    chosen : callable
        Called with the ends of a new section.
    """

    def __init__(
        self,
        opened: Opened,
        view: View,
        moved: Callable[[float, float], None],
        chosen: Callable[[float, float], None],
    ) -> None:
        self._opened = opened
        self._waveforms: dict[str, Waveform] = {}
        self._reach: dict[str, float] = {}
        self._end = max(opened.duration_s, 1e-3)
        self.lines = Lines(
            "Time / s", "", height=150, legend=False, coloured=True, shades="envelopes", tip=("s", "value")
        )
        self.sheet = self.lines.sheet
        select = BoxSelectTool(dimensions="width", description="Choose the time section")
        self.sheet.add_tools(select)
        self.sheet.toolbar.active_drag = select
        self._section = BoxAnnotation(fill_alpha=0.10, fill_color="#0072B2", line_color="#0072B2")
        self.sheet.add_layout(self._section)
        low = 0.0 if view.low is None else view.low
        high = self._end if view.high is None else view.high
        self.sheet.x_range.update(start=low, end=high, reset_start=0.0, reset_end=self._end)

        def ranged(attribute: str, old: Any, new: Any) -> None:
            moved(float(self.sheet.x_range.start), float(self.sheet.x_range.end))

        self.sheet.x_range.on_change("start", ranged)
        self.sheet.x_range.on_change("end", ranged)

        def taken(event: SelectionGeometry) -> None:
            if event.final and event.geometry.get("type") == "rect":
                ends = sorted((event.geometry["x0"], event.geometry["x1"]))
                chosen(max(ends[0], 0.0), min(ends[1], self._end))

        self.sheet.on_event(SelectionGeometry, taken)
        self.sheet.on_event(Reset, lambda event: chosen(0.0, self._end))

    @property
    def visible(self) -> tuple[float, float]:
        """Times on screen."""
        return float(self.sheet.x_range.start), float(self.sheet.x_range.end)

    def waveforms(self, view: View) -> list[tuple[str, Waveform]]:
        """Names and waveforms of the channels on screen."""
        found = []
        known = self._opened.keys
        for key in view.channel:
            if key in known:
                number, channel = known[key]
                if key not in self._waveforms:
                    self._waveforms[key] = Waveform(self._opened.recordings[number], channel)
                found.append((self._text(number, channel), self._waveforms[key]))
        return found

    def curves(self, view: View, start_s: float, stop_s: float) -> list[Curve | Band]:
        """What is to be drawn; reads from the file, so call it beside the page.

        Of many samples the envelope of each channel, of few the samples. Channels with different units are drawn as a
        part of the largest magnitude of their unit.
        """
        parts = [
            (name, w.channel.unit, *w.part(start_s, stop_s, COLUMNS)) for name, w in self.waveforms(view)
        ]
        self._reach = {}
        for _, unit, _, y in parts:
            self._reach[unit] = max(self._reach.get(unit, 0.0), float(np.nanmax(np.abs(y), initial=0.0)))
        found: list[Curve | Band] = []
        for hue, (name, unit, x, y) in enumerate(parts):
            scaled = y / (self._reach[unit] or 1.0) if len(self._reach) > 1 else y
            if x.size > 1 and x[0] == x[1]:  # lowest and highest of each column
                low, high = np.minimum(scaled[::2], scaled[1::2]), np.maximum(scaled[::2], scaled[1::2])
                found.append(Band(x[::2], low, high, hue, 0.3))
                found += [Curve(name, x[::2], end, hue, 0, 0.7) for end in (low, high)]
            else:
                found.append(Curve(name, x, scaled, hue, 0, 0.8))
        return found

    def draw(self, drawn: list[Curve | Band], view: View) -> None:
        """Exchange the lines."""
        self.lines.draw([d for d in drawn if isinstance(d, Curve)], [d for d in drawn if isinstance(d, Band)])
        if len(self._reach) > 1:
            self.lines.label("1 = " + "\n".join(f"{end:.3g} {unit}" for unit, end in self._reach.items()))
        else:
            self.lines.label(next(iter(self._reach), ""))

    def show_section(self, view: View) -> None:
        """Mark the time section."""
        self._section.update(left=view.start, right=self._end if view.stop is None else view.stop)

    def _text(self, number: int, channel: Channel) -> str:
        return self._opened.text(number, channel.name)
