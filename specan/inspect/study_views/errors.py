"""The errors of a study as pictures: step after step, the trial on screen, and where the model fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    Div,
    FactorRange,
    HoverTool,
    LabelSet,
    LinearColorMapper,
    Range1d,
)
from bokeh.palettes import PuOr11

from specan.inspect.look import COLOURS, notice
from specan.inspect.plots import panel, plain
from specan.inspect.trial import Trial
from specan.report.residual_map import ResidualMap, axis_text
from specan.study.history import Step
from specan.study.study import Study
from specan.units import axis_label

_KINDS = (("fitted", "fit_error", COLOURS[0]), ("held out", "held_out_error", COLOURS[1]))
_MOST = 7  # steps on screen: the latest
_ABOVE = 1.35  # height of the figure over that of the highest bar, whose number stands above it


class Staircase:
    """Errors on fitted and on held-out data, as bars that carry their numbers."""

    def __init__(self) -> None:
        self._bars = ColumnDataSource(
            {"x": [], "top": [], "colour": [], "text": [], "alpha": [], "about": []}
        )
        self.sheet = panel(
            2, title="Fitted (blue), held out (orange)", x_range=FactorRange(), y_range=Range1d(0, 1)
        )
        bars = self.sheet.vbar(
            "x", top="top", width=0.9, source=self._bars, color="colour", alpha="alpha", line_color=None
        )
        self.sheet.add_tools(HoverTool(renderers=[bars], tooltips=[("step", "@about"), ("RMS", "@text")]))
        self.sheet.add_layout(
            LabelSet(
                x="x", y="top", text="text", source=self._bars, text_align="left", text_baseline="middle",
                angle=np.pi / 2, y_offset=3, text_font_size="10px", text_color="#808894",
            )
        )  # fmt: skip
        self.sheet.xgrid.visible = False
        self.sheet.xaxis.major_label_text_font_size = "0px"
        self.sheet.xaxis.major_tick_line_color = None
        self.sheet.xaxis.group_text_font_size = "11px"
        self.sheet.xaxis.group_text_color = "#808894"
        self.sheet.x_range.group_padding = 0.6
        self._steps: Sequence[Step] = ()
        self._tried: tuple[str, Mapping[str, Any]] | None = None
        self.body: Any = self.sheet

    def show(self, steps: Sequence[Step]) -> None:
        """Show a history."""
        self._steps = steps[-_MOST:]
        self._draw()

    def tried(self, name: str, error: Mapping[str, Any] | None) -> None:
        """Show what a trial leaves on the fitted data, as a pale step; None takes it away."""
        self._tried = None if error is None else (name, error)
        self._draw()

    def _draw(self) -> None:
        # The names of effects would run into one another: the mouse and the history show them.
        rows = [
            (
                f"{s.step}\n{s.action}",
                kind,
                error["value"],
                colour,
                1.0,
                plain(f"{s.step} {s.action} {s.effect}".strip()),
            )
            for s in self._steps
            for kind, attribute, colour in _KINDS
            if (error := getattr(s, attribute)) is not None
        ]
        if self._tried is not None:
            name, error = self._tried
            rows.append(("try", "fitted", error["value"], COLOURS[0], 0.45, plain(f"try {name}")))
        known = [r for r in rows if r[2] is not None and np.isfinite(r[2])]
        self.sheet.x_range.factors = [(name, kind) for name, kind, *_ in known]
        self.sheet.y_range.end = _ABOVE * max((r[2] for r in known), default=1.0)
        self._bars.data = {
            "x": [(name, kind) for name, kind, *_ in known],
            "top": [r[2] for r in known],
            "text": [f"{r[2]:.3g}" for r in known],
            "colour": [r[3] for r in known],
            "alpha": [r[4] for r in known],
            "about": [r[5] for r in known],
        }
        if self._steps:
            error = self._steps[-1].fit_error
            self.sheet.yaxis[0].axis_label = axis_label(error["metric"], error["unit"])


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
