"""The waveform above the tabs: any length pans and zooms."""

from __future__ import annotations

from collections.abc import Callable

from bokeh.events import Reset, SelectionGeometry
from bokeh.models import BoxAnnotation, BoxSelectTool

from specan.inspect.look import COLOURS
from specan.inspect.opened import Opened
from specan.inspect.plots import PanelPlot
from specan.inspect.view import View
from specan.report.panels import Curve, Panel
from specan.report.waveform import COLUMNS, Waveform, common_reach
from specan.units import printed_unit


class WaveformView:
    """Figure and kept waveforms.

    Parameters
    ----------
    moved : callable
        Called when other times are visible.
    chosen : callable
        Called with the ends of a new section.
    """

    def __init__(
        self,
        opened: Opened,
        view: View,
        moved: Callable[[], None],
        chosen: Callable[[float, float], None],
    ) -> None:
        self._opened = opened
        self._waveforms: dict[str, Waveform] = {}
        self._end = max(opened.duration_s, 1e-3)
        self.plot = PanelPlot(height=165, tip=("s", "value"))
        self.sheet = self.plot.sheet
        self.sheet.xaxis[0].axis_label = "Time / s"
        select = BoxSelectTool(dimensions="width", description="Choose the time section")
        self.sheet.add_tools(select)
        self.sheet.toolbar.active_drag = select
        self._section = BoxAnnotation(fill_alpha=0.10, fill_color="#0072B2", line_color="#0072B2")
        self.sheet.add_layout(self._section)
        low = 0.0 if view.low is None else view.low
        high = self._end if view.high is None else view.high
        self.sheet.x_range.update(start=low, end=high, reset_start=0.0, reset_end=self._end)
        for end in ("start", "end"):
            self.sheet.x_range.on_change(end, lambda attribute, old, new: moved())

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
                found.append((self._opened.text(number, channel.label), self._waveforms[key]))
        return found

    def curves(self, view: View, start_s: float, stop_s: float) -> Panel:
        """What is to be drawn; reads from the file, so call it beside the page.

        Of many samples the extremes of each column, of few the samples. Channels with different units are drawn as a
        part of the largest magnitude of their unit.
        """
        parts = [
            (name, printed_unit(w.channel.unit), *w.part(start_s, stop_s, COLUMNS))
            for name, w in self.waveforms(view)
        ]
        reach = common_reach((unit, y) for _, unit, _, y in parts)
        scales = reach if len(reach) > 1 else dict.fromkeys(reach, 1.0)
        label = "\n".join(f"{end:.3g} {unit}" for unit, end in reach.items())
        return Panel(
            f"1 = {label}" if len(reach) > 1 else next(iter(reach), ""),
            tuple(Curve(name, x, y / scales[unit]) for name, unit, x, y in parts),
            leads=False,
        )

    def draw(self, shown: Panel) -> None:
        """Exchange the lines."""
        self.plot.draw(shown, {c.name: (k % len(COLOURS), 0) for k, c in enumerate(shown.curves)}, 0.7)

    def show_section(self, view: View) -> None:
        """Mark the time section."""
        self._section.update(left=view.start, right=self._end if view.stop is None else view.stop)
