"""Measured beside model: rows of tables, transfer functions of recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, DataRange1d, HoverTool, MultiSelect, Select, Span
from bokeh.plotting import figure

from specan.inspect.look import COLOURS
from specan.inspect.plots import PanelPlot, plain
from specan.inspect.trial import Trial
from specan.report.figure_style import level_limits, with_gaps
from specan.report.figures_study_frf import MeasuredTransfer, level_dB, measured_transfer, phase_deg
from specan.report.panels import Curve, Panel
from specan.report.residual_map import axis_text, map_axes
from specan.study.comparison import readings
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.study.study import Study
from specan.units import printed_unit

_TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
_MOST = 6  # levels that get a colour each
_ORDINATES = (("z", "residual / sigma"), ("residual", "residual"), ("pair", "measured and model"))


class TableAgreement:
    """Rows of all measured tables: what is drawn, over what, and in which colours are choices."""

    def __init__(self, study: Study) -> None:
        self._chosen = [k for k, o in enumerate(study.data.fitted) if isinstance(o, TableObservation)]
        tables = self._tables(study.data.fitted)
        self._known, self._variables = study.data.known, tables[0].variables
        self.labels = _labels(tables)
        several = [name for name in self.labels if name != "row"]
        self._read = self.labels | {
            name: np.concatenate([readings(study.model, o, name) for o in tables]) for name in several
        }
        order = sorted(self.labels, key=lambda n: -np.unique(self.labels[n]).size)
        first = (map_axes(self.labels) or order)[0]
        others = [name for name in order if name != first]
        self._now: Trial | None = None
        self._before: Trial | None = None
        names = [*self.labels, "x", "y", "z", "observable", "colour", "level", "measured", "model"]
        self._rows = ColumnDataSource({name: [] for name in names}, name="rows")
        self._old = ColumnDataSource({"x": [], "y": []}, name="rows-before")
        named = [(name, axis_text(name, self._variables)) for name in order]
        self.ordinate = Select(title="Show", value="z", options=list(_ORDINATES), width=150, name="ordinate")
        self.abscissa = Select(title="over", value=first, options=named, width=170, name="abscissa")
        self.hue = Select(
            title="coloured by", value=others[0] if others else first, options=named, width=170, name="hue"
        )
        for choice in (self.ordinate, self.abscissa, self.hue):
            choice.on_change("value", lambda a, old, new: self._draw())
        self.sheet = figure(
            title="Residual", sizing_mode="stretch_both", tools=_TOOLS, min_height=120, x_axis_label="",
            y_axis_label="", styles={"flex": "1 1 0", "min-height": "0", "background": "var(--paper)"},
            y_range=DataRange1d(),
        )  # fmt: skip
        self._spans = [
            Span(location=place, dimension="width", line_dash="solid" if place == 0 else "dashed")
            for place in (-2, 0, 2)
        ]
        for span in self._spans:
            self.sheet.add_layout(span)
        self.sheet.scatter(
            "x", "y", source=self._old, marker="circle", fill_alpha=0.0, line_color="#9aa3ad", size=6
        )
        dots = self.sheet.scatter(
            "x", "y", source=self._rows, color="colour", size=6, alpha=0.85, legend_field="level"
        )
        tips = [(axis_text(name, self._variables), "@{" + name + "}") for name in self.labels]
        tips += [("measured", "@measured"), ("model", "@model"), ("z", "@z{0.0}"), ("", "@observable")]
        self.sheet.add_tools(HoverTool(renderers=[dots], tooltips=tips))
        self.sheet.toolbar.logo = None
        self.sheet.legend.orientation = "horizontal"
        self.sheet.legend.location = "top_left"
        self.sheet.legend.label_text_font_size = "11px"
        self.sheet.legend.spacing = 8
        self.body: Any = column(
            row(self.ordinate, self.abscissa, self.hue, styles={"flex-wrap": "wrap"}), self.sheet,
            sizing_mode="stretch_both",
            styles={"flex": "1 1 0", "min-height": "0"},
        )  # fmt: skip

    def _tables(self, observations: Any) -> list[TableObservation]:
        return [observations[k] for k in self._chosen]

    def show(self, trial: Trial) -> None:
        """Show another fit of the same rows; beside a trial the model as it is stays as hollow points."""
        if trial.uses:
            self._before = self._before or self._now
        else:
            self._before = None
        self._now = trial
        self._draw()

    def _draw(self) -> None:
        if self._now is None:
            return
        measured, predicted, sigma, names = self._values(self._now)
        levels, colours = _coloured(self.labels[self.hue.value])
        kind = self.ordinate.value
        x = self._read[self.abscissa.value]
        self._rows.data = {
            **self.labels, "x": x, "y": _ordinate(kind, measured, predicted, sigma),
            "z": (predicted - measured) / sigma, "observable": names, "colour": colours, "level": levels,
            "measured": measured, "model": predicted,
        }  # fmt: skip
        old = np.empty(0)
        if kind == "pair":  # the measured ones hollow, the model's filled
            old = measured
        elif self._before is not None:
            old = _ordinate(kind, *self._values(self._before)[:3])
        self._old.data = {"x": x[: old.size], "y": old}
        for place, span in zip((-2, 0, 2), self._spans):
            span.visible = kind == "z" or (kind == "residual" and place == 0)
        self._label(kind, names[0] if names else "")

    def _label(self, kind: str, observable: str) -> None:
        of = "sigma" if self._known else "1 % of it"
        text = {
            "z": f"(model - measured) / {of}",
            "residual": f"model - measured {observable}",
            "pair": observable,
        }
        self.sheet.yaxis[0].axis_label = text[kind].replace("_", " ")
        self.sheet.xaxis[0].axis_label = axis_text(self.abscissa.value, self._variables)
        assert self._now is not None
        what = f" with {self._now.name}" if self._now.uses else ""
        chi2 = f": chi²/n {self._now.fit.reduced_chi2:.2f}" if self._known else ""
        hollow = "; hollow: measured" if kind == "pair" else "; hollow: before" if self._before else ""
        by = axis_text(self.hue.value, self._variables)
        self.sheet.title.text = f"Rows{what}{chi2}; colours: {by}{hollow}"

    def _values(self, trial: Trial) -> tuple[Any, Any, Any, list[str]]:
        tables = self._tables(trial.problem.observations)
        return (
            np.concatenate([o.measured for o in tables]),
            np.concatenate([trial.predictions[k] for k in self._chosen]),
            np.concatenate([o.sigma for o in tables]),
            np.concatenate([o.observable for o in tables]).tolist(),
        )


def _ordinate(kind: str, measured: Any, predicted: Any, sigma: Any) -> Any:
    if kind == "pair":
        return predicted
    return (predicted - measured) / sigma if kind == "z" else predicted - measured


def _coloured(values: Any) -> tuple[list[str], list[str]]:
    """Text of the level of each row, and its colour; many levels go into classes of even counts."""
    levels = np.unique(values)
    if levels.size > _MOST:
        edges = np.unique(np.quantile(values, np.linspace(0, 1, _MOST + 1)))
        place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
        texts = [f"{edges[k]:.4g} to {edges[k + 1]:.4g}" for k in place]
    else:
        place = np.searchsorted(levels, values)
        texts = [f"{value:g}" for value in values]
    return texts, [COLOURS[k % len(COLOURS)] for k in place]


def _labels(tables: list[TableObservation]) -> dict[str, Any]:
    """Operating variables of the rows that vary over them; the number of the row where none does."""
    numbers = [n for n, v in tables[0].labels.items() if v.dtype.kind in "fiu"]
    names = [n for n in numbers if all(n in o.labels for o in tables)]
    found = {n: np.concatenate([np.asarray(o.labels[n], dtype=float) for o in tables]) for n in names}
    varying = {n: v for n, v in found.items() if np.unique(v).size > 1}
    return varying or {"row": np.arange(sum(o.n for o in tables), dtype=float)}


_ALONE = (6, 1, 4)  # colours of measured, model and model before where one microphone is shown
_SHOWN = 1  # microphones at first: the one that the model misses most


class TransferAgreement:
    """Magnitude, phase, and the difference of the levels."""

    def __init__(self, study: Study) -> None:
        observations = study.data.fitted
        self._chosen = [k for k, o in enumerate(observations) if isinstance(o, FrfObservation)]
        recordings = [o for o in observations if isinstance(o, FrfObservation)]
        several = len(recordings) > 1
        self._keys = [
            (f"{number}/{name}", f"{name} · {o.name}" if several else name)
            for number, o in enumerate(recordings)
            for name in o.channels
        ]
        self._unit = study.model.observables[str(recordings[0].observable[0])].unit
        self._found: list[MeasuredTransfer] = []
        self._before: list[MeasuredTransfer] | None = None
        self._title, self._first = "", True
        self.microphones = MultiSelect(
            title="Microphones", options=[(key, plain(text)) for key, text in self._keys], value=[],
            size=min(max(len(self._keys), 4), 24), width=120, name="microphones",
            sizing_mode="stretch_height", stylesheets=["select[multiple].bk-input { height: 100% !important; }"],
        )  # fmt: skip
        self.microphones.on_change("value", lambda a, old, new: self._chosen_anew())
        self.changed: Callable[[tuple[str, ...]], None] = lambda chosen: None  # the page writes its address
        self.magnitude = PanelPlot(3, hertz=True, tip=("Hz", "dB"))
        self.phase = PanelPlot(2, hertz=True, like=self.magnitude, tip=("Hz", "degrees"))
        self.error = PanelPlot(2, hertz=True, like=self.magnitude, tip=("Hz", "dB"))
        for plot in (self.magnitude, self.phase):
            plot.sheet.xaxis[0].major_label_text_font_size = "0px"
        self.error.sheet.xaxis[0].axis_label = "Frequency / Hz"
        grows = {"flex": "1 1 0", "min-height": "0", "min-width": "0"}
        sheets = column(
            self.magnitude.sheet, self.phase.sheet, self.error.sheet, sizing_mode="stretch_both", styles=grows
        )
        self.body: Any = row(self.microphones, sheets, sizing_mode="stretch_both", styles=grows)

    def _chosen_anew(self) -> None:
        self._draw()
        self.changed(tuple(self.microphones.value))

    def choose(self, wanted: Sequence[str]) -> None:
        """Show these microphones; unknown ones are ignored."""
        self.microphones.value = [key for key, _ in self._keys if key in wanted]

    def show(self, trial: Trial) -> None:
        """Show another fit; a tried one is beside the model as it is."""
        found = [
            measured_transfer(o, trial.predictions[k])
            for k in self._chosen
            if isinstance(o := trial.problem.observations[k], FrfObservation)
        ]
        if trial.uses:
            self._before = self._before or self._found
        else:
            self._before = None
        self._found = found
        what = f" with {trial.name}" if trial.uses else ""
        self._title = f"Measured and model{what}: chi²/n {trial.fit.reduced_chi2:.2f}"
        f = found[0].frequency_hz[np.isfinite(found[0].measured).any(axis=0)]
        if trial.uses == () and self._first:
            self._first = False
            self.magnitude.span(float(f.min()), float(f.max()))
        if not self.microphones.value:
            worst = [f"0/{found[0].channels[k]}" for k in found[0].by_misfit()[:_SHOWN]]
            self.microphones.value = worst  # draws
        else:
            self._draw()

    def _draw(self) -> None:
        if not self._found:
            return
        levels, phases, errors = list[Curve](), list[Curve](), list[Curve]()
        styles: dict[str, tuple[int, int]] = {}
        shown = [(key, text) for key, text in self._keys if key in self.microphones.value]
        for place, (key, text) in enumerate(shown):
            number, _, name = key.partition("/")
            one = self._found[int(number)]
            k, f = one.channels.index(name), one.frequency_hz
            hues = _ALONE if len(shown) == 1 else (place,) * 3
            (low, high), level = one.band_dB(), level_dB(one.measured[k])
            phase, reach = with_gaps(phase_deg(one.measured[k])), 2 * one.u_phase_deg[k]
            measured, model, before = (f"{text} {what}" for what in ("measured", "model", "model before"))
            styles |= {measured: (hues[0], 0), model: (hues[1], 1), before: (hues[2], 2)}
            # Two standard uncertainties about what was measured, and about no error.
            levels.append(Curve(measured, f, level, low[k], high[k]))
            phases.append(Curve(measured, f, phase, phase - reach, phase + reach))
            others = [(model, one)] + ([] if self._before is None else [(before, self._before[int(number)])])
            for label, other in others:
                levels.append(Curve(label, f, level_dB(other.model[k])))
                phases.append(Curve(label, f, with_gaps(phase_deg(other.model[k]))))
                band = (low[k] - level, high[k] - level) if other is one else (None, None)
                errors.append(Curve(label, f, other.error_dB[k], *band))
        text = f"Magnitude / dB re 1 {printed_unit(self._unit)}"
        every = np.concatenate([curve.y for curve in levels] or [np.empty(0)])
        self.magnitude.draw(Panel(text, tuple(levels), level_limits(every, 80.0)), styles)
        self.phase.draw(Panel("Phase / degrees", tuple(phases), leads=False, phase=True), styles)
        self.error.draw(Panel("Error / dB", tuple(errors), leads=False), styles)
        self.magnitude.sheet.title.text = plain(self._title)


class Agreement(Protocol):
    """Figures that hold a fitted model beside its measurement.

    Attributes
    ----------
    body : object
        What is laid out.
    """

    body: Any

    def show(self, trial: Trial) -> None:
        """Show another fit."""


VIEWS: dict[str, Callable[[Study], Agreement]] = {"table": TableAgreement, "frf": TransferAgreement}


def agreement_of(study: Study) -> list[Agreement]:
    """One for every kind of measurement of a study."""
    kinds = {o.kind for o in study.data.fitted}  # not of the problem, whose covariances may rest on a fit
    return [view(study) for kind, view in VIEWS.items() if kind in kinds]
