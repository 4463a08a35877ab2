"""Figures of a study of order lines: measured and model lines over order, and what is between their levels."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from specan.errors import RequestError, nearest
from specan.planetary_gear.study.order_lines import OrderLinesObservation
from specan.report.figure_style import COLOURS, heading, new_figure, styled
from specan.report.study_words import state_of
from specan.study.observation import Array
from specan.study.observation.kept_lines import ABOVE_NOISE
from specan.units import axis_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from specan.study.study import Study


@styled
def figure_compare_orders(study: Study, channel: str | None = None) -> Figure:
    """Lines of one sensor, measured and model, and the difference of their levels.

    The sensor is by default that with the largest error. One column a harmonic, one colour a family of lines; grey
    where neither stands out of the noise. Levels are taken with the noise, below which nothing is known.

    Raises
    ------
    RequestError
        A `channel` that there is not.
    """
    observation = study.problem.observations[0]
    assert isinstance(observation, OrderLinesObservation)
    model = observation.lines_of(study.problem.plain(study.shown.theta)[0])
    sensor = _sensor(observation, model, channel)
    kept = observation.kept[sensor]
    noise = np.sqrt(2) * observation.noise[sensor]
    measured, predicted = (np.hypot(np.abs(lines[sensor]), noise) for lines in (observation.amplitude, model))
    out = kept & (np.maximum(measured, predicted) ** 2 > (1 + ABOVE_NOISE) * noise**2)
    groups = {name: kept & (observation.family == name) for name in dict.fromkeys(observation.family[out])}
    groups["no line above the noise"] = kept & ~np.isin(observation.family, list(groups))
    harmonics = np.unique(observation.harmonic[kept])
    figure = new_figure(5.6, max(1.4 + 2.4 * len(harmonics), 5.6))
    grid = figure.subplots(2, len(harmonics), sharex="col", sharey="row", squeeze=False, height_ratios=[2, 1])
    for harmonic, (top, bottom) in zip(harmonics, grid.T, strict=True):
        bottom.axhline(0, color="0.5", lw=0.8)
        for number, (name, lines) in enumerate(groups.items()):
            mine = lines & (observation.harmonic == harmonic)
            last = number == len(groups) - 1
            colour, marker = (
                ("0.7", "o")
                if last
                else (COLOURS[number % len(COLOURS)], "os^Dv"[number // len(COLOURS) % 5])
            )
            order, error_dB = observation.order[mine], 20 * np.log10(predicted[mine] / measured[mine])
            top.plot(order, measured[mine], marker, ms=4, color=colour, label=name)
            top.plot(order, predicted[mine], "_", ms=11, mew=1.4, color=colour)
            bottom.vlines(order, 0, error_dB, color=colour, lw=0.8)
            bottom.plot(order, error_dB, marker, ms=3, color=colour)
        top.set_title(f"h = {harmonic}")
        bottom.set_xlabel("Order")
    grid[0, 0].set_yscale("log")
    unit = study.model.observables[observation.observable].unit
    grid[0, 0].set_ylabel(axis_label("Amplitude", unit))
    grid[1, 0].set_ylabel("Model -\nmeasured / dB")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=min(len(groups), 6)
    )
    figure.align_ylabels(grid[:, 0])
    heading(
        figure, f"{study.directory.resolve().name}: measured and model", *state_of(study),
        f"{observation.of_row[sensor]}, {observation.channels[sensor]}. Marks: measured. Dashes: model with "
        "one gain a harmonic.",
    )  # fmt: skip
    return figure


def draw_residuals(axes: Axes, observation: OrderLinesObservation, predicted: Array) -> float:
    """Draw what each line is off by, over its order; returns the largest."""
    gap = np.abs(observation.lines_of(predicted) - observation.amplitude)
    for channel, mine, lines, colour in zip(
        observation.channels, observation.kept, gap, cycle(COLOURS), strict=False
    ):
        axes.plot(observation.order[mine], lines[mine], "o", ms=3, color=colour, label=channel)
    axes.set(xlabel="Order", ylabel=f"|Model - measured| of {observation.name}")
    axes.legend(loc="upper left")
    return float(gap[observation.kept].max())


def _sensor(observation: OrderLinesObservation, model: np.ndarray, channel: str | None) -> int:
    """Number of a sensor in use; of that with the largest error if none is named."""
    used = [name for name, lines in zip(observation.channels, observation.kept, strict=True) if lines.any()]
    if channel is None:
        gap = np.where(observation.kept, np.abs(model - observation.amplitude), 0.0)
        return int(np.argmax(np.sum(gap**2, axis=1)))
    if channel not in used:
        raise RequestError(f"{channel!r} is not a channel that is fitted", remedy=nearest(channel, used))
    return observation.channels.index(channel)
