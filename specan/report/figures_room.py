"""Figures of a room under study: its walls, and where the model of its sound field fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from specan.report.figure_style import COLOURS, octave_axis
from specan.study.impedance import ALL, Impedance, WallBand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_impedance(found: Impedance) -> Figure:
    """Absorption coefficient, and real and imaginary part of Z/(rho c), of every wall with 95 % intervals.

    What the positions do not determine is drawn pale: as an upper limit of the absorption, and not at all
    as an impedance.
    """
    from matplotlib.figure import Figure

    walls = found.walls
    figure = Figure(figsize=(max(6.0, 1.2 + 2.3 * len(walls)), 7.0), layout="constrained")
    grid = figure.subplots(3, len(walls), squeeze=False, sharex="col", sharey="row")
    for column, wall in enumerate(walls):
        rows = found.of(wall)
        _absorption(grid[0, column], rows)
        for line, name in ((1, "resistance"), (2, "reactance")):
            _part(grid[line, column], rows, name)
        grid[0, column].set_title(f"wall {wall}", fontsize="medium")
        grid[2, column].set_xlabel("frequency / Hz")
        octave_axis(grid[2, column], rows[0].mid_hz / 1.15, rows[-1].mid_hz * 1.15)
        for axes in grid[:, column]:
            axes.grid(alpha=0.3)
    grid[0, 0].set(ylabel="absorption, normal", ylim=(0, 1))
    grid[1, 0].set(ylabel="Re Z / (rho c)", yscale="log")
    grid[2, 0].set(ylabel="Im Z / (rho c)", yscale="symlog")
    mean = found.of(ALL)
    if mean:
        for axes in grid[0]:
            at = [r.mid_hz for r in mean]
            axes.plot(
                at, [r.absorption_normal.value for r in mean], ":", color="0.4", lw=1, label="all walls"
            )
        grid[0, 0].legend(fontsize="small")
    return figure


def _absorption(axes: Axes, rows: list[WallBand]) -> None:
    for row in rows:
        alpha = row.absorption_normal
        strength = 1.0 if row.determined else 0.3
        ends = [alpha.low, alpha.high]
        axes.plot([row.mid_hz] * 2, ends, color=COLOURS[0], lw=3, solid_capstyle="butt", alpha=strength)
        if row.determined:
            axes.plot(row.mid_hz, alpha.value, "o", ms=4, color=COLOURS[0])


def _part(axes: Axes, rows: list[WallBand], name: str) -> None:
    for row in rows:
        interval = getattr(row, name)
        if row.determined and np.isfinite([interval.low, interval.high]).all():
            axes.plot(
                [row.mid_hz] * 2, [interval.low, interval.high], color=COLOURS[1], lw=3, solid_capstyle="butt"
            )
            axes.plot(row.mid_hz, interval.value, "o", ms=4, color=COLOURS[1])
