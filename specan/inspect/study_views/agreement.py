"""Measured beside model: rows of tables, transfer functions of recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Div, MultiSelect, ScrollBox, Select
from matplotlib.figure import Figure

from specan.inspect.look import COLOURS, GROWS
from specan.inspect.plots import Plots, plain
from specan.inspect.trial import Trial
from specan.report.figures import figure_named
from specan.report.figures_study import RESPONSES, MeasuredTransfer, measured_transfer, response_drawing
from specan.report.html_page import picture
from specan.report.panels import Curve, Drawing, joined
from specan.report.residual_map import axis_text
from specan.report.study_rows import Rows, table_rows
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.study.study import Study

_ORDINATES = [("z", "residual / sigma"), ("residual", "residual"), ("pair", "measured and model")]


MOST_ROWS = 5000  # that a browser draws at once; of more, evenly chosen ones are shown


class TableAgreement:
    """Rows of all measured tables, or samples: what is drawn, over what, and in which colours are choices."""

    def __init__(self, study: Study) -> None:
        self._model, self._known = study.model, study.data.known
        tables = {k: o for k, o in enumerate(study.data.fitted) if isinstance(o, TableObservation)}
        self._chosen = list(tables)
        rows = table_rows(self._model, [*tables.values()], [o.measured for o in tables.values()], self._known)
        named = [(name, axis_text(name, rows.variables)) for name in rows.axes]
        self._now: Trial | None = None
        self._before: Trial | None = None
        self._text = dict(named)
        self.ordinate = Select(title="Show", value="z", options=_ORDINATES, width=150, name="ordinate")
        self.abscissa, self.hue = (
            Select(title=title, value=[*rows.axes, ""][place], options=[*named, *more], width=200, name=name)
            for title, place, name, *more in (
                ("over", 0, "abscissa"),
                ("coloured by", 1, "hue", ("", "nothing")),
            )
        )
        for choice in (self.ordinate, self.abscissa, self.hue):
            choice.on_change("value", lambda a, old, new: self._draw())
        self.plots = Plots(tip=("x", "y"))
        choices = row(self.ordinate, self.abscissa, self.hue, styles={"flex-wrap": "wrap"})
        self.body: Any = column(choices, self.plots.body, sizing_mode="stretch_both", styles=GROWS)

    def _rows(self, trial: Trial) -> Rows:
        tables = [o for k in self._chosen if isinstance(o := trial.problem.observations[k], TableObservation)]
        rows = table_rows(self._model, tables, [trial.predictions[k] for k in self._chosen], self._known)
        return rows.at(slice(None, None, 1 + len(rows.frame) // MOST_ROWS))

    def show(self, trial: Trial) -> None:
        """Show another fit of the same rows; beside a trial the model as it is stays, pale."""
        self._before = (self._before or self._now) if trial.uses else None
        self._now = trial
        self._draw()

    def _draw(self) -> None:
        if self._now is None:
            return
        rows, kind, x = self._rows(self._now), self.ordinate.value, self.abscissa.value
        panel = rows.panel(kind, x, self.hue.value)
        styles = {curve.name: (k % len(COLOURS), 0) for k, curve in enumerate(panel.curves)}
        pale = list[Curve]()
        if kind == "pair":
            pale = [Curve("measured", rows.read[x].to_numpy(), rows.frame["measured"].to_numpy())]
        elif self._before is not None:
            old = self._rows(self._before).panel(kind, x, self.hue.value).curves
            pale = [replace(curve, name="before") for curve in old]
        what = f" with {self._now.name}" if self._now.uses else ""
        chi2 = f": chi²/n {self._now.fit.reduced_chi2:.2f}" if self._known else ""
        grey = f"; grey: {pale[0].name}" if pale else ""
        title = f"Measured and model{what}{chi2}{grey}"
        panel = replace(panel, curves=(*pale, *panel.curves))
        low, high = float(rows.read[x].min()), float(rows.read[x].max())
        margin = 0.03 * (high - low) or 1.0
        ends = low - margin, high + margin
        self.plots.draw(Drawing("", (title,), self._text[x], (panel,), x_limits=ends), styles)


_ALONE = (6, 1, 4)  # colours of measured, model and model before where one microphone is shown


class TransferAgreement:
    """Magnitude, phase, and the difference of the levels."""

    def __init__(self, study: Study) -> None:
        recordings = {k: o for k, o in enumerate(study.data.fitted) if isinstance(o, FrfObservation)}
        self._chosen = list(recordings)
        self._texts = {
            f"{number}/{name}": f"{name} · {o.name}" if len(recordings) > 1 else name
            for number, o in enumerate(recordings.values())
            for name in o.channels
        }
        first = next(iter(recordings.values()))
        self._unit = study.model.observables[str(first.observable[0])].unit
        self._found: list[MeasuredTransfer] = []
        self._before: list[MeasuredTransfer] = []
        self._title = ""
        self.microphones = MultiSelect(
            title=first.plural.capitalize(), value=[],
            options=[(key, plain(text)) for key, text in self._texts.items()],
            size=min(max(len(self._texts), 4), 24), width=120, name="microphones",
            sizing_mode="stretch_height", stylesheets=["select[multiple].bk-input { height: 100% !important; }"],
        )  # fmt: skip
        self.microphones.on_change("value", lambda a, old, new: self._chosen_anew())
        self.changed: Callable[[tuple[str, ...]], None] = lambda chosen: None  # the page writes its address
        self.plots = Plots(hertz=True, tip=("Hz", "value"))
        self.body: Any = row(
            self.microphones, self.plots.body, sizing_mode="stretch_both", styles=GROWS,
            css_classes=["stacked", "figures"],
        )  # fmt: skip

    def _chosen_anew(self) -> None:
        self._draw()
        self.changed(tuple(self.microphones.value))

    def choose(self, wanted: Sequence[str]) -> None:
        """Show these microphones; unknown ones are ignored."""
        self.microphones.value = [key for key in self._texts if key in wanted]

    def show(self, trial: Trial) -> None:
        """Show another fit; a tried one is beside the model as it is."""
        self._before = (self._before or self._found) if trial.uses else []
        self._found = [
            measured_transfer(o, trial.predictions[k])
            for k in self._chosen
            if isinstance(o := trial.problem.observations[k], FrfObservation)
        ]
        what = f" with {trial.name}" if trial.uses else ""
        self._title = f"Measured and model{what}: chi²/n {trial.fit.reduced_chi2:.2f}"
        if self.microphones.value:
            self._draw()
        else:  # at first the one that the model misses most
            self.choose([f"0/{self._found[0].channels[self._found[0].by_misfit()[0]]}"])

    def _draw(self) -> None:
        shown = [key for key in self._texts if key in self.microphones.value]
        if not self._found or not shown:
            return
        drawings, styles = list[Drawing](), dict[str, tuple[int, int]]()
        for place, key in enumerate(shown):
            number, _, name = key.partition("/")
            found, text = self._found[int(number)], self._texts[key]
            before = self._before[int(number)] if self._before else None
            drawings.append(response_drawing(found, found.channels.index(name), self._unit, before, text))
            hues = _ALONE if len(shown) == 1 else (place % len(COLOURS),) * len(RESPONSES)
            styles |= {f"{text} {what}": (hue, dash) for dash, (what, hue) in enumerate(zip(RESPONSES, hues))}
        self.plots.draw(replace(joined(drawings), facts=(self._title,)), styles)


class DrawnAgreement:
    """The figure of ``specan study compare --plot``, where a model brings its own; of the model as it is."""

    def __init__(self, draw: Callable[[Study], Figure], current: Callable[[], Study]) -> None:
        self._draw, self._current = draw, current
        self.body: Any = ScrollBox(
            child=Div(name="drawn", sizing_mode="stretch_width"), sizing_mode="stretch_both", styles=GROWS,
            css_classes=["whole"],
        )  # fmt: skip

    def show(self, trial: Trial) -> None:
        """Draw it, but for a trial."""
        if not trial.uses:
            self.body.child.text = picture(self._draw(self._current()), "Measured and model")


Agreement = TableAgreement | TransferAgreement | DrawnAgreement


def agreement_of(study: Study, current: Callable[[], Study]) -> list[Agreement]:
    """Figures that hold a fitted model beside its measurement: one for every kind of measurement of a study."""
    data = study.data.fitted  # not of the problem, whose covariances may rest on a fit
    found = list[Agreement]()
    if any(isinstance(o, TableObservation) for o in data):
        found.append(TableAgreement(study))
    if any(isinstance(o, FrfObservation) for o in data):
        found.append(TransferAgreement(study))
    if not found and (draw := figure_named(f"Comparison {data[0].kind}")) is not None:
        found.append(DrawnAgreement(draw, current))
    return found
