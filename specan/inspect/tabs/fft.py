"""Magnitude and phase spectra."""

from __future__ import annotations

from typing import Any

import numpy as np

from specan.analysis.spectrum import FourierSpectrum
from specan.data.spectrum import SCALINGS
from specan.dsp.windows import WINDOWS
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import WRAPPED, Curve, Lines
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line
from specan.inspect.view import View
from specan.report.figure_style import micro, with_gaps
from specan.schema import parse

_PHASE_DB = 60.0  # below its highest line a spectrum's phase is not drawn


class FftTab(Tab):
    """Levels of the lines, and their phases over a reference channel."""

    name, title = "fft", "FFT magnitude and phase"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.number(view, "lines", "Lines", mode="int")
        self.choice(view, "window", "Window", WINDOWS, 130)
        self.number(view, "overlap", "Overlap", 70)
        self.choice(view, "scaling", "Scaling", SCALINGS)
        averages = [
            ("linear", "linear"),
            ("exponential", "exponential"),
            ("max", "max hold"),
            ("min", "min hold"),
        ]
        self.choice(view, "spectrum_averaging", "Averaging", averages)
        self.number(view, "blocks", "of blocks", 70, mode="int")
        names = list(dict.fromkeys(c.name for _, c in opened.keys.values()))
        self.choice(
            view, "reference", "Phase over", [("", "choose a channel"), *((n, n) for n in names)], 190
        )
        self.levels = GroupedLines(
            "Frequency / Hz", self.add_figure, hertz=True, tip=("Hz", "dB"), dynamics=100.0
        )
        self.phase = Lines(
            "Frequency / Hz", "Phase / degrees", hertz=True, like=self.levels.first, limits=WRAPPED,
            weight=2, tip=("Hz", "degrees"),
        )  # fmt: skip
        self.add_figure(self.phase)
        self.body = [self.levels.body]

    def compute(self, view: View, tell: Tell) -> Found:
        """Averaged spectra; without a reference an average has no phase."""
        return self.of_each(view, tell, lambda chosen, recording: _settings(view, chosen)(recording))

    def draw(self, found: Found, view: View) -> None:
        """Lines of the levels, and phases where the level is high enough to have one."""
        groups: dict[str, list[Curve]] = {}
        phases: list[Curve] = []
        for number, r in found:
            positive = r.frequency_hz > 0
            f, level = r.frequency_hz[positive], r.level_dB[:, positive]
            phase = r.phase_deg
            for row, name in enumerate(r.channels):
                text = self.opened.text(number, name)
                label = f"Level / {micro(r.scale.level_text(r.units[row]))}"
                groups.setdefault(label, []).append(Curve(text, f, level[row]))
                if phase is not None:
                    strong = level[row] > np.nanmax(level[row], initial=-np.inf) - _PHASE_DB
                    shown = with_gaps(np.where(strong, phase[row][positive], np.nan))
                    phases.append(Curve(text, f, shown))
        self.levels.draw(groups)
        self.phase.draw(phases)
        self.body = [self.levels.body, *([self.phase.sheet] if phases else [])]
        every = [c for curves in groups.values() for c in curves]
        self.levels.span(max(min(c.x[0] for c in every), 1.0), max(c.x[-1] for c in every))
        scale = found[0][1].scale
        over = f" over {view.reference}" if view.reference else ""
        self.phase.label(f"Phase{over} / degrees")
        self.levels.title(
            f"{scale.window}, lines {scale.line_spacing_hz:.4g} Hz apart, noise bandwidth "
            f"{scale.enbw_hz:.4g} Hz, {found[0][1].n_blocks} blocks, {found[0][1].averaging}"
        )

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Value, level and phase of the nearest line."""
        rows = []
        for number, r in found:
            line = nearest_line(r.frequency_hz, frequency)
            for row, name in enumerate(r.channels):
                text = f"{r.values[row, line]:.5g} {r.value_units[row]}, {r.level_dB[row, line]:.2f} "
                text += r.scale.level_text(r.units[row])
                if r.phase_deg is not None:
                    text += f", {round(r.phase_deg[row, line], 2) + 0.0:.2f} degrees"
                rows.append((self.opened.text(number, name), f"{r.frequency_hz[line]:.6g}", text))
        return rows


def _settings(view: View, chosen: Chosen) -> FourierSpectrum:
    content: dict[str, Any] = {
        "channels": chosen.patterns,
        "lines": view.lines if view.lines != View().lines else None,
        "window": view.window,
        "overlap": view.overlap,
        "scaling": view.scaling,
        "averaging": view.spectrum_averaging,
        "n_exponential": view.blocks,
        "start_s": view.start,
        "stop_s": view.stop,
        "reference": view.reference or None,
    }
    return parse(FourierSpectrum, content, "fft")
