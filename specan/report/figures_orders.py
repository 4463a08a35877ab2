"""Figures of order analyses: spectra, and maps of orders against speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.data.orders import OrderSpectrum
from specan.report.figure_style import (
    Styles,
    grouped,
    heading,
    legend_above,
    legend_below,
    level_label,
    level_limits,
    new_figure,
    outer_lines,
    styled,
)
from specan.result import counted
from specan.units import level_reference

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DYNAMICS_DB = 90.0
_MANY = 8  # panels of a map at most


@styled
def figure_orders(found: OrderSpectrum) -> Figure:
    """Levels against order, with the given lines as dots; one pair of axes a level reference."""
    texts = grouped(level_reference(unit).text for unit in found.units)
    figure = new_figure(2.2 + 2.6 * len(texts))
    sheet = figure.subplots(len(texts), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (text, rows) in zip(sheet, texts.items(), strict=True):
        _draw_orders(axes, found, rows)
        axes.set_ylabel(level_label(text))
        if len(texts) > 1:
            legend_above(axes)
    sheet[-1].set_xlim(0.0, float(found.order[-1]))
    sheet[-1].set_xlabel("Order of the shaft")
    if len(texts) == 1:
        legend_below(figure, sheet[0])
    heading(figure, found.label, _facts(found), "Dots: the lines that were given" if found.lines else "")
    return figure


def _draw_orders(axes: Axes, found: OrderSpectrum, rows: list[int]) -> None:
    styles: Styles = {}
    for row in outer_lines(axes, found.order, found.level_dB, rows, styles):
        axes.plot(found.order, found.level_dB[row], label=found.channels[row], linewidth=0.8, **styles[row])
        if found.lines is not None:
            reference = level_reference(found.units[row]).value
            with np.errstate(divide="ignore", invalid="ignore"):
                line = 20 * np.log10(np.abs(found.lines.amplitude[row]) / np.sqrt(2) / reference)
            colour = styles[row]["color"]
            axes.plot(found.lines.order, line, linestyle="", marker="o", markersize=3, color=colour)
    level = found.level_dB[rows][:, found.order > 0]
    finite = level[np.isfinite(level)]
    top = float(finite.max()) if finite.size else 0.0
    axes.set_ylim(max(top - _DYNAMICS_DB, float(finite.min()) - 3 if finite.size else -10), top + 5)


@styled
def figure_order_map(found: OrderSpectrum) -> Figure:
    """Levels against order and speed, one panel a channel; columns in the order of speed."""
    count = min(len(found.channels), _MANY)
    figure = new_figure(1.2 + 2.6 * count)
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    place = np.argsort(found.speed_hz, kind="stable")
    speed = found.speed_hz[place]
    for row, one in enumerate(axes):
        picture = found.map_level_dB[place, row][:, found.order > 0]
        low, high = level_limits(picture, _DYNAMICS_DB, below=0.0, above=0.0)
        mesh = one.pcolormesh(
            found.order[found.order > 0],
            speed,
            np.ma.masked_invalid(picture),
            vmin=low,
            vmax=high,
            cmap="cividis",
            shading="nearest",
            rasterized=True,
        )
        one.set_ylabel(f"{found.channels[row]}\nSpeed / Hz")
        one.grid(False)
        figure.colorbar(mesh, ax=one, label=level_label(level_reference(found.units[row]).text))
    left_out = len(found.channels) - count
    heading(figure, found.label, _facts(found), f"{left_out} more channels are not drawn" if left_out else "")
    axes[-1].set_xlabel("Order of the shaft")
    return figure


def _facts(found: OrderSpectrum) -> str:
    low, mean, high = found.tacho.speed_hz
    speed = f"{mean:.4g} Hz" if high - low < 0.01 * mean else f"{low:.4g} to {high:.4g} Hz"
    return f"Orders of a shaft at {speed}, blocks of {counted(found.block_turns, 'turn')}"
