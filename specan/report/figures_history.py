"""Figure of a study's history: the error after each step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from specan.errors import RequestError
from specan.report.figure_style import COLOURS, GREY, heading, new_figure, styled
from specan.report.verdict_words import history_sentence
from specan.study.history import History, Step
from specan.units import printed_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def figure_history(history: History) -> Figure:
    """The error of every step on fitted and on held-out data, as a staircase with its numbers."""
    steps = history.steps
    if not steps:
        raise RequestError("the history is empty", remedy="begin with specan study new")
    figure = new_figure(3.7, float(np.clip(2.6 + 0.95 * len(steps), 5.2, 11.0)))
    axes = figure.subplots()
    draw_staircase(axes, steps)
    metric, unit = steps[-1].fit_error["metric"], printed_unit(steps[-1].fit_error["unit"])
    axes.set_ylabel(metric.replace("_", " ") + (f" / {unit}" if unit else ""))
    heading(figure, "Error after each step", history_sentence(steps))
    return figure


def draw_staircase(axes: Axes, steps: Sequence[Step]) -> None:
    """One group of bars for each step: the error on fitted data, and on held-out data."""
    kinds = [("fit_error", "fitted", COLOURS[0]), ("held_out_error", "held out", COLOURS[1])]
    shown = [kind for kind in kinds if any(getattr(s, kind[0]) for s in steps)]
    width = 0.76 / len(shown)
    for place, (attribute, text, colour) in enumerate(shown):
        errors = [getattr(s, attribute) for s in steps]
        values = np.array([np.nan if e is None else e["value"] for e in errors])
        at = np.arange(len(steps)) + (place - (len(shown) - 1) / 2) * width
        axes.bar(at, values, width * 0.94, color=colour, label=text)
        if len(steps) <= 8:
            for x, value in zip(at, values, strict=True):
                if np.isfinite(value):
                    axes.annotate(f"{value:.3g}", (x, value), (0, 2), textcoords="offset points", ha="center",
                                  fontsize=7, color=GREY)  # fmt: skip
    names = [f"{s.action} {s.effect}".strip() for s in steps]
    long = max(map(len, names)) * len(names) > 70
    axes.set_xticks(range(len(steps)), names, rotation=25 if long else 0, ha="right" if long else "center")
    axes.grid(False, axis="x")
    axes.set_ylim(0, axes.get_ylim()[1] * 1.06)
    axes.legend(loc="upper right")
