"""Measured transfer functions beside a model's, as magnitude and phase with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.report.figure_style import band_about
from specan.study.observation.frf import FrfObservation

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
    model = np.full(kept.shape, np.nan, dtype=complex)
    half = observation.n // 2
    model[kept] = predicted[:half] + 1j * predicted[half:]
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
