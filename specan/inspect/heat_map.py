"""Levels over two axes as a picture, with a bar that tells its colours."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from specan.inspect.plots import plain


class HeatMap:
    """A picture of levels.

    Parameters
    ----------
    grows : int
        Share of the height.
    dynamics_dB : float
        Below the highest level everything is dark.
    name : str
        Of its source of data.
    **options
        Of `bokeh.plotting.figure`: labels, ranges and kinds of the axes.
    """

    def __init__(self, grows: int, dynamics_dB: float, name: str, **options: Any) -> None:
        self._dynamics_dB = dynamics_dB
        self._colours = LinearColorMapper(palette="Cividis256", low=0, high=1)
        self._source = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []}, name=name)
        self.sheet = figure(
            sizing_mode="stretch_both", styles={"flex": f"{grows} 1 0", "min-height": "0"}, min_height=120,
            tools="pan,box_zoom,wheel_zoom,reset,save", **{"y_range": Range1d(0, 1), **options},
        )  # fmt: skip
        self.sheet.toolbar.logo = None
        self.picture = self.sheet.image(
            "image", "x", "y", "dw", "dh", source=self._source, color_mapper=self._colours
        )
        self._bar = ColorBar(color_mapper=self._colours, title="dB")
        self.sheet.add_layout(self._bar, "right")

    def draw(
        self,
        picture: NDArray[np.float64],
        x: tuple[float, float],
        y: tuple[float, float],
        unit: str,
        title: str,
    ) -> None:
        """Show levels (rows upwards, columns) over the spans `x` and `y`."""
        known = np.isfinite(picture)
        top = float(picture[known].max()) if known.any() else 0.0
        self._colours.update(low=top - self._dynamics_dB, high=top)
        self._source.data = {
            "image": [np.where(known, picture, np.nan)],
            "x": [x[0]], "y": [y[0]], "dw": [x[1] - x[0]], "dh": [y[1] - y[0]],
        }  # fmt: skip
        self.sheet.y_range.update(start=y[0], end=y[1], reset_start=y[0], reset_end=y[1])
        self._bar.title = unit
        self.sheet.title.text = plain(title)
