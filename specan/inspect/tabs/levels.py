"""Levels of the channels: in bands, single numbers of the section, and against time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from bokeh.models import Div, ScrollBox

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.octave_settings import READINGS_PER_TIME_CONSTANT
from specan.data.band_levels import BandLevels
from specan.data.levels import SignalLevels
from specan.data.recording import Recording
from specan.divisions import DIVISIONS
from specan.dsp.weighting import FAST, SLOW
from specan.inspect.look import sheet
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Plots
from specan.inspect.tabs.tab import Change, Found, Tab
from specan.inspect.view import View
from specan.inspect.work import Tell
from specan.report.figure_style import micro
from specan.report.figures_bands import band_panels, history_panels
from specan.report.panels import Drawing

_MOST = 2000  # readings of a history


@dataclass(frozen=True)
class _Found:
    """Numbers of the section, and the level over the whole recording."""

    numbers: SignalLevels
    history: BandLevels


class LevelsTab(Tab):
    """RMS and its relatives, and the time-weighted level over the whole recording."""

    name, title = "levels", "Levels"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.choice(view, "level_weighting", "Weighting", ["A", "B", "C", "Z"], 80)
        self.choice(view, "level_averaging", "Time weighting", ["fast", "slow"])
        self.plots = Plots(tip=("s", "dB"))
        self.numbers = Div(sizing_mode="stretch_width", name="levels")
        below = ScrollBox(
            child=self.numbers, sizing_mode="stretch_both", styles={"flex": "2 1 0", "min-height": "0"}
        )
        self.body = [self.plots.body, below]
        self._kept: dict[tuple[Any, ...], BandLevels] = {}

    def compute(self, view: View, tell: Tell) -> Found:
        """Numbers of the section, and the level against time."""

        def analyse(chosen: Chosen, recording: Recording) -> _Found:
            key = (chosen.number, chosen.patterns, view.level_averaging)
            if key not in self._kept:
                self._kept = {**dict(list(self._kept.items())[-20:]), key: _history(chosen, recording, view)}
            return _Found(self.settings(view, chosen, Levels)(recording), self._kept[key])

        return self.of_each(view, tell, analyse)

    def drawing(self, result: _Found, view: View) -> Drawing:
        """The level against time."""
        return history_panels(result.history, view.level_weighting)

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the tables."""
        self.plots.draw(self.drawn(found, view))
        text = partial(self.opened.text)
        tables = [
            (one.title, one.header, [[text(number, row[0]), *row[1:]] for row in one.rows])
            for number, result in found
            for one in result.numbers.sheets()
        ]
        self.numbers.text = "".join(f"<p>{title}</p>{sheet(header, rows)}" for title, header, rows in tables)


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

    name, title = "octave", "Octave"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.choice(view, "fraction", "1/N octave", [*DIVISIONS], 80)
        self.choice(view, "weighting", "Weighting", ["Z", "A", "B", "C"], 80)
        self.choice(
            view,
            "averaging",
            "Averaging",
            [*_AVERAGING, *({view.averaging} - {*_AVERAGING}), *_constants(view)],
        )
        self.choice(view, "hold", "Hold", [("", "none"), "max", "min"], 80)
        self.number(view, "fmin", "From / Hz")
        self.number(view, "fmax", "To / Hz")
        self.plots = Plots(self.add_figure, hertz=True, tip=("Hz", "dB"))
        self.overall = Div(sizing_mode="stretch_width", name="overall")
        self.body, self.side = [self.plots.body], [self.overall]

    def compute(self, view: View, tell: Tell) -> Found:
        """Band levels."""

        def analyse(chosen: Chosen, recording: Recording) -> BandLevels:
            named = view.averaging in _AVERAGING
            settings = self.settings(
                view,
                chosen,
                Octave,
                averaging=view.averaging if named else float(view.averaging),
                hold=None if view.averaging == "linear" else view.hold or None,
                # Of several rates each goes as far as it can.
                fmax=view.fmax if view.fmax <= 0.8 * chosen.channels[0].sampling_rate / 2 else None,
            )
            return settings(recording)

        return self.of_each(view, tell, analyse)

    def drawing(self, result: Any, view: View) -> Drawing:
        """Steps from edge to edge of each band."""
        return band_panels(result)

    def draw(self, found: Found, view: View) -> None:
        """The bands, and the table of overall levels."""
        self.plots.draw(self.drawn(found, view))
        self.overall.text = _overall(self.opened, found)

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """The level of the band that contains the frequency."""
        rows = []
        for number, r in found:
            band = int(np.searchsorted(r.lower_hz, frequency, side="right")) - 1
            if band >= 0 and frequency <= r.upper_hz[-1]:
                for row, name in enumerate(r.channels):
                    words = " ".join(r.band_flags(row, band))
                    level = f"{r.level_dB[row, band]:.2f} dB re {r.references[row].text} {words}".strip()
                    rows.append((self.opened.text(number, name), f"{r.nominal_hz[band]:g}", level))
        return rows


def _constants(view: View) -> list[tuple[str, str]]:
    return [(text, f"{text} s") for text in ("0.25", "0.5", "2", "5", "10") if text != view.averaging]


def _overall(opened: Opened, found: Found) -> str:
    weightings = list(dict.fromkeys(w for _, r in found for w in r.overall_dB))
    parts = []
    for text in dict.fromkeys(reference.text for _, r in found for reference in r.references):
        rows = []
        for number, r in found:
            for row, name in enumerate(r.channels):
                if r.references[row].text == text:
                    values = [r.overall_dB[w][row] if w in r.overall_dB else np.nan for w in weightings]
                    cells = ["" if v != v else f"{v:.2f}" for v in values]
                    rows.append([opened.text(number, name), *cells, " ".join(r.flags[row])])
        used = [k for k, _ in enumerate(weightings, 1) if any(line[k] for line in rows)]
        kept = [0, *used, len(weightings) + 1]
        header = [f"re {micro(text)}", *weightings, ""]
        parts.append(sheet([header[k] for k in kept], [[line[k] for k in kept] for line in rows]))
    return "<b>Overall levels / dB</b>" + "".join(parts)
