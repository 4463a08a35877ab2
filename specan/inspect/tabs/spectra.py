"""Tabs of spectra: magnitude and phase, transfer functions, spectra against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from specan.data.spectrum import SCALINGS
from specan.dsp.windows import WINDOWS
from specan.inspect.plots import plain
from specan.inspect.tabs.tab import Found, Tab
from specan.inspect.view import View
from specan.report.figures_spectra import figure_frequency_response
from specan.report.panels import Drawing

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
