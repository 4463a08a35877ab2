"""Figures of a study of recordings: measured transfer functions, with their uncertainty, beside the model's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, nearest
from specan.report.figure_style import (
    COLOURS,
    band_about,
    heading,
    legend_below,
    level_limits,
    new_figure,
    octave_axis,
    phase_axis,
    styled,
    with_gaps,
)
from specan.report.study_words import state_of
from specan.study.observation.frf import FrfObservation
from specan.units import printed_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from specan.study.study import Study

MOST_CHANNELS = 3  # columns of the figure: those that the model misses most
_DYNAMICS_DB = 70.0
BAND: dict[str, Any] = {"color": "0.6", "alpha": 0.6, "linewidth": 0}


@styled
def figure_compare_frf(study: Study, channel: str | None = None) -> Figure:
    """Magnitude and phase of one channel, or of those that the model misses most, and the difference of the levels.

    The grey band is two standard uncertainties of the measurement to either side; what is common to all lines of a
    channel (its place, its calibration) and the declared discrepancy of the model are in it.
    """
    observation = study.problem.observations[0]
    assert isinstance(observation, FrfObservation)
    found = measured_transfer(observation, study.problem.plain(study.shown.theta)[0])
    chosen = found.by_misfit()[:MOST_CHANNELS] if channel is None else [_number(found, channel)]
    unit = study.model.observables[str(observation.observable[0])].unit
    figure = new_figure(6.4, max(1.2 + 3.0 * len(chosen), 5.6))
    grid = figure.subplots(
        3, len(chosen), sharex=True, sharey="row", squeeze=False, height_ratios=[3, 2, 1.5]
    )
    for row, axes in zip(chosen, grid.T, strict=True):
        _draw(found, row, axes)
    used = np.isfinite(found.measured[chosen]).any(axis=0)
    octave_axis(grid[-1, 0], float(found.frequency_hz[used].min()), float(found.frequency_hz[used].max()))
    grid[0, 0].set_ylim(*level_limits(level_dB(found.measured[chosen]), _DYNAMICS_DB))
    grid[0, 0].set_ylabel(f"Magnitude / dB re 1 {printed_unit(unit)}")
    phase_axis(grid[1, 0])
    grid[2, 0].set_ylabel("Model -\nmeasured / dB")
    error = np.abs(found.error_dB[chosen])
    reach = float(np.clip(np.nanquantile(error, 0.98), 1.0, 20.0))
    grid[2, 0].set_ylim(-reach, reach)
    legend_below(figure, grid[0, 0])
    figure.align_ylabels(grid[:, 0])
    plural = study.model.receivers.plural if study.model.receivers else "channels"
    which = (
        f"{len(chosen)} of {len(found.channels)} {plural}, the largest errors first"
        if channel is None
        else channel
    )
    heading(
        figure,
        f"{study.directory.resolve().name}: measured and model",
        *state_of(study),
        f"{found.name}: {which}",
    )
    return figure


def _number(found: MeasuredTransfer, channel: str) -> int:
    if channel not in found.channels:
        raise RequestError(f"there is no channel {channel!r}", remedy=nearest(channel, found.channels))
    return found.channels.index(channel)


def draw_response(found: MeasuredTransfer, row: int, level: Any, phase: Any) -> None:
    """Level with its band and phase of one channel, measured and model."""
    f, (low, high) = found.frequency_hz, found.band_dB()
    level.fill_between(f, low[row], high[row], label="measured, 95 %", **BAND)
    lines = (("measured", found.measured, "0.15", "-"), ("model", found.model, COLOURS[1], "--"))
    for text, response, colour, dash in lines:
        level.plot(f, level_dB(response[row]), color=colour, linestyle=dash, linewidth=1.0, label=text)
        shown = with_gaps(phase_deg(response[row]))
        phase.plot(f, shown, color=colour, linestyle=dash, linewidth=1.0)


def _draw(found: MeasuredTransfer, row: int, axes: Any) -> None:
    draw_response(found, row, axes[0], axes[1])
    f, (low, high), band = found.frequency_hz, found.band_dB(), BAND
    reach, phase = 2 * found.u_phase_deg[row], with_gaps(phase_deg(found.measured[row]))
    axes[1].fill_between(f, phase - reach, phase + reach, **band)
    level = level_dB(found.measured[row])
    axes[2].fill_between(f, low[row] - level, high[row] - level, **band)
    axes[2].plot(f, found.error_dB[row], color=COLOURS[1], linewidth=0.9)
    axes[0].set_title(found.channels[row])
    axes[2].set_xlabel("Frequency / Hz")


Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


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
    frequency_hz: Array
    measured: Complex
    model: Complex
    u_relative: Array
    u_phase_deg: Array

    def band_dB(self) -> tuple[Array, Array]:
        """Levels two standard uncertainties below and above the measured one."""
        return band_about(level_dB(self.measured), 2 * self.u_relative)

    @property
    def error_dB(self) -> Array:
        """Level of the model less that of the measurement."""
        return np.asarray(level_dB(self.model) - level_dB(self.measured))

    def by_misfit(self) -> list[int]:
        """Numbers of the channels in use, that with the largest error in units of the uncertainty first."""
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.abs(self.model - self.measured) / (np.abs(self.measured) * self.u_relative)
        share = [float(np.nanmean(row**2)) if np.isfinite(row).any() else 0.0 for row in off]
        used = np.asarray(np.isfinite(self.measured).any(axis=1), dtype=bool)
        return [int(k) for k in np.argsort(share, kind="stable")[::-1] if used[k]]


def measured_transfer(observation: FrfObservation, predicted: Array) -> MeasuredTransfer:
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


def level_dB(response: Complex) -> Array:
    """``20 log10 |H|``, minus infinity of zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(np.abs(response)))


def phase_deg(response: Complex) -> Array:
    """Phase in (-180, 180] degrees."""
    return np.asarray(np.degrees(np.angle(response)))
