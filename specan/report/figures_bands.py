"""Figures of band levels and of their histories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from specan.data.band_levels import BandLevels
from specan.report.channel_lines import Styles, grouped, outer_lines
from specan.report.figure_style import (
    heading,
    legend_above,
    legend_below,
    level_label,
    micro,
    new_figure,
    octave_axis,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

_BARS = 2  # channels up to which bands are filled; more are outlines
_DYNAMICS_DB = 90.0  # that a figure shows at most


@styled
def figure_band_levels(found: BandLevels) -> Figure:
    """Band levels of every channel, and the overall levels beside them; one pair of axes a level reference.

    The bar on a filled level is one standard deviation of stationary noise (`BandLevels.u_dB`). Of more than eight
    channels the range is drawn, the median, and the channels that are furthest from it.
    """
    texts = grouped(reference.text for reference in found.references)
    figure = new_figure(1.9 + 2.5 * len(texts))
    sheet = figure.subplots(len(texts), 2, sharex="col", sharey="row", width_ratios=[6, 1], squeeze=False)
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    for (axes, totals), (text, rows) in zip(sheet, texts.items()):
        names = [found.channels[r] for r in rows]
        colours = draw_bands(axes, edges, found.level_dB[rows], names)
        if len(rows) <= _BARS:
            _bars(axes, found, rows)
        _draw_totals(totals, found, rows, colours)
        _limit(axes, found, rows)
        axes.set_ylabel(level_label(text))
    octave_axis(sheet[-1, 0], float(found.lower_hz[0]), float(found.upper_hz[-1]))
    sheet[-1, 0].set_xlabel("Mid-band frequency / Hz")
    sheet[-1, 1].set_xlabel("Overall")
    _legends(figure, list(sheet[:, 0]))
    figure.align_ylabels(sheet[:, 0])
    heading(figure, found.label or "Band levels", *_facts(found), _loudest(found))
    return figure


def _legends(figure: Figure, panels: Sequence[Axes]) -> None:
    """One under the figure for a single level reference; in the axes where there are several."""
    if len(panels) == 1:
        legend_below(figure, panels[0])
        return
    for axes in panels:
        legend_above(axes)


def draw_bands(
    axes: Axes, edges: NDArray[np.float64], level_dB: NDArray[np.float64], names: Sequence[str]
) -> dict[int, str]:
    """Levels of channels with one reference as steps; returns the colours of the rows that have their own."""
    level = np.where(np.isneginf(level_dB), np.nan, level_dB)
    filled = len(level) <= _BARS
    styles: Styles = {}
    outer_lines(axes, edges, level, range(len(level)), styles)
    for row, style in styles.items():
        axes.stairs(
            level[row],
            edges,
            baseline=-999.0 if filled else None,
            fill=filled,
            alpha=0.45 if filled else 1.0,
            label=names[row],
            **style,
        )
    return {row: style["color"] for row, style in styles.items()}


def _bars(axes: Axes, found: BandLevels, rows: Sequence[int]) -> None:
    for row in rows:
        level = np.where(np.isneginf(found.level_dB[row]), np.nan, found.level_dB[row])
        axes.errorbar(found.exact_hz, level, found.u_dB, fmt="none", ecolor="0.35", elinewidth=0.8)


def _draw_totals(axes: Axes, found: BandLevels, rows: Sequence[int], colours: dict[int, str]) -> None:
    for number, row in enumerate(rows):
        colour = colours.get(number, "0.75")
        for place, values in enumerate(found.overall_dB.values()):
            axes.plot(
                place, values[row], marker="_", markersize=16, markeredgewidth=1.6, color=colour,
                zorder=3 if number in colours else 2,
            )  # fmt: skip
            if len(rows) == 1 and np.isfinite(values[row]):
                axes.annotate(f"{values[row]:.1f}", (place, values[row]), (0, 3), textcoords="offset points",
                              ha="center", va="bottom", fontsize=8)  # fmt: skip
    axes.set_xticks(range(len(found.overall_dB)), labels=list(found.overall_dB))
    axes.set_xlim(-0.7, len(found.overall_dB) - 0.3)
    axes.grid(False, axis="x")


def _limit(axes: Axes, found: BandLevels, rows: Sequence[int]) -> None:
    """From the highest level down to the lowest, but no further than the dynamics of a converter."""
    shown = np.concatenate([found.level_dB[rows].ravel(), *(v[rows] for v in found.overall_dB.values())])
    finite = shown[np.isfinite(shown)]
    if finite.size:
        top = float(finite.max())
        axes.set_ylim(max(float(finite.min()), top - _DYNAMICS_DB) - 3.0, top + 4.0)


@styled
def figure_level_history(found: BandLevels, channel: int = 0) -> Figure:
    """Time-weighted band levels of one channel against time, and its overall levels above them."""
    history = found.history
    if history is None:
        raise ValueError("a linear average has no history")
    figure = new_figure(6.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 3])
    for weighting, levels in history.overall_dB.items():
        if np.isfinite(levels[channel]).any():
            above.plot(history.time_s, levels[channel], label=f"L{weighting}", linewidth=1.0)
    text = found.references[channel].text
    above.set_ylabel(level_label(text))
    legend_above(above)
    half = history.interval_s / 2
    times = np.append(history.time_s - half, history.time_s[-1] + half)
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    level = history.level_dB[channel]
    finite = level[np.isfinite(level)]
    top = float(finite.max()) if finite.size else 0.0
    mesh = below.pcolormesh(
        times, edges, level, cmap="cividis", vmin=max(top - _DYNAMICS_DB, float(finite.min()) if finite.size else 0.0),
        vmax=top, rasterized=True,
    )  # fmt: skip
    octave_axis(below, float(edges[0]), float(edges[-1]), "y")
    below.set_ylabel("Mid-band frequency / Hz")
    below.set_xlabel("Time / s")
    below.grid(False)
    figure.colorbar(mesh, ax=below, label=level_label(text))
    heading(figure, f"{found.label}, {found.channels[channel]}", *_facts(found))
    return figure


def _facts(found: BandLevels) -> list[str]:
    held = f", {found.hold} hold" if found.hold else ""
    stop = found.start_s + found.duration_s
    return [
        f"1/{found.fraction} octave, {found.weighting} weighting, {found.averaging} averaging{held}, "
        f"{found.start_s:g} s to {stop:g} s"
    ]


def _loudest(found: BandLevels) -> str:
    """Overall level of each reference: of one channel, or the range of several."""
    texts = []
    name, values = next(iter(found.overall_dB.items()))
    for text in dict.fromkeys(reference.text for reference in found.references):
        here = [v for v, r in zip(values, found.references, strict=True) if r.text == text and np.isfinite(v)]
        if here:
            low, high = min(here), max(here)
            level = f"{high:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
            texts.append(f"L{name} {level} dB re {micro(text)}")
    return "Overall: " + "; ".join(texts) if texts else ""
