"""Time-domain model: rigid gears, elastic tooth contacts, constant speed of the driver and a torque on the output."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.errors import ComputationError
from specan.planetary_gear.model import contact_steps
from specan.planetary_gear.model.geometry import (
    Mesh,
    disc,
    inertias,
    mesh_phases,
    pair_mesh,
    planet_angles,
    set_meshes,
)
from specan.planetary_gear.model.rig import Contact, Gear, Rig

# Of the fastest oscillation of a loaded mesh, at least: forces of the article's pair and set then change by less than
# 1e-4 of the largest one when the step is halved. How fast contacts are damped does not matter to the method.
STEPS_PER_PERIOD = 25.0
SETTLE_S = 0.25  # left away before the first sample: transients of the contacts have died away
_STORED_RATE = 51200.0
OVERSAMPLED = 4
_CHUNK = 12800


@dataclass(frozen=True)
class Motion:
    """What the integration gives; all arrays against `time`.

    Attributes
    ----------
    time : array
        s from the first stored sample on.
    sun_force, ring_force : arrays (planets, samples)
        Along the lines of action, N; a pair has one "sun" mesh and no ring.
    carrier_angle : array
        Of the carrier (of the driven gear), steady rotation included, rad.
    sun_angle : array
    torque_in : array
        That the driver gives, N m.
    step_s : float
    """

    time: Real
    sun_force: Real
    ring_force: Real
    carrier_angle: Real
    sun_angle: Real
    torque_in: Real
    step_s: float
    rig: Rig


@dataclass(frozen=True)
class _System:
    """One machine as the integrator takes it: `contact_steps.advance` gets `machine` from its number of planets on.

    The driver turns at `driver_speed`, its torque is `lever` times that of the sun's base circle.
    """

    machine: Any
    carrier_speed: float
    driver_speed: float
    lever: float
    step: float
    state: Real

    def advance(self, rows: int, every: int, dt: float, start: float) -> Real:
        """Forces of sun and ring meshes, angle of the carrier and torque, every so many steps; goes on from there."""
        out = np.zeros((rows, 2 * self.machine[0] + 2))
        own = (*self.machine, self.state, out)
        contact_steps.advance(rows * every, every, dt, start, *own)
        return out


def simulate(rig: Rig, duration_s: float, *, sampling_rate: float = _STORED_RATE, refine: int = 1) -> Motion:
    """Integrate the equations of motion of a set or a pair.

    Parameters
    ----------
    rig : Rig
    duration_s : float
        After the transients of the start.
    sampling_rate : float
        Of what is stored; the step is a whole part of it.
    refine : int
        Divides the step further: 2 halves it.

    Raises
    ------
    ComputationError
        The integration became infinite.
    """
    system = _system(rig)
    fine = OVERSAMPLED * sampling_rate
    every = math.ceil(1.0 / (fine * system.step)) * refine
    dt = 1.0 / (fine * every)
    settle, count = math.ceil(SETTLE_S * sampling_rate), round(duration_s * sampling_rate)
    taps = _low_pass()
    held = np.empty((0, 2 * system.machine[0] + 2))
    stored: list[Real] = []
    rows, done, guard = 0, 0, (taps.size - 1) // (2 * OVERSAMPLED) + 1
    while rows < settle + count + guard:
        out = system.advance(_CHUNK, every, dt, done / fine)
        if not np.all(np.isfinite(out)):
            raise ComputationError(
                "the equations of motion became infinite", remedy="check [contact] and the torque"
            )
        done += _CHUNK
        held = np.concatenate([held, out])
        windows = np.lib.stride_tricks.sliding_window_view(held, taps.size, axis=0)[::OVERSAMPLED]
        stored.append(windows @ taps)
        rows += windows.shape[0]
        held = held[windows.shape[0] * OVERSAMPLED :]
    kept = np.concatenate(stored)[settle : settle + count].T.copy()
    n, time = system.machine[0], np.arange(count) / sampling_rate
    # The first filtered row stands half a filter after the start.
    whole = time + (settle + (taps.size - 1) / 2 / OVERSAMPLED) / sampling_rate
    return Motion(
        time=time,
        sun_force=kept[:n],
        ring_force=kept[n : 2 * n] if rig.gear is not None else np.empty((0, count)),
        carrier_angle=system.carrier_speed * whole + kept[2 * n],
        sun_angle=system.driver_speed * whole,
        torque_in=kept[2 * n + 1] * system.lever,
        step_s=dt,
        rig=rig,
    )


def _low_pass() -> Real:
    """What lies above half the sampling rate is taken away before every fourth sample is kept: it would fold back."""
    half = 16 * OVERSAMPLED
    at = np.arange(-half, half + 1) / OVERSAMPLED
    taps = np.sinc(0.85 * at) * np.kaiser(at.size, 9.0)
    return taps / taps.sum()


def force_normal_angle(rig: Rig, motion: Motion) -> tuple[Real, Real]:
    """Directions of the forces on the sun and on the ring, rad from the horizontal, (planets, samples)."""
    if rig.gear is None:
        assert rig.pair is not None
        angle = math.radians(rig.pair.pressure_angle_deg)
        return np.full((1, motion.time.size), np.pi / 2 - angle), np.empty((0, motion.time.size))
    sun, ring = set_meshes(rig.gear)
    place = planet_angles(rig.gear)[:, None] + motion.carrier_angle[None, :]
    # On the sun against its rotation, on the ring with the planets' way, tilted by the pressure angle.
    return place - np.pi / 2 - sun.pressure_angle, place + np.pi / 2 - ring.pressure_angle


def _system(rig: Rig) -> _System:
    contact = rig.contact
    if rig.gear is not None:
        return _set(rig, rig.gear, contact)
    assert rig.pair is not None
    pair, mesh = rig.pair, pair_mesh(rig.pair)
    cos = math.cos(math.radians(pair.pressure_angle_deg))
    module = 1e-3 * pair.module_mm
    rb1, rb2 = module * pair.z_driver * cos / 2, module * pair.z_driven * cos / 2
    inertia = disc(pair.z_driven * module, 1e-3 * pair.face_width_mm)[1]
    ratio = pair.z_driver / pair.z_driven
    load = pair.driver_torque_Nm / ratio
    # A pair is a set whose "carrier" is the driven gear: x = -rb2 angle, and no planet that turns.
    sizes = np.array([rb2, 0.0, 0.0, inertia, 1.0, pair.z_driver * pair.driver_speed_hz])
    depth = _depth(load / rb2, contact)
    none, phases = np.array([1.0, 1.0, 0.0, 0.0]), np.array([[0.0], [0.5]])
    speed = 2 * np.pi * pair.driver_speed_hz
    # Power goes in at the driver: torque there is force times rb1, that of the "sun" force times rb2.
    return _System(
        (1, sizes, _law(contact, pair.backlash_mm), _numbers(mesh), none, phases, load), speed * ratio, speed,
        rb1 / rb2, _step(contact, depth, inertia / rb2**2), np.array([-1e-3 * depth / rb2, 0.0, 0.0, 0.0]),
    )  # fmt: skip


def _set(rig: Rig, gear: Gear, contact: Contact) -> _System:
    sun, ring = set_meshes(gear)
    rb_s, rb_p, rb_r = gear.base_radii_m
    carrier, inertia = inertias(gear, rig.rotors)
    speed = 2 * np.pi * rig.operation.sun_speed_hz
    relative = speed * gear.z_ring / (gear.z_sun + gear.z_ring)  # of the sun against the carrier
    sizes = np.array([rb_s, rb_p, rb_r, carrier, inertia, relative * gear.z_sun / (2 * np.pi)])
    phases, load = np.stack(mesh_phases(gear)), rig.operation.carrier_torque_Nm
    depth = 1e-3 * _depth(load / (gear.planets * (rb_s + rb_r)), contact)
    # Both meshes of a planet are pressed as deep: x_s = x_r = depth.
    angle = -2 * depth / (rb_s + rb_r)
    turn = (depth + (rb_s + rb_p) * angle) / rb_p
    law = _law(contact, gear.backlash_mm)
    return _System(
        (gear.planets, sizes, law, _numbers(sun), _numbers(ring), phases, load), speed - relative, speed, 1.0,
        _step(contact, 1e3 * depth, inertia / rb_p**2 / 2),
        np.array([angle, *([turn] * gear.planets), *([0.0] * (gear.planets + 1))]),
    )  # fmt: skip


def _depth(force: float, contact: Contact) -> float:
    return float((force / contact.K_N_mm_e) ** (1.0 / contact.exponent))


def _law(contact: Contact, backlash: float) -> Real:
    return np.array([contact.K_N_mm_e, contact.exponent, contact.C_Ns_mm, contact.depth_mm, backlash])


def _numbers(mesh: Mesh) -> Real:
    return np.array(
        [1e3 * mesh.base_pitch, mesh.contact_ratio, 1e-3 * mesh.gap_before, 1e-3 * mesh.gap_after]
    )


def _step(contact: Contact, depth: float, mass: float) -> float:
    """Part of the shortest period: that of a mesh's mass on two pairs of teeth."""
    stiffness = 2e3 * contact.exponent * contact.K_N_mm_e * depth ** (contact.exponent - 1.0)
    return 2 * np.pi / math.sqrt(stiffness / mass) / STEPS_PER_PERIOD
