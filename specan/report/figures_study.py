"""Figures of a study: measured beside model, where it fails, how the errors went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import csd, welch

from specan.arrays import Flags, Real
from specan.errors import RequestError, require_known
from specan.models.rates import TIME
from specan.report.figure_style import COLOURS, heading, legend_below, new_figure, styled
from specan.report.figures import figure_named
from specan.report.figures_study_frf import figure_compare_frf
from specan.report.residual_map import axis_text, plot_axes
from specan.report.study_sheets import state_of
from specan.study.comparison import Comparison, readings
from specan.study.observation import variable_named
from specan.study.observation.table import TableObservation
from specan.study.observation.time import TimeObservation
from specan.study.study import Study
from specan.units import axis_label, convert

MOST_PANELS = 4
MOST_LINES = 7
POINTS = 60  # along a curve


@dataclass(frozen=True)
class _Panel:
    """Rows of one observable at one level of the third variable; which variable goes where."""

    observable: str
    rows: Flags
    x: str
    line: str | None
    title: str


@styled
def figure_comparison(found: Comparison, channel: str | None = None) -> Figure:
    """Measured values with two standard uncertainties beside the fitted model, and what is between them.

    Of responses the figure that the model brings; else of transfer functions `figure_compare_frf`, of recordings
    `figure_compare_time`. Of tables, one pair of panels for every observable and, with three operating variables, for
    every level of the third. The curves run at the levels of the other variables; where readings lie beside their
    level (a brake that misses its set value), they are brought to it by the model, so that the gap between point and
    curve is the residual.

    Raises
    ------
    RequestError
        A `channel` that there is not, or one of a table.
    """
    study = found.study
    recorded = study.frf_errors()
    if recorded and (of_model := figure_named(f"Comparison {study.model.name}")) is not None:
        return of_model(study, recorded[0], recorded[0].number(channel))
    observation = study.problem.observations[0]
    drawn = {"transfer": figure_compare_frf, "time": figure_compare_time}
    own = drawn.get(observation.kind) or figure_named(f"Comparison {observation.kind}")
    if own is not None:
        return own(study, channel)
    assert isinstance(observation, TableObservation)
    if channel is not None:
        raise RequestError("a table has no channels", remedy="leave out --channel")
    predicted = study.problem.plain(study.shown.theta)[0]
    panels = _panels(observation)
    figure = new_figure(6.2, max(1.4 + 2.75 * len(panels), 5.6))
    grid = figure.subplots(2, len(panels), squeeze=False, sharex="col", height_ratios=[2, 1])
    for panel, (top, bottom) in zip(panels, grid.T, strict=True):
        _draw(study, observation, predicted, panel, top, bottom)
    for name in dict.fromkeys(panel.observable for panel in panels):
        same = [pair for panel, pair in zip(panels, grid.T, strict=True) if panel.observable == name]
        line = next(panel.line for panel in panels if panel.observable == name)
        for first, *others in zip(*same, strict=True):
            for axes in others:
                axes.sharey(first)
                axes.tick_params(labelleft=False)
                axes.set_ylabel("")
        reach = max(3.0, *(abs(end) for _, bottom in same for end in bottom.get_ylim()))
        same[0][1].set_ylim(-reach, reach)
        if line:
            legend_below(figure, same[0][0], MOST_LINES, title=axis_text(line, observation.variables))
    figure.align_ylabels(grid[:, 0])
    grid[1, 0].set_ylabel("(Measured - model)\n/ sigma" if study.data.known else "Relative to 1 %")
    bars = " with two standard uncertainties" if study.data.known else ""
    band = " Grey band: two standard uncertainties." if study.data.known else ""
    explained = f"Points: measured{bars}. Lines: model.{band}"
    heading(figure, f"{study.directory.resolve().name}: measured and model", *state_of(study), explained)
    return figure


def _panels(observation: TableObservation) -> list[_Panel]:
    found = []
    for name in dict.fromkeys(observation.observable.tolist()):
        rows = observation.observable == name
        varied = plot_axes({n: labels[rows] for n, labels in observation.labels.items()})
        order = [*varied, None, None, None][:3]
        x, line, third = order[0] or next(iter(observation.labels)), order[1], order[2]
        levels = [] if third is None else np.unique(observation.labels[third][rows]).tolist()
        if not 0 < len(levels) <= MOST_PANELS:
            found.append(_Panel(name, rows, x, line, ""))
            continue
        for level in levels:
            inside = rows & (observation.labels[third or ""] == level)
            title = variable_named(third or "", observation.variables).spoken(level)
            found.append(_Panel(name, inside, x, line, title))
    return found


def _draw(
    study: Study,
    observation: TableObservation,
    predicted: Real,
    panel: _Panel,
    top: Axes,
    bottom: Axes,
) -> None:
    x = readings(study.model, observation, panel.x)
    at_level = _predict(study, observation, _at_levels(study, observation, panel.x))
    shown = observation.measured - predicted + at_level
    z = (observation.measured - predicted) / observation.sigma
    bottom.axhspan(-2, 2, color="0.92", lw=0)
    bottom.axhline(0, color="0.5", lw=0.8)
    for text, colour, mine in _lines(observation, panel):
        sigma = 2 * observation.sigma[mine] if study.data.known else None
        top.errorbar(x[mine], shown[mine], yerr=sigma, fmt="o", ms=3, color=colour, capsize=2, lw=0.8)
        top.plot(*_curve(study, observation, panel, mine), color=colour, lw=1.2, label=text)
        bottom.plot(x[mine], z[mine], "o", ms=3, color=colour)
    top.set_ylabel(axis_label(panel.observable.capitalize(), study.model.observables[panel.observable].unit))
    top.set_title(panel.title)
    bottom.set_xlabel(axis_text(panel.x, observation.variables))


def _lines(observation: TableObservation, panel: _Panel) -> list[tuple[str, str, Flags]]:
    """Text, colour and rows of each level that gets a line of its own; thinned out where they are many."""
    if panel.line is None:
        return [("model", COLOURS[0], panel.rows)]
    values = observation.labels[panel.line]
    levels = np.unique(values[panel.rows])
    kept = levels[np.unique(np.linspace(0, levels.size - 1, MOST_LINES).astype(int))].tolist()
    return [
        (level if isinstance(level, str) else f"{level:g}", colour, panel.rows & (values == level))
        for level, colour in zip(kept, COLOURS, strict=False)
    ]


def _condition_of(study: Study, column: str) -> str | None:
    """The model's condition that a column holds; None for a label that is none of them."""
    return next((n for n, c in study.model.conditions.items() if c.column == column), None)


def _at_levels(study: Study, observation: TableObservation, but: str) -> dict[str, Real]:
    """Conditions with every operating variable at its level, except one."""
    moved = dict(observation.conditions)
    for column, level in observation.labels.items():
        if column not in (but, "measurement", "elapsed_time_s"):
            name = _condition_of(study, column)
            if name is None or study.model.conditions[name].group:
                continue
            condition = study.model.conditions[name]
            moved[name] = np.asarray(convert(level, condition.column_unit, condition.unit))
    return moved


def _predict(study: Study, observation: TableObservation, conditions: Mapping[str, Real]) -> Real:
    moved = replace(observation, conditions=dict(conditions), series=None, position=None)
    return moved.predict(study.problem.assembly, study.problem.values_at(study.shown.theta))


def _curve(study: Study, observation: TableObservation, panel: _Panel, mine: Flags) -> tuple[Real, Real]:
    """The model along x, everything else as in the first of the rows."""
    x = readings(study.model, observation, panel.x)[mine]
    name = _condition_of(study, panel.x)
    if name is None:  # no curve between labels that the model does not know: its values at the rows
        moved = _predict(study, observation, _at_levels(study, observation, panel.x))[mine]
        order = np.argsort(x, kind="stable")
        return x[order], moved[order]
    along = np.linspace(x.min(), x.max(), POINTS)
    condition = study.model.conditions[name]
    first = int(np.flatnonzero(mine)[0])
    at = {n: np.full(POINTS, v[first]) for n, v in _at_levels(study, observation, panel.x).items()}
    at[name] = np.asarray(convert(along, condition.column_unit, condition.unit))
    one_row = replace(observation.take(np.full(POINTS, first)), lines=None)
    return along, _predict(study, one_row, at)


SHOWN = 500  # samples of the first panel, about the largest error
SEGMENTS = 16


@styled
def figure_compare_time(study: Study, channel: str | None = None) -> Figure:
    """Measured and model about the largest error, the error over the whole time, and the spectrum of both.

    Parameters
    ----------
    study : Study
    channel : str, optional
        An observable; by default the first.

    Raises
    ------
    RequestError
        There is no such observable.
    """
    o = study.problem.observations[0]
    assert isinstance(o, TimeObservation)
    name = channel or next(iter(o.chains))
    require_known(name, o.chains, f"no channel {name!r}")
    rows = max(o.chains[name], key=len)
    time, measured = o.conditions[TIME][rows], o.measured[rows]
    predicted = study.problem.plain(study.shown.theta)[0][rows]
    gap, unit = measured - predicted, study.model.observables[name].unit
    figure = new_figure(7.0, 7.6)
    top, middle, bottom = figure.subplots(3, 1)
    first = int(np.clip(np.argmax(np.abs(gap)) - SHOWN // 2, 0, max(rows.size - SHOWN, 0)))
    near = slice(first, first + SHOWN)
    top.plot(time[near], measured[near], ".", ms=2.5, color="0.5", label="measured")
    top.plot(time[near], predicted[near], color=COLOURS[0], lw=1.2, label="model")
    top.set(ylabel=axis_label(name, unit))
    top.legend(loc="upper right", ncols=2)
    middle.plot(time, gap, color=COLOURS[1], lw=0.5)
    middle.set(xlabel="Time / s", ylabel=axis_label("Measured - model", unit))
    rate, size = 1 / float(time[1] - time[0]), max(2 * rows.size // (SEGMENTS + 1), 8)
    f, of_measured = welch(measured - measured.mean(), rate, nperseg=size)
    left = welch(gap, rate, nperseg=size)[1]
    bottom.loglog(f[1:], np.sqrt(of_measured[1:]), color="0.5", lw=1, label="measured")
    bottom.loglog(f[1:], np.sqrt(left[1:]), color=COLOURS[1], lw=1, label="measured - model")
    for word, column in (study.model.rates.inputs if study.model.rates else {}).items():
        given = o.conditions[column][rows]
        if np.ptp(given):
            cross = np.abs(csd(given, gap, rate, nperseg=size)[1]) / np.sqrt(
                welch(given, rate, nperseg=size)[1]
            )
            bottom.loglog(f[1:], cross[1:], "--", lw=1, color=COLOURS[2], label=f"of that, follows {word}")
    bottom.set(xlabel="Frequency / Hz", ylabel=axis_label("Amplitude density", f"{unit}/√Hz"))
    bottom.legend()
    heading(figure, f"{study.directory.resolve().name}: measured and model", *state_of(study), "")
    return figure
