"""Figures of a study: measured beside model, where it fails, how the errors went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import csd, welch

from specan.arrays import Complex, Flags, Real
from specan.data.levels import decibels
from specan.dsp.transfer_function import phase_deg
from specan.errors import RequestError, require_known
from specan.models.rates import TIME
from specan.report.figure_style import (
    COLOURS,
    band_about,
    heading,
    legend_below,
    level_limits,
    new_figure,
    octave_axis,
    styled,
    with_gaps,
)
from specan.report.figures import figure_named
from specan.report.panels import Curve, Drawing, Panel, draw_panels, joined
from specan.report.residual_map import axis_text, plot_axes
from specan.report.study_sheets import state_of
from specan.study.comparison import Comparison, readings
from specan.study.observation import variable_named
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
from specan.study.observation.time import TimeObservation
from specan.study.study import Study
from specan.units import axis_label, convert, printed_unit

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
    if found.recorded and (of_model := figure_named(f"Comparison {study.model.name}")) is not None:
        return of_model(study, found.recorded[0], found.recorded[0].number(channel))
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


MOST_CHANNELS = 3  # columns of the figure: those that the model misses most
_DYNAMICS_DB = 70.0


@styled
def figure_compare_frf(study: Study, channel: str | None = None) -> Figure:
    """Magnitude and phase of one channel, or of those that the model misses most, and the difference of the levels.

    The band is two standard uncertainties of the measurement to either side; what is common to all lines of a
    channel (its place, its calibration) and the declared discrepancy of the model are in it.
    """
    observation = study.problem.observations[0]
    assert isinstance(observation, FrfObservation)
    found = measured_transfer(observation, study.problem.plain(study.shown.theta)[0])
    chosen = found.by_misfit()[:MOST_CHANNELS] if channel is None else [_number(found, channel)]
    unit = study.model.observables[str(observation.observable[0])].unit
    drawings = [response_drawing(found, row, unit) for row in chosen]
    figure = new_figure(6.4, max(1.2 + 3.0 * len(chosen), 5.6))
    grid = figure.subplots(
        3, len(chosen), sharex=True, sharey="row", squeeze=False, height_ratios=[3, 2, 1.5]
    )
    for drawing, row, axes in zip(drawings, chosen, grid.T, strict=True):
        draw_panels(axes, drawing.panels)
        axes[0].set_title(found.channels[row])
        axes[2].set_xlabel(drawing.x_label)
    for axes, panel in zip(grid[:, 0], joined(drawings).panels, strict=True):
        axes.set_ylim(*(panel.limits or axes.get_ylim()))
    for axes in grid.flat:
        axes.label_outer()
    octave_axis(grid[-1, 0], *drawings[0].span)
    legend_below(figure, grid[0, 0])
    figure.align_ylabels(grid[:, 0])
    largest = f"{len(chosen)} of {len(found.channels)} {observation.plural}, the largest errors first"
    which = largest if channel is None else channel
    heading(
        figure,
        f"{study.directory.resolve().name}: measured and model",
        *state_of(study),
        f"{found.name}: {which}",
    )
    return figure


def _number(found: MeasuredTransfer, channel: str) -> int:
    require_known(channel, found.channels, f"there is no channel {channel!r}")
    return found.channels.index(channel)


def response_drawing(
    found: MeasuredTransfer, row: int, unit: str, before: MeasuredTransfer | None = None, of: str = ""
) -> Drawing:
    """Magnitude, phase and difference of the levels of one channel; `before` is what the model was.

    The names of the curves begin with `of`. Bands are two standard uncertainties, about what was measured and about no
    error.
    """
    f, level = found.frequency_hz, decibels(found.measured[row])
    low, high = band_about(level, 2 * found.u_relative[row])
    phase, reach = with_gaps(phase_deg(found.measured[row])), 2 * found.u_phase_deg[row]
    measured, model, was = (f"{of} {what}".lstrip() for what in RESPONSES)
    levels = [Curve(measured, f, level, low, high)]
    phases = [Curve(measured, f, phase, phase - reach, phase + reach)]
    errors = [Curve(measured, f, np.where(np.isfinite(level), 0.0, np.nan), low - level, high - level)]
    for name, one in ((model, found), (was, before)):
        if one is not None:
            levels.append(Curve(name, f, decibels(one.model[row])))
            phases.append(Curve(name, f, with_gaps(phase_deg(one.model[row]))))
            errors.append(Curve(name, f, one.error_dB[row]))
    worst = max(float(np.nanquantile(np.abs(curve.y), 0.98)) for curve in errors)
    end = float(np.clip(worst, 1.0, 20.0))
    used = f[np.isfinite(found.measured).any(axis=0)]
    panels = (
        Panel(f"Magnitude / dB re 1 {printed_unit(unit)}", tuple(levels), level_limits(level, _DYNAMICS_DB)),
        Panel("Phase / degrees", tuple(phases), share=2, leads=False, phase=True),
        Panel("Measured - model\n/ dB", tuple(errors), (-end, end), share=2, leads=False),
    )
    ends = float(used.min()), float(used.max())
    return Drawing(found.name, ("",), "Frequency / Hz", panels, hertz=True, x_limits=ends)


RESPONSES = ("measured", "model", "model before")


@dataclass(frozen=True, eq=False)
class MeasuredTransfer:
    """One recording's transfer functions; NaN at lines that are not in use.

    Attributes
    ----------
    name : str
        The recording.
    channels : tuple of str
    frequency_hz : array (lines,)
    measured, model : complex array (channels, lines)
        The model's as the analysis would see it, through the same windows.
    u_relative : array (channels, lines)
        Standard uncertainty of the measured magnitude over the magnitude: noise, place, calibration and the model's
        declared discrepancy.
    u_phase_deg : array (channels, lines)
    """

    name: str
    channels: tuple[str, ...]
    frequency_hz: Real
    measured: Complex
    model: Complex
    u_relative: Real
    u_phase_deg: Real

    @property
    def error_dB(self) -> Real:
        """Level of the measurement less that of the model."""
        return np.asarray(decibels(self.measured) - decibels(self.model))

    def by_misfit(self) -> list[int]:
        """Numbers of the channels in use, that with the largest error in units of the uncertainty first."""
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.abs(self.model - self.measured) / (np.abs(self.measured) * self.u_relative)
        share = [float(np.nanmean(row**2)) if np.isfinite(row).any() else 0.0 for row in off]
        used = np.asarray(np.isfinite(self.measured).any(axis=1), dtype=bool)
        return [int(k) for k in np.argsort(share, kind="stable")[::-1] if used[k]]


def measured_transfer(observation: FrfObservation, predicted: Real) -> MeasuredTransfer:
    """What was measured and what a model expects in its place.

    Parameters
    ----------
    observation : FrfObservation
    predicted : array (observation.n,)
        Real parts, then imaginary parts, of the rows in use.

    Notes
    -----
    What is common to a microphone's lines is a set of complex directions ``s``; along the measured value
    they change the magnitude, across it the phase: with ``s/H``, the real part is relative, the imaginary part
    is in radians.
    """
    kept = observation.kept
    measured = np.where(kept, observation.response, np.nan)
    model = observation.lines_of(predicted, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = observation.common / measured[..., None]
        noise = observation.noise / np.abs(measured)
    along = np.sqrt(noise**2 + np.sum(turned.real**2, axis=-1))
    across = np.sqrt(noise**2 + np.sum(turned.imag**2, axis=-1))
    return MeasuredTransfer(
        observation.name,
        observation.channels,
        observation.frequency_hz,
        measured,
        model,
        along,
        np.degrees(across),
    )
