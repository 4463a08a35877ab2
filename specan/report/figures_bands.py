"""Figures of band levels and their histories, of levels of channels, and of decay times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.arrays import Real
from specan.data.band_levels import BandLevels, LevelHistory
from specan.data.decay import DecayTimes
from specan.data.levels import SignalLevels
from specan.data.limits import LimitCurve
from specan.divisions import division_name
from specan.errors import RequestError
from specan.report.figure_style import (
    COLOURS,
    heading,
    legend_below,
    level_label,
    level_limits,
    name_rows,
    new_figure,
    style_of,
    styled,
)
from specan.report.panels import (
    BOUND,
    Curve,
    Drawing,
    Panel,
    Picture,
    draw_panels,
    finish,
    grouped,
    level_panels,
    numbered,
    with_bounds,
)
from specan.units import printed_unit

_DYNAMICS_DB = 90.0  # that a figure shows at most


def band_panels(found: BandLevels, limits: LimitCurve | None = None) -> Drawing:
    """Band levels of every channel as steps, one pair of axes a level reference, and limits that they have to keep.

    Of more than eight channels the range is drawn, the median, and the channels that are furthest from it.
    """
    labels = [level_label(reference.text) for reference in found.references]
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    panels = level_panels(labels, found.channels, edges, found.level_dB, _DYNAMICS_DB)
    if limits is not None:
        panels = with_bounds(panels, limits.label, edges, limits.at_bands(found.nominal_hz))
    facts = f"{division_name(found.fraction)}, {found.how}", _loudest(found)
    title = found.label or "Band levels"
    return Drawing(title, facts, "Mid-band frequency / Hz", tuple(panels), hertz=True)


@styled
def figure_band_levels(found: BandLevels, *, limits: LimitCurve | None = None) -> Figure:
    """The bands, and the overall levels beside them.

    The bar on a filled level is one standard deviation of stationary noise (`BandLevels.u_dB`).
    """
    drawing = band_panels(found, limits)
    figure = new_figure(1.9 + 2.5 * len(drawing.panels))
    sheet = figure.subplots(
        len(drawing.panels), 2, sharex="col", sharey="row", width_ratios=[6, 1], squeeze=False
    )
    draw_panels(list(sheet[:, 0]), drawing.panels)
    numbers = numbered(drawing.panels)
    kinds = grouped(r.text for r in found.references).values()
    for (axes, totals), panel, rows in zip(sheet, drawing.panels, kinds, strict=True):
        if len(rows) == 1:
            for row in rows:
                level = np.where(np.isneginf(found.level_dB[row]), np.nan, found.level_dB[row])
                axes.errorbar(found.exact_hz, level, found.u_dB, fmt="none", ecolor="0.35", elinewidth=0.8)
        colours = [
            style_of(numbers[name])["color"] if (name := found.channels[row]) in numbers else "0.75" for row in rows
        ]  # fmt: skip
        _draw_totals(totals, found, rows, colours)
        bounds = {} if limits is None else limits.overall_dB
        for place, name in enumerate(found.overall_dB):
            totals.hlines(bounds.get(name, ()), place - 0.5, place + 0.5, BOUND["color"], BOUND["linestyle"])
        overall = (values[rows] for values in found.overall_dB.values())
        drawn = (curve.y for curve in panel.bounds)
        shown = np.concatenate([found.level_dB[rows].ravel(), *overall, *drawn, *bounds.values()])
        if np.isfinite(shown).any():
            axes.set_ylim(*level_limits(shown, _DYNAMICS_DB))
    sheet[-1, 1].set_xlabel("Overall")
    finish(figure, list(sheet[:, 0]), drawing)
    return figure


def _draw_totals(axes: Axes, found: BandLevels, rows: Sequence[int], colours: Sequence[str]) -> None:
    for row, colour in zip(rows, colours, strict=True):
        for place, values in enumerate(found.overall_dB.values()):
            axes.plot(
                place, values[row], marker="_", markersize=16, markeredgewidth=1.6, color=colour,
                zorder=2 if colour == "0.75" else 3,
            )  # fmt: skip
            if len(rows) == 1 and np.isfinite(values[row]):
                axes.annotate(f"{values[row]:.1f}", (place, values[row]), (0, -3), textcoords="offset points",
                              ha="center", va="top", fontsize=8, rotation=90)  # fmt: skip
    axes.set_xticks(range(len(found.overall_dB)), labels=list(found.overall_dB))
    axes.set_xlim(-1.0, len(found.overall_dB))
    axes.grid(False, axis="x")


def _history(found: BandLevels) -> tuple[LevelHistory, Real]:
    """The history, and the ends of its intervals: a reading is drawn over the interval that it ends."""
    if found.history is None:
        raise RequestError("a linear average has no history", remedy="use averaging fast, slow or seconds")
    first = found.history.time_s[:1] - found.history.interval_s
    return found.history, np.append(first, found.history.time_s)


def history_panels(found: BandLevels, weighting: str) -> Drawing:
    """Overall levels of all channels against time; Z for what has no such weighting."""
    history, times = _history(found)
    weighted = history.overall_dB[weighting] if weighting in history.overall_dB else history.overall_dB["Z"]
    levels = np.where(np.isfinite(weighted).any(axis=1, keepdims=True), weighted, history.overall_dB["Z"])
    labels = [level_label(reference.text) for reference in found.references]
    panels = level_panels(labels, found.channels, times, levels, _DYNAMICS_DB)
    pressure = f", sound pressure {weighting}-weighted" if "Pa" in found.units else ""
    about = f"time weighting {found.averaging}{pressure}"
    return Drawing(found.label, (about,), "Time / s", tuple(panels))


def figure_level_history(found: BandLevels, channel: int = 0) -> Drawing:
    """Overall levels of one channel against time, and its time-weighted band levels below them."""
    history, times = _history(found)
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    text = level_label(found.references[channel].text)
    curves = tuple(
        Curve(
            f"L{weighting}, max {history.overall_max_dB[weighting][channel]:.1f} dB", times, levels[channel]
        )
        for weighting, levels in history.overall_dB.items()
        if np.isfinite(levels[channel]).any()
    )
    levels = Panel(text, curves, kind="steps")
    bands = Picture("", times, edges, history.level_dB[channel], "Mid-band frequency / Hz", text, hertz=True)
    title = f"{found.label}, {found.channels[channel]}"
    return Drawing(title, (f"{division_name(found.fraction)}, {found.how}",), "Time / s", (levels,), (bands,))


def _loudest(found: BandLevels) -> str:
    """Overall level of each reference: of one channel, or the range of several."""
    texts = []
    name, values = next(iter(found.overall_dB.items()))
    for text in dict.fromkeys(reference.text for reference in found.references):
        here = [v for v, r in zip(values, found.references, strict=True) if r.text == text and np.isfinite(v)]
        if here:
            low, high = min(here), max(here)
            level = f"{high:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
            texts.append(printed_unit(f"L{name} {level} dB re {text}"))
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
        f"{found.start_s:g} s to {stop:g} s, time weighting {found.averaging}{found.weighted}",
        f"Highest equivalent level: {', '.join(loudest)}" if loudest else "",
    )  # fmt: skip
    return figure


def equivalent(found: SignalLevels) -> Real:
    """Equivalent levels with the weighting of the time-weighted ones, between whose ends they lie."""
    weighted = found.equivalent_dB[found.weighting]
    return np.where(np.isfinite(weighted), weighted, found.level_dB)


def _draw(axes: Axes, found: SignalLevels, rows: list[int]) -> None:
    places = np.arange(len(rows))
    ordered = sorted(found.percentile_dB)

    def finite(values: Real) -> Real:
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
    name_rows(axes, [found.channels[r] for r in rows])


def figure_decay(found: DecayTimes) -> Drawing:
    """Reverberation time T20 with its standard deviation, and clarity C80, of every channel."""
    x, top = found.nominal_hz, float(np.nanmax(found.t20_s + found.u_t20_s, initial=0.0)) or 1.0
    rows = list(enumerate(found.channels))
    t20, u = found.t20_s, found.u_t20_s
    times = tuple(Curve(name, x, t20[r], t20[r] - u[r], t20[r] + u[r]) for r, name in rows)
    clarity = tuple(Curve(name, x, found.c80_dB[r]) for r, name in rows)
    panels = [Panel("Reverberation time T20 / s", times, (0.0, 1.05 * top))]
    if np.isfinite(found.c80_dB).any():
        panels.append(Panel("Clarity C80 / dB", clarity, leads=False))
    known = found.t20_s[np.isfinite(found.t20_s)]
    result = f"T20 {known.min():.3g} to {known.max():.3g} s" if known.size else "No band has a decay of 20 dB"
    facts = f"1/{found.fraction} octave, ISO 3382-1; shaded: one standard deviation", result
    edge = 10 ** (0.15 / found.fraction)
    return Drawing(
        found.label or "Decay times", facts, "Mid-band frequency / Hz", tuple(panels), hertz=True,
        x_limits=(float(x[0] / edge), float(x[-1] * edge)),
    )  # fmt: skip
