"""Tabs of spectra: magnitude and phase, transfer functions, spectra against time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from bokeh.models import HoverTool, Range1d

from specan.analysis.spectrogram import SpectrogramSettings
from specan.analysis.spectrum import FourierSpectrum
from specan.analysis.transfer_function import TransferFunction
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.data.spectrum import SCALINGS, Spectrogram
from specan.dsp.windows import WINDOWS
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import (
    FEW,
    WRAPPED,
    Band,
    Curve,
    HarmonicCursor,
    HeatMap,
    Lines,
    hertz_axis,
    outer_of,
    plain,
)
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line
from specan.inspect.view import COLUMNS, View
from specan.report.figure_style import band_about, micro, with_gaps
from specan.result import counted

_PHASE_DB = 60.0  # below its highest line a spectrum's phase is not drawn


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
        return self.of_each(
            view, tell, lambda chosen, recording: self.settings(view, chosen, FourierSpectrum)(recording)
        )

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


_MOST_BANDS = 8  # channels whose bands are drawn: more would be one grey


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
        self.magnitude = GroupedLines(
            "", self.add_figure, hertz=True, tip=("Hz", "dB"), dynamics=100.0, named=False
        )
        self.phase = Lines(
            "", "Phase\n/ degrees", hertz=True, like=self.magnitude.first, weight=2, tip=("Hz", "degrees"),
            limits=WRAPPED, legend=False, named=False,
        )  # fmt: skip
        self.coherence = Lines(
            "Frequency / Hz", "Coherence", hertz=True, like=self.magnitude.first, limits=(0, 1.05), weight=2,
            tip=("Hz", "coherence"), legend=False,
        )  # fmt: skip
        self.add_figure(self.phase)
        self.add_figure(self.coherence)
        self.body = [self.magnitude.body, self.phase.sheet, self.coherence.sheet]

    def compute(self, view: View, tell: Tell) -> Found:
        """Transfer functions of the channels on screen, the reference left out."""

        def analyse(chosen: Chosen, recording: Recording) -> FrequencyResponse:
            return self.settings(view, chosen, TransferFunction)(recording)

        return self.of_each(view, tell, analyse, "a response")

    def draw(self, found: Found, view: View) -> None:
        """Three strips over one axis, with the bands of 95 % where they can be distinguished."""
        magnitude: list[Curve] = []
        phase: list[Curve] = []
        coherence: list[Curve] = []
        places: dict[str, list[int]] = {}
        levels: dict[str, list[Band]] = {}
        turns: list[Band] = []
        banded = sum(len(r.channels) for _, r in found) <= _MOST_BANDS
        for number, r in found:
            turned = r.unwrapped_phase_deg if view.unwrapped else r.phase_deg
            for row, name in enumerate(r.channels):
                text = self.opened.text(number, name)
                magnitude.append(Curve(text, r.frequency_hz, r.level_dB[row]))
                label = f"Magnitude\n/ dB re 1 {r.units[row]}"
                places.setdefault(label, []).append(len(magnitude) - 1)
                one = turned[row] if view.unwrapped else with_gaps(turned[row])
                if banded:
                    hue = len(magnitude) - 1
                    relative = 2 * np.hypot(r.u_magnitude_percent[row], r.u_common_percent[row]) / 100
                    reach = 2 * np.hypot(r.u_phase_deg[row], r.u_common_phase_deg[row])
                    levels.setdefault(label, []).append(
                        Band(r.frequency_hz, *band_about(r.level_dB[row], relative), hue)
                    )
                    turns.append(Band(r.frequency_hz, one - reach, one + reach, hue))
                phase.append(Curve(text, r.frequency_hz, one))
                coherence.append(Curve(text, r.frequency_hz, r.coherence[row]))
        outer = [k for mine in places.values() for k in _outer(magnitude, mine)]
        magnitude, phase, coherence = (_coloured(curves, outer) for curves in (magnitude, phase, coherence))
        self.magnitude.draw({label: [magnitude[k] for k in mine] for label, mine in places.items()}, levels)
        self.phase.draw(phase, turns, outer)
        self.phase.limit(*_ends(phase) if view.unwrapped else WRAPPED)
        self.coherence.draw(coherence, (), outer)
        self.magnitude.span(min(c.x[0] for c in magnitude), max(c.x[-1] for c in magnitude))
        first = found[0][1]
        self.magnitude.title(
            f"{first.estimator} over {first.reference} ({first.reference_rms:.4g} {first.reference_unit} RMS), "
            f"{counted(first.n_blocks, 'block')}" + ("; bands: 95 %" if banded else "")
        )

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


def _outer(curves: list[Curve], mine: list[int]) -> list[int]:
    """Of the lines of one unit, those that get a colour."""
    return mine if len(mine) <= FEW else [mine[k] for k in outer_of([curves[m] for m in mine])]


def _coloured(curves: list[Curve], outer: list[int]) -> list[Curve]:
    """The same channel has the same colour in every figure."""
    return [replace(c, hue=outer.index(k)) if k in outer else c for k, c in enumerate(curves)]


def _ends(curves: list[Curve]) -> tuple[float, float]:
    """Of all curves, with a margin."""
    values = np.concatenate([c.y[np.isfinite(c.y)] for c in curves])
    if not values.size:
        return WRAPPED
    margin = 10.0 + 0.03 * float(np.ptp(values))
    return float(values.min()) - margin, float(values.max()) + margin


_ROWS = 220  # of the picture
_DYNAMICS_DB = 80.0


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
            return self.settings(view, chosen, SpectrogramSettings, columns=COLUMNS)(recording)

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
            f"blocks per column: {r.blocks_per_column}, {r.scale.level_text(r.units[0])}",
        )  # fmt: skip
        self.sheet.x_range.update(start=left, end=right, reset_start=left, reset_end=right)
