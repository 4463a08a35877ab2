"""Levels of the channels: in bands, single numbers of the section, and against time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from bokeh.models import Div, ScrollBox

from specan.analysis.octave import READINGS_PER_TIME_CONSTANT, Octave
from specan.data.band_levels import BandLevels
from specan.data.levels import SignalLevels
from specan.data.recording import Recording
from specan.divisions import DIVISIONS
from specan.dsp.weighting import FAST, SLOW
from specan.inspect.look import share
from specan.inspect.opened import Chosen
from specan.inspect.tabs.tab import Found, Tab
from specan.inspect.view import View, written
from specan.report.figure_style import micro
from specan.report.figures_bands import band_panels, history_panels
from specan.report.html_page import table
from specan.report.panels import Drawing
from specan.result import cell

_MOST = 2000  # readings of a history


@dataclass(frozen=True)
class _Found:
    """Numbers of the section, and the level over the whole recording."""

    numbers: SignalLevels
    history: BandLevels


class LevelsTab(Tab):
    """RMS and its relatives, and the time-weighted level over the whole recording."""

    name, title, verb = "levels", "Levels", "rms"
    tip, hertz = ("s", "dB"), False

    def add_controls(self) -> None:
        """Weightings, and the tables."""
        self.choice("weighting", "Weighting", ["A", "B", "C", "Z"], 80, "A")
        self.choice("averaging", "Time weighting", ["fast", "slow"])
        self.numbers = Div(sizing_mode="stretch_width", name="levels")
        below = ScrollBox(child=self.numbers, sizing_mode="stretch_both", styles=share(2))
        self.body = [*self.body, below]
        self._kept: dict[tuple[Any, ...], BandLevels] = {}

    def analyse(self, view: View, chosen: Chosen, recording: Recording) -> _Found:
        """Numbers of the section, and the level against time."""
        averaging = view.settings.get("averaging", "fast")
        key = (chosen.number, chosen.patterns, averaging)
        if key not in self._kept:
            kept = list(self._kept.items())[-20:]
            self._kept = {**dict(kept), key: _history(chosen, recording, averaging)}
        return _Found(super().analyse(view, chosen, recording), self._kept[key])

    def drawing(self, result: _Found, view: View) -> Drawing:
        """The level against time."""
        return history_panels(result.history, result.numbers.weighting)

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the tables."""
        super().draw(found, view)
        self.numbers.text = "".join(
            f"<p>{one.title}</p>"
            + table(one.header, [[self.opened.text(number, row[0]), *row[1:]] for row in one.rows])
            for number, result in found
            for one in result.numbers.sheets()
        )


def _history(chosen: Chosen, recording: Recording, averaging: Any) -> BandLevels:
    """Levels against time, with all weightings: of few bands, since none is shown."""
    duration = min(c.duration_s for c in chosen.channels)
    constant = {"fast": FAST, "slow": SLOW}[averaging]
    settings = Octave(
        channels=chosen.patterns, averaging=averaging, fraction=1,
        band=min(1000.0, chosen.channels[0].sampling_rate / 5),
        interval_s=min(max(constant / READINGS_PER_TIME_CONSTANT, duration / _MOST), duration),
    )  # fmt: skip
    return settings(recording)


_AVERAGING = ("linear", "fast", "slow", "impulse")


class OctaveTab(Tab):
    """The octave spectrum."""

    name, title, verb = "octave", "Octave", "octave"
    readings: ClassVar = {"level_dB": "{:.2f} dB", "flags": "{}"}

    def add_controls(self) -> None:
        """Bands, weighting, averaging; the overall levels beside the figures."""
        self.choice("fraction", "1/N octave", [*DIVISIONS], 80)
        self.choice("weighting", "Weighting", ["Z", "A", "B", "C"], 80)
        constants = dict.fromkeys(["0.25", "0.5", "2", "5", "10", written(self._begun.averaging)])
        texts = [(text, f"{text} s") for text in constants if text not in _AVERAGING]
        self.choice("averaging", "Averaging", [*_AVERAGING, *texts])
        self.choice("hold", "Hold", [("", "none"), "max", "min"], 80)
        self.number("fmin", "From / Hz", usual="20")
        self.number("fmax", "To / Hz", usual="20000")
        self.overall = Div(sizing_mode="stretch_width", name="overall")
        self.side = [self.overall]

    def given(self, view: View) -> dict[str, Any]:
        """A linear average has no highest value."""
        found = super().given(view)
        return found if "averaging" in found else {n: v for n, v in found.items() if n != "hold"}

    def drawing(self, result: Any, view: View) -> Drawing:
        """Steps from edge to edge of each band."""
        return band_panels(result)

    def draw(self, found: Found, view: View) -> None:
        """The bands, and the table of overall levels."""
        super().draw(found, view)
        self.overall.text = "<b>Overall levels / dB</b>" + "".join(
            table(
                [f"re {micro(text)}", *r.overall_dB, ""],
                [
                    [
                        self.opened.text(number, name),
                        *(cell(levels[row]) for levels in r.overall_dB.values()),
                        " ".join(r.flags[row]),
                    ]
                    for row, name in enumerate(r.channels)
                    if r.references[row].text == text
                ],
            )
            for number, r in found
            for text in dict.fromkeys(reference.text for reference in r.references)
        )

    def line(self, result: Any, axis: Any, frequency: float) -> int | None:
        """The band that contains the frequency."""
        band = int(np.searchsorted(result.lower_hz, frequency, side="right")) - 1
        return band if band >= 0 and frequency <= result.upper_hz[-1] else None
