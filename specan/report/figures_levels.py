"""Figure of single-number levels: every channel on a line of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.levels import SignalLevels
from specan.report.channel_lines import grouped
from specan.report.figure_style import COLOURS, heading, legend_below, level_label, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def figure_levels(found: SignalLevels) -> Figure:
    """Level of every channel with what its time-weighted level did; one pair of axes a level reference.

    A thin bar runs from the lowest to the highest time-weighted level, a thick one over the outer percentiles.
    """
    rows = grouped(reference.text for reference in found.references)
    figure = new_figure(1.5 + 0.55 * len(rows) + 0.17 * len(found.channels))
    sheet = figure.subplots(
        len(rows), 1, squeeze=False, height_ratios=[len(mine) + 1 for mine in rows.values()]
    )
    for axes, (text, mine) in zip(sheet[:, 0], rows.items(), strict=True):
        _draw(axes, found, mine)
        axes.set_xlabel(level_label(text))
    legend_below(figure, sheet[0, 0])
    stop = found.start_s + found.duration_s
    loudest = [
        f"{found.channels[mine[k]]} {found.level_dB[mine[k]]:.1f} dB"
        for mine in rows.values()
        if np.isfinite(found.level_dB[mine]).any() and len(mine) > 1
        for k in [int(np.nanargmax(found.level_dB[mine]))]
    ]
    heading(
        figure, found.label or "Levels",
        f"{found.start_s:g} s to {stop:g} s, time weighting {found.averaging}, {found.weighting} weighting for Pa",
        f"Highest level: {', '.join(loudest)}" if loudest else "",
    )  # fmt: skip
    return figure


def _draw(axes: Axes, found: SignalLevels, rows: list[int]) -> None:
    places = np.arange(len(rows))
    ordered = sorted(found.percentile_dB)

    def finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(np.isfinite(values[rows]), values[rows], np.nan)

    axes.hlines(
        places, finite(found.min_dB), finite(found.max_dB), color=COLOURS[4], lw=1,
        label="lowest to highest",
    )  # fmt: skip
    if len(ordered) > 1:
        most, least = ordered[0], ordered[-1]
        axes.hlines(
            places, finite(found.percentile_dB[least]), finite(found.percentile_dB[most]), color=COLOURS[4],
            lw=6, alpha=0.6, label=f"L{least:g} to L{most:g}",
        )  # fmt: skip
    axes.plot(finite(found.level_dB), places, "o", color=COLOURS[0], ms=5, label="level")
    if np.isfinite(found.equivalent_dB["A"][rows]).any():
        axes.plot(finite(found.equivalent_dB["A"]), places, "^", color=COLOURS[1], ms=5, label="Leq A")
    axes.set_yticks(places, [found.channels[r] for r in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(False, axis="y")
