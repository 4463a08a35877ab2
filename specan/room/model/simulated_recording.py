"""What microphones, vibrometer and generator would record if the room were as the model says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from specan.arrays import Complex, Real
from specan.errors import RequestError
from specan.models.chosen_model import ChosenModel, SimulatedChannel

VELOCITY = 5e-3  # m/s RMS of the diaphragm
LOUDSPEAKER = 0.1  # m/s per volt at the generator, at all frequencies
OVERSAMPLED = 2.56  # sampling rate over the highest frequency of a transfer function, at least
EDGE_HZ = 50.0  # noise reaches so far beyond the band: estimates at its ends need what lies around them
LONGEST_S = 120.0
_RATES = tuple(51200.0 / 2**k for k in range(7, -3, -1))
_LINES_AT_ONCE = 2000


def simulated_recording(
    chosen: ChosenModel,
    *,
    duration_s: float = 10.0,
    frequency_hz: float | None = None,
    noise: float = 0.0,
    seed: int = 0,
) -> tuple[list[SimulatedChannel], float]:
    """A recording under gaussian noise over the rig's band, or under a sine.

    The noise repeats with the recording's length, and so does everything that it drives: what the room heard before
    the recording began is in it.

    Parameters
    ----------
    chosen : ChosenModel
        Model of a room with effects and parameter values.
    duration_s : float
        Length.
    frequency_hz : float, optional
        A sine of this frequency instead of noise.
    noise : float
        Standard deviation of a noise that every microphone adds, white up to half the sampling rate, Pa.
    seed : int
        Of all that is random.

    Raises
    ------
    RequestError
        A length, frequency or noise that cannot be.
    """
    rig = chosen.assembly.model.settings["rig"]
    band = rig["band"]
    if not 0.1 <= duration_s <= LONGEST_S:
        raise RequestError(f"{duration_s:g} s are requested", expected=f"0.1 to {LONGEST_S:g} s")
    if frequency_hz is not None:
        check_frequency(frequency_hz, band["f_max_hz"])
    if not 0.0 <= noise < np.inf:
        raise RequestError(f"the noise is {noise:g} Pa", expected="a standard deviation, not below zero")
    # the lowest usual rate at which the band and its edge can be analysed
    needed = OVERSAMPLED * (band["f_max_hz"] + EDGE_HZ)
    rate = next((rate for rate in _RATES if rate >= needed), None)
    if rate is None:
        raise RequestError(
            f"a band up to {band['f_max_hz']:g} Hz needs more than {_RATES[-1]:g} samples per second"
        )
    n = round(duration_s * rate)
    rng = np.random.default_rng(seed)
    if frequency_hz is None:
        frequency, velocity = _gaussian(rng, n, rate, band)
        pressure = np.fft.irfft(_filtered(chosen, frequency, velocity, n, rate), n)
        moving = np.fft.irfft(velocity, n)
    else:
        turning = np.sqrt(2) * VELOCITY * np.exp(2j * np.pi * frequency_hz * np.arange(n) / rate)
        moving = turning.real
        transfer = _transfer(chosen, np.array([frequency_hz]), np.array([VELOCITY**2 * duration_s]))
        pressure = np.real(transfer * turning)
    pressure = pressure + noise * rng.standard_normal(pressure.shape)
    sensitivity = rig["mics"]["nominal_sensitivity_mV_per_Pa"]
    channels = [
        SimulatedChannel(name, "Pa", samples, sensitivity, "mV/Pa")
        for name, samples in zip(chosen.assembly.model.axes["microphone"], pressure, strict=True)
    ]
    velocity = rig["vibrometer"]["sensitivity_mm_s_per_V"] / 1000.0
    channels.append(SimulatedChannel("Vibrometer", "m/s", moving, velocity, "(m/s)/V"))
    channels.append(SimulatedChannel("Generator", "V", moving / LOUDSPEAKER, 1.0, "V/V"))
    return channels, rate


def check_frequency(frequency_hz: float, highest: float) -> None:
    """Refuse a frequency beyond the band of the rig file."""
    if not 1e-3 <= frequency_hz <= highest:
        raise RequestError(
            f"{frequency_hz:g} Hz is requested",
            expected=f"a frequency from 0.001 Hz up to [band] f_max_hz, {highest:g} Hz",
        )


def _gaussian(
    rng: np.random.Generator, n: int, rate: float, band: Mapping[str, float]
) -> tuple[Real, Complex]:
    """Frequencies, and the spectrum of a velocity that is flat over the band and fades at its edges."""
    frequency = np.arange(n // 2 + 1, dtype=np.float64) * (rate / n)
    low, high = band["f_min_hz"], band["f_max_hz"]
    up = np.clip(2.0 * frequency / low, 0.0, 1.0) if low else (frequency > 0).astype(float)
    shape = up * np.clip((high + EDGE_HZ - frequency) / (0.5 * EDGE_HZ), 0.0, 1.0)
    spectrum: Complex = np.fft.rfft(rng.standard_normal(n)) * shape
    spectrum *= VELOCITY * n / np.sqrt(2.0 * np.sum(np.abs(spectrum) ** 2))
    return frequency, spectrum


def _filtered(chosen: ChosenModel, frequency: Real, velocity: Complex, n: int, rate: float) -> Complex:
    """Spectra of the pressures."""
    driven = np.flatnonzero(np.abs(velocity))
    density = 2.0 * VELOCITY**2 / (2.0 * np.sum(frequency[driven] > 0) * rate / n)
    found = np.zeros((len(chosen.assembly.model.axes["microphone"]), len(frequency)), complex)
    for first in range(0, len(driven), _LINES_AT_ONCE):
        lines = driven[first : first + _LINES_AT_ONCE]
        transfer = _transfer(chosen, frequency[lines], np.full(len(lines), density))
        found[:, lines] = transfer * velocity[lines]
    return found


def _transfer(chosen: ChosenModel, frequency: Real, velocity_psd: Real) -> Complex:
    conditions = {"frequency": frequency, "velocity_psd": velocity_psd}
    found = chosen.assembly.evaluate(conditions, chosen.values, ["indicated_frf"])["indicated_frf"]
    return np.asarray(found)[: len(chosen.assembly.model.axes["microphone"])]
