"""The state of the running gear: torques, losses and temperatures that hold each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from specan.errors import ComputationError
from truth.worm_gear import bearings, mesh
from truth.worm_gear.forms import Forms, bearing_moment, boundary_share, drag_shape, oil
from truth.worm_gear.gear import (
    BEARINGS,
    RATIO,
    REFERENCE_SPEED,
    REFERENCE_VISCOSITY,
    SHAFT_WEIGHT,
    Array,
    Gear,
)

FULL_DEPTH = 0.6  # immersion over the radius of the dipping part at full oil level
_TOLERANCE = 1e-12
_MOST_ROUNDS = 400


@dataclass(frozen=True)
class Conditions:
    """What the bench really runs at; arrays over the conditions.

    Parameters
    ----------
    speed_rpm, output_torque, oil_temperature, oil_level : array
        Worm speed, torque at the output shaft (Nm), sump temperature (degC), oil level (percent of full).
    elapsed_time : array
        Time at the end of the reading since the campaign began, s.
    dwell : array
        How long the condition had been held by then, s.
    """

    speed_rpm: Array
    output_torque: Array
    oil_temperature: Array
    oil_level: Array
    elapsed_time: Array
    dwell: Array


@dataclass
class State:
    """Where the iteration stands; what hidden effects may look at."""

    conditions: Conditions
    film_temperature: Array
    viscosity: Array  # of the oil in the gaps, mm^2/s
    local_force: Array  # normal force at each contact point, N
    sliding_speed: Array  # at each contact point, m/s
    loss: Array  # W


@dataclass
class Slots:
    """Where a hidden effect takes hold. Every entry is a function of the State, most return arrays per condition.

    Parameters
    ----------
    film_temperature
        Kelvin that the oil in the gaps is warmer than the sump.
    drag_factor, rolling_factor
        Factors on the oil's no-load torque and on the bearings' rolling torque.
    sheared_viscosity
        Factor on the viscosity of the oil that the rotating parts shear; what that does to the drag is the drag's law.
    friction_factor, friction_added
        On the mesh friction coefficient, per contact point.
    thrust
        Further axial load of the locating bearings, N.
    torque
        Further drag at the worm shaft, Nm.
    indicated_torque, indicated_temperature
        What the input torque and the temperature instrument show beyond the truth: functions of State and torque.
    """

    film_temperature: list[Callable[[State], Array]] = field(default_factory=list)
    drag_factor: list[Callable[[State], Array]] = field(default_factory=list)
    sheared_viscosity: list[Callable[[State], Array]] = field(default_factory=list)
    rolling_factor: list[Callable[[State], Array]] = field(default_factory=list)
    friction_factor: list[Callable[[State], Array]] = field(default_factory=list)
    friction_added: list[Callable[[State], Array]] = field(default_factory=list)
    thrust: list[Callable[[State], Array]] = field(default_factory=list)
    torque: list[Callable[[State], Array]] = field(default_factory=list)
    indicated_torque: list[Callable[[State, Array], Array]] = field(default_factory=list)
    indicated_temperature: list[Callable[[State], Array]] = field(default_factory=list)


@dataclass(frozen=True)
class Balance:
    """The gear in equilibrium: torque in, and where the power goes (W); arrays over the conditions."""

    input_torque: Array
    mesh: Array
    drag: Array
    bearings: Array
    further: Array
    state: State


def _drag_torque(gear: Gear, forms: Forms, slots: Slots, state: State) -> Array:
    """Oil sheared and carried by worm and wheel: by default proportional to viscosity, saturating with speed.

    The wetted part of a circle that dips to 0.6 of its radius when the level is full.
    """
    depth = np.clip(state.conditions.oil_level / 100.0 * FULL_DEPTH, 0.0, 1.9)
    wetted = np.arccos(1.0 - depth) / np.arccos(1.0 - FULL_DEPTH)
    speed = state.conditions.speed_rpm / REFERENCE_SPEED
    shape = drag_shape(forms, gear.drag_speed)
    viscosity = state.viscosity / REFERENCE_VISCOSITY
    for factor in slots.sheared_viscosity:
        viscosity = viscosity * factor(state)
    return gear.drag_torque * shape(speed, viscosity) * wetted


def _mesh_friction(gear: Gear, forms: Forms, slots: Slots, state: State) -> Array:
    lifted = boundary_share(forms, state.sliding_speed, gear.boundary_speed)
    friction = gear.film_friction + gear.boundary_friction * lifted
    for factor in slots.friction_factor:
        friction = friction * factor(state)
    for added in slots.friction_added:
        friction = friction + added(state)
    return friction


def _bearing_torques(
    gear: Gear, forms: Forms, slots: Slots, state: State, contact: mesh.MeshForces, omega: Array
) -> tuple[Array, Array]:
    """Friction torque of the worm's and of the wheel's bearings, each at its own shaft."""
    torques = []
    for shaft, shaft_speed in (("worm", omega), ("wheel", omega / RATIO)):
        near, far = (bearing for bearing in BEARINGS if bearing.shaft == shaft)
        axial, at_near, at_far = mesh.shaft_loads(
            contact, shaft, near.position, far.position, SHAFT_WEIGHT[shaft]
        )
        total = np.zeros_like(omega)
        axial = axial + sum((thrust(state) for thrust in slots.thrust), np.zeros_like(omega))
        for bearing, radial in ((near, at_near), (far, at_far)):
            thrust = (axial if bearing.locating else 0.0 * axial) + gear.bearing_seat
            factors = np.ones_like(omega)
            for factor in slots.rolling_factor:
                factors = factors * factor(state)
            if forms.bearing != "ball by ball":
                total = total + bearing_moment(
                    forms, bearing, radial, thrust, shaft_speed, state.viscosity, factors
                )
                continue
            angle = bearings.contact_angle(bearing, thrust)
            loads = bearings.ball_loads(bearing, radial, thrust, angle)
            rolling = bearings.rolling_torque(bearing, loads, shaft_speed, state.viscosity)
            total = total + rolling * factors + bearings.spinning_torque(bearing, loads, angle)
        torques.append(gear.bearing_roughness * total)
    return torques[0], torques[1]


def solve(
    gear: Gear, conditions: Conditions, slots: Slots | None = None, forms: Forms | None = None
) -> Balance:
    """Find the input torque at which torques, forces, losses and oil temperatures agree.

    Parameters
    ----------
    gear : Gear
        The specimen.
    conditions : Conditions
        What it runs at.
    slots : Slots, optional
        Hidden effects.
    forms : Forms, optional
        Published forms of the parts; those of this simulator by default.

    Returns
    -------
    Balance

    Raises
    ------
    ComputationError
        If the state does not settle, or is not finite.
    """
    slots, forms = slots or Slots(), forms or Forms()
    omega = 2.0 * np.pi * np.asarray(conditions.speed_rpm, float) / 60.0
    points = mesh.contact_points()
    state = State(
        conditions,
        film_temperature=np.array(conditions.oil_temperature, float),
        viscosity=oil(forms, gear, np.asarray(conditions.oil_temperature, float)),
        local_force=np.outer(conditions.output_torque, points.share) / 0.045,
        sliding_speed=np.outer(omega, points.sliding_speed),
        loss=np.zeros_like(omega),
    )
    wheel_torque = np.array(conditions.output_torque, float)
    before = np.full_like(omega, np.inf)
    for _ in range(_MOST_ROUNDS):
        contact = mesh.forces(wheel_torque, omega, _mesh_friction(gear, forms, slots, state))
        at_worm, at_wheel = _bearing_torques(gear, forms, slots, state, contact, omega)
        drag = _drag_torque(gear, forms, slots, state)
        for factor in slots.drag_factor:
            drag = drag * factor(state)
        further = np.zeros_like(omega)
        for torque in slots.torque:
            further = further + torque(state)
        input_torque = contact.worm_torque + at_worm + drag + further
        if not np.all(np.isfinite(input_torque)):
            raise ComputationError("the simulated gear has no finite state")
        if np.all(np.abs(input_torque - before) <= _TOLERANCE * np.abs(input_torque)):
            return Balance(
                input_torque,
                mesh=contact.power,
                drag=drag * omega,
                bearings=at_worm * omega + at_wheel * omega / RATIO,
                further=further * omega,
                state=state,
            )
        before = input_torque
        wheel_torque = conditions.output_torque + at_wheel
        state.loss = input_torque * omega - conditions.output_torque * omega / RATIO
        state.local_force = np.outer(contact.normal_force, points.share)
        state.film_temperature = conditions.oil_temperature + sum(
            (rise(state) for rise in slots.film_temperature), np.zeros_like(omega)
        )
        state.viscosity = oil(forms, gear, state.film_temperature)
    raise ComputationError(
        "the simulated gear does not settle", remedy="weaken the effect that heats the oil"
    )
