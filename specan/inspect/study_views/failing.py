"""The residual map: third octave x microphone, torque x speed."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, Div, HoverTool, LinearColorMapper
from bokeh.palettes import PuOr11

from specan.inspect.header import notice
from specan.inspect.plots import panel, plain
from specan.inspect.trial import Trial
from specan.report.residual_map import ResidualMap, axis_text
from specan.study.study import Study

_PALE = "#c3c8cf"  # outline of a cell that is not significant: an error near zero is as white as the paper


class FailingMap:
    """Left-out z of every pair of levels; a frame where it is significant."""

    def __init__(self, study: Study) -> None:
        self._colours = LinearColorMapper(palette=PuOr11, low=-1, high=1)
        self._cells = ColumnDataSource(
            {"x": [], "y": [], "z": [], "n": [], "edge": [], "width": [], "text": []}
        )
        self._known = study.data.known
        self.sheet = panel(
            3, title="Where the model fails", x_range=[""], y_range=[""], x_axis_label="", y_axis_label=""
        )
        boxes = self.sheet.rect(
            "x", "y", 0.96, 0.94, source=self._cells, line_color="edge", line_width="width",
            fill_color={"field": "z", "transform": self._colours},
        )  # fmt: skip
        self._hover = HoverTool(renderers=[boxes], tooltips=[])
        self.sheet.add_tools(self._hover)
        self.sheet.add_layout(ColorBar(color_mapper=self._colours, title="sigma", width=10), "right")
        self.sheet.xaxis.major_label_orientation = 0.8
        self.sheet.grid.visible = False
        self._missing = Div(text=notice("No operating variable varies: there is no map."), visible=False)
        self.body: Any = [self.sheet, self._missing]

    def show(self, trial: Trial) -> None:
        """Show the map of a fit."""
        found = trial.where
        self.sheet.visible, self._missing.visible = found is not None, found is None
        if found is None:
            return
        self._colours.update(low=-found.end, high=found.end)
        self.sheet.x_range.factors = [plain(text) for text in found.columns]
        self.sheet.y_range.factors = [plain(text) for text in found.rows]
        across, up = (axis_text(name, found.variables) for name in (found.across, found.up))
        self.sheet.xaxis.axis_label, self.sheet.yaxis.axis_label = across, up
        self._hover.tooltips = [
            (across, "@x"), *([(up, "@y")] if up else []),
            ("left-out z, positive: model high", "@z{0.0}"), ("", "@text"), ("values", "@n"),
        ]  # fmt: skip
        self._cells.data = _cells(found)
        self.sheet.title.text = self._title(found)

    def _title(self, found: ResidualMap) -> str:
        if self._known and not found.significant.any():
            return "No significant deviation of the model"
        of = "framed: significant" if self._known else "relative to 1 %"
        return f"Violet: low, orange: high; {of}"


def _cells(found: ResidualMap) -> dict[str, list[Any]]:
    places = [(int(i), int(j)) for i, j in np.argwhere(np.isfinite(found.z))]
    return {
        "x": [plain(found.columns[j]) for _, j in places],
        "y": [plain(found.rows[i]) for i, _ in places],
        "z": [float(found.z[p]) for p in places],
        "text": [plain(found.texts[i][j]) for i, j in places],
        "n": [int(found.count[p]) for p in places],
        "edge": ["#808894" if found.significant[p] else _PALE for p in places],
        "width": [1.5 if found.significant[p] else 0.5 for p in places],
    }
