"""Figures of band levels and of their histories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.data.band_levels import BandLevels
from specan.report.figure_style import line_styles, octave_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BARS = 2  # channels up to which bands are filled; more are outlines
_MANY = 8  # lines from which on the legend stands beside the axes
_DYNAMICS_DB = 90.0  # that a figure shows at most


def figure_band_levels(found: BandLevels) -> Figure:
    """Band levels of every channel, and the overall levels beside them; one pair of axes a level reference.

    The bar on a filled level is one standard deviation of stationary noise (`BandLevels.u_dB`).
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    texts = list(dict.fromkeys(reference.text for reference in found.references))
    figure = Figure(figsize=(9.0, 2.5 + 3.0 * len(texts)), layout="constrained")
    sheet = figure.subplots(len(texts), 2, sharex="col", sharey="row", width_ratios=[6, 1], squeeze=False)
    style = dict(zip(range(len(found.channels)), line_styles()))
    for (axes, totals), text in zip(sheet, texts):
        rows = [r for r, reference in enumerate(found.references) if reference.text == text]
        _draw_levels(axes, found, rows, style)
        _draw_totals(totals, found, rows, style)
        _limit(axes, found, rows)
        axes.set_ylabel(f"Level / dB re {text}")
        if len(found.channels) <= _MANY:
            axes.legend(fontsize="small")
    octave_axis(sheet[-1, 0], float(found.lower_hz[0]), float(found.upper_hz[-1]))
    sheet[-1, 0].set_xlabel("Mid-band frequency / Hz")
    sheet[-1, 1].set_xlabel("overall")
    if len(found.channels) > _MANY:
        figure.legend(loc="outside right upper", fontsize="x-small")
    figure.suptitle(_title(found, ""), fontsize="medium")
    return figure


def _draw_levels(
    axes: Axes, found: BandLevels, rows: Sequence[int], styles: Mapping[int, Mapping[str, Any]]
) -> None:
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    for row in rows:
        level = np.where(np.isneginf(found.level_dB[row]), np.nan, found.level_dB[row])
        filled = len(rows) <= _BARS
        axes.stairs(
            level,
            edges,
            baseline=-999.0 if filled else None,
            fill=filled,
            alpha=0.45 if filled else 1.0,
            label=found.channels[row],
            **styles[row],
        )
        if filled:
            axes.errorbar(found.exact_hz, level, found.u_dB, fmt="none", ecolor="0.35", elinewidth=0.8)


def _draw_totals(
    axes: Axes, found: BandLevels, rows: Sequence[int], styles: Mapping[int, Mapping[str, Any]]
) -> None:
    for row in rows:
        for place, values in enumerate(found.overall_dB.values()):
            axes.plot(place, values[row], marker="_", markersize=14, color=styles[row]["color"])
            if len(rows) == 1 and np.isfinite(values[row]):
                axes.annotate(
                    f"{values[row]:.1f}", (place, values[row]), ha="center", va="bottom", fontsize="x-small"
                )
    axes.set_xticks(range(len(found.overall_dB)), labels=list(found.overall_dB))
    axes.set_xlim(-0.7, len(found.overall_dB) - 0.3)
    axes.grid(True, axis="y", color="0.9")


def _limit(axes: Axes, found: BandLevels, rows: Sequence[int]) -> None:
    """From the highest level down to the lowest, but no further than the dynamics of a converter."""
    shown = np.concatenate([found.level_dB[rows].ravel(), *(v[rows] for v in found.overall_dB.values())])
    finite = shown[np.isfinite(shown)]
    if finite.size:
        top = float(finite.max())
        axes.set_ylim(max(float(finite.min()), top - _DYNAMICS_DB) - 3.0, top + 4.0)
    axes.grid(True, axis="y", color="0.9")
    axes.set_axisbelow(True)


def figure_level_history(found: BandLevels, channel: int = 0) -> Figure:
    """Time-weighted band levels of one channel against time, and its overall levels above them."""
    from matplotlib.figure import Figure

    history = found.history
    if history is None:
        raise ValueError("a linear average has no history")
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 3])
    for (weighting, levels), style in zip(history.overall_dB.items(), line_styles()):
        if np.isfinite(levels[channel]).any():
            above.plot(history.time_s, levels[channel], label=weighting, linewidth=1.0, **style)
    text = found.references[channel].text
    above.set_ylabel(f"Level / dB re {text}")
    above.grid(True, color="0.9")
    above.legend(fontsize="small", title="overall", ncols=4)
    above.set_title(_title(found, found.channels[channel]), fontsize="medium")
    half = history.interval_s / 2
    times = np.append(history.time_s - half, history.time_s[-1] + half)
    edges = np.append(found.lower_hz, found.upper_hz[-1])
    level = history.level_dB[channel]
    finite = level[np.isfinite(level)]
    top = float(finite.max()) if finite.size else 0.0
    mesh = below.pcolormesh(times, edges, level, cmap="cividis", vmin=top - _DYNAMICS_DB, vmax=top)
    octave_axis(below, float(edges[0]), float(edges[-1]), "y")
    below.set_ylabel("Mid-band frequency / Hz")
    below.set_xlabel("Time / s")
    figure.colorbar(mesh, ax=below, label=f"dB re {text}")
    return figure


def _title(found: BandLevels, channel: str) -> str:
    held = f", {found.hold} hold" if found.hold else ""
    parts = [found.label, channel, f"1/{found.fraction} octave", f"{found.weighting} weighting"]
    stop = found.start_s + found.duration_s
    section = f"{found.averaging} averaging{held}, {found.start_s:g} s to {stop:g} s"
    return ", ".join(part for part in [*parts, section] if part)
