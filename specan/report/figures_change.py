"""Figures of a step that changed the model, before and after, and of the error after each step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.report.figure_style import (
    COLOURS,
    GREY,
    heading,
    legend_above,
    new_figure,
    octave_axis,
    styled,
)
from specan.report.figures import figure_named
from specan.report.figures_study_frf import measured_transfer
from specan.report.panels import draw_range
from specan.report.residual_map import axis_text, map_axes
from specan.report.study_words import fall_text, history_sentence, state_of
from specan.study.comparison import readings
from specan.study.history import History, Step, error_pairs
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.units import axis_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from specan.study.edit import Change
    from specan.study.study import Study

BEFORE, AFTER = "0.6", COLOURS[0]
MOST_COLOURS = 6


@styled
def figure_change(change: Change) -> Figure:
    """RMS errors before and after on fitted and held-out data, and the residuals before and after on one scale.

    Of a table the residuals over the operating variable with most levels, coloured by the next one; of
    recordings the range of the level errors of all channels over frequency.
    """
    figure = new_figure(4.4, 10.2)
    bars, one, two = figure.subplots(1, 3, width_ratios=[1.15, 2, 2])
    _bars(bars, change)
    pairs = list(zip((one, two), ("before", "after"), (change.was, change.study), strict=True))
    reach = max(_residuals(axes, study, after=text == "after") for axes, text, study in pairs)
    for axes, text, study in pairs:
        axes.set_ylim(-1.05 * reach, 1.05 * reach)
        chi2 = f", chi²/n {study.shown.reduced_chi2:.3g}" if study.data.known else ""
        axes.set_title(f"Residual {text}{chi2}")
    two.set_ylabel("")
    two.tick_params(labelleft=False)
    after = change.after
    texts = [
        f"{text.replace('fitted', 'Fitted').replace('held-out', 'held out')}: {fall_text(a, b)}"
        for text, a, b in error_pairs(change.before, change.after)
    ]
    what = {"add": "with", "drop": "without"}.get(after.action, after.action)
    heading(
        figure, f"{change.study.directory.resolve().name}, step {after.step}: {what} {after.effect}",
        "RMS error. " + "; ".join(texts), state_of(change.study)[0],
    )  # fmt: skip
    return figure


def _bars(axes: Axes, change: Change) -> None:
    main = change.after.fit_error["metric"]  # other observables have other units
    pairs = error_pairs(change.before, change.after)
    rows = [(text.split()[0].replace("-", " "), a, b) for text, a, b in pairs if b["metric"] == main]
    for place, (_, before, after) in enumerate(rows):
        for shift, value, colour, text in ((-0.2, before, BEFORE, "before"), (0.2, after, AFTER, "after")):
            axes.bar(place + shift, value["value"], 0.38, color=colour, label=text if place == 0 else "")
            axes.annotate(f"{value['value']:.2g}", (place + shift, value["value"]), (0, 2), ha="center",
                          textcoords="offset points", fontsize=7, color=GREY)  # fmt: skip
    error = change.after.fit_error
    axes.set_ylabel(axis_label(error["metric"], error["unit"]))
    axes.set_xticks(range(len(rows)), [text for text, *_ in rows])
    axes.set_xlim(-0.6, len(rows) - 0.4)
    axes.grid(False, axis="x")
    legend_above(axes)


def _residuals(axes: Axes, study: Study, after: bool) -> float:
    """Draw what the model is off by; returns how far the axis has to reach."""
    observation = study.problem.observations[0]
    predicted = study.problem.plain(study.shown.theta)[0]
    axes.axhline(0, color="0.5", lw=0.8)
    if isinstance(observation, FrfObservation):
        return _level_errors(axes, observation, predicted)
    own = figure_named(f"Residuals {observation.kind}")
    if own is not None:
        return own(axes, observation, predicted)
    return _table_residuals(axes, observation, predicted, study, after)  # type: ignore[arg-type]


def _table_residuals(
    axes: Axes, observation: TableObservation, predicted: NDArray[np.float64], study: Study, after: bool
) -> float:
    first = observation.observable == observation.observable[0]
    name = str(observation.observable[0])
    residual = (predicted - observation.measured)[first]
    sigma = observation.sigma[first]
    names = map_axes({n: v[first] for n, v in observation.labels.items()})
    order = sorted(names, key=lambda n: np.unique(observation.labels[n]).size, reverse=True)
    x = readings(study.model, observation, order[0])[first] if order else np.arange(residual.size)
    if study.data.known:
        reach = 2 * float(np.median(sigma))
        axes.axhspan(-reach, reach, color="0.92", lw=0)
    for text, colour, mine in _groups(observation, first, order):
        axes.plot(x[mine], residual[mine], "o", ms=3, color=colour, label=text)
    axes.set_ylabel(axis_label(f"Model - measured {name}", study.model.observables[name].unit))
    axes.set_xlabel(axis_text(order[0], observation.variables) if order else "reading")
    if after and len(order) > 1:
        axes.legend(title=axis_text(order[1], observation.variables), ncols=3, loc="upper right",
                    columnspacing=0.8, handletextpad=0.1)  # fmt: skip
    return float(np.max(np.abs(residual)))


def _groups(observation: TableObservation, rows: NDArray[np.bool_], order: Sequence[str]) -> list[Any]:
    """Rows of each level of the second variable."""
    values = observation.labels[order[1]][rows] if len(order) > 1 else np.zeros(int(rows.sum()))
    levels = np.unique(values)
    if not 1 < levels.size <= MOST_COLOURS:
        return [("", COLOURS[0], np.ones(values.size, bool))]
    return [
        (f"{level:g}" if values.dtype.kind in "fiu" else str(level), colour, values == level)
        for level, colour in zip(levels, COLOURS, strict=False)
    ]


def _level_errors(axes: Axes, observation: FrfObservation, predicted: NDArray[np.float64]) -> float:
    found = measured_transfer(observation, predicted)
    error = found.error_dB
    draw_range(axes, found.frequency_hz, np.where(np.isfinite(error), error, np.nan))
    low, high = found.band_dB()
    known = np.isfinite(error).any(axis=0)
    half = np.full(error.shape[1], np.nan)
    half[known] = np.nanmedian((high - low)[:, known], axis=0) / 2
    axes.fill_between(
        found.frequency_hz, -half, half, color=COLOURS[4], alpha=0.5, lw=0, label="measurement, 95 %"
    )
    octave_axis(axes, float(found.frequency_hz[known].min()), float(found.frequency_hz[known].max()))
    axes.set(xlabel="Frequency / Hz", ylabel="Model - measured level / dB")
    axes.legend(loc="lower left")
    return float(np.clip(np.nanquantile(np.abs(error[np.isfinite(error)]), 0.995), 1.0, 20.0))


@styled
def figure_history(history: History) -> Figure:
    """The error of every step on fitted and on held-out data, as a staircase with its numbers."""
    steps = history.steps
    if not steps:
        raise RequestError("the history is empty", remedy="begin with specan study new")
    figure = new_figure(3.7, float(np.clip(2.6 + 0.95 * len(steps), 5.2, 11.0)))
    axes = figure.subplots()
    draw_staircase(axes, steps)
    axes.set_ylabel(axis_label(steps[-1].fit_error["metric"], steps[-1].fit_error["unit"]))
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
