"""Tabs of spectra: magnitude and phase, transfer functions, spectra against time."""

from __future__ import annotations

from typing import Any

import numpy as np

from specan.analysis.spectrogram import SpectrogramSettings
from specan.analysis.spectrum import FourierSpectrum
from specan.analysis.transfer_function import TransferFunction
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.data.spectrum import SCALINGS, Spectrogram
from specan.dsp.windows import WINDOWS
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import HarmonicCursor, HeatMap, Plots, plain
from specan.inspect.tabs.tab import Change, Found, Tab, nearest_line
from specan.inspect.view import COLUMNS, View
from specan.inspect.work import Tell
from specan.report.figures_spectra import figure_frequency_response, figure_spectrogram, figure_spectrum
from specan.report.panels import Drawing


class FftTab(Tab):
    """Levels of the lines, and their phases over a reference channel."""

    name, title = "fft", "FFT magnitude and phase"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.number(view, "lines", "Lines", mode="int", placeholder="automatic")
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
        names = list(dict.fromkeys(c.label for _, c in opened.keys.values()))
        self.choice(
            view, "reference", "Phase over", [("", "choose a channel"), *((n, n) for n in names)], 190
        )
        self.plots = Plots(self.add_figure, hertz=True, tip=("Hz", "dB"))
        self.body = [self.plots.body]

    def compute(self, view: View, tell: Tell) -> Found:
        """Averaged spectra; without a reference an average has no phase."""
        return self.of_each(
            view, tell, lambda chosen, recording: self.settings(view, chosen, FourierSpectrum)(recording)
        )

    def drawing(self, result: Any, view: View) -> Drawing:
        """Levels, and phases where there are some."""
        return figure_spectrum(result)

    def draw(self, found: Found, view: View) -> None:
        """Levels above phases."""
        self.plots.draw(self.drawn(found, view))

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


class FrfTab(Tab):
    """Responses on screen over a reference."""

    name, title = "frf", "Transfer function"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        names = list(dict.fromkeys(c.label for _, c in opened.keys.values()))
        self.choice(view, "over", "Reference", [("", "the vibrometer"), *((n, n) for n in names)], 170)
        self.choice(view, "estimator", "Estimator", ["H1", "H2", "Hv", "H3c"], 90)
        self.choice(view, "instrument", "of H3c", [("", "the generator"), *((n, n) for n in names)], 150)
        self.choice(view, "unwrapped", "Phase", [("False", "-180 to 180"), ("True", "unwrapped")], 120)
        self.number(view, "lines", "Lines", mode="int", placeholder="automatic")
        self.number(view, "overlap", "Overlap", 70)
        self.plots = Plots(self.add_figure, hertz=True, tip=("Hz", "value"))
        self.body = [self.plots.body]

    def compute(self, view: View, tell: Tell) -> Found:
        """Transfer functions of the channels on screen, the reference left out."""

        def analyse(chosen: Chosen, recording: Recording) -> FrequencyResponse:
            return self.settings(view, chosen, TransferFunction)(recording)

        return self.of_each(view, tell, analyse, "a response")

    def drawing(self, result: Any, view: View) -> Drawing:
        """Magnitude, phase and coherence, with their bands of 95 %."""
        return figure_frequency_response(result, unwrapped=view.unwrapped)

    def draw(self, found: Found, view: View) -> None:
        """Strips over one axis."""
        self.plots.draw(self.drawn(found, view))

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """Magnitude, phase, coherence of the nearest line."""
        rows = []
        for number, r in found:
            line = nearest_line(r.frequency_hz, frequency)
            for row, name in enumerate(r.channels):
                text = (
                    f"{r.magnitude[row, line]:.5g} {r.units[row]} ({r.level_dB[row, line]:.2f} dB), "
                    f"{round(r.phase_deg[row, line], 2) + 0.0:.2f} degrees, coherence {r.coherence[row, line]:.4f}, "
                    f"u {np.hypot(r.u_magnitude_percent, r.u_common_percent)[row, line]:.2g} % and "
                    f"{np.hypot(r.u_phase_deg, r.u_common_phase_deg)[row, line]:.2g} degrees"
                )
                rows.append((self.opened.text(number, name), f"{r.frequency_hz[line]:.6g}", text))
        return rows


class SpectrogramTab(Tab):
    """Level against time and frequency."""

    name, title = "spectrogram", "Spectrogram"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        keys = [(key, plain(opened.text(n, c.label))) for key, (n, c) in opened.keys.items()]
        self.choice(view, "of", "Channel", [("", "the first on screen"), *keys], 220)
        self.number(view, "lines", "Lines", mode="int", placeholder="automatic")
        self.choice(view, "window", "Window", WINDOWS, 130)
        self.number(view, "overlap", "Overlap", 70)
        self.map = HeatMap(1, "spectrogram", hertz=True)
        self.sheet = self.map.sheet
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
            return self.settings(view, chosen, SpectrogramSettings, columns=COLUMNS)(recording)

        wanted = (view.of,) if view.of in self.opened.keys else view.channel[:1]
        return self.of_each(view.but(channel=wanted), tell, analyse)

    def drawing(self, result: Any, view: View) -> Drawing:
        """The picture of the channel."""
        return figure_spectrogram(result)

    def draw(self, found: Found, view: View) -> None:
        """The picture."""
        self.map.draw(self.drawn(found, view))
