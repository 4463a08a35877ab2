"""Figures of a study of order lines: measured and model lines over order, and what is left."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from specan.errors import require_known
from specan.planetary_gear.study.order_lines import OrderLinesObservation
from specan.report.figure_style import COLOURS, heading, new_figure, styled
from specan.report.study_sheets import state_of
from specan.study.observation import Array
from specan.units import axis_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from specan.study.study import Study


@styled
def figure_compare_orders(study: Study, channel: str | None = None) -> Figure:
    """Lines of one sensor, measured and model, and what is left between them.

    The sensor and recording are by default those with the largest error. One column a harmonic, one colour for what
    makes a line. Grey is the noise, and what is left below it is nothing.

    Raises
    ------
    RequestError
        A `channel` that there is not.
    """
    observation = study.problem.observations[0]
    assert isinstance(observation, OrderLinesObservation)
    model = observation.lines_of(study.problem.plain(study.shown.theta)[0])
    known, row = observation.known, _row(observation, model, channel)
    kept, noise = observation.kept[row], np.sqrt(2) * observation.noise[row]
    measured, predicted = np.abs(observation.amplitude[row]), np.abs(model[row])
    left = np.abs(observation.amplitude[row] - model[row])
    parts = np.array([_part(family) for family in known.family])
    kept = kept & ((parts != "half mesh") | (measured > 2 * noise))  # far from the others
    harmonics = np.unique(known.harmonic[kept])
    figure = new_figure(5.6, max(1.4 + 2.4 * len(harmonics), 5.6))
    grid = figure.subplots(2, len(harmonics), sharex="col", sharey="all", squeeze=False, height_ratios=[3, 2])
    floor = 0.5 * float(noise[kept].min())
    for harmonic, (top, bottom) in zip(harmonics, grid.T, strict=True):
        near = kept & (known.harmonic == harmonic)
        for axes in (top, bottom):
            axes.fill_between(known.order[near], floor, noise[near], color="0.88", lw=0, step="mid")
        for part, colour in zip(dict.fromkeys(parts[kept].tolist()), COLOURS, strict=False):
            mine = near & (parts == part)
            order = known.order[mine]
            top.vlines(order, floor, measured[mine], color=colour, lw=2.0, label=part)
            shown = predicted[mine] > floor
            top.plot(order[shown], predicted[mine][shown], "_", ms=12, mew=1.8, color="0.1")
            bottom.vlines(order, floor, left[mine], color=colour, lw=2.0)
        top.set_title(f"h = {harmonic}")
        bottom.set_xlabel("Order")
    grid[0, 0].set(yscale="log", ylim=(floor, None))
    unit = study.model.observables[observation.observable].unit
    grid[0, 0].set_ylabel(axis_label("Amplitude", unit))
    grid[1, 0].set_ylabel(axis_label("|Difference|", unit))
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    figure.align_ylabels(grid[:, 0])
    heading(
        figure, f"{study.directory.resolve().name}: measured and model", *state_of(study),
        f"{observation.of_row[row]}, {observation.channels[row]}. Lines: measured. Dashes: model with one gain "
        "per harmonic. Grey: below it nothing is known.",
    )  # fmt: skip
    return figure


def _part(family: str) -> str:
    """What makes a line, from the name of its family."""
    name, _, part = family.partition(" (")
    return part.rstrip(")") or ("passing planets" if "+-" in name else "mesh")


def draw_residuals(axes: Axes, observation: OrderLinesObservation, predicted: Array) -> float:
    """Draw what each line is off by, over its order; returns the largest."""
    gap = np.abs(observation.lines_of(predicted) - observation.amplitude)
    sensors = np.array(observation.channels)
    for channel, colour in zip(dict.fromkeys(observation.channels), cycle(COLOURS), strict=False):
        row, line = np.nonzero(observation.kept & (sensors == channel)[:, None])
        axes.plot(observation.known.order[line], gap[row, line], "o", ms=3, color=colour, label=channel)
    axes.set(xlabel="Order", ylabel=axis_label("|Measured - model|", "m/s^2"))
    axes.legend(loc="upper left")
    return float(gap[observation.kept].max())


def _row(observation: OrderLinesObservation, model: np.ndarray, channel: str | None) -> int:
    """Number of a row of lines in use, of a sensor if one is named: that with the largest error over its lines."""
    used = observation.kept.any(axis=1)
    names = np.array(observation.channels)
    if channel is not None:
        require_known(channel, names[used], f"{channel!r} is not a channel that is fitted")
        used &= names == channel
    gap, size = (
        np.sum(np.where(observation.kept, np.abs(lines) ** 2, 0.0), axis=1)
        for lines in (model - observation.amplitude, observation.amplitude)
    )
    return int(np.argmax(np.where(used, gap / np.where(used, size, 1.0), -1.0)))
