"""Figures of a study of recordings: measured transfer functions, with their uncertainty, beside the model's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from specan.arrays import Complex, Real
from specan.dsp.transfer_function import phase_deg
from specan.errors import require_known
from specan.report.figure_style import (
    band_about,
    heading,
    legend_below,
    level_limits,
    new_figure,
    octave_axis,
    styled,
    with_gaps,
)
from specan.report.panels import Curve, Drawing, Panel, draw_panels, joined
from specan.report.study_sheets import state_of
from specan.study.observation.frf import FrfObservation
from specan.study.study import Study
from specan.units import printed_unit

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
    f, level = found.frequency_hz, level_dB(found.measured[row])
    low, high = band_about(level, 2 * found.u_relative[row])
    phase, reach = with_gaps(phase_deg(found.measured[row])), 2 * found.u_phase_deg[row]
    measured, model, was = (f"{of} {what}".lstrip() for what in RESPONSES)
    levels = [Curve(measured, f, level, low, high)]
    phases = [Curve(measured, f, phase, phase - reach, phase + reach)]
    errors = [Curve(measured, f, np.where(np.isfinite(level), 0.0, np.nan), low - level, high - level)]
    for name, one in ((model, found), (was, before)):
        if one is not None:
            levels.append(Curve(name, f, level_dB(one.model[row])))
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
        return np.asarray(level_dB(self.measured) - level_dB(self.model))

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


def level_dB(response: Complex) -> Real:
    """``20 log10 |H|``, minus infinity of zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(np.abs(response)))
