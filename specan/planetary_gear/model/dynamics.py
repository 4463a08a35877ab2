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
    """One machine as the integrator takes it, see `contact_steps.advance`; the carrier (driven gear) is the first body.

    The driver turns at `driver_speed`; its torque is its `radius` times the forces of the first `driven` meshes.
    """

    machine: tuple[Any, ...]
    carrier_speed: float
    driver_speed: float
    radius: float
    driven: int
    step: float
    state: Real

    def advance(self, rows: int, every: int, dt: float, start: float) -> Real:
        """Forces of the meshes and angle of the carrier, every so many steps; goes on from there."""
        out = np.zeros((rows, len(self.machine[4]) + 1))
        contact_steps.advance(rows * every, every, dt, start, self.machine, self.state, out)
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
    held = np.empty((0, len(system.machine[4]) + 1))
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
    driven, ring, time = kept[: system.driven], kept[system.driven : -1], np.arange(count) / sampling_rate
    # The first filtered row stands half a filter after the start.
    whole = time + (settle + (taps.size - 1) / 2 / OVERSAMPLED) / sampling_rate
    return Motion(
        time=time,
        sun_force=driven,
        ring_force=ring,
        carrier_angle=system.carrier_speed * whole + kept[-1],
        sun_angle=system.driver_speed * whole,
        torque_in=driven.sum(axis=0) * system.radius,
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
    if rig.gear is not None:
        return _set(rig, rig.gear)
    assert rig.pair is not None
    pair, contact = rig.pair, rig.contact
    cos, module = math.cos(math.radians(pair.pressure_angle_deg)), 1e-3 * pair.module_mm
    rb1, rb2 = module * pair.z_driver * cos / 2, module * pair.z_driven * cos / 2
    inertia = disc(pair.z_driven * module, 1e-3 * pair.face_width_mm)[1]
    ratio, speed = pair.z_driver / pair.z_driven, 2 * np.pi * pair.driver_speed_hz
    load = pair.driver_torque_Nm / ratio
    depth = _depth(load / rb2, contact)
    machine = (
        pair.z_driver * pair.driver_speed_hz, _law(contact, pair.backlash_mm), np.array([-load]),
        np.array([inertia]), np.array([0]), np.array([[-rb2, 0.0]]), np.zeros(1), np.array([_numbers(pair_mesh(pair))]),
    )  # fmt: skip
    step, state = _step(contact, depth, inertia / rb2**2), np.array([-1e-3 * depth / rb2, 0.0])
    return _System(machine, speed * ratio, speed, rb1, 1, step, state)


def _set(rig: Rig, gear: Gear) -> _System:
    (sun, ring), n, contact = set_meshes(gear), gear.planets, rig.contact
    rb_s, rb_p, rb_r = gear.base_radii_m
    carrier, planet = inertias(gear, rig.rotors)
    speed = 2 * np.pi * rig.operation.sun_speed_hz
    relative = speed * gear.z_ring / (gear.z_sun + gear.z_ring)  # of the sun against the carrier
    load = rig.operation.carrier_torque_Nm
    depth = 1e-3 * _depth(load / (n * (rb_s + rb_r)), contact)
    # Both meshes of a planet are pressed as deep.
    angle = -2 * depth / (rb_s + rb_r)
    turn = (depth + (rb_s + rb_p) * angle) / rb_p
    levers, meshes = [[-(rb_s + rb_p), rb_p], [rb_p - rb_r, -rb_p]], [_numbers(sun), _numbers(ring)]
    machine = (
        relative * gear.z_sun / (2 * np.pi), _law(contact, gear.backlash_mm), np.array([-load, *[0.0] * n]),
        np.array([carrier, *[planet] * n]), np.tile(np.arange(1, n + 1), 2), np.repeat(levers, n, axis=0),
        np.concatenate(mesh_phases(gear)), np.repeat(meshes, n, axis=0),
    )  # fmt: skip
    state = np.array([angle, *[turn] * n, *[0.0] * (n + 1)])
    step = _step(contact, 1e3 * depth, planet / rb_p**2 / 2)
    return _System(machine, speed - relative, speed, rb_s, n, step, state)


def _depth(force: float, contact: Contact) -> float:
    return float((force / contact.K_N_mm_e) ** (1.0 / contact.exponent))


def _law(contact: Contact, backlash: float) -> Real:
    return np.array([contact.K_N_mm_e, contact.exponent, contact.C_Ns_mm, contact.depth_mm, backlash])


def _numbers(mesh: Mesh) -> list[float]:
    return [1e3 * mesh.base_pitch, mesh.contact_ratio, 1e-3 * mesh.gap_before, 1e-3 * mesh.gap_after]


def _step(contact: Contact, depth: float, mass: float) -> float:
    """Part of the shortest period: that of a mesh's mass on two pairs of teeth."""
    stiffness = 2e3 * contact.exponent * contact.K_N_mm_e * depth ** (contact.exponent - 1.0)
    return 2 * np.pi / math.sqrt(stiffness / mass) / STEPS_PER_PERIOD
