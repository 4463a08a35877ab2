"""Tables: measured against predicted, and the residual of every row."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.layouts import row
from bokeh.models import ColumnDataSource, HoverTool, Range1d, Span
from bokeh.plotting import figure

from specan.inspect.trial import Trial
from specan.report.figure_style import COLOURS
from specan.report.residual_map import axis_text, map_axes
from specan.study.observation.table import TableObservation
from specan.study.study import Study

_TOOLS = "pan,box_zoom,wheel_zoom,reset,save"


class TableAgreement:
    """Two figures over the rows of all measured tables."""

    def __init__(self, study: Study) -> None:
        self._chosen = [k for k, o in enumerate(study.data.fitted) if isinstance(o, TableObservation)]
        tables = self._tables(study.data.fitted)
        self._known = study.data.known
        self.labels = _labels(tables)
        self._across = (map_axes(self.labels) or list(self.labels))[0]
        names = [*self.labels, "across", "measured", "model", "z", "observable", "colour"]
        self._rows = ColumnDataSource({name: [] for name in names})
        measured = np.concatenate([o.measured for o in tables])
        reach = 0.05 * float(np.ptp(measured) or 1.0)
        ends = (float(measured.min()) - reach, float(measured.max()) + reach)
        self.agreement = figure(
            title="Measured and model", height=300, sizing_mode="stretch_width", tools=_TOOLS,
            x_axis_label="measured", y_axis_label="model", x_range=Range1d(*ends), y_range=Range1d(*ends),
        )  # fmt: skip
        self.agreement.line(ends, ends, color="#999999")
        dots = self.agreement.scatter(
            "measured", "model", source=self._rows, color="colour", size=6, alpha=0.8
        )
        of = "sigma" if self._known else "1 % of it"
        self.residual = figure(
            title="Residual", height=300, sizing_mode="stretch_width", tools=_TOOLS,
            x_axis_label=axis_text(self._across, tables[0].variables), y_axis_label=f"(model - measured) / {of}",
        )  # fmt: skip
        for place in (-2, 0, 2):
            self.residual.add_layout(
                Span(location=place, dimension="width", line_color="#999999", line_dash="dashed")
            )
        marks = self.residual.scatter("across", "z", source=self._rows, color="colour", size=6, alpha=0.8)
        tips = [(name, "@{" + name + "}") for name in self.labels] + [("z", "@z{0.0}"), ("", "@observable")]
        for sheet, glyph in ((self.agreement, dots), (self.residual, marks)):
            sheet.add_tools(HoverTool(renderers=[glyph], tooltips=tips))
            sheet.toolbar.logo = None
        self.body: Any = row(self.agreement, self.residual, sizing_mode="stretch_width")

    def _tables(self, observations: Any) -> list[TableObservation]:
        return [observations[k] for k in self._chosen]

    def show(self, trial: Trial) -> None:
        """Show another fit of the same rows."""
        tables = self._tables(trial.problem.observations)
        measured = np.concatenate([o.measured for o in tables])
        predicted = np.concatenate([trial.predictions[k] for k in self._chosen])
        sigma = np.concatenate([o.sigma for o in tables])
        names = np.concatenate([o.observable for o in tables]).tolist()
        kinds = dict(zip(dict.fromkeys(names), COLOURS))
        self._rows.data = {
            **self.labels, "across": self.labels[self._across], "measured": measured, "model": predicted,
            "z": (predicted - measured) / sigma, "observable": names, "colour": [kinds[name] for name in names],
        }  # fmt: skip
        what = f" with {trial.name}" if trial.uses else ""
        chi2 = f": chi2/n {trial.fit.reduced_chi2:.2f}" if self._known else ""
        self.residual.title.text = f"Residual{what}{chi2}"


def _labels(tables: list[TableObservation]) -> dict[str, Any]:
    """Operating variables of the rows that vary over them; the number of the row where none does."""
    numbers = [n for n, v in tables[0].labels.items() if v.dtype.kind in "fiu"]
    names = [n for n in numbers if all(n in o.labels for o in tables)]
    found = {n: np.concatenate([np.asarray(o.labels[n], dtype=float) for o in tables]) for n in names}
    varying = {n: v for n, v in found.items() if np.unique(v).size > 1}
    return varying or {"row": np.arange(sum(o.n for o in tables), dtype=float)}
