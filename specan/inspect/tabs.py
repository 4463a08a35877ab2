"""The tabs of a recording's page: levels in bands, spectra, transfer functions, levels, orders, what is in the file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from bokeh.models import Div, ScrollBox

from specan.analysis.octave import READINGS_PER_TIME_CONSTANT, Octave
from specan.data.band_levels import BandLevels
from specan.data.levels import SignalLevels
from specan.data.recording import Recording
from specan.data.spectrum import SCALINGS
from specan.divisions import DIVISIONS
from specan.dsp.weighting import FAST, SLOW
from specan.dsp.windows import WINDOWS
from specan.inspect.look import notice, share
from specan.inspect.opened import Chosen
from specan.inspect.plots import plain
from specan.inspect.tab import Found, Tab
from specan.inspect.view import View, written
from specan.inspect.work import Tell
from specan.report.contents import sheets
from specan.report.figures_bands import band_panels, history_panels
from specan.report.figures_spectra import figure_frequency_response, figure_order_map, figure_orders
from specan.report.html_page import table
from specan.report.panels import Drawing, grouped
from specan.result import cell
from specan.units import printed_unit

_READINGS = 2000  # readings of a history


@dataclass(frozen=True, kw_only=True, repr=False)
class _Levels(SignalLevels):
    """Of the section, and the level over the whole recording."""

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
        below = ScrollBox(
            child=self.numbers, sizing_mode="stretch_both", styles=share(2), css_classes=["whole"]
        )
        self.plots.body.styles = share(3) | {"min-height": "250px"}
        self.body = [self.plots.body, below]
        self._kept: dict[tuple[Any, ...], BandLevels] = {}

    def analyse(self, view: View, chosen: Chosen, recording: Recording) -> _Levels:
        """Numbers of the section, and the level against time."""
        averaging = view.settings.get("averaging", "fast")
        key = (chosen.number, chosen.patterns, averaging)
        if key not in self._kept:
            kept = list(self._kept.items())[-20:]
            self._kept = {**dict(kept), key: _history(chosen, recording, averaging)}
        return _Levels(**vars(super().analyse(view, chosen, recording)), history=self._kept[key])

    def drawing(self, result: _Levels, view: View) -> Drawing:
        """The level against time."""
        return history_panels(result.history, result.weighting)

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the tables."""
        super().draw(found, view)
        self.numbers.text = "".join(
            f"<p>{one.title}</p>"
            + table(one.header, [[self.opened.text(number, row[0]), *row[1:]] for row in one.rows])
            for number, result in found
            for one in result.sheets()
        )


def _history(chosen: Chosen, recording: Recording, averaging: Any) -> BandLevels:
    """Levels against time, with all weightings: of few bands, since none is shown."""
    duration = min(c.duration_s for c in chosen.channels)
    constant = {"fast": FAST, "slow": SLOW}[averaging]
    settings = Octave(
        channels=chosen.patterns, averaging=averaging, fraction=1,
        band=min(1000.0, chosen.channels[0].sampling_rate / 5),
        interval_s=min(max(constant / READINGS_PER_TIME_CONSTANT, duration / _READINGS), duration),
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
        content = "<b>Overall levels / dB</b>"
        for number, r in found:
            for text, rows in grouped(reference.text for reference in r.references).items():
                header = [printed_unit(f"re {text}"), *r.overall_dB, ""]
                lines = [
                    [
                        self.opened.text(number, r.channels[row]),
                        *(cell(levels[row]) for levels in r.overall_dB.values()),
                        " ".join(r.flags[row]),
                    ]
                    for row in rows
                ]
                content += table(header, lines)
        self.overall.text = content

    def line(self, result: Any, axis: Any, frequency: float) -> int | None:
        """The band that contains the frequency."""
        band = int(np.searchsorted(result.lower_hz, frequency, side="right")) - 1
        return band if band >= 0 and frequency <= result.upper_hz[-1] else None


COLUMNS = 500  # of a spectrogram on the page


class FftTab(Tab):
    """Levels of the lines, and their phases over a reference channel."""

    name, title, verb = "fft", "FFT magnitude and phase", "fft"
    readings: ClassVar = {"values": "{:.5g} {unit}", "level_dB": "{:.2f} dB", "phase_deg": "{:.2f} degrees"}

    def add_controls(self) -> None:
        """Blocks, scaling, averages, the reference of the phase."""
        self.number("lines", "Lines", mode="int", usual="automatic")
        self.choice("window", "Window", WINDOWS, 130)
        self.number("overlap", "Overlap", 70)
        self.choice("scaling", "Scaling", SCALINGS, 125)
        averages = ["linear", "exponential", ("max", "max hold"), ("min", "min hold")]
        self.choice("averaging", "Averaging", averages)
        self.number("n_exponential", "Blocks", 70, mode="int")
        self.channel_choice("reference", "Phase over", "choose a channel", 190)


class FrfTab(Tab):
    """Responses on screen over a reference."""

    name, title, verb = "frf", "Transfer function", "frf"
    needs, tip = "a response", ("Hz", "value")
    readings: ClassVar = {
        "magnitude": "{:.5g} {unit}",
        "level_dB": "{:.2f} dB",
        "phase_deg": "{:.2f} degrees",
        "coherence": "coherence {:.4f}",
        "u_total_percent": "u {:.2g} %",
        "u_total_phase_deg": "u {:.2g} degrees",
    }

    def add_controls(self) -> None:
        """Reference, estimator, phase, blocks."""
        self.channel_choice("reference", "Reference", "the vibrometer")
        self.choice("estimator", "Estimator", ["H1", "H2", "Hv", "H3c"], 90)
        self.channel_choice("instrument", "Instrument (H3c)", "the generator", 150)
        self.choice("unwrap", "Phase", [("false", "-180 to 180"), ("true", "unwrapped")], 130)
        self.number("lines", "Lines", mode="int", usual="automatic")
        self.number("overlap", "Overlap", 70)

    def drawing(self, result: Any, view: View) -> Drawing:
        """Magnitude, phase and coherence, with their bands of 95 %."""
        return figure_frequency_response(result, unwrapped=bool(view.settings.get("unwrap")))


class SpectrogramTab(Tab):
    """Level against time and frequency."""

    hertz = False
    readings: ClassVar = {"level_dB": "{:.2f} dB"}
    name, title, verb, tip = "spectrogram", "Spectrogram", "fft", ("s", "Hz")

    def add_controls(self) -> None:
        """The channel, and blocks."""
        keys = [(key, plain(self.opened.text(n, c.label))) for key, (n, c) in self.opened.keys.items()]
        self.choice("of", "Channel", [("", "the first on screen"), *keys], 220)
        self.number("lines", "Lines", mode="int", usual="automatic")
        self.choice("window", "Window", WINDOWS, 130)
        self.number("overlap", "Overlap", 70)

    def keys(self, view: View) -> Sequence[str]:
        """Of one channel only."""
        of = view.settings.get("of")
        return (of,) if of in self.opened.keys else view.channel[:1]

    def given(self, view: View) -> dict[str, Any]:
        """As many columns as the screen shows."""
        own = {name: value for name, value in view.settings.items() if name != "of"}
        return {**own, "spectrogram": True, "columns": COLUMNS}

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Lowest and highest level of the nearest line over time."""
        number, r = found[0]
        line = self.line(r, r.frequency_hz, frequency) or 0
        level = r.level_dB[0][:, line]
        known = level[np.isfinite(level)]
        text = f"{known.min():.2f} to {known.max():.2f} dB over time" if known.size else "no signal"
        return [(self.opened.text(number, r.channels[0]), f"{r.frequency_hz[line]:.6g}", text)]


class OrdersTab(Tab):
    """Levels over the order of a shaft; a cursor in hertz stands at its order at the mean speed."""

    name, title, verb = "orders", "Orders", "orders"
    needs, tip, hertz = "a channel that is not a tacho", ("order", "dB"), False
    readings: ClassVar = {"order": "order {:.6g}", "amplitude": "{:.5g} {unit}", "level_dB": "{:.2f} dB"}

    def add_controls(self) -> None:
        """Tacho or speed, orders, the map."""
        self.channel_choice("tacho", "Tacho", "automatic")
        self.number("pulses_per_turn", "Pulses per revolution", 140)
        self.number("ratio", "Ratio", 70)
        self.number("speed_hz", "Speed / Hz")
        self.number("max_order", "Highest order")
        self.number("turns", "Turns", 70, mode="int")
        self.choice("map", "Show", [("false", "spectrum"), ("true", "with the map")], 140)

    def keys(self, view: View) -> Sequence[str]:
        """Of the channels on screen that are no tachos."""
        return self.opened.without_tachos(view.channel, view.settings.get("tacho", ""))

    def per_hertz(self, result: Any) -> float:
        """Orders, at the mean speed of the shaft."""
        return 1 / float(result.tacho.mean_hz)

    def drawing(self, result: Any, view: View) -> Drawing:
        """Levels over order, and the map of the first channel where it is wanted."""
        pictures = figure_order_map(result).pictures[:1] if view.settings.get("map") else ()
        return replace(figure_orders(result), pictures=pictures)

    def draw(self, found: Found, view: View) -> None:
        """The cursor stands at the mean speed of the first recording."""
        self.figure_view = "map" if view.settings.get("map") else ""
        super().draw(found, view)
        for figure in self.figures:
            figure.per_hertz = self.per_hertz(found[0][1])


class InfoTab(Tab):
    """Headers only; nothing is computed, and all of it is shown when the page opens."""

    name, title, verb, tip = "info", "Info", "info", None

    def add_controls(self) -> None:
        """The tables."""
        content = Div(
            text="<hr>".join(map(_contents, self.opened.recordings)), sizing_mode="stretch_width", name="info"
        )
        self.body = [
            ScrollBox(child=content, sizing_mode="stretch_both", styles=share(), css_classes=["whole"])
        ]

    def compute(self, view: View, tell: Tell) -> Found:
        """Nothing."""
        return []

    def commands(self, view: View) -> list[str]:
        """For each recording."""
        return [self.opened.command(number, self.verb, []) for number in range(len(self.opened.recordings))]


def _contents(recording: Recording) -> str:
    """What ``specan info`` shows."""
    parts = [f"<h2>{notice(recording.label)}</h2>"]
    parts += [f"<p>{notice(note)}</p>" for note in (*recording.flags, *recording.notes)]
    for one in filter(lambda one: one.rows, sheets(recording, {})):
        parts += [f"<h3>{notice(one.title)}</h3>", table(one.header, one.rows), notice(one.below)]
    return "".join(parts)


TABS = (OctaveTab, FftTab, FrfTab, LevelsTab, SpectrogramTab, OrdersTab, InfoTab)
