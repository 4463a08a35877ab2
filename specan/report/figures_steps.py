"""Figures of the steps of a study: a diagnosis, what to measure next, a change, the error after each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.errors import RequestError
from specan.report.figure_style import (
    COLOURS,
    GREY,
    heading,
    legend_above,
    name_rows,
    new_figure,
    octave_axis,
    styled,
)
from specan.report.figures import figure_named
from specan.report.figures_study import measured_transfer
from specan.report.panels import Curve, Panel, draw_panels
from specan.report.residual_map import axis_text
from specan.report.study_rows import table_rows
from specan.report.study_sheets import falls, state_of
from specan.study.edit import Change
from specan.study.history import History, Step
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.study.study import Study
from specan.study.verdict import Diagnosis, NextMeasurements, headline, percent
from specan.units import axis_label


@styled
def figure_change(change: Change) -> Figure:
    """RMS errors before and after on fitted and held-out data, and the residuals before and after on one scale.

    Of a table the residuals over the operating variable with most levels, coloured by the next one; of
    recordings the level errors of all channels over frequency.
    """
    figure = new_figure(4.4, 10.2)
    bars, one, two = figure.subplots(1, 3, width_ratios=[1.5, 2, 2])
    draw_steps(bars, (change.before, change.after))
    bars.set_xticks((0, 1), ("before", "after"))
    pairs = list(zip((one, two), ("before", "after"), (change.was, change.study), strict=True))
    reach = max(_residuals(axes, study, legend=text == "after") for axes, text, study in pairs)
    signed = min(one.dataLim.y0, two.dataLim.y0) < 0  # and no magnitudes
    for axes, text, study in pairs:
        axes.set_ylim(-1.05 * reach * signed, 1.05 * reach)
        chi2 = f", chi²/n {study.shown.reduced_chi2:.3g}" if study.data.known else ""
        axes.set_title(f"Residual {text}{chi2}")
    two.set_ylabel("")
    two.tick_params(labelleft=False)
    after = change.after
    what = {"add": "with", "drop": "without"}.get(after.action, after.action)
    heading(
        figure, f"{change.study.directory.resolve().name}, step {after.step}: {what} {after.effect}",
        f"RMS error. {falls(change.before, after)}", state_of(change.study)[0],
    )  # fmt: skip
    return figure


def _residuals(axes: Axes, study: Study, legend: bool) -> float:
    """Draw what the model is off by; returns how far the axis has to reach."""
    observation = study.problem.observations[0]
    predicted = study.problem.plain(study.shown.theta)[0]
    if (own := figure_named(f"Residuals {observation.kind}")) is not None:
        reach: float = own(axes, observation, predicted)
        return reach
    title = ""
    if isinstance(observation, FrfObservation):
        found = measured_transfer(observation, predicted)
        used = np.isfinite(found.error_dB).any(axis=0)
        f, errors = found.frequency_hz[used], found.error_dB[:, used]
        named = zip(found.channels, errors, strict=True)
        curves = tuple(Curve(name, f, error) for name, error in named if np.isfinite(error).any())
        panel = Panel("Measured - model level / dB", curves, marks=(0.0,))
        octave_axis(axes, float(f[0]), float(f[-1]))
        axes.set_xlabel("Frequency / Hz")
        reach = float(np.clip(np.nanquantile(np.abs(errors), 0.995), 1.0, 20.0))
    else:
        assert isinstance(observation, TableObservation)
        rows = table_rows(study.model, [observation], [predicted], study.data.known)
        x, *others = rows.axes
        panel = rows.of(str(observation.observable[0])).panel("residual", x, others[0] if others else "")
        axes.set_xlabel(axis_text(x, rows.variables))
        title = axis_text(others[0], rows.variables) if others else ""
        legend = legend and bool(others)
        reach = max(float(np.max(np.abs(curve.y))) for curve in panel.curves)
    draw_panels([axes], [panel])
    if legend:
        axes.legend(title=title, ncols=3, loc="best", columnspacing=0.8, handletextpad=0.3, frameon=True)
    return reach


@styled
def figure_history(history: History) -> Figure:
    """The error of every step on fitted and on held-out data, as bars with their numbers."""
    steps = history.steps
    if not steps:
        raise RequestError("the history is empty", remedy="begin with specan study new")
    figure = new_figure(3.7, float(np.clip(2.6 + 0.95 * len(steps), 5.2, 11.0)))
    axes = figure.subplots()
    draw_steps(axes, steps)
    heading(figure, "Error after each step", falls(steps[0], steps[-1]))
    return figure


def draw_steps(axes: Axes, steps: Sequence[Step]) -> None:
    """One group of bars for each step: the error on fitted data, and on held-out data."""
    kinds = [("fit_error", "fitted", COLOURS[0]), ("held_out_error", "held out", COLOURS[1])]
    shown = [kind for kind in kinds if any(getattr(s, kind[0]) for s in steps)]
    width = 0.76 / len(shown)
    for place, (attribute, text, colour) in enumerate(shown):
        errors = [getattr(s, attribute) for s in steps]
        values = np.array([np.nan if e is None else e["value"] for e in errors])
        at = np.arange(len(steps)) + (place - (len(shown) - 1) / 2) * width
        bars = axes.bar(at, values, width * 0.94, color=colour, label=text)
        if len(steps) <= 8:
            axes.bar_label(bars, fmt="{:.3g}", padding=2, fontsize=7, color=GREY)
    axes.set_ylabel(axis_label(steps[-1].fit_error["metric"], steps[-1].fit_error["unit"]))
    names = [f"{s.action} {s.effect}".strip() for s in steps]
    long = max(map(len, names)) * len(names) > 70
    axes.set_xticks(range(len(steps)), names, rotation=25 if long else 0, ha="right" if long else "center")
    axes.grid(False, axis="x")
    axes.set_ylim(0, axes.get_ylim()[1] * 1.06)
    legend_above(axes)


MOST_ROWS = 16


@styled
def figure_diagnosis(found: Diagnosis) -> Figure:
    """RMS error that each refitted candidate leaves, beside that of the model as it is.

    Those that the verdict names are dark, the others pale; those with implausible values are hatched.

    Raises
    ------
    RequestError
        Nothing was refitted.
    """
    ranked = found.ranking[:MOST_ROWS]
    if not ranked:
        raise RequestError("no candidate was refitted: there is nothing to draw", remedy="leave out --plot")
    now = found.error.before if found.error is not None else None
    first = 0 if now is None else 1
    figure = new_figure(2.1 + 0.24 * (len(ranked) + first))
    axes = figure.subplots()
    named = len(found.alternatives) if found.verdict in ("effect", "group", "fits-only-if") else 0
    if now is not None:
        axes.barh(0, now.rms, color="0.6", height=0.72)
        axes.annotate(f" {now.rms:.3g}", (now.rms, 0), va="center", fontsize=8, color="0.3")
    for place, row in enumerate(ranked, first):
        axes.barh(
            place, row.error_after, height=0.72, edgecolor="white" if row.plausible else "0.35", linewidth=0.0,
            color=COLOURS[0] if place - first < named else "#bcd6e6", hatch="" if row.plausible else "////",
        )  # fmt: skip
        beside = f" {row.error_after:.3g}   {percent(row.probability)}" + (
            "" if row.plausible else "   implausible"
        )
        axes.annotate(beside, (row.error_after, place), va="center", fontsize=8, color="0.3")
    name_rows(axes, [*(["model as it is"] if first else []), *(" + ".join(row.names) for row in ranked)])
    axes.set_xlim(0, 1.28 * max([row.error_after for row in ranked] + [now.rms if now else 0.0]))
    what = f"RMS error of {now.observable}" if now else "RMS error"
    axes.set_xlabel(axis_label(f"Remaining {what}", now.unit if now else "1"))
    fit = (
        "" if found.lack_of_fit is None else f"Model as it is: chi²/n {found.lack_of_fit.reduced_chi2:.3g}. "
    )
    heading(
        figure, headline(found),
        fit + "Dark: named by the verdict. Hatched: with values that are not plausible. Beside each bar: remaining "
        "error, probability.",
    )  # fmt: skip
    return figure


@styled
def figure_next(found: NextMeasurements) -> Figure:
    """What the rivals expect of each proposed reading; the bars are two standard uncertainties of a reading.

    Raises
    ------
    RequestError
        No condition is proposed.
    """
    shown = [row for row in found.rows if row["predictions"]]
    if not shown:
        raise RequestError("no condition is proposed: there is nothing to draw", remedy="leave out --plot")
    most = max(len(row["predictions"]) for row in shown)
    figure = new_figure(1.3 + len(shown) * (0.65 + 0.2 * most))
    for axes, row in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
        values = list(row["predictions"].values())
        reach = None if row["sigma"] is None else 2 * row["sigma"]
        for place, value in enumerate(values):
            axes.errorbar(value, place, xerr=reach, fmt="o", color=COLOURS[place % len(COLOURS)], capsize=3)
        name_rows(axes, list(row["predictions"]))
        apart = "" if row["separation_sigma"] is None else f": {row['separation_sigma']:.1f} sigma apart"
        axes.set_title(row["text"].partition(":")[0] + apart)
    axes.set_xlabel(axis_label("Expected reading", shown[-1]["unit"]))
    bars = "bars: two standard uncertainties of it"
    heading(figure, "The next measurement", f"What each candidate expects of a reading; {bars}")
    return figure
