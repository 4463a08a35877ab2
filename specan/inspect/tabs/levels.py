"""Levels of the channels: single numbers of the section, and the level against time."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import Div, ScrollBox

from specan.analysis.levels import Levels
from specan.data.recording import Recording
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.level_history import LevelCurves
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Curve
from specan.inspect.sheets import sheet
from specan.inspect.superseded import Superseded
from specan.inspect.tabs.tab import Change, Found, Tab, Tell
from specan.inspect.view import View
from specan.report.figure_style import level_label
from specan.schema import parse
from specan.units import level_reference


class LevelsTab(Tab):
    """RMS and its relatives, and the time-weighted level over the whole recording."""

    name, title = "levels", "Levels"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.choice(view, "level_weighting", "Weighting", ["Z", "A", "B", "C"], 80)
        self.choice(view, "level_averaging", "Time weighting", ["fast", "slow"])
        self.history = GroupedLines("Time / s", tip=("s", "dB"), dynamics=90.0)
        self.numbers = Div(sizing_mode="stretch_width", name="levels")
        below = ScrollBox(
            child=self.numbers, sizing_mode="stretch_both", styles={"flex": "2 1 0", "min-height": "0"}
        )
        self.body = [self.history.body, below]
        self.partly: Any = lambda found, view: None  # the page shows what is known so far
        self._curves: dict[tuple[Any, ...], LevelCurves] = {}

    def compute(self, view: View, tell: Tell) -> Found:
        """Numbers of the section, then the level against time: what the waveform shows first."""

        def analyse(chosen: Chosen, recording: Recording) -> dict[str, Any]:
            content = {
                "channels": chosen.patterns, "start_s": view.start, "stop_s": view.stop,
                "averaging": view.level_averaging, "weighting": view.level_weighting,
            }  # fmt: skip
            found = parse(Levels, content, "levels")(recording)
            return {"numbers": found, "curves": self._of(chosen, view)}

        results = self.of_each(view, tell, analyse)
        low = view.start if view.low is None else view.low
        high = self.opened.duration_s if view.high is None else view.high
        for _, result in results:

            def told(part: float) -> bool:
                self.partly(results, view)
                return tell(part)

            if not result["curves"].fill(low, high, told):
                raise Superseded
        return results

    def _of(self, chosen: Chosen, view: View) -> LevelCurves:
        key = (chosen.number, chosen.patterns, view.level_weighting, view.level_averaging)
        if key not in self._curves:
            if len(self._curves) > 20:
                self._curves.clear()
            self._curves[key] = LevelCurves(
                chosen.recording, chosen.channels, view.level_weighting, view.level_averaging
            )
        return self._curves[key]

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the table."""
        groups: dict[str, list[Curve]] = {}
        rows = []
        for number, result in found:
            history, r = result["curves"], result["numbers"]
            for row, channel in enumerate(history.channels):
                name = self.opened.text(number, channel.name)
                label = level_label(level_reference(channel.unit).text)
                groups.setdefault(label, []).append(Curve(name, history.times, history.levels[row]))
                rows.append([
                    name, r.units[row], f"{r.rms[row]:.5g}", _decibels(r.level_dB[row]), r.references[row].text,
                    f"{r.peak[row]:.5g}", _decibels(r.crest_factor[row]), f"{r.mean[row]:.4g}",
                    _decibels(r.equivalent_dB["A"][row]), _decibels(r.max_dB[row]), _decibels(r.min_dB[row]),
                    *(_decibels(v[row]) for v in r.percentile_dB.values()), " ".join(r.flags[row]),
                ])  # fmt: skip
        self.history.draw(groups)
        self.history.span(0.0, max(self.opened.duration_s, 1e-3))
        first = found[0][1]["numbers"]
        percent = [f"L{n:g}" for n in first.percentile_dB]
        header = ["Channel", "unit", "RMS", "level dB", "re", "peak", "crest", "mean", "Leq A", "max", "min"]
        self.numbers.text = sheet([*header, *percent, ""], rows) + (
            f"<p>Section {first.start_s:g} s to {first.start_s + first.duration_s:g} s; max, min and percentiles of "
            f"the level with {first.averaging} time weighting.</p>"
        )


def _decibels(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else ""
