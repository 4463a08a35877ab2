"""The box in which a field was measured: its faces, the receivers in their places, and where the model fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.layouts import column
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    HoverTool,
    LabelSet,
    LinearColorMapper,
    Range1d,
    Select,
    TapTool,
)
from bokeh.palettes import PuOr11

from specan.inspect.plots import panel, plain
from specan.inspect.trial import Trial
from specan.study.localisation.frf_errors import FrfErrors, curve_errors
from specan.study.observation.frf import FrfObservation
from specan.study.study import Study

_LEAST_DB = 1.0  # end of the colour scale at least
# Oblique projection: x to the right, z up, y into the picture.
_INTO = np.array([0.42, 0.30])


class PlacesView:
    """An oblique view; a click on a receiver shows its curves.

    Parameters
    ----------
    study : Study
        Of transfer functions at places.
    chosen : callable
        Called with the keys (``0/NAME``) of receivers that were clicked.
    """

    def __init__(self, study: Study, chosen: Callable[[tuple[str, ...]], None]) -> None:
        self._receivers = study.model.receivers
        assert self._receivers is not None
        places = self._receivers.places
        self._extent = np.array(places.extent_m if places else self._receivers.positions_m.max(axis=0))
        self._observations = [k for k, o in enumerate(study.data.fitted) if isinstance(o, FrfObservation)]
        self._errors: FrfErrors | None = None
        self._colours = LinearColorMapper(palette=PuOr11, low=-1, high=1)
        fields = ["x", "y", "foot_x", "foot_y", "name", "error", "key", "where"]
        self._points = ColumnDataSource({name: [] for name in fields}, name="places")
        self.band = Select(title="Third octave / Hz", value="", options=[], width=130, name="place-band")
        self.band.on_change("value", lambda a, old, new: self._draw())
        self.sheet = self._figure()

        def tapped(attribute: str, old: Any, new: Sequence[int]) -> None:
            if new:
                chosen(tuple(self._points.data["key"][k] for k in new))

        self._points.selected.on_change("indices", tapped)
        self.body: Any = column(
            self.band, self.sheet, sizing_mode="stretch_both", styles={"flex": "3 1 0", "min-height": "0"}
        )

    def _figure(self) -> Any:
        corners = self._flat(
            np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * self._extent
        )
        low, high = corners.min(axis=0), corners.max(axis=0)
        margin = 0.09 * (high - low)
        sheet = panel(
            1, title="Level error", match_aspect=True,
            x_range=Range1d(low[0] - margin[0], high[0] + margin[0]),
            y_range=Range1d(low[1] - margin[1], high[1] + margin[1]),
        )  # fmt: skip
        sheet.axis.visible = sheet.grid.visible = False
        for line, dash in self._edges():
            sheet.line(line[:, 0], line[:, 1], line_color="#808894", line_dash=dash)
        sheet.add_layout(LabelSet(
            x="x", y="y", text="text", source=ColumnDataSource(self._faces()), text_color="#808894",
            text_font_size="11px", text_align="center", text_baseline="middle",
        ))  # fmt: skip
        sheet.segment(
            "x",
            "y",
            "foot_x",
            "foot_y",
            source=self._points,
            line_color="#808894",
            line_alpha=0.5,
            line_dash="dotted",
        )
        dots = sheet.scatter(
            "x", "y", source=self._points, size=15, line_color="#555b66", nonselection_alpha=1.0,
            fill_color={"field": "error", "transform": self._colours},
        )  # fmt: skip
        sheet.add_layout(LabelSet(
            x="x", y="y", text="name", source=self._points, x_offset=9, y_offset=4, text_font_size="10px",
            text_color="#808894",
        ))  # fmt: skip
        tips = [("", "@name"), ("m", "@where"), ("model - measured", "@error{+0.00} dB")]
        sheet.add_tools(HoverTool(renderers=[dots], tooltips=tips), TapTool(renderers=[dots]))
        sheet.add_layout(ColorBar(color_mapper=self._colours, title="dB", width=10), "right")
        return sheet

    def _flat(self, points: Any) -> Any:
        """Places in the picture."""
        points = np.asarray(points, dtype=float)
        return points[:, [0, 2]] + points[:, 1:2] * _INTO

    def _edges(self) -> list[tuple[Any, str]]:
        """The twelve edges; those behind are dotted."""
        found = []
        for axis in range(3):
            others = [a for a in range(3) if a != axis]
            for i in (0, 1):
                for j in (0, 1):
                    ends = np.zeros((2, 3))
                    ends[:, others[0]], ends[:, others[1]] = i, j
                    ends[1, axis] = 1
                    hidden = (ends[:, 0] == 0).all() or (ends[:, 1] == 1).all() or (ends[:, 2] == 0).all()
                    behind = hidden and not ((ends[:, 1] == 0).all() or (ends[:, 2] == 1).all())
                    found.append((self._flat(ends * self._extent), "dotted" if behind else "solid"))
        return found

    def _faces(self) -> dict[str, Any]:
        names, centres = [], []
        for axis, letter in enumerate("xyz"):
            for end in (0, 1):
                centre = np.full(3, 0.5)
                centre[axis] = end
                names.append(f"{letter}{end}")
                centres.append(centre * self._extent)
        flat = self._flat(np.array(centres))
        return {"x": flat[:, 0], "y": flat[:, 1], "text": names}

    def show(self, trial: Trial) -> None:
        """Show the errors of a fit."""
        k = self._observations[0]
        observation = trial.problem.observations[k]
        assert isinstance(observation, FrfObservation)
        self._errors = curve_errors(observation, trial.predictions[k])
        bands, worst = self._errors.band_texts, self._errors.worst_band
        self.band.options = [("", f"worst: {bands[worst]}"), *((b, b) for b in bands)]
        self._worst = worst
        self._draw()

    def _draw(self) -> None:
        errors = self._errors
        if errors is None:
            return
        band = self._worst if not self.band.value else errors.band_texts.index(self.band.value)
        level = errors.level_dB[:, band]
        rows = [k for k, value in enumerate(level) if np.isfinite(value)]
        assert self._receivers is not None
        at = self._receivers.positions_m[rows]
        flat, foot = self._flat(at), self._flat(at * np.array([1.0, 1.0, 0.0]))
        reach = max(_LEAST_DB, float(np.nanmax(np.abs(errors.level_dB))))
        self._colours.update(low=-reach, high=reach)
        self._points.data = {
            "x": flat[:, 0], "y": flat[:, 1], "foot_x": foot[:, 0], "foot_y": foot[:, 1],
            "name": [plain(errors.channels[k]) for k in rows], "error": level[rows],
            "key": [f"0/{errors.channels[k]}" for k in rows],
            "where": [", ".join(f"{value:.3g}" for value in place) for place in at],
        }  # fmt: skip
        self.sheet.title.text = f"Level error at {errors.bands[band]:g} Hz"
