"""The staircase of errors: one step of the history after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure

from specan.inspect.plots import plain
from specan.report.figure_style import COLOURS
from specan.study.history import Step


class Staircase:
    """Errors on fitted and on held-out data."""

    def __init__(self) -> None:
        self._steps = ColumnDataSource({"x": [], "fitted": [], "held": []})
        self.sheet = figure(
            title="Errors of the steps", height=300, sizing_mode="stretch_width", tools="save,reset",
            x_range=[""], y_axis_label="RMS error",
        )  # fmt: skip
        kinds = (("fitted", "fitted", COLOURS[0], "solid"), ("held", "held out", COLOURS[1], "dashed"))
        for name, text, colour, dash in kinds:
            self.sheet.step(
                "x", name, source=self._steps, mode="center", color=colour, line_dash=dash, legend_label=text
            )
            self.sheet.scatter("x", name, source=self._steps, color=colour, size=7)
        self.sheet.y_range.start = 0
        self.sheet.xaxis.major_label_orientation = 0.6
        self.sheet.legend.location = "bottom_left"
        self.sheet.toolbar.logo = None
        self.body: Any = self.sheet

    def show(self, steps: Sequence[Step]) -> None:
        """Show a history."""
        texts = [plain(f"{s.step} {s.action} {s.effect}".strip()) for s in steps]
        self.sheet.x_range.factors = texts
        self._steps.data = {
            "x": texts,
            "fitted": [s.fit_error["value"] for s in steps],
            "held": [np.nan if s.held_out_error is None else s.held_out_error["value"] for s in steps],
        }
        if steps:
            error = steps[-1].fit_error
            unit = "" if error["unit"] == "1" else f" / {error['unit']}"
            self.sheet.yaxis[0].axis_label = error["metric"] + unit
