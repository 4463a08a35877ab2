"""Figures of the page: lines distinguished by every kind of vision, octave ticks, maps of levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.models import (
    AdaptiveTicker,
    BoxZoomTool,
    ColorBar,
    ColumnDataSource,
    CrosshairTool,
    DataRange1d,
    FixedTicker,
    HoverTool,
    Legend,
    LegendItem,
    LinearColorMapper,
    PanTool,
    Range1d,
    ResetTool,
    SaveTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure
from numpy.typing import NDArray

from specan.inspect.look import COLOURS
from specan.report.figure_style import chosen, octave_ticks

_DASHES = ("solid", "dashed", "dotted", "dotdash")
_HARMONICS = 10
_DYNAMICS_DB = 100.0
WRAPPED = (-190.0, 190.0)  # limits of a wrapped phase
FEW = 8  # lines that have a colour each; of more the outer ones have, and the others are pale
_PALE = "#9aa3ad"


@dataclass(frozen=True)
class Curve:
    """One line: its name, and where it runs.

    Attributes
    ----------
    hue, dash : int or None
        Colour and dash by their numbers; otherwise one after the other.
    """

    name: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    hue: int | None = None
    dash: int | None = None
    alpha: float = 1.0


@dataclass(frozen=True)
class Band:
    """What lies between two lines, in the colour of a curve; nothing where an end is not finite."""

    x: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    hue: int
    alpha: float = 0.25

    @property
    def outline(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closed outlines of its pieces, NaN between them."""
        known = np.isfinite(self.low) & np.isfinite(self.high)
        ends = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
        xs: list[NDArray[np.float64]] = []
        ys: list[NDArray[np.float64]] = []
        gap = np.array([np.nan])
        for first, last in zip(ends[::2], ends[1::2]):
            x, low, high = (v[first:last] for v in (self.x, self.low, self.high))
            xs += [x, x[::-1], gap]
            ys += [low, high[::-1], gap]
        return (np.concatenate(xs[:-1]), np.concatenate(ys[:-1])) if xs else (np.empty(0), np.empty(0))


def plain(text: str) -> str:
    r"""Text that Bokeh does not take for a formula.

    Examples
    --------
    >>> plain("$$x$$") == "$$x$$"
    False
    """
    joiner = "\u2060"
    for mark in ("$$", r"\(", r"\["):
        text = text.replace(mark, mark[0] + joiner + mark[1])
    return text


def panel(grows: int, **options: Any) -> Any:
    """An empty figure that takes its share of the height, without a tool bar in the way."""
    styles = {"flex": f"{grows} 1 0", "min-height": "0", "background": "var(--paper)"}
    options = {"tools": "save", "min_height": 120, **options}
    sheet = figure(sizing_mode="stretch_both", styles=styles, **options)
    sheet.toolbar.logo = None
    sheet.toolbar.autohide = True
    return sheet


def hertz_axis(sheet: Any, axis: Any) -> None:
    """A tick at each octave."""
    frequencies, names = octave_ticks()
    axis.ticker = FixedTicker(ticks=frequencies, minor_ticks=[])
    axis.major_label_overrides = dict(zip(frequencies, names))


def outer_of(curves: Sequence[Curve]) -> list[int]:
    """Numbers of the lines that are furthest from the median; of lines on different axes, the first ones."""
    if any(c.y.size != curves[0].y.size for c in curves):
        return list(range(min(len(curves), 3)))
    return chosen(np.array([c.y for c in curves]))


class HarmonicCursor:
    """Lines at a frequency and its multiples.

    Parameters
    ----------
    sheet : figure
    dimension : {"height", "width"}
        Along which the lines run.
    colour : str
    """

    def __init__(self, sheet: Any, dimension: str, colour: str = "#808894") -> None:
        self._spans = [
            Span(dimension=dimension, line_color=colour, line_dash="dashed", line_width=1, visible=False)
            for _ in range(_HARMONICS)
        ]
        for span in self._spans:
            sheet.add_layout(span)

    def show(self, frequency: float | None, harmonics: bool) -> None:
        """Move the lines, or hide them."""
        for number, span in enumerate(self._spans, 1):
            span.visible = frequency is not None and (number == 1 or harmonics)
            span.location = (frequency or 1.0) * number
            span.line_alpha = 0.9 if number == 1 else 0.45


class Lines:
    """A figure of lines that are exchanged as a whole.

    Parameters
    ----------
    x_label, y_label : str
    hertz : bool
        A logarithmic axis of frequency, with a cursor.
    limits : tuple of float, optional
        Of the vertical axis; otherwise it follows the lines, over the dynamics of a converter at most.
    like : Lines, optional
        Shares its horizontal axis.
    height, weight : int
        Pixels; without them a share of the height that there is.
    named : bool
        Ticks of the horizontal axis carry numbers.
    shades : str
        Name of the data of the bands.
    coloured : bool
        Every line has a colour, however many they are.
    """

    def __init__(
        self,
        x_label: str,
        y_label: str,
        *,
        hertz: bool = False,
        height: int | None = None,
        weight: int = 3,
        limits: tuple[float, float] | None = None,
        like: Lines | None = None,
        legend: bool = True,
        tip: tuple[str, str] = ("x", "y"),
        dynamics: float | None = None,
        coloured: bool = False,
        named: bool = True,
        shades: str = "bands",
    ) -> None:
        self._fixed, self._dynamics, self._coloured = limits is not None, dynamics, coloured
        self._limits: tuple[float, float] | None = None
        vertical = Range1d(*limits) if limits else DataRange1d() if dynamics is None else Range1d(0, 1)
        self.sheet: Any = figure(
            height=height,
            min_height=56,
            sizing_mode="stretch_both" if height is None else "stretch_width",
            styles={"background": "var(--paper)"}
            | ({"flex": f"{weight} 1 0", "min-height": "0"} if height is None else {}),
            x_axis_type="log" if hertz else "linear",
            x_range=like.sheet.x_range if like else Range1d(20, 20000) if hertz else Range1d(0, 1),
            y_range=vertical,
            x_axis_label=x_label,
            y_axis_label=y_label,
            tools=[],
            output_backend="canvas",
        )
        self._shades = ColumnDataSource({"x": [], "y": [], "colour": [], "alpha": []}, name=shades)
        self.sheet.patches(
            "x", "y", source=self._shades, fill_color="colour", fill_alpha="alpha", line_color=None
        )
        self._source = ColumnDataSource(
            {"x": [], "y": [], "colour": [], "dash": [], "name": [], "alpha": []}, name="curves"
        )
        glyph = self.sheet.multi_line(
            "x",
            "y",
            source=self._source,
            line_color="colour",
            line_dash="dash",
            line_width=1.3,
            line_alpha="alpha",
        )
        hover = HoverTool(
            renderers=[glyph],
            line_policy="nearest",
            tooltips=[("", "@name"), (tip[0], "$snap_x{0.[0000]}"), (tip[1], "$snap_y{0.00[00]}")],
        )
        wheel = WheelZoomTool(dimensions="width")
        self.sheet.add_tools(
            PanTool(), BoxZoomTool(), wheel, hover, CrosshairTool(line_alpha=0.4), ResetTool(), SaveTool()
        )
        self.sheet.toolbar.active_scroll = wheel
        if tip[1] == "degrees":  # ticks at halves, quarters and eighths of a turn
            self.sheet.yaxis[0].ticker = AdaptiveTicker(base=10, mantissas=[1.8, 4.5, 9], min_interval=1)
            self.sheet.ygrid.ticker = self.sheet.yaxis[0].ticker
        self.sheet.toolbar.logo = None
        # Figures under one another have their frames in line: the toolbar is inside, two lines of label fit.
        self.sheet.update(min_border_left=88, min_border_right=12, toolbar_inner=True)
        self.sheet.toolbar.autohide = True
        if not named:
            self.sheet.xaxis[0].major_label_text_font_size = "0px"
        if weight < 3:
            self.sheet.yaxis[0].ticker.desired_num_ticks = 2 * weight
        if like is not None:
            self.sheet.toolbar.visible = False
        self._cursor = HarmonicCursor(self.sheet, "height")
        if hertz:
            hertz_axis(self.sheet, self.sheet.xaxis[0])
            self.sheet.xgrid.ticker = self.sheet.xaxis[0].ticker
        self._glyph = glyph
        self._legend = Legend(
            items=[], click_policy="none", border_line_color=None, label_text_font_size="11px", spacing=10, padding=4,
            margin=0, orientation="horizontal", ncols=8, glyph_width=14, glyph_height=12, label_height=12,
        ) if legend else None  # fmt: skip
        if self._legend is not None:
            self.sheet.add_layout(self._legend, "above")

    def draw(
        self,
        curves: Sequence[Curve],
        bands: Sequence[Band] = (),
        outer: Sequence[int] | None = None,
        first: int = 0,
    ) -> int:
        """Exchange the lines, and the bands behind them.

        Parameters
        ----------
        outer : sequence of int, optional
            The lines of many that get a colour.
        first : int
            Number of the first colour, for lines that do not name theirs.

        Returns
        -------
        int
            How many lines have a colour.
        """
        n = len(COLOURS)
        outlines = [band.outline for band in bands]
        self._shades.data = {
            "x": [x for x, _ in outlines],
            "y": [y for _, y in outlines],
            "colour": [COLOURS[band.hue % n] for band in bands],
            "alpha": [band.alpha for band in bands],
        }
        apart = None if self._coloured or len(curves) <= FEW else list(outer or outer_of(curves))
        hues = [first + k if c.hue is None else c.hue for k, c in enumerate(curves)]
        dashes = [hue // n if c.dash is None else c.dash for hue, c in zip(hues, curves)]
        self._source.data = {
            "x": [c.x for c in curves],
            "y": [np.where(np.isfinite(c.y), c.y, np.nan) for c in curves],
            "colour": [
                COLOURS[(first + apart.index(k) if apart and curves[k].hue is None else hue) % n]
                if apart is None or k in apart
                else _PALE
                for k, hue in enumerate(hues)
            ],
            "dash": [_DASHES[dash % len(_DASHES) if apart is None else 0] for dash in dashes],
            "name": [plain(c.name) for c in curves],
            "alpha": [c.alpha if apart is None or k in apart else 0.35 for k, c in enumerate(curves)],
        }
        if self._legend is not None:
            named = range(len(curves)) if apart is None else apart
            self._legend.items = [
                LegendItem(label={"value": plain(curves[k].name)}, renderers=[self._glyph], index=k)
                for k in named
            ]
        if self._dynamics is not None:
            self._follow(curves)
        return len(curves) if apart is None else len(apart)

    def _follow(self, curves: Sequence[Curve]) -> None:
        values = np.concatenate([c.y[np.isfinite(c.y)] for c in curves] or [np.empty(0)])
        if not values.size:
            return
        top = float(values.max())
        low = max(float(values.min()), top - (self._dynamics or 0.0))
        margin = max(0.05 * (top - low), 1.0)
        limits = (low - margin, top + margin)
        if limits != self._limits:
            self._limits = limits
            self.sheet.y_range.update(
                start=limits[0], end=limits[1], reset_start=limits[0], reset_end=limits[1]
            )

    def span(self, low: float, high: float) -> None:
        """Show this part of the horizontal axis, and come back to it on a reset."""
        self.sheet.x_range.update(start=low, end=high, reset_start=low, reset_end=high)

    def limit(self, low: float, high: float) -> None:
        """Show this part of the vertical axis, and come back to it on a reset."""
        self.sheet.y_range.update(start=low, end=high, reset_start=low, reset_end=high)

    def label(self, text: str) -> None:
        """Name of the vertical axis."""
        self.sheet.yaxis[0].axis_label = plain(text)

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Lines at a frequency and its multiples."""
        self._cursor.show(frequency, harmonics)

    def frequency_at(self, event: Any) -> float:
        """Of a click."""
        return float(event.x)


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
