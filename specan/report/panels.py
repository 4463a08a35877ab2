"""What a figure shows, apart from how it is drawn: panels of curves, and pictures of levels.

The same description is drawn by matplotlib here, and on the page by `specan.inspect.plots`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.arrays import Real
from specan.report.figure_style import (
    heading,
    legend_above,
    legend_below,
    level_limits,
    new_figure,
    octave_axis,
    style_of,
    styled,
)
from specan.result import gathered

FEW = 8  # channels that are drawn each in its own colour
APART = 3  # of many: those that are drawn over the range
BOUND = {"color": "#B00020", "linestyle": "--"}  # red: of a limit
_SPARSE = 60  # points up to which a line has marks


@dataclass(frozen=True)
class Curve:
    """A line of one channel.

    Attributes
    ----------
    name : str
    x, y : arrays
        `x` with one value more holds the edges of steps.
    low, high : array or None
        Ends of a band about it, such as 95 %.
    dots : tuple of array, or None
        Places and values of further points in its colour.
    about : tuple of str
        What the page says of each point under the mouse.
    """

    name: str
    x: Real
    y: Real
    low: Real | None = None
    high: Real | None = None
    dots: tuple[Real, Real] | None = None
    about: tuple[str, ...] = ()


@dataclass(frozen=True)
class Panel:
    """Curves over one vertical axis.

    Attributes
    ----------
    label : str
        Of the vertical axis.
    curves : tuple of Curve
    limits : tuple of float, or None
        Of the vertical axis.
    share : int
        Of the height of the figure.
    leads : bool
        It has a legend, and of many channels it decides which have a colour; the panels below follow.
    phase : bool
        A whole turn, with ticks at quarters.
    kind : {"line", "steps", "dots", "rows", "thin"}
        Of many curves a range is drawn; of "thin" ones, such as phases, all of them in grey. "rows" are larger dots,
        "steps" are never filled.
    marks : tuple of float
        Where thin lines run across.
    bounds : tuple of Curve
        Limits that the curves have to keep.
    amplitude : bool
        The curves are levels in dB re 1, and the axis tells the amplitudes.
    """

    label: str
    curves: tuple[Curve, ...]
    limits: tuple[float, float] | None = None
    share: int = 3
    leads: bool = True
    phase: bool = False
    kind: str = "line"
    marks: tuple[float, ...] = ()
    bounds: tuple[Curve, ...] = ()
    amplitude: bool = False

    @property
    def values(self) -> Real | None:
        """Of all curves, (curves, points); None where they do not have the same points."""
        same = len({(c.x.size, c.y.size) for c in self.curves}) == 1
        return np.array([np.where(np.isfinite(c.y), c.y, np.nan) for c in self.curves]) if same else None


@dataclass(frozen=True)
class Picture:
    """Levels over two axes: `values` (places in y, places in x); `hertz` where y is a logarithmic axis of frequency."""

    name: str
    x: Real
    y: Real
    values: Real
    y_label: str
    unit: str
    hertz: bool = False


@dataclass(frozen=True)
class Drawing:
    """A figure: panels, and below them pictures, under each other over one horizontal axis."""

    title: str
    facts: tuple[str, ...]
    x_label: str
    panels: tuple[Panel, ...] = ()
    pictures: tuple[Picture, ...] = ()
    hertz: bool = False  # the horizontal axis is a logarithmic one of frequency
    dynamics_dB: float = 90.0
    x_limits: tuple[float, float] | None = None

    @property
    def span(self) -> tuple[float, float]:
        """Ends of the horizontal axis."""
        if self.x_limits is not None:
            return self.x_limits
        shown = [c.x for panel in self.panels for c in panel.curves] or [_edges(p) for p in self.pictures]
        xs = [x[x > 0] if self.hertz else x for x in shown]
        ends = [(float(x[0]), float(x[-1])) for x in xs if x.size] or [(1.0, 2.0)]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        return low, max(high, 1.01 * low if self.hertz else low + 1e-9)

    def named(self, name: Any) -> Drawing:
        """With other names of the channels: `name` is called with each."""
        panels = (
            replace(p, curves=tuple(replace(c, name=name(c.name)) for c in p.curves)) for p in self.panels
        )
        pictures = (replace(p, name=name(p.name)) for p in self.pictures)
        return replace(self, panels=tuple(panels), pictures=tuple(pictures))


def with_bounds(panels: Iterable[Panel], label: str, x: Real, ends: Real) -> list[Panel]:
    """Panels of levels with their lower and upper limits, which the axis shows as well."""
    bounds = tuple(Curve(label, x, one) for one in ends if np.isfinite(one).any())
    known = [end for one in bounds for end in (np.nanmin(one.y) - 3.0, np.nanmax(one.y) + 3.0)]
    return [
        replace(p, bounds=bounds, limits=(min(p.limits[0], *known), max(p.limits[1], *known)))
        if p.limits and known
        else p
        for p in panels
    ]


def joined(drawings: Sequence[Drawing]) -> Drawing:
    """Several in one: curves of panels with the same label over one axis."""
    panels: dict[tuple[bool, str], Panel] = {}
    for panel in (panel for drawing in drawings for panel in drawing.panels):
        key = (not panel.leads, panel.label)
        if (known := panels.get(key)) is not None:
            ends = [limits for limits in (known.limits, panel.limits) if limits]
            limits = (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None
            panel = replace(known, curves=known.curves + panel.curves, limits=limits)
        panels[key] = panel
    ordered = sorted(panels.items(), key=lambda item: item[0][0])  # levels above phases
    pictures = tuple(p for drawing in drawings for p in drawing.pictures)
    return replace(drawings[0], panels=tuple(panel for _, panel in ordered), pictures=pictures)


def numbered(panels: Iterable[Panel]) -> dict[str, int]:
    """Number of the colour of each channel that has one: all of a few, of many those furthest from the median."""
    numbers: dict[str, int] = {}
    for panel in panels:
        for k in outer(panel) if panel.leads else ():
            numbers.setdefault(panel.curves[k].name, len(numbers))
    return numbers


def outer(panel: Panel) -> list[int]:
    """Curves that get a colour: all of a few; of many those that are furthest from the median, on average over x."""
    values = panel.values
    if len(panel.curves) <= FEW:
        return list(range(len(panel.curves)))
    if values is None or not (known := np.isfinite(values).any(axis=0)).any():
        return list(range(APART))
    off = np.abs(values[:, known] - np.nanmedian(values[:, known], axis=0))
    distance = np.nansum(off, axis=1) / np.maximum(np.isfinite(off).sum(axis=1), 1)
    return np.argsort(-distance, kind="stable")[:APART].tolist()


def grouped(kinds: Iterable[str]) -> dict[str, list[int]]:
    """Rows of each unit or level reference.

    Examples
    --------
    >>> grouped(["Pa", "m/s", "Pa"])
    {'Pa': [0, 2], 'm/s': [1]}
    """
    return gathered((kind, row) for row, kind in enumerate(kinds))


def level_panels(
    labels: Iterable[str],
    names: Sequence[str],
    x: Real,
    levels: Real,
    dynamics_dB: float,
    decisive: Real | None = None,
    **more: Any,
) -> list[Panel]:
    """A panel for each label of an axis.

    `decisive` are the levels that set its limits, where there are any; `more` are further arrays of the curves.
    """
    panels = []
    for label, rows in grouped(labels).items():
        deciding = levels[rows] if decisive is None else decisive[rows]
        deciding = deciding if np.isfinite(deciding).any() else levels[rows]
        curves = tuple(Curve(names[r], x, levels[r], **{key: v[r] for key, v in more.items()}) for r in rows)
        panels.append(Panel(label, curves, level_limits(deciding, dynamics_dB)))
    return panels


@styled
def figure_of_panels(drawing: Drawing) -> Figure:
    """Drawn by matplotlib."""
    panels, pictures = drawing.panels, drawing.pictures
    shares = [panel.share for panel in panels] + [5.0 if len(pictures) == 1 else 3.5] * len(pictures)
    figure = new_figure(2.0 + 0.72 * sum(shares))
    sheet = list(figure.subplots(len(shares), 1, sharex=True, squeeze=False, height_ratios=shares)[:, 0])
    draw_panels(sheet[: len(panels)], panels)
    for axes, picture in zip(sheet[len(panels) :], pictures, strict=True):
        draw_picture(figure, axes, picture, drawing.dynamics_dB)
    finish(figure, sheet, drawing)
    return figure


def finish(figure: Figure, sheet: Sequence[Axes], drawing: Drawing) -> None:
    """Horizontal axis, legend and heading."""
    leading = [axes for axes, panel in zip(sheet, drawing.panels) if panel.leads]
    if len(leading) == 1:
        legend_below(figure, leading[0])
    else:
        for axes in leading:
            legend_above(axes)
    if drawing.hertz:
        octave_axis(sheet[-1], *drawing.span)
    else:
        sheet[-1].set_xlim(*drawing.span)
    sheet[-1].set_xlabel(drawing.x_label)
    figure.align_ylabels(sheet)
    heading(figure, drawing.title, *drawing.facts)


def draw_panels(sheet: Sequence[Axes], panels: Sequence[Panel]) -> None:
    """Panels, each into its axes; a channel has the same colour in all of them."""
    numbers = numbered(panels)
    for axes, panel in zip(sheet, panels, strict=True):
        many = len(panel.curves) > FEW
        for place in panel.marks:
            axes.axhline(place, color="0.6", linewidth=0.8, linestyle="--" if place else "-", zorder=1.2)
        if many and panel.kind == "line" and (values := panel.values) is not None:
            draw_range(axes, panel.curves[0].x, values)
        for curve in sorted(panel.curves, key=lambda c: numbers.get(c.name, len(numbers))):
            if curve.name in numbers:
                _draw(axes, panel, curve, style_of(numbers[curve.name], many))
            elif many and panel.kind in ("thin", "rows"):
                form = "-" if panel.kind == "thin" else "."
                axes.plot(curve.x, curve.y, form, color="0.72", linewidth=0.4, markersize=6, zorder=1.5)
        for curve in panel.bounds:
            _draw(axes, replace(panel, kind="steps"), curve, BOUND)
        axes.set_ylabel(panel.label)
        if panel.phase:
            axes.set(ylim=(-190, 190), yticks=range(-180, 181, 90))
        if panel.amplitude:
            axes.set_yticks([20 * (k + np.log10(n)) for k in range(-15, 16) for n in (1, 2, 5)])
            axes.yaxis.set_major_formatter(lambda level, _: f"{10 ** (level / 20):g}")
        if panel.limits is not None:
            axes.set_ylim(*panel.limits)


def _draw(axes: Axes, panel: Panel, curve: Curve, style: dict[str, Any]) -> None:
    label = curve.name if panel.leads else None
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=style["color"], alpha=0.2, linewidth=0)
    if curve.x.size == curve.y.size + 1:
        filled = len(panel.curves) == 1 and panel.kind == "line"
        values = np.where(np.isneginf(curve.y), np.nan, curve.y)
        axes.stairs(
            values, curve.x, baseline=-999.0 if filled else None, fill=filled, alpha=0.45 if filled else 1.0,
            label=label, **style,
        )  # fmt: skip
    elif panel.kind in ("dots", "rows"):
        size = 6 if panel.kind == "rows" else 3
        axes.plot(curve.x, curve.y, ".", color=style["color"], markersize=size, label=label)
    else:
        marker = "." if curve.x.size < _SPARSE else ""
        axes.plot(curve.x, curve.y, label=label, linewidth=1.0, marker=marker, **style)
    if curve.dots is not None:
        axes.plot(*curve.dots, linestyle="", marker="o", markersize=3, color=style["color"])


def draw_range(axes: Axes, x: Real, values: Real) -> None:
    """From the lowest to the highest of all channels, and their median; as steps where `x` holds edges."""
    known = np.isfinite(values).any(axis=0)
    low, middle, high = (np.full(values.shape[1], np.nan) for _ in range(3))
    low[known], high[known] = np.nanmin(values[:, known], axis=0), np.nanmax(values[:, known], axis=0)
    middle[known] = np.nanmedian(values[:, known], axis=0)
    label = f"range of {len(values)} channels"
    pale: dict[str, Any] = {"color": "0.82", "linewidth": 0, "label": label}
    if x.size == values.shape[1] + 1:
        axes.stairs(high, x, baseline=low, fill=True, **pale)
        axes.stairs(middle, x, baseline=None, color="0.4", linewidth=1.3, label="median")
    else:
        axes.fill_between(x, low, high, **pale)
        axes.plot(x, middle, color="0.4", linewidth=1.3, label="median")


def _edges(picture: Picture) -> Real:
    """Of a picture along x: its axis holds the middles of the cells, or their edges."""
    x = picture.x
    if x.size != picture.values.shape[1]:
        return x
    half = (x[1] - x[0]) / 2 if x.size > 1 else 0.5
    return np.array([x[0] - half, x[-1] + half])


def draw_picture(figure: Figure, axes: Axes, picture: Picture, dynamics_dB: float) -> None:
    """A picture with its scale of colours."""
    low, high = level_limits(picture.values, dynamics_dB, below=0.0, above=0.0)
    shading: Any = "nearest" if picture.x.size == picture.values.shape[1] else "flat"
    mesh = axes.pcolormesh(
        picture.x, picture.y, np.ma.masked_invalid(picture.values), vmin=low, vmax=high, cmap="cividis",
        shading=shading, rasterized=True,
    )  # fmt: skip
    axes.grid(False)
    figure.colorbar(mesh, ax=axes, label=picture.unit)
    if picture.hertz:
        octave_axis(axes, float(picture.y[0]), float(picture.y[-1]), "y")
    axes.set_ylabel(f"{picture.name}\n{picture.y_label}".lstrip())
