"""Band levels: fraction, weighting, averaging, range; overall levels beside them."""

from __future__ import annotations

import numpy as np
from bokeh.models import Div

from specan.analysis.octave import Octave
from specan.data.band_levels import BandLevels
from specan.data.recording import Recording
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.header import sheet
from specan.inspect.kept_bands import KeptBands
from specan.inspect.opened import Chosen, Opened
from specan.inspect.plots import Curve
from specan.inspect.tabs.tab import Change, Found, Tab, Tell
from specan.inspect.view import View
from specan.report.figure_style import level_label, micro
from specan.schema import parse


class OctaveTab(Tab):
    """The octave spectrum."""

    name, title = "octave", "Octave"

    def __init__(self, opened: Opened, view: View, change: Change, kept: KeptBands) -> None:
        super().__init__(opened, view, change)
        self._kept = kept
        self.choice(view, "fraction", "1/N octave", [1, 3, 6, 12, 24], 80)
        self.choice(view, "weighting", "Weighting", ["Z", "A", "B", "C"], 80)
        names = ["linear", "fast", "slow", "impulse"]
        self.choice(
            view, "averaging", "Averaging", [*names, *({view.averaging} - set(names)), *_constants(view)]
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
            settings = octave_settings(view, chosen)
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


def octave_settings(view: View, chosen: Chosen) -> Octave:
    """The settings of the command for what is on screen."""
    named = view.averaging in ("linear", "fast", "slow", "impulse")
    nyquist = chosen.channels[0].sampling_rate / 2
    return parse(
        Octave,
        {
            "fraction": view.fraction,
            "weighting": view.weighting,
            "averaging": view.averaging if named else float(view.averaging),
            "hold": None if view.averaging == "linear" else view.hold or None,
            "fmin": view.fmin,
            # Of several rates each goes as far as it can.
            "fmax": view.fmax if view.fmax <= 0.8 * nyquist else None,
            "channels": chosen.patterns,
            "start_s": view.start,
            "stop_s": view.stop,
        },
        "octave",
    )


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
