"""A recording of a simulated room, with all that is true about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.testing.rig import CALIBRATOR_HZ, Rig, Take, velocity_per_volt
from specan.testing.rig_files import write_tdms
from specan.testing.room import layout as rooms
from specan.testing.room.effects import Truth, check, hide
from specan.testing.room.field import LONGEST_S
from specan.testing.room.line import Real
from specan.testing.room.response import SAMPLING_RATE, impulse_responses, spectrum_for

DRIVE_V = 0.05
_LOWEST_HZ, _FADE_HZ = 12.0, 80.0
_VIBROMETER_NOISE = 5e-4  # over the velocity, both RMS


@dataclass(frozen=True)
class RoomCase:
    """A simulated recording and the truth behind it.

    Attributes
    ----------
    take : Take
        Channels with their noise-free quantities and the volts at the converters.
    rig : dict
        Content of the rig file; says nothing of what was hidden.
    effects : dict
        What was hidden, by name (with its place), and how strong.
    truth : Truth
        The room and the instruments as they are; `truth.details` holds what was drawn for each effect.
    responses : array (microphones, samples)
        Impulse responses; see `impulse_responses`.
    """

    take: Take
    rig: dict[str, Any]
    effects: dict[str, float]
    truth: Truth
    responses: Real
    hardware: Rig
    seed: int


def simulate(
    seed: int,
    effects: Mapping[str, float] | None = None,
    *,
    take: int = 0,
    n_mics: int = 12,
    duration_s: float = 5.0,
    noise: bool = True,
    cache: Path | str | None = None,
) -> RoomCase:
    """Record a room in which effects are hidden.

    Parameters
    ----------
    seed : int
        Draws the room, its true geometry and the open shapes of the effects, which do not depend on what is hidden.
    effects : mapping of str to float, optional
        Names in `EFFECTS`, with a place where wanted (``wall-impedance@z1``, ``microphone-gain@Mic 3``,
        ``microphone-delay@2`` for a card, ``dimension-error@x``), and their strengths; ``none`` is passed over.
    take : int
        Draws excitation, noise, and the errors of the instruments anew in the same room.
    n_mics : int
        Number of microphones, eight to a converter card.
    duration_s : float
        Length of the recording.
    noise : bool
        Whether the channels are noisy; hidden and common errors stay.
    cache : path, optional
        Directory of impulse responses.

    Returns
    -------
    RoomCase

    Raises
    ------
    RequestError
        An unknown effect, a place or a strength that cannot be.
    """
    hidden = {name: float(value) for name, value in (effects or {}).items() if name != "none"}
    check(hidden)
    if not 1 <= n_mics <= 24 or not 0.5 <= duration_s <= 600.0:
        raise RequestError(
            f"{n_mics} microphones for {duration_s:g} s are asked for",
            expected="1 to 24 microphones and 0.5 to 600 s",
        )
    truth = hide(_draw_truth(seed, take, n_mics), hidden, seed)
    responses = impulse_responses(truth.room, cache)
    hardware = _hardware(truth)
    rng = np.random.default_rng([seed, 4, take])
    recorded = _record(truth, hardware, responses, round(duration_s * SAMPLING_RATE), rng, noise)
    return RoomCase(recorded, rooms.rig_file(truth.layout, seed), hidden, truth, responses, hardware, seed)


def _draw_truth(seed: int, take: int, n_mics: int) -> Truth:
    """A room without hidden effects; streams of their own for layout, geometry and instruments."""
    layout = rooms.draw_layout(np.random.default_rng([seed, 1]), n_mics)
    room, temperature = rooms.draw_room(layout, np.random.default_rng([seed, 2]))
    rng = np.random.default_rng([seed, 3, take])
    u = rooms.UNCERTAINTY
    phase = u["calibration_phase_deg"] * rng.standard_normal(n_mics)
    card = u["card_delay_s"] * rng.standard_normal(len(layout.cards))
    delay = np.repeat(card, rooms.MICS_PER_CARD)[:n_mics] - phase / 360.0 / CALIBRATOR_HZ
    return Truth(
        layout=layout,
        room=room,
        temperature_C=temperature,
        gain_dB=u["calibration_dB"] * rng.standard_normal(n_mics),
        delay_s=delay,
        vibrometer_gain=u["vibrometer_gain_percent"] / 100.0 * rng.standard_normal(),
        vibrometer_delay_s=u["vibrometer_delay_s"] * rng.standard_normal(),
        vibrometer_noise=0.0,
        breakup=(0.0, 1000.0, 0.1),
        details={},
    )


def _hardware(truth: Truth) -> Rig:
    """The same as channels: sensitivities, and phases as the acquisition would show them at the calibrator's tone."""
    return Rig(
        dims_m=truth.layout.dims_m,
        piston_centre_m=truth.layout.piston.centre_m,
        piston_radius_m=truth.layout.piston.radius_m,
        mic_position_m=np.array(truth.layout.position_m),
        sensitivity_dB=truth.gain_dB,
        phase_deg=-360.0 * CALIBRATOR_HZ * truth.delay_s,
        nominal_V_per_Pa=rooms.MIC_MV_PER_PA / 1000.0,
        vibrometer_m_s_per_V=rooms.VIBROMETER_MM_S_PER_V / 1000.0,
    )


def _indicated(truth: Truth, frequency_hz: Real) -> NDArray[np.complex128]:
    """What the vibrometer makes of the diaphragm's mean velocity: its own errors, and the break-up at its point.

    The centre runs ahead of the mean by a resonator that the inertia of the cone drives.
    """
    strength, resonance, loss = truth.breakup
    x = frequency_hz / resonance
    ahead = 1.0 + strength * x**2 / (1.0 - x**2 + 1j * loss * x)
    late = np.exp(-2j * np.pi * frequency_hz * truth.vibrometer_delay_s)
    return (1.0 + truth.vibrometer_gain) * late * ahead


def _drive(rng: np.random.Generator, frequency_hz: Real, n: int) -> NDArray[np.complex128]:
    """Spectrum of gaussian noise of `DRIVE_V` volts within the band of the rig."""
    up = np.clip(frequency_hz / _LOWEST_HZ - 1.0, 0.0, 1.0)
    down = np.clip((rooms.F_MAX_HZ + _FADE_HZ - frequency_hz) / _FADE_HZ, 0.0, 1.0)
    spectrum = np.fft.rfft(rng.standard_normal(n)) * up * down
    level = np.sqrt(2.0 * np.sum(np.abs(spectrum) ** 2)) / n
    return spectrum * (DRIVE_V / level)


def _record(
    truth: Truth, hardware: Rig, responses: Real, n: int, rng: np.random.Generator, noise: bool
) -> Take:
    """All channels under noise; the field has been built up before the recording begins."""
    before = round((LONGEST_S + 0.5) * SAMPLING_RATE)  # the same for every room: the drive does not tell
    total = before + n + round(0.1 * SAMPLING_RATE)
    frequency = np.fft.rfftfreq(total, 1.0 / SAMPLING_RATE)

    def signal(spectrum: NDArray[np.complexfloating]) -> Real:
        return np.fft.irfft(spectrum, total)[..., before : before + n]

    drive: NDArray[np.complexfloating] = _drive(rng, frequency, total)
    moving = drive * velocity_per_volt(hardware, frequency)
    pressure = moving * spectrum_for(responses, total)
    quantities = np.vstack([signal(pressure), signal(moving), signal(drive)])
    shown = np.vstack(
        [
            signal(pressure * hardware.channel_phase(frequency)),
            signal(moving * _indicated(truth, frequency)),
            quantities[-1],
        ]
    )
    swing = float(np.std(quantities[-2]))
    spread = np.array(
        [hardware.mic_noise_Pa] * hardware.n_mics
        + [swing * float(np.hypot(_VIBROMETER_NOISE, truth.vibrometer_noise)), hardware.generator_noise_V]
    )
    if noise:
        shown = shown + spread[:, None] * rng.standard_normal(shown.shape)
    gain = np.append(hardware.sensitivity_V_per_Pa, [1.0 / hardware.vibrometer_m_s_per_V, 1.0])
    names = (*(f"Mic {m}" for m in range(1, hardware.n_mics + 1)), "Vibrometer", "Generator")
    properties: dict[str, object] = {"Excitation": "gaussian noise", "ExcitationAmplitude_V": DRIVE_V}
    return Take(names, SAMPLING_RATE, quantities, shown * gain[:, None], properties)


def write(case: RoomCase, directory: Path | str) -> tuple[Path, Path]:
    """Write ``recording.tdms`` (24-bit samples) and ``rig.toml``; nothing in them tells what was hidden.

    Returns
    -------
    recording, rig : Path
    """
    import tomlkit

    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    recording, rig_file = folder / "recording.tdms", folder / "rig.toml"
    write_tdms(recording, case.hardware, case.take)
    rig_file.write_text(tomlkit.dumps(case.rig), encoding="utf-8", newline="\n")
    return recording, rig_file
