"""What `specan.report.panels` describes, drawn on the page: panels of curves under each other, pictures of levels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from html import escape
from itertools import zip_longest
from typing import Any

import numpy as np
from bokeh.layouts import column
from bokeh.models import (
    AdaptiveTicker,
    BoxZoomTool,
    ColorBar,
    ColumnDataSource,
    CrosshairTool,
    Div,
    FixedTicker,
    HoverTool,
    Legend,
    LegendItem,
    LinearColorMapper,
    NoOverlap,
    PanTool,
    Range1d,
    ResetTool,
    SaveTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure

from specan.arrays import Real
from specan.inspect.look import COLOURS, share
from specan.report.figure_style import OCTAVE_NAMES, OCTAVES
from specan.report.panels import FEW, Curve, Drawing, Panel, Picture, numbered

_DASHES = ("solid", "dashed", "dotted", "dotdash")
_HARMONICS = 10
_MARKS = 3  # lines across a panel at most
_PALE = "#9aa3ad"
_ROWS, _COLUMNS = 220, 800  # of a picture
Styles = Mapping[str, tuple[int, int]]  # name of a curve to numbers of its colour and dash; others are pale


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


def hertz_axis(axis: Any) -> None:
    """A tick at each octave; labels that would overlap are left out."""
    axis.ticker = FixedTicker(ticks=OCTAVES, minor_ticks=[])
    axis.major_label_overrides = dict(zip(OCTAVES, OCTAVE_NAMES))
    axis.major_label_policy = NoOverlap(min_distance=4)  # on a phone


def styles_of(panels: tuple[Panel, ...]) -> Styles:
    """As the figures of a report have them; of many channels each line is full."""
    many, n = any(len(p.curves) > FEW for p in panels), len(COLOURS)
    return {name: (k % n, 0 if many else k // n) for name, k in numbered(panels).items()}


class Spectral:
    """A figure over frequency: lines at the cursor and its multiples, along one `dimension`: "height" or "width".

    Attributes
    ----------
    sheet : bokeh figure
    per_hertz : float
        What 1 Hz is on the axis, such as an order.
    """

    def __init__(self, sheet: Any, dimension: str = "height", colour: str = "#808894") -> None:
        self.sheet, self.per_hertz, self._dimension = sheet, 1.0, dimension
        # The outermost pixels of a canvas keep a part of the colours before a change to dark.
        sheet.styles = {**sheet.styles, "background": "var(--paper)", "clip-path": "inset(2px)"}
        self._spans = [
            Span(dimension=dimension, line_color=colour, line_dash="dashed", line_width=1, visible=False)
            for _ in range(_HARMONICS)
        ]
        self._spans[0].update(name="cursor-line", editable=True)
        for span in self._spans:
            sheet.add_layout(span)

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Move the lines, or hide them."""
        for number, span in enumerate(self._spans, 1):
            span.visible = frequency is not None and (number == 1 or harmonics)
            span.tags = [(frequency or 1.0) * number * self.per_hertz]  # what is not dragged there
            span.location = span.tags[0]
            span.line_alpha = 0.9 if number == 1 else 0.45

    def frequency_at(self, event: Any) -> float:
        """Of a click; left of zero there is none."""
        return max(float(event.x if self._dimension == "height" else event.y), 1e-6) / self.per_hertz


class PanelPlot(Spectral):
    """The figure of one panel; its curves are exchanged as a whole.

    Parameters
    ----------
    share : int
        Of the height; `height` in pixels instead.
    like : PanelPlot, optional
        Shares its horizontal axis.
    hertz : bool
        A logarithmic axis of frequency.
    tip : tuple of str
        Names of the values at the mouse.
    """

    def __init__(
        self,
        share: int = 3,
        *,
        hertz: bool = False,
        like: PanelPlot | None = None,
        height: int | None = None,
        tip: tuple[str, str] = ("x", "y"),
    ) -> None:
        grows = {} if height else {"flex": f"{share + 1} 1 0", "min-height": "0" if share > 1 else "112px"}
        self.sheet: Any = figure(
            height=height, min_height=76, sizing_mode="stretch_width" if height else "stretch_both",
            styles=grows, x_axis_type="log" if hertz else "linear",
            x_range=like.sheet.x_range if like else Range1d(20, 20000) if hertz else Range1d(0, 1),
            y_range=Range1d(0, 1), tools=[], output_backend="canvas",
        )  # fmt: skip
        self._shades = ColumnDataSource({"x": [], "y": [], "colour": []}, name="bands")
        self.sheet.patches(
            "x", "y", source=self._shades, fill_color="colour", fill_alpha=0.25, line_color=None
        )
        self.source = ColumnDataSource(_columns(LINE, []), name="curves")
        self._glyph = self.sheet.multi_line(
            "x", "y", source=self.source, line_color="colour", line_dash="dash", line_width=1.3, line_alpha="alpha"
        )  # fmt: skip
        self._dots = ColumnDataSource({name: [] for name in ("x", "y", "colour", "name")}, name="dots")
        self._dotted = self.sheet.scatter("x", "y", source=self._dots, color="colour", size=3)
        self._marks = [Span(dimension="width", line_width=1, visible=False) for _ in range(_MARKS)]
        self.sheet.center.extend(self._marks)
        self._add_tools(tip, like is None)
        # Figures under one another have their frames in line: the toolbar is inside, three lines of label fit.
        self.sheet.update(min_border_left=88, min_border_right=12, toolbar_inner=True)
        super().__init__(self.sheet)
        self.sheet.yaxis[0].major_label_policy = NoOverlap(min_distance=2)
        if hertz:
            hertz_axis(self.sheet.xaxis[0])
            self.sheet.xgrid.ticker = self.sheet.xaxis[0].ticker
        self._legend = Legend(
            items=[], click_policy="none", border_line_color=None, label_text_font_size="11px", spacing=6, padding=2,
            margin=0, orientation="horizontal", ncols=8, glyph_width=14, glyph_height=12, label_height=12,
        )  # fmt: skip
        self.sheet.add_layout(self._legend, "above")

    def _add_tools(self, tip: tuple[str, str], shown: bool) -> None:
        wheel = WheelZoomTool(dimensions="width")
        tips = [("", "@name"), (tip[0], "$snap_x{0.[0000]}"), (tip[1], "$snap_y{0.00[00]}")]
        self.sheet.add_tools(
            PanTool(), BoxZoomTool(), wheel, CrosshairTool(line_alpha=0.4), ResetTool(), SaveTool(),
            HoverTool(renderers=[self._glyph, self._dotted], line_policy="nearest", tooltips=tips),
        )  # fmt: skip
        self.sheet.toolbar.update(active_scroll=wheel, logo=None, autohide=True, visible=shown)

    def draw(self, shown: Panel, styles: Styles, alpha: float = 1.0) -> None:
        """Exchange the curves, and the bands behind them."""
        curves = shown.curves
        hues = [COLOURS[styles[c.name][0]] if c.name in styles else _PALE for c in curves]
        self._shades.data = _columns(
            ("x", "y", "colour"),
            [
                (*outline(c.x, c.low, c.high), hue)
                for c, hue in zip(curves, hues)
                if c.low is not None and c.high is not None and hue != _PALE
            ],
        )
        lines = curves if shown.kind in ("line", "steps", "thin") else ()
        self.source.data = _columns(
            LINE,
            [
                (*_line(c), hue, _DASHES[styles.get(c.name, (0, 0))[1] % len(_DASHES)], plain(c.name),
                 alpha if c.name in styles else 0.35)
                for c, hue in zip(lines, hues)
            ],
        )  # fmt: skip
        self._draw_dots(shown, hues, styles)
        for mark, place in zip_longest(self._marks, shown.marks[:_MARKS]):
            mark.update(
                visible=place is not None, location=place or 0.0, line_dash="dashed" if place else "solid"
            )
        self.sheet.yaxis[0].axis_label = plain(shown.label)
        axis = self.sheet.yaxis[0]
        if shown.phase:  # ticks at halves, quarters and eighths of a turn
            axis.ticker = AdaptiveTicker(base=10, mantissas=[1.8, 4.5, 9], min_interval=1)
            self.sheet.ygrid.ticker = axis.ticker
        self.limit(*((-190.0, 190.0) if shown.phase else shown.limits or _ends(curves)))

    def _draw_dots(self, shown: Panel, hues: list[str], styles: Styles) -> None:
        """Points, of curves that are points alone or have some; and the legend, whose lines or points it shows."""
        dotted = shown.kind in ("dots", "rows")
        dots = [
            (*points, hue, c.about or (c.name,) * len(points[0]))
            for c, hue in zip(shown.curves, hues)
            if (points := (c.x, c.y) if dotted else c.dots) is not None
        ]
        self._dots.data = {
            "x": np.concatenate([x for x, *_ in dots] or [np.empty(0)]),
            "y": np.concatenate([y for _, y, *_ in dots] or [np.empty(0)]),
            "colour": [hue for x, _, hue, _ in dots for _ in range(len(x))],
            "name": [plain(text) for *_, about in dots for text in about],
        }
        self._dotted.glyph.size = 6 if shown.kind == "rows" else 3
        firsts = np.cumsum([0, *(len(x) for x, *_ in dots)]).tolist() if dotted else range(len(shown.curves))
        of = self._dotted if dotted else self._glyph
        self._legend.items = [
            LegendItem(label={"value": plain(c.name)}, renderers=[of], index=first)
            for first, c in zip(firsts, shown.curves)
            if shown.leads and c.name and c.name in styles
        ]

    def span(self, low: float, high: float) -> None:
        """Show this part of the horizontal axis, and come back to it on a reset."""
        self.sheet.x_range.update(start=low, end=high, reset_start=low, reset_end=high)

    def limit(self, low: float, high: float) -> None:
        """Show this part of the vertical axis where it is another one, and come back to it on a reset."""
        axis = self.sheet.y_range
        if (axis.reset_start, axis.reset_end) != (low, high):
            axis.update(start=low, end=high, reset_start=low, reset_end=high)


def _folded(label: str) -> str:
    """Name of a vertical axis in lines that fit beside a low figure."""
    if " / " in label:
        label = label.partition("\n")[0]
    for word in ("/", "over", "-"):
        label = label.replace(f" {word} ", f"\n{word} ", 1)
    return label


LINE = ("x", "y", "colour", "dash", "name", "alpha")  # columns of the lines


def _columns(names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> dict[str, Any]:
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _line(curve: Curve) -> tuple[Real, Real]:
    """Through its points, or along its steps."""
    y = np.where(np.isfinite(curve.y), curve.y, np.nan)
    if curve.x.size == y.size + 1:
        return np.repeat(curve.x, 2)[1:-1], np.repeat(y, 2)
    return curve.x, y


def _ends(curves: tuple[Curve, ...]) -> tuple[float, float]:
    """Of all curves, with a margin."""
    values = np.concatenate([c.y[np.isfinite(c.y)] for c in curves] or [np.empty(0)])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) or abs(high) or 1.0
    return low - margin, high + margin


def outline(x: Any, low: Any, high: Any) -> tuple[Real, Real]:
    """Closed outlines of the pieces of a band where both ends are known, NaN between them."""
    known = np.isfinite(low) & np.isfinite(high)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    xs, ys, gap = list[Any](), list[Any](), np.array([np.nan])
    for first, last in zip(ends[::2], ends[1::2]):
        xs += [x[first:last], x[first:last][::-1], gap]
        ys += [low[first:last], high[first:last][::-1], gap]
    return (np.concatenate(xs[:-1]), np.concatenate(ys[:-1])) if xs else (np.empty(0), np.empty(0))


class Plots:
    """Panels and pictures of a drawing under each other over one horizontal axis; they are used again for the next one.

    Parameters
    ----------
    made : callable, optional
        Called with each figure that is made.
    **options
        Of `PanelPlot`.
    """

    def __init__(self, made: Callable[[Spectral], None] | None = None, **options: Any) -> None:
        self._options, self._made = options, made
        self.plots: dict[tuple[int, int], PanelPlot] = {}
        self.maps: dict[tuple[int, bool], HeatMap] = {}
        self.first = self._plot(0, 3)
        self._span = (0.0, 0.0)
        self.facts = Div(sizing_mode="stretch_width", styles={"text-align": "center"})
        self.body = column(
            self.facts,
            self.first.sheet,
            sizing_mode="stretch_both",
            styles=share(3),
        )

    def _plot(self, number: int, share: int) -> PanelPlot:
        like = self.first if self.plots else None
        make = partial(PanelPlot, share, like=like, **self._options)
        plot: PanelPlot = self._kept(self.plots, (number, share), make)
        return plot

    def _kept(self, figures: dict[Any, Any], key: Any, make: Callable[[], Any]) -> Any:
        if key not in figures:
            figures[key] = make()
            if self._made is not None:
                self._made(figures[key])
        return figures[key]

    def draw(self, drawing: Drawing, styles: Styles | None = None) -> None:
        """Exchange everything."""
        shown, styles = [], styles_of(drawing.panels) if styles is None else styles
        for number, one in enumerate(drawing.panels):
            plot = self._plot(number, one.share)
            plot.draw(one if len(drawing.panels) == 1 else replace(one, label=_folded(one.label)), styles)
            shown.append(plot.sheet)
        for number, picture in enumerate(drawing.pictures):
            make = partial(HeatMap, self.first.sheet.x_range, picture.hertz)
            heat = self._kept(self.maps, (number, picture.hertz), make)
            heat.draw(picture, drawing.dynamics_dB)
            shown.append(heat.sheet)
        for sheet in shown:
            sheet.xaxis[0].axis_label = drawing.x_label if sheet is shown[-1] else ""
            sheet.xaxis[0].major_label_text_font_size = "11px" if sheet is shown[-1] else "0px"
        if self.body.children[1:] != shown:
            self.body.children = [self.facts, *shown]
        if drawing.span != self._span:
            self._span = drawing.span
            self.first.span(*drawing.span)
        self.facts.text = escape(drawing.facts[0])


class HeatMap(Spectral):
    """A picture of levels; `hertz` where its vertical axis is one of frequency."""

    def __init__(self, x_range: Any, hertz: bool = False) -> None:
        self._hertz = hertz
        self._colours = LinearColorMapper(palette="Cividis256", low=0, high=1)
        self.source = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []}, name="picture")
        sheet = figure(
            sizing_mode="stretch_both", tools="pan,box_zoom,wheel_zoom,reset,save", x_range=x_range, min_height=120,
            y_range=Range1d(20, 20000), y_axis_type="log" if hertz else "linear", min_border_left=88,
            min_border_right=12, styles=share(4) | {"min-height": "220px"}, toolbar_inner=True,
        )  # fmt: skip
        super().__init__(sheet, *(("width", "#ffffff") if hertz else ()))
        sheet.toolbar.update(logo=None, autohide=True)
        picture = sheet.image("image", "x", "y", "dw", "dh", source=self.source, color_mapper=self._colours)
        tips = [("x", "$x{0.000}"), ("y", "$y{0.0}"), ("dB", "@image{0.0}")]
        sheet.add_tools(HoverTool(renderers=[picture], tooltips=tips))
        if hertz:
            hertz_axis(sheet.yaxis[0])
        self._bar = ColorBar(color_mapper=self._colours, title="dB", title_text_font_style="normal")
        sheet.add_layout(self._bar, "below")

    def draw(self, shown: Picture, dynamics_dB: float) -> None:
        """Exchange the picture."""
        picture, (left, right), (low, high) = even(shown, self._hertz)
        top = float(np.nanmax(picture, initial=-np.inf))
        top = top if np.isfinite(top) else 0.0
        self._colours.update(low=top - dynamics_dB, high=top)
        self.source.data = {
            "image": [picture], "x": [left], "y": [low], "dw": [right - left], "dh": [high - low],
        }  # fmt: skip
        self.sheet.y_range.update(start=low, end=high, reset_start=low, reset_end=high)
        self.sheet.yaxis[0].axis_label = f"{plain(shown.name)}\n{shown.y_label}".lstrip()
        self._bar.title = shown.unit.removeprefix("Level / ")


def even(picture: Picture, hertz: bool) -> tuple[Real, tuple[float, float], tuple[float, float]]:
    """Levels at even steps, of the logarithm where `hertz`; and the ends of both axes.

    Each row is that of the nearest place in y. Of more columns than the screen has, the highest of its neighbours is
    shown: a line is never lost.
    """
    x, y, values = picture.x, picture.y, np.where(np.isfinite(picture.values), picture.values, np.nan)
    step = float(x[1] - x[0]) if x.size > 1 else 1.0
    low, high = float(y[0]), float(y[-1])
    if hertz:
        low = max(low, 10.0 if high > 100 else low)
        wanted = np.geomspace(low, high, _ROWS)
    else:
        margin = 0.005 * high if high - low < 0.01 * high else 0.0  # a constant speed is a strip
        low, high = low - margin, high + margin
        wanted = low + (high - low) * (np.arange(_ROWS) + 0.5) / _ROWS
    rows = values[np.searchsorted((y[1:] + y[:-1]) / 2, wanted)]
    together = -(-rows.shape[1] // _COLUMNS)
    padded = np.pad(rows, ((0, 0), (0, -rows.shape[1] % together)), constant_values=np.nan)
    columns = np.fmax.reduce(padded.reshape(_ROWS, -1, together), axis=2)
    return np.asarray(columns), (float(x[0]) - step / 2, float(x[-1]) + step / 2), (low, high)
