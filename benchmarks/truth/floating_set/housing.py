"""From the ring's mesh forces to recordings: a path for each harmonic, modes of the housing, background, tachos."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from truth.floating_set.machine import SETTLE_S, STEPS_HZ, Machine, ring_forces

Real = NDArray[np.float64]

RATE = 12800.0
HARMONICS = 5  # of the mesh that have a path of their own
PULSES = 32  # of the sun's tacho


@dataclass(frozen=True)
class Housing:
    """What lies between the meshes and the samples.

    Attributes
    ----------
    angles_deg : tuple of float
        Places of the sensors.
    gain : complex array (sensors, harmonics)
        Path of each harmonic of the mesh.
    narrow, skew, floor : arrays (sensors, harmonics)
        A planet at an angle x from the sensor is heard as floor + (1 + skew sin x) exp(narrow (cos x - 1)).
    modes : array (sensors, modes, 3)
        Hz, damping ratio, participation.
    noise, tones : float
        White noise and background tones over the RMS of what the meshes give.
    disc_deg : array (PULSES,)
        Errors of the marks on the sun's disc.
    """

    angles_deg: tuple[float, ...]
    gain: NDArray[np.complex128]
    narrow: Real
    skew: Real
    floor: Real
    modes: Real
    noise: float
    tones: Real
    disc_deg: Real


@dataclass(frozen=True)
class Run:
    """One operating point."""

    sun_hz: float
    torque: float
    duration_s: float


def record(
    machine: Machine, housing: Housing, run: Run, mount_deg: float, rng: np.random.Generator
) -> dict[str, Real]:
    """Channels of one recording, m/s^2 and V."""
    carrier_hz = run.sun_hz * machine.z_sun / (machine.z_sun + machine.z_ring)
    steps = np.arange(-round(SETTLE_S * STEPS_HZ), round(run.duration_s * STEPS_HZ)) / STEPS_HZ
    turn = _turns(machine, carrier_hz, rng)(steps)
    force = resample_poly(ring_forces(machine, turn, run.torque), 1, round(STEPS_HZ / RATE), axis=-1)
    size = force.shape[1]
    coarse = turn[round(SETTLE_S * STEPS_HZ) :: round(STEPS_HZ / RATE)][:size]
    channels: dict[str, Real] = {}
    for s in range(len(housing.angles_deg)):
        heard = _heard(
            housing, s, force, 2 * np.pi * coarse + machine.places()[:, None], carrier_hz * machine.z_ring
        )
        level = float(np.std(heard))
        time = np.arange(size) / RATE
        for hz, part, phase in housing.tones:
            heard = heard + level * part * np.cos(2 * np.pi * (hz * time + phase))
        heard = heard + level * housing.noise * rng.standard_normal(size)
        if "bearing-defect" in machine.hidden:
            heard = heard + level * _bearing(machine.hidden["bearing-defect"], coarse, rng)
        channels[f"Acc {s + 1}"] = heard
    sun = coarse * (1 + machine.z_ring / machine.z_sun)
    channels["Tacho sun"] = _pulses(sun, PULSES, housing.disc_deg / 360)
    channels["Tacho carrier"] = _pulses(coarse + mount_deg / 360, 1, np.zeros(1))
    return channels


def _turns(machine: Machine, carrier_hz: float, rng: np.random.Generator):
    """Turns of the carrier against time: begun anywhere, at a speed that wanders, or that is unsteady."""
    slow = rng.normal(0, 5e-4, 3), rng.uniform(0.1, 0.8, 3), rng.uniform(0, 1, 3)
    part = machine.value("speed-fluctuation", "part")
    quick = part * rng.uniform(0.3, 1, 4) / 2, rng.uniform(0.8, 6.0, 4), rng.uniform(0, 1, 4)
    begun = rng.uniform(0, 100)

    def turns(time: Real) -> Real:
        off = sum(a * np.sin(2 * np.pi * (f * time + p)) / (2 * np.pi * f)
                  for parts in (slow, quick) for a, f, p in zip(*parts, strict=True))  # fmt: skip
        return begun + carrier_hz * (time + off)

    return turns


def _heard(housing: Housing, s: int, force: Real, place: Real, mesh_hz: float) -> Real:
    """Acceleration at a sensor: each harmonic of each planet through its own path, then the housing's modes."""
    size = force.shape[1]
    hz = np.fft.rfftfreq(size, 1 / RATE)
    spectra = np.fft.rfft(force, axis=-1)
    x = place - math.radians(housing.angles_deg[s])
    total = np.zeros(hz.size, complex)
    for h in range(1, HARMONICS + 1):
        band = np.abs(hz / mesh_hz - h) < 0.5
        own = np.fft.irfft(spectra * band, size, axis=-1)
        k = h - 1
        window = housing.floor[s, k] + (1 + housing.skew[s, k] * np.sin(x)) * np.exp(
            housing.narrow[s, k] * (np.cos(x) - 1)
        )
        total += housing.gain[s, k] * np.fft.rfft(np.sum(window * own, axis=0))
    omega = 2 * np.pi * hz
    modes = np.ones(hz.size, complex)
    for natural, damping, part in housing.modes[s]:
        modes += part * (hz / natural) ** 2 / (1 - (hz / natural) ** 2 + 2j * damping * hz / natural)
    return np.fft.irfft(-(omega**2) * total * modes / 1e9, size)


def _bearing(defect: dict[str, float], turn: Real, rng: np.random.Generator) -> Real:
    """Impacts of a planet's bearing, louder where the planet is near."""
    hits = np.flatnonzero(np.diff(np.floor(turn * defect["order"]))) + 1
    shock = np.zeros(turn.size)
    shock[hits] = (1 + 0.6 * np.cos(2 * np.pi * turn[hits])) * (1 + 0.1 * rng.standard_normal(hits.size))
    time = np.arange(128) / RATE
    ring = np.exp(-0.3 * defect["hz"] * time) * np.sin(2 * np.pi * defect["hz"] * time)
    return defect["peak"] * np.convolve(shock, ring)[: turn.size]


def _pulses(turn: Real, count: int, error: Real) -> Real:
    """Volts of a disc with marks that are a little off, half of each pitch high; edges last one sample."""
    marks = (np.arange(count) + 0.0) / count + error
    phase = np.interp(
        turn % 1.0, np.concatenate([marks[-1:] - 1, marks, marks[:1] + 1]), np.arange(-1, count + 1.0)
    )
    phase += np.floor(turn) * count
    step = np.maximum(np.gradient(phase), 1e-9)
    near = (phase + 0.25) % 1.0 - 0.25
    rise = np.clip(near / step + 0.5, 0, 1)
    fall = np.clip((near - 0.5) / step + 0.5, 0, 1)
    return 5.0 * (rise - fall)
