"""The page of a study: measured beside model, where it fails, effects to try and to accept, the history."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import (
    Button,
    ColorBar,
    ColumnDataSource,
    Div,
    HoverTool,
    LinearColorMapper,
    ScrollBox,
    Span,
    TextInput,
)
from bokeh.palettes import PuOr11
from bokeh.plotting import figure

from specan.inspect.sheets import notice, sheet
from specan.inspect.superseded import Tell
from specan.inspect.trial import Trial, as_it_is, candidates_of, tables_of, try_effect
from specan.inspect.work import Work
from specan.report.figure_style import COLOURS
from specan.study.change import Change, add_effect
from specan.study.study import Study

if TYPE_CHECKING:
    from bokeh.document import Document

_TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
Z_SHOWN = 6.0  # end of the colour scale of the map


class StudyPage:
    """Everything on the page of one browser window; accepting writes the study, as ``specan study add`` does."""

    def __init__(self, document: Document, directory: Path) -> None:
        self.document, self.directory = document, directory
        self.study = Study(directory)
        self.labels = _labels(self.study)
        self.work = Work(document, lambda part: None, self._failed)
        self.status = Div(text="", name="status", height=20)
        self.verdict = Div(text="", name="trial", sizing_mode="stretch_width")
        self.history = Div(text="", name="history", sizing_mode="stretch_width")
        self.reason = TextInput(title="Because", placeholder="for the history", width=220, name="because")
        self.accept = Button(label="Accept", button_type="primary", disabled=True, width=220, name="accept")
        self.accept.on_click(self._accept)
        self.tried: Trial | None = None
        self.list = column(name="candidates")
        self._figures()
        self._lay_out()
        document.on_session_destroyed(lambda context: self.work.close())
        self.now = as_it_is(self.study)
        self._show(self.now)
        self._show_study()

    def _figures(self) -> None:
        self.rows = ColumnDataSource({})
        self.agreement = figure(
            title="Measured and model", height=300, sizing_mode="stretch_width", tools=_TOOLS,
            x_axis_label="measured", y_axis_label="model",
        )  # fmt: skip
        self.agreement.line([-1e9, 1e9], [-1e9, 1e9], color="#999999")
        dots = self.agreement.scatter(
            "measured", "model", source=self.rows, color="colour", size=6, alpha=0.8
        )
        self.agreement.x_range.renderers = self.agreement.y_range.renderers = [dots]
        self.residual = figure(
            title="Residual", height=300, sizing_mode="stretch_width", tools=_TOOLS,
            x_axis_label=self._across(), y_axis_label="(model - measured) / sigma",
        )  # fmt: skip
        for place in (-2, 0, 2):
            self.residual.add_layout(
                Span(location=place, dimension="width", line_color="#999999", line_dash="dashed")
            )
        marks = self.residual.scatter("across", "z", source=self.rows, color="colour", size=6, alpha=0.8)
        tips = [(name, "@{" + name + "}") for name in self.labels] + [("z", "@z{0.0}"), ("", "@observable")]
        for sheet_, glyph in ((self.agreement, dots), (self.residual, marks)):
            sheet_.add_tools(HoverTool(renderers=[glyph], tooltips=tips))
            sheet_.toolbar.logo = None
        self.colours = LinearColorMapper(palette=PuOr11[::-1], low=-Z_SHOWN, high=Z_SHOWN)
        self.cells = ColumnDataSource({"x": [], "y": [], "z": [], "n": []})
        across, up = self._map_axes()
        levels = [sorted({f"{v:g}" for v in self.labels[n]}, key=float) for n in (across, up)]
        self.map = figure(
            title="Where the model fails", height=300, sizing_mode="stretch_width", tools="save",
            x_range=levels[0], y_range=levels[1], x_axis_label=across, y_axis_label=up,
        )  # fmt: skip
        boxes = self.map.rect(
            "x",
            "y",
            1,
            1,
            source=self.cells,
            fill_color={"field": "z", "transform": self.colours},
            line_color="white",
        )
        self.map.add_tools(
            HoverTool(
                renderers=[boxes],
                tooltips=[(across, "@x"), (up, "@y"), ("mean z", "@z{0.0}"), ("values", "@n")],
            )
        )
        self.map.add_layout(ColorBar(color_mapper=self.colours, title="mean z"), "right")
        self.map.xaxis.major_label_orientation = 0.8
        self.map.toolbar.logo = None
        self.steps = ColumnDataSource({"x": [], "fitted": [], "held": []})
        self.staircase = figure(
            title="Errors of the steps", height=300, sizing_mode="stretch_width", tools="save,reset",
            x_range=[""], y_axis_label="RMS error",
        )  # fmt: skip
        for name, text, colour in (("fitted", "fitted", COLOURS[0]), ("held", "held out", COLOURS[1])):
            self.staircase.step("x", name, source=self.steps, mode="center", color=colour, legend_label=text)
            self.staircase.scatter("x", name, source=self.steps, color=colour, size=7)
        self.staircase.y_range.start = 0
        self.staircase.xaxis.major_label_orientation = 0.6
        self.staircase.legend.location = "bottom_left"
        self.staircase.toolbar.logo = None

    def _map_axes(self) -> tuple[str, str]:
        """The two operating variables with most levels."""
        counts = {n: np.unique(v).size for n, v in self.labels.items()}
        order = sorted(counts, key=lambda n: (-counts[n], n))
        return order[0], order[1] if len(order) > 1 else order[0]

    def _across(self) -> str:
        return self._map_axes()[0]

    def _lay_out(self) -> None:
        title = self.directory.resolve().name
        self.heading = Div(text="", name="model", width=300)
        left = column(
            Div(text=f"<b>{notice(title)}</b>", width=300), self.heading,
            Div(text="<b>What could be missing</b>", width=300),
            ScrollBox(child=self.list, width=310, height=470), self.reason, self.accept, width=320,
        )  # fmt: skip
        right = column(
            self.status,
            row(self.agreement, self.residual, sizing_mode="stretch_width"),
            self.verdict,
            row(self.map, self.staircase, sizing_mode="stretch_width"),
            self.history,
            sizing_mode="stretch_width",
        )
        self.document.add_root(row(left, right, sizing_mode="stretch_width"))
        self.document.title = f"{title} - specan"

    # --- showing ----------------------------------------------------------------------------------

    def _show(self, trial: Trial) -> None:
        kinds = dict(zip(dict.fromkeys(trial.observable.tolist()), COLOURS))
        self.rows.data = {
            **self.labels, "across": self.labels[self._across()], "measured": trial.measured,
            "model": trial.predicted, "z": trial.z, "observable": trial.observable.tolist(),
            "colour": [kinds[name] for name in trial.observable.tolist()],
        }  # fmt: skip
        names = self._map_axes()
        cells: dict[tuple[str, str], list[float]] = {}
        for a, b, z in zip(*(self.labels[n] for n in names), trial.z):
            cells.setdefault((f"{a:g}", f"{b:g}"), []).append(float(z))
        self.cells.data = {
            "x": [a for a, _ in cells], "y": [b for _, b in cells],
            "z": [float(np.mean(v)) for v in cells.values()], "n": [len(v) for v in cells.values()],
        }  # fmt: skip
        what = f" with {trial.name}" if trial.name else ""
        self.residual.title.text = f"Residual{what}: chi2/n {trial.fit.reduced_chi2:.2f}"
        rows = [
            [
                e.observable,
                e.n,
                f"{e.rms:.4g} {'' if e.unit == '1' else e.unit}",
                f"{e.relative_rms:.2f} %",
                _before(k, self.now, e),
            ]
            for k, e in enumerate(trial.errors)
        ]
        self.verdict.text = sheet(["Observable", "values", "RMS error", "relative", "before"], rows) + sheet(
            ["Parameter", "value", "95 %", "unit", ""], trial.parameters
        )

    def _show_study(self) -> None:
        effects = ", ".join(self.study.model_effects) or "none, the ideal machine"
        self.heading.text = notice(f"{self.study.model.title}. Effects: {effects}")
        found, not_testable = candidates_of(self.study)
        children: list[Any] = []
        for candidate in found:
            name = str(candidate.use)
            button = Button(label="Try", width=55, name=f"try-{name}")
            button.on_click(partial(self._try, name))
            children.append(row(button, Div(text=notice(name), width=220)))
        children += [Div(text=notice(f"{n}: {why}"), width=280) for n, why in not_testable.items()]
        self.list.children = children
        steps = self.study.history.steps
        texts = [f"{s.step} {s.action} {s.effect}".strip() for s in steps]
        self.staircase.x_range.factors = texts
        self.steps.data = {
            "x": texts,
            "fitted": [s.fit_error["value"] for s in steps],
            "held": [np.nan if s.held_out_error is None else s.held_out_error["value"] for s in steps],
        }
        if steps:
            error = steps[-1].fit_error
            self.staircase.yaxis[0].axis_label = error["metric"] + (
                "" if error["unit"] == "1" else f" / {error['unit']}"
            )
        rows = [
            [s.step, f"{s.action} {s.effect}".strip(), s.because, f"{s.fit_error['value']:.4g}",
             "" if s.held_out_error is None else f"{s.held_out_error['value']:.4g}"]
            for s in steps
        ]  # fmt: skip
        self.history.text = sheet(["Step", "what", "because", "fitted", "held out"], rows)

    # --- what a person does -----------------------------------------------------------------------

    def _try(self, name: str) -> None:
        self.status.text = notice(f"Fitting with {name} ...", "busy")
        self.accept.disabled = True
        study = self.study

        def show(trial: Trial) -> None:
            self.tried = trial
            self._show(trial)
            self.status.text = notice(f"{name} is tried, not accepted.")
            self.accept.update(label=f"Accept {name}", disabled=False)

        self.work.ask(lambda tell: try_effect(study, name), show)

    def _accept(self) -> None:
        if self.tried is None:
            return
        name, because = self.tried.name, self.reason.value
        self.status.text = notice(f"Adding {name} ...", "busy")
        self.accept.disabled = True

        def add(tell: Tell) -> Change:
            # Read anew: another window or the command may have changed it meanwhile.
            return add_effect(Study(self.directory), name, because)

        def show(change: Change) -> None:
            self.study, self.tried = change.study, None
            self.now = as_it_is(self.study)
            self._show(self.now)
            self._show_study()
            self.reason.value = ""
            self.accept.update(label="Accept", disabled=True)
            self.status.text = notice("; ".join([f"{name} is in the model now", *change.remarks]) + ".")

        self.work.ask(add, show)

    def _failed(self, message: str) -> None:
        self.status.text = notice(message, "error")


def _labels(study: Study) -> dict[str, Any]:
    """Operating variables of the rows that vary over them; the number of the row where none does."""
    tables = tables_of(study.problem)
    names = [n for n in tables[0].labels if n != "measurement" and all(n in o.labels for o in tables)]
    found = {n: np.concatenate([np.asarray(o.labels[n], dtype=float) for o in tables]) for n in names}
    varying = {n: v for n, v in found.items() if np.unique(v).size > 1}
    return varying or {"row": np.arange(sum(o.n for o in tables), dtype=float)}


def _before(number: int, now: Trial, error: Any) -> str:
    same = now.errors[number] if number < len(now.errors) else None
    return "" if same is None or same.observable != error.observable else f"{same.rms:.4g}"
