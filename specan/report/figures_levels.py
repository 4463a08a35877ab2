"""Figure of single-number levels: every channel on a line of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.data.levels import SignalLevels
from specan.report.figure_style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_levels(found: SignalLevels) -> Figure:
    """Level of every channel with what its time-weighted level did; one pair of axes a level reference.

    A thin bar runs from the lowest to the highest time-weighted level, a thick one over the outer percentiles.
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    texts = list(dict.fromkeys(reference.text for reference in found.references))
    rows = [[r for r, reference in enumerate(found.references) if reference.text == text] for text in texts]
    figure = Figure(figsize=(8.0, 1.6 + 0.9 * len(texts) + 0.24 * len(found.channels)), layout="constrained")
    sheet = figure.subplots(len(texts), 1, squeeze=False, height_ratios=[len(mine) + 1 for mine in rows])
    for axes, text, mine in zip(sheet[:, 0], texts, rows, strict=True):
        _draw(axes, found, mine)
        axes.set_xlabel(f"Level / dB re {text}")
    handles = dict(zip(*sheet[0, 0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize="small")
    stop = found.start_s + found.duration_s
    figure.suptitle(f"{found.label}, {found.start_s:g} s to {stop:g} s", fontsize="medium")
    return figure


def _draw(axes: Axes, found: SignalLevels, rows: list[int]) -> None:
    places = np.arange(len(rows))
    ordered = sorted(found.percentile_dB)
    name = f"{found.averaging}, {found.weighting} for Pa"

    def finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(np.isfinite(values[rows]), values[rows], np.nan)

    axes.hlines(
        places, finite(found.min_dB), finite(found.max_dB), color=COLOURS[4], lw=1,
        label=f"lowest to highest, {name}",
    )  # fmt: skip
    if len(ordered) > 1:
        most, least = ordered[0], ordered[-1]
        axes.hlines(
            places, finite(found.percentile_dB[least]), finite(found.percentile_dB[most]), color=COLOURS[4],
            lw=6, alpha=0.6, label=f"L{least:g} to L{most:g}, {name}",
        )  # fmt: skip
    axes.plot(finite(found.level_dB), places, "o", color=COLOURS[0], ms=5, label="level")
    if np.isfinite(found.equivalent_dB["A"][rows]).any():
        axes.plot(finite(found.equivalent_dB["A"]), places, "^", color=COLOURS[1], ms=5, label="Leq A")
    axes.set_yticks(places, [found.channels[r].replace("$", r"\$") for r in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(True, axis="x", color="0.9")
    axes.set_axisbelow(True)
