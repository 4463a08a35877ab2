"""Spectrum against time of one channel."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import HoverTool, Range1d

from specan.analysis.spectrogram import SpectrogramSettings
from specan.data.recording import Recording
from specan.data.spectrum import Spectrogram
from specan.dsp.windows import WINDOWS
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import HarmonicCursor, HeatMap, hertz_axis, plain
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line
from specan.inspect.view import View
from specan.report.figure_style import micro
from specan.schema import parse

_ROWS, _COLUMNS = 220, 500  # of the picture
_DYNAMICS_DB = 80.0


class SpectrogramTab(Tab):
    """Level against time and frequency."""

    name, title = "spectrogram", "Spectrogram"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        keys = [(key, plain(opened.text(n, c.name))) for key, (n, c) in opened.keys.items()]
        self.choice(view, "of", "Channel", [("", "the first on screen"), *keys], 220)
        self.number(view, "lines", "Lines", mode="int")
        self.choice(view, "window", "Window", WINDOWS, 130)
        self.number(view, "overlap", "Overlap", 70)
        self.map = HeatMap(
            1, _DYNAMICS_DB, "spectrogram", x_range=Range1d(0, 1), y_range=Range1d(20, 20000), y_axis_type="log",
            x_axis_label="Time / s", y_axis_label="Frequency / Hz",
        )  # fmt: skip
        self.sheet = self.map.sheet
        hertz_axis(self.sheet, self.sheet.yaxis[0])
        tips = [("s", "$x{0.000}"), ("Hz", "$y{0.0}")]
        self.sheet.add_tools(HoverTool(renderers=[self.map.picture], tooltips=tips))
        self._cursor = HarmonicCursor(self.sheet, "width", "#ffffff")
        self.add_figure(self)
        self.body = [self.sheet]

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Lines across the picture."""
        self._cursor.show(frequency, harmonics)

    def frequency_at(self, event: Any) -> float:
        """Of a click: frequency runs upwards."""
        return float(event.y)

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Lowest and highest level of the nearest line over time."""
        number, r = found[0]
        line = nearest_line(r.frequency_hz, frequency)
        level = r.level_dB[0][:, line]
        known = level[np.isfinite(level)]
        text = (
            f"{known.min():.2f} to {known.max():.2f} {r.scale.level_text(r.units[0])} over time"
            if known.size
            else "no signal"
        )
        return [(self.opened.text(number, r.channels[0]), f"{r.frequency_hz[line]:.6g}", text)]

    def compute(self, view: View, tell: Tell) -> Found:
        """Of one channel only."""

        def analyse(chosen: Chosen, recording: Recording) -> Spectrogram:
            content = {
                "channels": chosen.patterns,
                "lines": view.lines if view.lines != View().lines else None,
                "window": view.window,
                "overlap": view.overlap,
                "start_s": view.start,
                "stop_s": view.stop,
                "columns": _COLUMNS,
            }
            return parse(SpectrogramSettings, content, "spectrogram")(recording)

        wanted = (view.of,) if view.of in self.opened.keys else view.channel[:1]
        return self.of_each(view.but(channel=wanted), tell, analyse)

    def draw(self, found: Found, view: View) -> None:
        """The picture, its rows at even ratios of frequency."""
        number, r = found[0]
        positive = r.frequency_hz > 0
        f = r.frequency_hz[positive]
        level = r.level_dB[0][:, positive].T
        step = r.time_s[1] - r.time_s[0] if len(r.time_s) > 1 else 1.0
        left, right = float(r.time_s[0] - step / 2), float(r.time_s[-1] + step / 2)
        low = max(float(f[0]), 10.0 if f[-1] > 100 else float(f[0]))
        rows = np.geomspace(low, f[-1], _ROWS)
        picture = level[np.clip(np.searchsorted(f, rows), 0, f.size - 1)]
        # An image lies evenly on the screen, and the axis is logarithmic: the rows are as well.
        self.map.draw(
            picture, (left, right), (low, float(f[-1])), micro(r.scale.level_text(r.units[0])),
            f"{self.opened.text(number, r.channels[0])}: lines {r.scale.line_spacing_hz:.4g} Hz apart, "
            f"blocks a column: {r.blocks_per_column}, {r.scale.level_text(r.units[0])}",
        )  # fmt: skip
        self.sheet.x_range.update(start=left, end=right, reset_start=left, reset_end=right)
