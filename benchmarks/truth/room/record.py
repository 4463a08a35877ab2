"""From impulse responses and instruments to the channels of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truth.rig import Rig, Take, velocity_per_volt
from truth.room import layout as rooms
from truth.room.field import LONGEST_S
from truth.room.line import Real
from truth.room.response import SAMPLING_RATE, spectrum_for
from truth.room.truth import Truth

DRIVE_V = 0.05
_LOWEST_HZ, _FADE_HZ = 12.0, 80.0
_VIBROMETER_NOISE = 5e-4  # over the velocity, both RMS
_BEFORE_S = LONGEST_S + 0.5  # the same for every room: the drive does not tell
_AFTER_S = 0.1

Complex = NDArray[np.complexfloating]


@dataclass(frozen=True)
class Session:
    """How long, under what drive, and whether noise is heard.

    Attributes
    ----------
    tone_hz : float or None
        Frequency of a sine; noise within the band of the rig where there is none.
    """

    duration_s: float
    noise: bool
    tone_hz: float | None = None


def record(
    truth: Truth, hardware: Rig, responses: Sequence[Real], session: Session, rng: np.random.Generator
) -> Take:
    """All channels; the field has been built up before the recording begins.

    Parameters
    ----------
    responses : sequence of array
        Impulse responses at equal distances of time over the recording; one where nothing changes.
    """
    n, before = round(session.duration_s * SAMPLING_RATE), round(_BEFORE_S * SAMPLING_RATE)
    total = before + n + round(_AFTER_S * SAMPLING_RATE)
    frequency = np.fft.rfftfreq(total, 1.0 / SAMPLING_RATE)

    def signal(spectrum: Complex) -> Real:
        return np.fft.irfft(spectrum, total)[..., before : before + n]

    drive = _sine(rng, session.tone_hz, total) if session.tone_hz else _noise(rng, frequency, total)
    moving = drive * velocity_per_volt(hardware, frequency)
    pressure = _heard(truth, moving, [spectrum_for(r, total) for r in responses], frequency, before, n)
    quantities = np.vstack([signal(pressure), signal(moving), signal(drive)])
    seen = moving * _indicated(truth, frequency)
    if not session.noise and truth.vibrometer_noise:
        seen = seen * _as_a_bias(truth, hardware, frequency)
    shown = np.vstack([signal(pressure * hardware.channel_phase(frequency)), signal(seen), quantities[-1]])
    if session.noise:
        swing = float(np.std(quantities[-2]))
        spread = np.array(
            [hardware.mic_noise_Pa] * hardware.n_mics
            + [
                swing * float(np.hypot(_VIBROMETER_NOISE, truth.vibrometer_noise)),
                hardware.generator_noise_V,
            ]
        )
        shown = shown + spread[:, None] * rng.standard_normal(shown.shape)
    gain = np.append(hardware.sensitivity_V_per_Pa, [1.0 / hardware.vibrometer_m_s_per_V, 1.0])
    names = (*(f"Mic {m}" for m in range(1, hardware.n_mics + 1)), "Vibrometer", "Generator")
    return Take(names, SAMPLING_RATE, quantities, shown * gain[:, None], _properties(session))


def _properties(session: Session) -> dict[str, object]:
    if session.tone_hz is None:
        return {"Excitation": "gaussian noise", "ExcitationAmplitude_V": DRIVE_V}
    return {
        "Excitation": "sine",
        "ExcitationFrequency_Hz": session.tone_hz,
        "ExcitationAmplitude_V": DRIVE_V * float(np.sqrt(2.0)),
    }


def _heard(
    truth: Truth, moving: Complex, fields: Sequence[Complex], frequency: Real, before: int, n: int
) -> Complex:
    """Spectrum of what the microphones hear: the field, and what shakes them."""
    pressure = moving * fields[0]
    if len(fields) > 1:
        total = round((_BEFORE_S + _AFTER_S) * SAMPLING_RATE) + n
        place = np.clip((np.arange(total) - before) / (n - 1), 0.0, 1.0) * (len(fields) - 1)
        parts = (
            np.clip(1.0 - np.abs(place - k), 0.0, None) * np.fft.irfft(moving * field, total)
            for k, field in enumerate(fields)
        )
        pressure = np.fft.rfft(sum(parts))
    if truth.shaking is not None:
        x = frequency / truth.shaking.frequency_hz
        structure = 1j * x / truth.shaking.quality / (1.0 - x**2 + 1j * x / truth.shaking.quality)
        pressure = pressure + np.outer(truth.shaking.pressure, moving * structure)
    return pressure


def _indicated(truth: Truth, frequency_hz: Real) -> Complex:
    """What the vibrometer makes of the diaphragm's mean velocity: its own errors, and the break-up at its point.

    The centre runs ahead of the mean by a resonator that the inertia of the cone drives.
    """
    strength, resonance, loss = truth.breakup
    x = frequency_hz / resonance
    ahead = 1.0 + strength * x**2 / (1.0 - x**2 + 1j * loss * x)
    late = np.exp(-2j * np.pi * frequency_hz * truth.vibrometer_delay_s)
    return (1.0 + truth.vibrometer_gain) * late * ahead


def _band(frequency_hz: Real) -> Real:
    """Amplitude of the noise over frequency."""
    up = np.clip(frequency_hz / _LOWEST_HZ - 1.0, 0.0, 1.0)
    down = np.clip((rooms.F_MAX_HZ + _FADE_HZ - frequency_hz) / _FADE_HZ, 0.0, 1.0)
    return up * down


def _as_a_bias(truth: Truth, hardware: Rig, frequency_hz: Real) -> Real:
    """Factor by which noise on the velocity lowers an H1 in the mean: 1 + noise over velocity, line by line."""
    velocity = np.abs(_band(frequency_hz) * velocity_per_volt(hardware, frequency_hz)) ** 2
    noise = truth.vibrometer_noise**2 * np.mean(velocity)
    return 1.0 + noise / np.maximum(velocity, 1e-3 * noise)


def _noise(rng: np.random.Generator, frequency_hz: Real, n: int) -> Complex:
    """Spectrum of gaussian noise of `DRIVE_V` volts within the band of the rig."""
    spectrum = np.fft.rfft(rng.standard_normal(n)) * _band(frequency_hz)
    level = np.sqrt(2.0 * np.sum(np.abs(spectrum) ** 2)) / n
    return spectrum * (DRIVE_V / level)


def _sine(rng: np.random.Generator, frequency_hz: float, n: int) -> Complex:
    """Spectrum of a sine of `DRIVE_V` volts that begins long before the recording."""
    time = np.arange(n) / SAMPLING_RATE
    return np.fft.rfft(np.sqrt(2.0) * DRIVE_V * np.sin(2 * np.pi * (frequency_hz * time + rng.uniform())))
