"""Levels of the channels: in bands, single numbers of the section, and against time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from bokeh.models import Div, ScrollBox

from specan.analysis.levels import Levels
from specan.analysis.octave import READINGS_PER_TIME_CONSTANT, Octave
from specan.data.band_levels import BandLevels
from specan.data.levels import SignalLevels
from specan.data.recording import Recording
from specan.divisions import DIVISIONS
from specan.dsp.weighting import FAST, SLOW
from specan.inspect.look import share
from specan.inspect.opened import Chosen
from specan.inspect.tabs.tab import Found, Tab
from specan.inspect.view import View
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

    name, title, kind = "levels", "Levels", Levels
    tip, hertz = ("s", "dB"), False

    def add_controls(self, view: View) -> None:
        """Weightings, and the tables."""
        self.choice(view, "level_weighting", "Weighting", ["A", "B", "C", "Z"], 80)
        self.choice(view, "level_averaging", "Time weighting", ["fast", "slow"])
        self.numbers = Div(sizing_mode="stretch_width", name="levels")
        below = ScrollBox(child=self.numbers, sizing_mode="stretch_both", styles=share(2))
        self.body = [*self.body, below]
        self._kept: dict[tuple[Any, ...], BandLevels] = {}

    def analyse(self, view: View, chosen: Chosen, recording: Recording) -> _Found:
        """Numbers of the section, and the level against time."""
        key = (chosen.number, chosen.patterns, view.level_averaging)
        if key not in self._kept:
            self._kept = {**dict(list(self._kept.items())[-20:]), key: _history(chosen, recording, view)}
        return _Found(super().analyse(view, chosen, recording), self._kept[key])

    def drawing(self, result: _Found, view: View) -> Drawing:
        """The level against time."""
        return history_panels(result.history, view.level_weighting)

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the tables."""
        super().draw(found, view)
        self.numbers.text = "".join(
            f"<p>{one.title}</p>"
            + table(one.header, [[self.opened.text(number, row[0]), *row[1:]] for row in one.rows])
            for number, result in found
            for one in result.numbers.sheets()
        )


def _history(chosen: Chosen, recording: Recording, view: View) -> BandLevels:
    """Levels against time, with all weightings: of few bands, since none is shown."""
    duration = min(c.duration_s for c in chosen.channels)
    constant = {"fast": FAST, "slow": SLOW}[view.level_averaging]
    settings = Octave(
        channels=chosen.patterns, averaging=view.level_averaging, fraction=1,
        band=min(1000.0, chosen.channels[0].sampling_rate / 5),
        interval_s=min(max(constant / READINGS_PER_TIME_CONSTANT, duration / _MOST), duration),
    )  # fmt: skip
    return settings(recording)


_AVERAGING = ("linear", "fast", "slow", "impulse")


class OctaveTab(Tab):
    """The octave spectrum."""

    name, title, kind = "octave", "Octave", Octave
    readings: ClassVar = {"level_dB": "{:.2f} dB", "flags": "{}"}

    def add_controls(self, view: View) -> None:
        """Bands, weighting, averaging; the overall levels beside the figures."""
        self.choice(view, "fraction", "1/N octave", [*DIVISIONS], 80)
        self.choice(view, "weighting", "Weighting", ["Z", "A", "B", "C"], 80)
        constants = dict.fromkeys(["0.25", "0.5", "2", "5", "10", *({view.averaging} - {*_AVERAGING})])
        self.choice(
            view, "averaging", "Averaging", [*_AVERAGING, *((text, f"{text} s") for text in constants)]
        )
        self.choice(view, "hold", "Hold", [("", "none"), "max", "min"], 80)
        self.number(view, "fmin", "From / Hz")
        self.number(view, "fmax", "To / Hz")
        self.overall = Div(sizing_mode="stretch_width", name="overall")
        self.side = [self.overall]

    def more(self, view: View, chosen: Chosen) -> dict[str, Any]:
        """Of several rates each goes as far as it can."""
        return {
            "hold": None if view.averaging == "linear" else view.hold or None,
            "fmax": view.fmax if view.fmax <= 0.8 * chosen.channels[0].sampling_rate / 2 else None,
        }

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
