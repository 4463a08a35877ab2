"""Figures of a step that changed the model, before and after, and of the error after each step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from specan.errors import RequestError
from specan.report.figure_style import COLOURS, GREY, heading, legend_above, new_figure, octave_axis, styled
from specan.report.figures import figure_named
from specan.report.figures_study_frf import measured_transfer
from specan.report.panels import Curve, Panel, draw_panels
from specan.report.residual_map import axis_text
from specan.report.study_rows import table_rows
from specan.report.study_words import falls, state_of
from specan.study.edit import Change
from specan.study.history import History, Step
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.study.study import Study
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
