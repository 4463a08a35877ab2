"""Levels of the channels: in bands, single numbers of the section, and against time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.models import Div, ScrollBox
from numpy.typing import NDArray

from specan.analysis.band_results import level
from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.octave_settings import READINGS_PER_TIME_CONSTANT
from specan.analysis.section import slow_part
from specan.data.band_levels import BandLevels
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.divisions import DIVISIONS
from specan.dsp.band_history import BandHistoryAccumulator
from specan.dsp.history_filters import weighting_filter
from specan.dsp.multirate import LENGTH
from specan.dsp.slow_part import SlowPart
from specan.dsp.time_weighting import FAST, SLOW
from specan.dsp.weighting import Weighting
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.kept_bands import KeptBands
from specan.inspect.look import sheet
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Curve
from specan.inspect.tabs.tab import Change, Found, Tab, Tell
from specan.inspect.view import View
from specan.inspect.work import Superseded
from specan.report.figure_style import level_label, micro
from specan.units import level_reference


class LevelsTab(Tab):
    """RMS and its relatives, and the time-weighted level over the whole recording."""

    name, title = "levels", "Levels"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.choice(view, "level_weighting", "Weighting", ["A", "B", "C", "Z"], 80)
        self.choice(view, "level_averaging", "Time weighting", ["fast", "slow"])
        self.history = GroupedLines("Time / s", tip=("s", "dB"), dynamics=90.0)
        self.numbers = Div(sizing_mode="stretch_width", name="levels")
        below = ScrollBox(
            child=self.numbers, sizing_mode="stretch_both", styles={"flex": "2 1 0", "min-height": "0"}
        )
        self.body = [self.history.body, below]
        self.partly: Any = lambda found, view: None  # the page shows what is known so far
        self._curves: dict[tuple[Any, ...], LevelCurves] = {}

    def compute(self, view: View, tell: Tell) -> Found:
        """Numbers of the section, then the level against time: what the waveform shows first."""

        def analyse(chosen: Chosen, recording: Recording) -> dict[str, Any]:
            found = self.settings(view, chosen, Levels)(recording)
            return {"numbers": found, "curves": self._of(chosen, view)}

        results = self.of_each(view, tell, analyse)
        low = view.start if view.low is None else view.low
        high = self.opened.duration_s if view.high is None else view.high
        for _, result in results:

            def told(part: float) -> bool:
                self.partly(results, view)
                return tell(part)

            if not result["curves"].fill(low, high, told):
                raise Superseded
        return results

    def _of(self, chosen: Chosen, view: View) -> LevelCurves:
        key = (chosen.number, chosen.patterns, view.level_weighting, view.level_averaging)
        if key not in self._curves:
            if len(self._curves) > 20:
                self._curves.clear()
            self._curves[key] = LevelCurves(
                chosen.recording, chosen.channels, view.level_weighting, view.level_averaging
            )
        return self._curves[key]

    def draw(self, found: Found, view: View) -> None:
        """Level against time, and the table."""
        groups: dict[str, list[Curve]] = {}
        rows = []
        for number, result in found:
            history, r = result["curves"], result["numbers"]
            for row, channel in enumerate(history.channels):
                name = self.opened.text(number, channel.label)
                label = level_label(level_reference(channel.unit).text)
                groups.setdefault(label, []).append(Curve(name, history.times, history.levels[row]))
                rows.append([
                    name, r.units[row], f"{r.rms[row]:.5g}", _decibels(r.level_dB[row]), r.references[row].text,
                    f"{r.peak[row]:.5g}", _decibels(r.crest_factor[row]), f"{r.mean[row]:.4g}",
                    _decibels(r.equivalent_dB["A"][row]), _decibels(r.max_dB[row]), _decibels(r.min_dB[row]),
                    *(_decibels(v[row]) for v in r.percentile_dB.values()), " ".join(r.flags[row]),
                ])  # fmt: skip
        self.history.draw(groups)
        self.history.span(0.0, max(self.opened.duration_s, 1e-3))
        first = found[0][1]["numbers"]
        percent = [f"L{n:g}" for n in first.percentile_dB]
        header = ["Channel", "unit", "RMS", "level dB", "re", "peak", "crest", "mean", "Leq A", "max", "min"]
        self.numbers.text = sheet([*header, *percent, ""], rows) + (
            f"<p>Section {first.start_s:g} s to {first.start_s + first.duration_s:g} s; max, min and percentiles of "
            f"the level with {first.averaging} time weighting.</p>"
        )


def _decibels(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else ""


_BLOCK = 1 << 16
_PIECE_S = 20.0
# Before a piece this many time constants are read: what lies further back has decayed by 130 dB.
_LEAD = 30.0
_MOST = 2000  # readings


@dataclass
class LevelCurves:
    """Time-weighted levels of channels of one rate, as far as they are known; NaN elsewhere.

    Channels are taken as they were measured; those that are no sound pressure have the Z weighting.

    Attributes
    ----------
    times : array (n,)
        From the beginning of the recording, in s.
    levels : array (channels, n)
    """

    recording: Recording
    channels: tuple[Channel, ...]
    weighting: Weighting
    averaging: str

    def __post_init__(self) -> None:
        duration = min(c.duration_s for c in self.channels)
        self.time_constant = {"fast": FAST, "slow": SLOW}[self.averaging]
        interval = max(self.time_constant / READINGS_PER_TIME_CONSTANT, duration / _MOST)
        self.times = np.arange(1, max(int(duration / interval + 1e-9), 1) + 1) * min(interval, duration)
        self._slow: SlowPart | None = None
        self.levels = np.full((len(self.channels), self.times.size), np.nan)
        per_piece = max(int(max(_PIECE_S, _LEAD * self.time_constant) / interval), 1)
        self.pieces = [slice(k, k + per_piece) for k in range(0, self.times.size, per_piece)]

    def fill(self, start_s: float, stop_s: float, tell: Callable[[float], bool]) -> bool:
        """Fill the pieces that touch a part of the recording, then the others; False if told to stop."""

        def apart(piece: slice) -> bool:
            seen = self.times[piece]
            return bool(seen[-1] < start_s or seen[0] > stop_s)

        ordered = sorted(self.pieces, key=apart)
        for number, piece in enumerate(ordered, 1):
            if np.isnan(self.levels[:, piece]).any() or number == 1:
                self.levels[:, piece] = self._piece(piece)
            if not tell(number / len(ordered)):
                return False
        return True

    def _piece(self, piece: slice) -> NDArray[np.float64]:
        rate = self.channels[0].sampling_rate
        times = self.times[piece]
        before = self.times[piece.start - 1] if piece.start else 0.0
        # On the grid of the transform's blocks, so that a piece has the numbers of the whole.
        first = max(int((before - _LEAD * self.time_constant) * rate), 0) // LENGTH * LENGTH
        end = -(-(int(np.ceil(times[-1] * rate)) + 1) // LENGTH) * LENGTH
        last = min(end, *(c.n_samples for c in self.channels))
        if self._slow is None:
            length = min(c.n_samples for c in self.channels)
            self._slow = slow_part(self.recording, self.channels, 0, length)
        history = BandHistoryAccumulator(
            len(self.channels),
            rate,
            last - first,
            [weighting_filter(self.weighting), weighting_filter("Z")],
            self.time_constant,
            None,
            np.asarray(times - first / rate, dtype=np.float64),
            slow=self._slow,
        )
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            for samples in self.recording.blocks(self.channels, _BLOCK, first, last):
                history.add(samples)
            readings = history.result().readings
        pressure = np.array([[c.unit == "Pa"] for c in self.channels])
        zero = np.array([[level_reference(c.unit).value ** 2] for c in self.channels])
        return np.asarray(level(np.where(pressure, readings[:, 0], readings[:, 1]), zero))


_AVERAGING = ("linear", "fast", "slow", "impulse")


class OctaveTab(Tab):
    """The octave spectrum."""

    name, title = "octave", "Octave"

    def __init__(self, opened: Opened, view: View, change: Change, kept: KeptBands) -> None:
        super().__init__(opened, view, change)
        self._kept = kept
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
        self.levels = GroupedLines(
            "Mid-band frequency / Hz", self.add_figure, hertz=True, tip=("Hz", "dB"), dynamics=90.0
        )
        self.overall = Div(sizing_mode="stretch_width", name="overall")
        self.body, self.side = [self.levels.body], [self.overall]

    def compute(self, view: View, tell: Tell) -> Found:
        """Band levels; linear ones from kept power spectra."""

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
            if settings.averaging == "linear":
                return self._kept.levels(recording, chosen.channels, settings)
            return settings(recording)

        return self.of_each(view, tell, analyse)

    def draw(self, found: Found, view: View) -> None:
        """Steps from edge to edge of each band, and the table of overall levels."""
        groups: dict[str, list[Curve]] = {}
        for number, result in found:
            edges = np.append(result.lower_hz, result.upper_hz[-1])
            x = np.repeat(edges, 2)[1:-1]
            for row, name in enumerate(result.channels):
                curves = groups.setdefault(level_label(result.references[row].text), [])
                curves.append(Curve(self.opened.text(number, name), x, np.repeat(result.level_dB[row], 2)))
        self.levels.draw(groups)
        results = [result for _, result in found]
        self.levels.span(min(r.lower_hz[0] for r in results), max(r.upper_hz[-1] for r in results))
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
