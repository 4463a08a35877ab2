"""Figures of band levels and their histories, of levels of channels, and of decay times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.band_levels import BandLevels
from specan.data.decay import DecayTimes
from specan.data.levels import SignalLevels
from specan.divisions import division_name
from specan.report.figure_style import (
    COLOURS,
    FEW,
    Styles,
    chosen,
    draw_range,
    grouped,
    heading,
    legend_above,
    legend_below,
    level_label,
    level_limits,
    micro,
    new_figure,
    octave_axis,
    outer_lines,
    styled,
    styles_of,
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
    shown = np.concatenate([found.level_dB[rows].ravel(), *(v[rows] for v in found.overall_dB.values())])
    if np.isfinite(shown).any():
        axes.set_ylim(*level_limits(shown, _DYNAMICS_DB, above=4.0))


@styled
def figure_level_history(found: BandLevels, channel: int = 0) -> Figure:
    """Time-weighted band levels of one channel against time, and its overall levels above them.

    A reading is drawn over the interval that it ends: it holds what happened there.
    """
    history = found.history
    if history is None:
        raise ValueError("a linear average has no history")
    figure = new_figure(6.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 3])
    times = np.append(history.time_s[:1] - history.interval_s, history.time_s)
    for weighting, levels in history.overall_dB.items():
        if np.isfinite(levels[channel]).any():
            highest = history.overall_max_dB[weighting][channel]
            label = f"L{weighting}, max {highest:.1f} dB"
            drawn = above.stairs(levels[channel], times, baseline=None, label=label, linewidth=1.0)
            above.axhline(highest, color=drawn.get_edgecolor(), linewidth=0.6, linestyle=":")
    text = found.references[channel].text
    above.set_ylabel(level_label(text))
    legend_above(above)
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    level = history.level_dB[channel]
    low, high = level_limits(level, _DYNAMICS_DB, below=0.0, above=0.0)
    mesh = below.pcolormesh(times, edges, level, cmap="cividis", vmin=low, vmax=high, rasterized=True)
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
        f"{division_name(found.fraction)}, {found.weighting} weighting, {found.averaging} averaging{held}, "
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


@styled
def figure_levels(found: SignalLevels) -> Figure:
    """Equivalent level of every channel with what its time-weighted level did; one pair of axes a level reference.

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
    level = equivalent(found)
    loudest = [
        f"{found.channels[mine[k]]} {level[mine[k]]:.1f} dB"
        for mine in rows.values()
        if np.isfinite(level[mine]).any() and len(mine) > 1
        for k in [int(np.nanargmax(level[mine]))]
    ]
    heading(
        figure, found.label or "Levels",
        f"{found.start_s:g} s to {stop:g} s, time weighting {found.averaging}, {found.weighting} weighting for Pa",
        f"Highest equivalent level: {', '.join(loudest)}" if loudest else "",
    )  # fmt: skip
    return figure


def equivalent(found: SignalLevels) -> NDArray[np.float64]:
    """Equivalent levels with the weighting of the time-weighted ones, between whose ends they lie."""
    weighted = found.equivalent_dB[found.weighting]
    return np.where(np.isfinite(weighted), weighted, found.level_dB)


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
    axes.plot(finite(equivalent(found)), places, "o", color=COLOURS[0], ms=5, label="equivalent level")
    axes.set_yticks(places, [found.channels[r] for r in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(False, axis="y")


@styled
def figure_decay(found: DecayTimes) -> Figure:
    """Reverberation time T20 with its standard deviation, and clarity C80, of every channel."""
    figure = new_figure(5.8)
    times, clarity = figure.subplots(2, 1, sharex=True)
    many = len(found.channels) > FEW
    if many:
        draw_range(times, found.exact_hz, found.t20_s)
        draw_range(clarity, found.exact_hz, found.c80_dB)
    for row, style in styles_of(chosen(found.t20_s), many).items():
        times.errorbar(
            found.exact_hz, found.t20_s[row], found.u_t20_s[row], marker="o", markersize=4, capsize=3,
            label=found.channels[row], **style,
        )  # fmt: skip
        clarity.plot(found.exact_hz, found.c80_dB[row], marker="o", markersize=4, **style)
    times.set_ylabel("Reverberation time T20 / s")
    clarity.set_ylabel("Clarity C80 / dB")
    times.set_ylim(bottom=0.0)
    edge = 10 ** (0.15 / found.fraction)
    octave_axis(clarity, float(found.exact_hz[0] / edge), float(found.exact_hz[-1] * edge))
    clarity.set_xlabel("Mid-band frequency / Hz")
    figure.align_ylabels()
    known = found.t20_s[np.isfinite(found.t20_s)]
    result = f"T20 {known.min():.3g} to {known.max():.3g} s" if known.size else "No band has a decay of 20 dB"
    heading(
        figure, found.label or "Decay times",
        f"1/{found.fraction} octave, ISO 3382-1; bars: one standard deviation", result,
    )  # fmt: skip
    legend_below(figure, times)
    return figure
