"""A simulated rig with a known truth: a piston in the wall of a box, microphones, vibrometer, generator.

The box is small and its field is summed over image sources, so that the transfer function from diaphragm
velocity to sound pressure is known in closed form at every frequency. What the converter cards would
have recorded follows from it: sensitivities and phases that differ from microphone to microphone, noise,
24-bit samples.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.floating]
Complex = NDArray[np.complexfloating]

CALIBRATOR_HZ = 1000.0


@dataclass(frozen=True)
class Rig:
    """Geometry, transducers and noise of the simulated rig; SI units.

    Attributes
    ----------
    dims_m : tuple of float
        Edges of the box; the piston sits in the rigid wall ``x = 0``, the other five walls reflect.
    mic_position_m : array (n, 3)
        Where the microphones stand.
    sensitivity_dB : array (n,)
        Deviation of each microphone from the nominal sensitivity.
    phase_deg : array (n,)
        Phase of each channel at 1 kHz, proportional to frequency; positive means that it leads. Zero
        for the first microphone, because a calibrator gives phases relative to that one.
    reflection : float
        Pressure reflection coefficient of the five walls, real.
    order : int
        Largest number of reflections that are summed.
    """

    dims_m: tuple[float, float, float]
    piston_centre_m: tuple[float, float, float]
    piston_radius_m: float
    mic_position_m: Real
    sensitivity_dB: Real
    phase_deg: Real
    sound_speed_m_s: float = 343.2
    density_kg_m3: float = 1.204
    reflection: float = 0.35
    order: int = 2
    speaker_hz: float = 130.0
    speaker_q: float = 0.9
    speaker_m_s_per_V: float = 0.15
    second_harmonic: float = 0.004
    nominal_V_per_Pa: float = 0.05
    vibrometer_m_s_per_V: float = 0.05
    mic_noise_Pa: float = 3e-4
    vibrometer_noise_m_s: float = 2e-6
    generator_noise_V: float = 2e-6

    @property
    def n_mics(self) -> int:
        """Number of microphones."""
        return len(self.mic_position_m)

    @property
    def sensitivity_V_per_Pa(self) -> Real:
        """True sensitivity of each microphone."""
        return self.nominal_V_per_Pa * 10 ** (self.sensitivity_dB / 20)

    def channel_phase(self, frequency_hz: Real) -> Complex:
        """Factor by which each microphone channel leads, shape (microphones, frequencies)."""
        turns = np.outer(self.phase_deg / 360.0, np.asarray(frequency_hz) / CALIBRATOR_HZ)
        return np.exp(2j * np.pi * turns)


def box_rig(n_mics: int = 24, seed: int = 4) -> Rig:
    """The rig of the sample data: a 0.9 m x 0.6 m x 0.7 m box with microphones on a jittered grid.

    Sensitivities spread over +-1 dB, phases over +-3 degrees.
    """
    rng = np.random.default_rng(seed)
    dims = (0.9, 0.6, 0.7)
    grid = np.array(list(itertools.product(range(4), range(3), range(2))), dtype=float)[:n_mics]
    place = np.array([0.2, 0.1, 0.18]) + grid * np.array([0.19, 0.18, 0.32])
    place += rng.uniform(-0.02, 0.02, place.shape)
    phase = rng.uniform(-3.0, 3.0, n_mics)
    phase[0] = 0.0
    return Rig(
        dims_m=dims,
        piston_centre_m=(0.0, 0.246, 0.323),
        piston_radius_m=0.05,
        mic_position_m=np.round(place, 4),
        sensitivity_dB=np.round(rng.uniform(-1.0, 1.0, n_mics), 3),
        phase_deg=np.round(phase, 3),
    )


def pressure_per_velocity(rig: Rig, frequency_hz: Real) -> Complex:
    r"""Sound pressure over diaphragm velocity at every microphone [Pa s/m], shape (n, frequencies).

    A small piston of radius a in a rigid wall radiates :math:`p/v = j\omega\rho a^2 e^{-jkr} / (2r)`
    (Pierce, Acoustics, section 5-8, far field, ka << 1); each reflection multiplies by R and moves the
    source to its mirror image (Allen & Berkley, JASA 65, 1979). The piston lies in the rigid wall, so it
    coincides with its own image there, which is the half space of the formula.
    """
    f = np.asarray(frequency_hz, dtype=float)
    omega = 2 * np.pi * f
    field = np.zeros((rig.n_mics, f.size), dtype=complex)
    for image, hits in _images(rig):
        distance = np.linalg.norm(rig.mic_position_m - image, axis=1)[:, None]
        field += rig.reflection**hits / distance * np.exp(-1j * omega * distance / rig.sound_speed_m_s)
    return 1j * omega * rig.density_kg_m3 * rig.piston_radius_m**2 / 2 * field


def _images(rig: Rig) -> list[tuple[Real, int]]:
    """Mirror images of the piston with the number of reflections that each took."""
    reach = range(-rig.order, rig.order + 1)
    found = []
    for nx, ny, nz, qy, qz in itertools.product(reach, reach, reach, (0, 1), (0, 1)):
        hits = abs(nx) + abs(ny - qy) + abs(ny) + abs(nz - qz) + abs(nz)
        if hits <= rig.order:
            x, y, z = rig.piston_centre_m
            lx, ly, lz = rig.dims_m
            place = [x + 2 * nx * lx, (1 - 2 * qy) * y + 2 * ny * ly, (1 - 2 * qz) * z + 2 * nz * lz]
            found.append((np.array(place), hits))
    return found


def velocity_per_volt(rig: Rig, frequency_hz: Real) -> Complex:
    r"""Diaphragm velocity over generator voltage [m/s/V]: a loudspeaker with one resonance."""
    f = np.asarray(frequency_hz, dtype=float)
    ratio = f / rig.speaker_hz
    return rig.speaker_m_s_per_V * 1j * ratio / rig.speaker_q / (1 - ratio**2 + 1j * ratio / rig.speaker_q)


@dataclass(frozen=True)
class Take:
    """One simulated recording: what truly was, and what the converters made of it.

    Attributes
    ----------
    names : tuple of str
        Channels, in order.
    truth : array (channels, samples)
        Noise-free quantity of each channel in Pa, m/s or V.
    volts : array (channels, samples)
        What reached the converter: sensitivity, phase and noise included.
    properties : dict
        Properties of the group, as the acquisition program writes them.
    """

    names: tuple[str, ...]
    sampling_rate: float
    truth: Real
    volts: Real
    properties: dict[str, object]

    def only(self, names: Sequence[str]) -> Take:
        """The same with some of the channels."""
        rows = [self.names.index(name) for name in names]
        return replace(self, names=tuple(names), truth=self.truth[rows], volts=self.volts[rows])


def sine_take(
    rig: Rig, frequency_hz: float, amplitude_V: float, n: int, sampling_rate: float, seed: int
) -> Take:
    """All channels under a sine; the loudspeaker adds a second harmonic to the velocity."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / sampling_rate
    harmonics = np.array([frequency_hz, 2 * frequency_hz])
    drive = amplitude_V * np.exp(1j * rng.uniform(-np.pi, np.pi))
    velocity = drive * velocity_per_volt(rig, harmonics[:1])[0] * np.array([1.0, rig.second_harmonic])
    pressure = pressure_per_velocity(rig, harmonics) * velocity
    turning = np.exp(2j * np.pi * np.outer(harmonics, time))
    generator = np.real(drive * turning[0])
    return _take(
        rig,
        sampling_rate,
        np.real(pressure @ turning),
        np.real(pressure * rig.channel_phase(harmonics) @ turning),
        np.real(velocity @ turning),
        generator,
        rng,
        {"Excitation": "sine", "ExcitationFrequency_Hz": frequency_hz, "ExcitationAmplitude_V": amplitude_V},
    )


def noise_take(rig: Rig, rms_V: float, n: int, sampling_rate: float, seed: int) -> Take:
    """All channels under Gaussian noise up to 0.42 of the sampling rate.

    The field is built up before the recording begins: the part of the simulated stretch that circular
    convolution spoils is cut away.
    """
    rng = np.random.default_rng(seed)
    before = int(sampling_rate)
    f = np.fft.rfftfreq(n + before, 1 / sampling_rate)
    shape = 1.0 - np.clip((f / sampling_rate - 0.42) / 0.04, 0.0, 1.0)
    drive = np.fft.rfft(rng.standard_normal(n + before)) * shape
    drive *= rms_V / np.sqrt(2 * np.sum(np.abs(drive) ** 2)) * (n + before)

    def signal(spectrum: Complex) -> Real:
        return np.fft.irfft(spectrum, n + before)[..., before:]

    velocity = drive * velocity_per_volt(rig, f)
    pressure = velocity * pressure_per_velocity(rig, f)
    return _take(
        rig,
        sampling_rate,
        signal(pressure),
        signal(pressure * rig.channel_phase(f)),
        signal(velocity),
        signal(drive),
        rng,
        {"Excitation": "gaussian noise", "ExcitationAmplitude_V": rms_V},
    )


def knock_take(rig: Rig, volts: float, n: int, sampling_rate: float, seed: int) -> Take:
    """Something that is neither a sine nor noise: one short knock by the loudspeaker, half way."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(n, 1 / sampling_rate)
    width, centre = 5e-4, 0.5 * n / sampling_rate
    drive = volts * width * np.sqrt(2 * np.pi) * np.exp(-0.5 * (2 * np.pi * f * width) ** 2)
    drive = drive * np.exp(-2j * np.pi * f * centre) * sampling_rate
    velocity = drive * velocity_per_volt(rig, f)
    pressure = velocity * pressure_per_velocity(rig, f)
    return _take(
        rig,
        sampling_rate,
        np.fft.irfft(pressure, n),
        np.fft.irfft(pressure * rig.channel_phase(f), n),
        np.fft.irfft(velocity, n),
        np.fft.irfft(drive, n),
        rng,
        {},
    )


def calibrator_take(
    rig: Rig, mics: tuple[int, ...], n: int, sampling_rate: float, seed: int, level_dB: float = 94.0
) -> Take:
    """The microphones `mics` (numbered from 1) in a calibrator with a six-way adapter.

    The calibrator's tone is 1000.02 Hz rather than the nominal 1 kHz, and each insertion repeats to
    0.01 dB and 0.005 degree, as a good one does.
    """
    rng = np.random.default_rng(seed)
    chosen = np.array(mics) - 1
    true_hz = CALIBRATOR_HZ * (1 + 2e-5)
    turning = np.exp(2j * np.pi * (true_hz * np.arange(n) / sampling_rate + rng.uniform()))
    amplitude = np.sqrt(2) * 20e-6 * 10 ** (level_dB / 20)
    tone = np.broadcast_to(amplitude * np.real(turning), (len(mics), n))
    seat = 10 ** (rng.normal(0, 0.01, len(mics)) / 20) * np.exp(
        1j * np.radians(rng.normal(0, 0.01, len(mics)))
    )
    heard = np.real(np.outer(seat * rig.channel_phase(np.array([true_hz]))[chosen, 0], amplitude * turning))
    volts = (heard + rig.mic_noise_Pa * rng.standard_normal(tone.shape)) * rig.sensitivity_V_per_Pa[
        chosen, None
    ]
    properties: dict[str, object] = {
        "Excitation": "calibrator",
        "CalibratorFrequency_Hz": CALIBRATOR_HZ,
        "CalibratorLevel_dB": level_dB,
        "CalibratedChannels": ",".join(str(m) for m in mics),
    }
    return Take(tuple(f"Mic {m}" for m in mics), sampling_rate, np.array(tone), volts, properties)


def _take(
    rig: Rig,
    sampling_rate: float,
    pressure: Real,
    heard: Real,
    velocity: Real,
    generator: Real,
    rng: np.random.Generator,
    properties: dict[str, object],
) -> Take:
    """Sensitivities and noise onto the quantities of all 26 channels."""
    truth = np.vstack([pressure, velocity, generator])
    noise = rng.standard_normal(truth.shape)
    noise *= np.array([rig.mic_noise_Pa] * rig.n_mics + [rig.vibrometer_noise_m_s, rig.generator_noise_V])[
        :, None
    ]
    gain = np.append(rig.sensitivity_V_per_Pa, [1 / rig.vibrometer_m_s_per_V, 1.0])
    volts = (np.vstack([heard, velocity, generator]) + noise) * gain[:, None]
    names = (*(f"Mic {m}" for m in range(1, rig.n_mics + 1)), "Vibrometer", "Generator")
    return Take(names, sampling_rate, truth, volts, properties)
