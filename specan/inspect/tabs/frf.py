"""Transfer functions: magnitude, phase, coherence strip."""

from __future__ import annotations

from typing import Any

import numpy as np

from specan.analysis.transfer_function import TransferFunction
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.errors import InputError
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Curve, Lines
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line, run
from specan.inspect.view import View
from specan.report.figure_style import with_gaps
from specan.report.figures_spectra import figure_frequency_response
from specan.schema import parse


class FrfTab(Tab):
    """Responses on screen over a reference."""

    name, title = "frf", "Transfer function"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        names = list(dict.fromkeys(c.name for _, c in opened.keys.values()))
        self.choice(view, "over", "Reference", [("", "the vibrometer"), *((n, n) for n in names)], 170)
        self.choice(view, "estimator", "Estimator", ["H1", "H2", "Hv", "H3c"], 90)
        self.choice(view, "unwrapped", "Phase", [("False", "-180 to 180"), ("True", "unwrapped")], 120)
        self.number(view, "lines", "Lines", mode="int")
        self.magnitude = Lines("", "Magnitude / dB", hertz=True, tip=("Hz", "dB"), dynamics=100.0, height=260)
        self.phase = Lines(
            "", "Phase / degrees", hertz=True, like=self.magnitude, height=190, tip=("Hz", "degrees")
        )
        self.coherence = Lines(
            "Frequency / Hz", "Coherence", hertz=True, like=self.magnitude, limits=(0, 1.05), height=130,
            tip=("Hz", "coherence"),
        )  # fmt: skip
        self.figures = [self.magnitude, self.phase, self.coherence]
        self.body = [f.sheet for f in self.figures]

    def compute(self, view: View, tell: Tell) -> Found:
        """Transfer functions of the channels on screen, the reference left out."""

        def analyse(chosen: Chosen, recording: Recording) -> FrequencyResponse:
            settings = parse(
                TransferFunction,
                {
                    "reference": view.over or None,
                    "channels": chosen.patterns,
                    "estimator": view.estimator,
                    "lines": _lines(view, chosen),
                    "window": view.window,
                    "start_s": view.start,
                    "stop_s": view.stop,
                },
                "frf",
            )
            return run(settings.accumulator(recording), recording, tell)

        return self.of_each(view, analyse, "a response")

    def draw(self, found: Found, view: View) -> None:
        """Three strips over one axis."""
        magnitude, phase, coherence = [], [], []
        for number, r in found:
            turned = r.unwrapped_phase_deg if view.unwrapped else r.phase_deg
            for row, name in enumerate(r.channels):
                text = self.opened.text(number, name)
                magnitude.append(Curve(text, r.frequency_hz, r.level_db[row]))
                one = turned[row] if view.unwrapped else with_gaps(turned[row])
                phase.append(Curve(text, r.frequency_hz, one))
                coherence.append(Curve(text, r.frequency_hz, r.coherence[row]))
        for figure, curves in zip(self.figures, (magnitude, phase, coherence)):
            figure.draw(curves)
        self.magnitude.span(min(c.x[0] for c in magnitude), max(c.x[-1] for c in magnitude))
        units = dict.fromkeys(unit for _, r in found for unit in r.units)
        self.magnitude.label("Magnitude / dB re 1 " + ", ".join(units))
        first = found[0][1]
        self.magnitude.sheet.title.text = (
            f"{first.estimator} over {first.reference} ({first.reference_rms:.4g} {first.reference_unit} RMS), "
            f"{first.n_blocks} blocks"
        )

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Magnitude, phase, coherence of the nearest line."""
        rows = []
        for number, r in found:
            line = nearest_line(r.frequency_hz, frequency)
            for row, name in enumerate(r.channels):
                text = (
                    f"{r.magnitude[row, line]:.5g} {r.units[row]} ({r.level_db[row, line]:.2f} dB), "
                    f"{r.phase_deg[row, line]:.2f} degrees, coherence {r.coherence[row, line]:.4f}"
                )
                rows.append((self.opened.text(number, name), f"{r.frequency_hz[line]:.6g}", text))
        return rows

    def picture(self, result: Any) -> Any:
        """As the command draws it."""
        return figure_frequency_response(result)


def _lines(view: View, chosen: Chosen) -> int:
    """Those asked for, or fewer where the section is short and nobody asked."""
    stop = min(chosen.channels[0].duration_s, view.stop or np.inf)
    possible = int((stop - view.start) * chosen.channels[0].sampling_rate / 2.56) - 1
    if possible < 8:
        raise InputError("the section is too short for a transfer function", remedy="choose a longer one")
    return view.lines if view.lines != View().lines else min(view.lines, possible)
