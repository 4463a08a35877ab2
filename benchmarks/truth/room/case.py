"""A recording of a simulated room, with all that is true about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import RequestError
from truth.rig import CALIBRATOR_HZ, Rig, Take, calibrator_take
from truth.rig_files import write_tdms
from truth.room import layout as rooms
from truth.room.effects import check, hide
from truth.room.field import Room, Uneven
from truth.room.layout import at_temperature
from truth.room.line import Real
from truth.room.record import Session, record
from truth.room.response import impulse_responses
from truth.room.truth import Truth

_DRIFT_STEP_K = 0.5
_DELIVERED_DB, _DELIVERED_DEG = 0.7, 2.0  # standard deviations of an uncalibrated set
_ADAPTER = 6  # microphones that go into the calibrator at once
_CALIBRATION_RATE, _CALIBRATION_S = 8192.0, 6.0
MAINS_HZ = 50.02
UNEVEN_UP_TO_HZ = 560.0  # above, modes lie off the bands that are looked at


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
        Impulse responses (in drifting air: half way); see `impulse_responses`.
    hardware, at_calibration : Rig
        The channels while recording, and when they were calibrated.
    """

    take: Take
    rig: dict[str, Any]
    effects: dict[str, float]
    truth: Truth
    responses: Real
    hardware: Rig
    at_calibration: Rig
    seed: int


def simulate(
    seed: int,
    effects: Mapping[str, float] | None = None,
    *,
    take: int = 0,
    repeat: int = 0,
    n_mics: int = 12,
    duration_s: float = 5.0,
    noise: bool = True,
    tone_hz: float | None = None,
    hum_Pa: float = 0.0,
    calibrated: bool = True,
    uneven_percent: tuple[float, float] | None = None,
    cache: Path | str | None = None,
) -> RoomCase:
    """Record a room in which effects are hidden.

    Parameters
    ----------
    seed : int
        Draws the room, its true geometry and the open shapes of the effects, which do not depend on what is hidden.
    effects : mapping of str to float, optional
        Names in `EFFECTS`, with a place where wanted (``wall-impedance@z1``, ``microphone-gain@Mic 3``,
        ``microphone-delay@2`` for a card, ``dimension-error@x``), and their strengths; ``none`` is ignored.
    take : int
        Draws excitation, noise, and the errors of the instruments anew in the same room.
    repeat : int
        Draws excitation and noise anew; room and instruments stay.
    n_mics : int
        Number of microphones, eight to a converter card.
    duration_s : float
        Length of the recording.
    noise : bool
        Whether the channels are noisy; hidden and common errors stay. Hidden noise of the vibrometer then stands in
        the recording as the bias that it gives to a transfer function.
    tone_hz : float, optional
        A sine of this frequency instead of noise.
    hum_Pa : float
        RMS of the hum of the mains, 50 Hz and odd harmonics, at a usual microphone.
    calibrated : bool
        Whether the nominal sensitivities are true but for the errors that a calibration leaves. Otherwise the
        microphones are as they come: some decibels and degrees off, which `write` tells by calibrator recordings.
    uneven_percent : tuple of float, optional
        RMS of what every mode's natural frequency and damping differ from those of the box.
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
    if tone_hz is not None and not 0.0 < tone_hz <= rooms.F_MAX_HZ:
        raise RequestError(f"a tone of {tone_hz:g} Hz is asked for", expected=f"up to {rooms.F_MAX_HZ:g} Hz")
    truth = hide(_draw_truth(seed, take, n_mics), hidden, seed)
    if uneven_percent is not None:
        truth = replace(truth, room=_with_uneven_modes(truth.room, uneven_percent, seed))
    responses = [impulse_responses(room, cache) for room in _over_time(truth)]
    raw = _as_delivered(seed, take, n_mics) if not calibrated else (np.zeros(n_mics), np.zeros(n_mics))
    hardware = _hardware(truth, raw[0] + truth.gain_dB, raw[1] - 360.0 * CALIBRATOR_HZ * truth.delay_s)
    rng = np.random.default_rng([seed, 4, take, repeat] if repeat else [seed, 4, take])
    recorded = record(truth, hardware, responses, Session(duration_s, noise, tone_hz), rng)
    if hum_Pa:
        recorded = _with_hum(recorded, hardware, hum_Pa, seed)
    return RoomCase(
        take=recorded,
        rig=rooms.rig_file(truth.layout, seed),
        effects=hidden,
        truth=truth,
        responses=responses[len(responses) // 2],
        hardware=hardware,
        at_calibration=_hardware(truth, *raw),
        seed=seed,
    )


def _with_hum(take: Take, hardware: Rig, level_Pa: float, seed: int) -> Take:
    """The same with a hum that each microphone hears in its own strength and phase, always the same."""
    rng = np.random.default_rng([seed, 6])
    heard = level_Pa * np.exp(0.5 * rng.standard_normal((hardware.n_mics, 3)))
    phase = 2.0 * np.pi * rng.uniform(size=heard.shape)
    time = np.arange(take.volts.shape[1]) / take.sampling_rate
    volts = take.volts.copy()
    for k, harmonic in enumerate((1, 3, 5)):
        turn = 2.0 * np.pi * harmonic * MAINS_HZ * time
        hum = np.sqrt(2.0) / harmonic * heard[:, k, None] * np.sin(turn + phase[:, k, None])
        volts[: hardware.n_mics] += hardware.sensitivity_V_per_Pa[:, None] * hum
    return replace(take, volts=volts)


def background(case: RoomCase, *, duration_s: float = 5.0, hum_Pa: float = 0.0) -> Take:
    """What the channels of a case show while the loudspeaker is silent: their noise, and a hum."""
    n, hardware = round(duration_s * case.take.sampling_rate), case.hardware
    spread = np.array(
        [hardware.mic_noise_Pa] * hardware.n_mics
        + [hardware.vibrometer_noise_m_s, hardware.generator_noise_V]
    )
    shown = spread[:, None] * np.random.default_rng([case.seed, 7]).standard_normal((len(spread), n))
    gain = np.append(hardware.sensitivity_V_per_Pa, [1.0 / hardware.vibrometer_m_s_per_V, 1.0])
    silent = replace(case.take, truth=np.zeros_like(shown), volts=shown * gain[:, None], properties={})
    return _with_hum(silent, hardware, hum_Pa, case.seed) if hum_Pa else silent


def _over_time(truth: Truth) -> list[Room]:
    """The room from the beginning of the recording to its end, in steps that a line hardly sees."""
    if not truth.drift_K:
        return [truth.room]
    steps = 2 * int(np.ceil(abs(truth.drift_K) / 2.0 / _DRIFT_STEP_K))
    part = np.linspace(-0.5, 0.5, steps + 1)
    return [at_temperature(truth.room, truth.temperature_C + p * truth.drift_K) for p in part]


def _with_uneven_modes(room: Room, percent: tuple[float, float], seed: int) -> Room:
    """The room with every mode somewhat elsewhere: uniform in frequency, skew in damping."""
    rng = np.random.default_rng([seed, 8])
    edges = np.array(room.dims_m)
    most = (2.0 * UNEVEN_UP_TO_HZ * edges / room.sound_speed).astype(int) + 1
    found = []
    for orders in np.ndindex(*most):
        frequency = room.sound_speed / 2.0 * float(np.linalg.norm(np.array(orders) / edges))
        shift = percent[0] / 100.0 * rng.uniform(-np.sqrt(3.0), np.sqrt(3.0))
        duller = percent[1] / 100.0 * (rng.exponential() - 1.0)  # of mean 0 and standard deviation 1
        if 0.0 < frequency <= UNEVEN_UP_TO_HZ:
            first, second, third = orders
            found.append(Uneven((first, second, third), (1.0 + shift) ** 2 - 1.0, duller))
    return replace(room, uneven=tuple(found))


def _as_delivered(seed: int, take: int, n_mics: int) -> tuple[Real, Real]:
    """Sensitivities in dB over the nominal one, phases in degrees at 1 kHz, of microphones as they are delivered."""
    rng = np.random.default_rng([seed, 5, take])
    return _DELIVERED_DB * rng.standard_normal(n_mics), _DELIVERED_DEG * rng.standard_normal(n_mics)


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


def _hardware(truth: Truth, sensitivity_dB: Real, phase_deg: Real) -> Rig:
    """The rig as channels: sensitivities, and phases as the acquisition would show them at the calibrator's tone."""
    return Rig(
        dims_m=truth.layout.dims_m,
        piston_centre_m=truth.layout.piston.centre_m,
        piston_radius_m=truth.layout.piston.radius_m,
        mic_position_m=np.array(truth.layout.position_m),
        sensitivity_dB=sensitivity_dB,
        phase_deg=phase_deg,
        nominal_V_per_Pa=rooms.MIC_MV_PER_PA / 1000.0,
        vibrometer_m_s_per_V=rooms.VIBROMETER_MM_S_PER_V / 1000.0,
    )


def insertions(n_mics: int) -> list[tuple[int, ...]]:
    """Groups of microphones that are calibrated together: six at a time, microphone 1 in each.

    >>> insertions(8)
    [(1, 2, 3, 4, 5, 6), (1, 7, 8)]
    """
    others = range(2, n_mics + 1)
    return [(1, *others[k : k + _ADAPTER - 1]) for k in range(0, len(others), _ADAPTER - 1)] or [(1,)]


def write(case: RoomCase, directory: Path | str, *, calibrations: bool = False) -> tuple[Path, Path]:
    """Write ``recording.tdms`` (24-bit samples) and ``rig.toml``; nothing in them tells what was hidden.

    Parameters
    ----------
    case : RoomCase
        What to write.
    directory : path
        Made if it is not there.
    calibrations : bool
        Write the calibrator's recordings too, ``calibration_1.tdms`` and so on: 1 kHz at 94 dB on up to six
        microphones at once, microphone 1 in every group. What happened after the calibration, hidden errors of
        microphones included, is not in them.

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
    if calibrations:
        n = round(_CALIBRATION_S * _CALIBRATION_RATE)
        for number, group in enumerate(insertions(case.hardware.n_mics), 1):
            heard = calibrator_take(
                case.at_calibration, group, n, _CALIBRATION_RATE, seed=1000 * case.seed + number
            )
            write_tdms(folder / f"calibration_{number}.tdms", case.at_calibration, heard)
    return recording, rig_file
