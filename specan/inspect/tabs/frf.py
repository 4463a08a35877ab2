"""Transfer functions: magnitude, phase, coherence strip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from specan.analysis.transfer_function import TransferFunction
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.errors import InputError
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import FEW, WRAPPED, Band, Curve, Lines, outer_of
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line
from specan.inspect.view import View
from specan.report.figure_style import band_about, with_gaps
from specan.schema import parse

_MOST_BANDS = 8  # channels whose bands are drawn: more would be one grey


class FrfTab(Tab):
    """Responses on screen over a reference."""

    name, title = "frf", "Transfer function"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        names = list(dict.fromkeys(c.name for _, c in opened.keys.values()))
        self.choice(view, "over", "Reference", [("", "the vibrometer"), *((n, n) for n in names)], 170)
        self.choice(view, "estimator", "Estimator", ["H1", "H2", "Hv", "H3c"], 90)
        self.choice(view, "instrument", "of H3c", [("", "the generator"), *((n, n) for n in names)], 150)
        self.choice(view, "unwrapped", "Phase", [("False", "-180 to 180"), ("True", "unwrapped")], 120)
        self.number(view, "lines", "Lines", mode="int")
        self.number(view, "overlap", "Overlap", 70)
        self.magnitude = GroupedLines(
            "", self.add_figure, hertz=True, tip=("Hz", "dB"), dynamics=100.0, named=False
        )
        self.phase = Lines(
            "", "Phase\n/ degrees", hertz=True, like=self.magnitude.first, weight=2, tip=("Hz", "degrees"),
            limits=WRAPPED, legend=False, named=False,
        )  # fmt: skip
        self.coherence = Lines(
            "Frequency / Hz", "Coherence", hertz=True, like=self.magnitude.first, limits=(0, 1.05), weight=1,
            tip=("Hz", "coherence"), legend=False,
        )  # fmt: skip
        self.add_figure(self.phase)
        self.add_figure(self.coherence)
        self.body = [self.magnitude.body, self.phase.sheet, self.coherence.sheet]

    def compute(self, view: View, tell: Tell) -> Found:
        """Transfer functions of the channels on screen, the reference left out."""

        def analyse(chosen: Chosen, recording: Recording) -> FrequencyResponse:
            settings = parse(
                TransferFunction,
                {
                    "reference": view.over or None,
                    "channels": chosen.patterns,
                    "estimator": view.estimator,
                    "instrument": view.instrument or None,
                    "lines": _lines(view, chosen),
                    "window": view.window,
                    "overlap": view.overlap,
                    "start_s": view.start,
                    "stop_s": view.stop,
                },
                "frf",
            )
            return settings(recording)

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
            f"{first.n_blocks} blocks" + ("; bands: 95 %" if banded else "")
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


def _lines(view: View, chosen: Chosen) -> int:
    """Those asked for, or fewer where the section is short and nobody asked."""
    stop = min(chosen.channels[0].duration_s, view.stop or np.inf)
    possible = int((stop - view.start) * chosen.channels[0].sampling_rate / 2.56) - 1
    if possible < 8:
        raise InputError("the section is too short for a transfer function", remedy="choose a longer one")
    return view.lines if view.lines != View().lines else min(view.lines, possible)
