"""What sensors on the housing and tachos give of a set: paths, resonances, wander of the speed, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truth.planetary_gear.machine import Machine, ring_forces

Real = NDArray[np.float64]

RATE = 12800.0
HIGHEST = 4  # harmonics of the mesh that the sensors pass
RIM = 6e8  # N/m
TACHO_SUN = 32


@dataclass(frozen=True)
class Housing:
    """Path from a planet to each sensor: window over the angle, resonances of the housing, gain.

    Attributes
    ----------
    form : str
        ``gauss``: exp(-x^2 / 2 w^2); ``arc``: a raised cosine over +-w.
    width, skew : float
        w in rad; the window is louder before the sensor than behind it by this part.
    resonance : array (sensors, modes, 3)
        Hz, damping ratio, participation.
    """

    angles_deg: tuple[float, ...]
    form: str
    width: float
    skew: float
    resonance: Real
    noise: float

    def window(self, angle: Real) -> Real:
        """Weight of a planet at an angle from the sensor."""
        x = (angle + np.pi) % (2 * np.pi) - np.pi
        if self.form == "gauss":
            shape = np.exp(-0.5 * (x / self.width) ** 2)
        else:
            shape = np.where(np.abs(x) < self.width, 0.5 + 0.5 * np.cos(np.pi * x / self.width), 0.0)
        return shape * (1 + self.skew * np.sin(x))

    def gain(self, sensor: int, frequency: Real) -> NDArray[np.complex128]:
        """Complex gain between rim and sensor."""
        found = np.ones(frequency.shape, dtype=complex)
        for natural, damping, part in self.resonance[sensor]:
            r = frequency / natural
            found += part * r**2 / (1 - r**2 + 2j * damping * r)
        return found


@dataclass(frozen=True)
class Run:
    """One operating point."""

    sun_hz: float
    torque: float
    duration_s: float


def record(
    machine: Machine, housing: Housing, run: Run, mount_deg: float, rng: np.random.Generator
) -> dict[str, Real]:
    """Channels of one run, in their quantities' units; tachos in V."""
    from scipy.interpolate import CubicSpline

    carrier_hz = run.sun_hz * machine.z_sun / (machine.z_sun + machine.z_ring)
    turn, force = ring_forces(machine, carrier_hz, run.torque)
    time = np.arange(round(run.duration_s * RATE)) / RATE
    at = _turns(machine, time, carrier_hz, rng)
    heard = at + _flutter(machine, at, rng)
    channels: dict[str, Real] = {}
    orders = np.arange(turn.size // 2 + 1) / machine.period
    omega = 2 * np.pi * orders * carrier_hz
    for s, degrees in enumerate(housing.angles_deg):
        rim = np.zeros(turn.size)
        for i, place in enumerate(machine.angles()):
            rim += housing.window(2 * np.pi * turn + place - math.radians(degrees)) * force[i] / RIM
        lines = (
            -(omega**2)
            * np.fft.rfft(rim)
            * housing.gain(s, orders * carrier_hz)
            * (orders <= HIGHEST * machine.z_ring)
        )
        around = np.fft.irfft(lines, turn.size)
        closed = CubicSpline(
            np.append(turn, machine.period), np.append(around, around[0]), bc_type="periodic"
        )
        channels[f"Acc {s + 1}"] = closed(heard % machine.period)
    for name in list(channels):
        level = housing.noise
        channels[name] = channels[name] + level * rng.standard_normal(time.size)
        if "bearing-defect" in machine.hidden:
            channels[name] += _bearing(machine.hidden["bearing-defect"], time, at, rng)
    if "speed-fluctuation" not in machine.hidden:
        channels["Tacho sun"] = _pulses(
            heard * (machine.z_sun + machine.z_ring) / machine.z_sun, TACHO_SUN, 0.5
        )
    channels["Tacho carrier"] = _pulses(heard + mount_deg / 360, 1, 0.1)
    return channels


def _turns(machine: Machine, time: Real, carrier_hz: float, rng: np.random.Generator) -> Real:
    """Turns of the carrier: somewhere in the period at first, at a speed that wanders by a tenth of a per cent."""
    begun = rng.uniform(0, machine.period)
    wander = sum(
        a * np.sin(2 * np.pi * f * time + p) / (2 * np.pi * f)
        for a, f, p in zip(
            rng.normal(0, 7e-4, 3), rng.uniform(0.1, 0.6, 3), rng.uniform(0, 6.28, 3), strict=True
        )
    )
    return begun + carrier_hz * (time + wander)


def _flutter(machine: Machine, turns: Real, rng: np.random.Generator) -> Real:
    """Turns by which a hidden flutter moves the shaft, faster than once a turn."""
    if "speed-fluctuation" not in machine.hidden:
        return np.zeros_like(turns)
    rms = machine.hidden["speed-fluctuation"]["rms_deg"] / 360
    parts = [
        np.sin(2 * np.pi * (o * turns + p))
        for o, p in zip(rng.uniform(2.3, 9.7, 12), rng.uniform(0, 1, 12), strict=True)
    ]
    whole = np.sum(parts, axis=0)
    return rms * whole / whole.std()


def _bearing(defect: dict[str, float], time: Real, turns: Real, rng: np.random.Generator) -> Real:
    """Impacts of a rolling element on a planet's bearing, louder where the planet is near."""
    passes = turns * defect["order"]
    hits = np.flatnonzero(np.diff(np.floor(passes))) + 1
    signal = np.zeros(time.size)
    strength = (
        defect["peak"]
        * (1 + 0.6 * np.cos(2 * np.pi * turns[hits]))
        * (1 + 0.1 * rng.standard_normal(hits.size))
    )
    signal[hits] = strength
    ring = np.arange(round(0.01 * RATE)) / RATE
    decay = np.exp(-2 * np.pi * 0.05 * defect["hz"] * ring) * np.sin(2 * np.pi * defect["hz"] * ring)
    return np.convolve(signal, decay)[: time.size]


def _pulses(turns: Real, count: int, duty: float) -> Real:
    """Rectangular pulses whose edges take one sample, so that their instants are known between samples."""
    phase = turns * count
    step = np.gradient(phase)
    inside = (phase + 0.5) % 1.0 - 0.5  # the rise stands at zero
    up = np.clip(inside / step + 0.5, 0, 1)
    down = np.clip(((phase - duty + 0.5) % 1.0 - 0.5) / step + 0.5, 0, 1)
    high = np.where((phase % 1.0) < duty, 1.0, 0.0)
    near_rise, near_fall = np.abs(inside) < 2 * step, np.abs((phase - duty + 0.5) % 1.0 - 0.5) < 2 * step
    return 5.0 * np.where(near_rise, up, np.where(near_fall, 1 - down, high))
