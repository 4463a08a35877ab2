"""Loads and friction moments of the four bearings: rows 0 and 1 are the worm's, 2 and 3 the wheel's.

The moments are those of the SKF model: rolling, sliding, drag, seals. The factors for inlet shear heating and for
starvation are effects of their own (`inlet-shear-heating`, `starvation`): they scale the rolling moment. Torque of the
bearings themselves is left out of the statics: it is some thousandths of the output torque, and with it in, loads and
moments would depend on each other in a circle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from specan.models.quantity import Quantity, constant, quantity
from specan.worm_gear.model.rig import K_Z, PlacedBearing, Rig

WORM, WHEEL = slice(0, 2), slice(2, 4)
AXES = ("bearing",)

SKF = "SKF, The SKF model for calculating the frictional moment (catalogue 10000 EN 2013, 17000 EN 2018)"
RPM = 30 / np.pi  # r/min in a rad/s
MU_BOUNDARY = 0.12  # sliding friction of the bare contact in motion
MU_FULL_FILM = 0.04  # full film, synthetic oils; 0.05 for mineral ones


def force_quantities(rig: Rig, bearings: Sequence[PlacedBearing]) -> list[Quantity]:
    """Forces between the flanks, and the radial and axial load of each bearing."""
    loads = [_radial(rig), _axial(bearings)]
    return [worm_axial_force, worm_tangential_force, radial_force, *loads]


@quantity(unit="N", reference="statics of the flank")
def worm_axial_force(output_torque, wheel_radius):
    """Axial force on the worm; the same force turns the wheel."""
    return output_torque / wheel_radius


@quantity(unit="N", reference="statics of the flank")
def worm_tangential_force(
    output_torque, normal_force_per_torque, friction_coefficient, lead_angle, normal_pressure_angle
):
    """Tangential force on the worm; the same force pushes the wheel along its axis."""
    share = math.cos(normal_pressure_angle) * math.sin(lead_angle) + friction_coefficient * math.cos(
        lead_angle
    )
    return output_torque * normal_force_per_torque * share


@quantity(unit="N", reference="statics of the flank")
def radial_force(output_torque, normal_force_per_torque, normal_pressure_angle):
    """Force that pushes worm and wheel apart."""
    return output_torque * (normal_force_per_torque * math.sin(normal_pressure_angle))


def _shares(positions: tuple[float, float]) -> tuple[float, float, float]:
    """Shares of a force in the mesh plane on the two bearings, and one over their distance in m."""
    low, high = positions
    return high / (high - low), -low / (high - low), 1e3 / (high - low)


def _radial(rig: Rig) -> Quantity:
    """Radial loads: force in the mesh plane shared by the lever rule, moment of the axial force as a couple."""
    gear = rig.gear
    near, far, per_length = _shares(gear.worm_bearing_positions_mm)
    worm_split = np.array([near, far])
    worm_couple = np.array([1.0, -1.0]) * 5e-4 * gear.worm_pitch_diameter_mm * per_length
    near, far, per_length = _shares(gear.wheel_bearing_positions_mm)
    wheel_split = np.array([near, far])
    wheel_couple = np.array([-1.0, 1.0]) * 5e-4 * gear.wheel_pitch_diameter_mm * per_length
    dead_load = gear.bearing_dead_load_N**2
    outer = np.multiply.outer

    @quantity(unit="N", axes=AXES, reference="statics of the two shafts")
    def bearing_radial_load(worm_axial_force, worm_tangential_force, radial_force):
        """Radial load of each bearing, with the dead load that keeps an idle bearing rolling."""
        apart = np.concatenate(
            [
                outer(worm_split, radial_force) + outer(worm_couple, worm_axial_force),
                outer(wheel_split, radial_force) + outer(wheel_couple, worm_tangential_force),
            ]
        )
        across = np.concatenate(
            [outer(worm_split, worm_tangential_force), outer(wheel_split, worm_axial_force)]
        )
        return np.sqrt(apart * apart + across * across + dead_load)

    return bearing_radial_load


def _axial(bearings: Sequence[PlacedBearing]) -> Quantity:
    worm = np.array([float(b.locating) for b in bearings[WORM]])
    wheel = np.array([float(b.locating) for b in bearings[WHEEL]])

    @quantity(unit="N", axes=AXES, reference="the locating bearing of a shaft takes its axial force")
    def bearing_axial_load(worm_axial_force, worm_tangential_force):
        """Axial load of each bearing."""
        outer = np.multiply.outer
        return np.abs(np.concatenate([outer(worm, worm_axial_force), outer(wheel, worm_tangential_force)]))

    return bearing_axial_load


def bearing_quantities(bearings: Sequence[PlacedBearing], ratio: float) -> list[Quantity]:
    """Speeds and moments of the bearings."""
    balls = [b.bearing for b in bearings]
    return [
        constant("bearing_bore", np.array([1e-3 * b.bore for b in balls]), "m", "Bore.", AXES),
        constant("bearing_outside", np.array([1e-3 * b.outside for b in balls]), "m", "Outside diameter.", AXES),
        _speed(ratio),
        _contact(bearings),
        *_rolling(bearings),
        *_sliding(bearings),
        _drag(bearings),
        _seals(bearings),
        *_palmgren(bearings),
        bearing_moment,
        worm_bearing_torque,
        wheel_bearing_torque,
        bearing_loss,
    ]  # fmt: skip


def without_load(factor: np.ndarray, share: Any) -> np.ndarray:
    """What a factor on the bearings' rolling moments makes of the viscous loss without load.

    A `share` of that loss is the bearings', and most of it that of the larger one on the fast shaft, whose
    factor lies furthest from one.
    """
    return 1.0 - share * (1.0 - factor[WORM].min(axis=0))


def _column(values: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Values of the bearings, shaped to multiply an array whose first axis is theirs."""
    return values.reshape((-1,) + (1,) * (np.ndim(like) - 1))


def _speed(ratio: float) -> Quantity:
    speeds = np.array([1.0, 1.0, 1 / ratio, 1 / ratio])

    @quantity(unit="rad/s", axes=AXES)
    def bearing_speed(worm_speed):
        """Speed of each bearing."""
        return np.multiply.outer(speeds, worm_speed)

    return bearing_speed


def _contact(bearings: Sequence[PlacedBearing]) -> Quantity:
    locating = [(i, b.bearing.static_rating) for i, b in enumerate(bearings) if b.locating]

    @quantity(unit="1", axes=AXES, reference=f"{SKF}, angle 24.6 (Fa/C0)^0.24 degrees")
    def bearing_contact(bearing_axial_load):
        """Sine of the angle under which the balls of each locating bearing carry its axial load; one for the others."""
        sine = np.ones_like(bearing_axial_load)
        for i, rating in locating:
            share = np.maximum(bearing_axial_load[i], 1e-6) / rating
            sine[i] = np.sin(np.deg2rad(24.6 * share**0.24))
        return sine

    return bearing_contact


def _rolling(bearings: Sequence[PlacedBearing]) -> list[Quantity]:
    factor = np.array([1e-3 * b.bearing.r1 * b.bearing.mean_diameter**1.96 for b in bearings])  # N mm -> N m
    locating = [(i, b.bearing.r2) for i, b in enumerate(bearings) if b.locating]

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, rolling frictional variable")
    def bearing_rolling_variable(bearing_radial_load, bearing_axial_load, bearing_contact):
        """Rolling moment of each bearing where the product of viscosity in mm^2/s and speed in r/min is one: G_rr."""
        load = bearing_radial_load
        if np.any(bearing_axial_load):
            load = load.copy()
            for i, r2 in locating:
                load[i] += r2 * bearing_axial_load[i] / bearing_contact[i]
        return _column(factor, load) * load**0.54

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, rolling frictional moment")
    def bearing_rolling_moment(bearing_rolling_variable, bearing_speed, kinematic_viscosity):
        """Rolling moment of each bearing: G_rr (nu n)^0.6, without the factors for heating and starvation."""
        return bearing_rolling_variable * (1e6 * RPM * kinematic_viscosity * bearing_speed) ** 0.6

    return [bearing_rolling_variable, bearing_rolling_moment]


def _sliding(bearings: Sequence[PlacedBearing]) -> list[Quantity]:
    radial = np.array(
        [1e-3 * b.bearing.s1 * b.bearing.mean_diameter ** (-0.145 if b.locating else -0.26) for b in bearings]
    )
    diameters = np.array([b.bearing.mean_diameter for b in bearings])
    locating = [
        (i, b.bearing.s2 * b.bearing.mean_diameter**1.5) for i, b in enumerate(bearings) if b.locating
    ]

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, sliding frictional variable")
    def bearing_sliding_variable(bearing_radial_load, bearing_axial_load, bearing_contact):
        """Sliding moment of each bearing where the coefficient of friction is one: G_sl."""
        load = bearing_radial_load**5
        for i, s2 in locating:
            load[i] += s2 * bearing_axial_load[i] ** 4 / bearing_contact[i]
        return _column(radial, load) * np.cbrt(load)

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, sliding frictional moment")
    def bearing_sliding_moment(bearing_sliding_variable, bearing_speed, kinematic_viscosity):
        """Sliding moment of each bearing: G_sl times a coefficient between bare and full-film contact."""
        film = (1e6 * RPM * kinematic_viscosity * bearing_speed) ** 1.4
        bare = np.exp(-2.6e-8 * _column(diameters, film) * film)
        return bearing_sliding_variable * (MU_FULL_FILM + (MU_BOUNDARY - MU_FULL_FILM) * bare)

    return [bearing_sliding_variable, bearing_sliding_moment]


def _drag(bearings: Sequence[PlacedBearing]) -> Quantity:
    """Drag in the oil bath; nothing for a bearing whose oil height and drag loss factor are not given."""
    ball, layer = [], []
    for b in bearings:
        bore, outside, mean = b.bearing.bore, b.bearing.outside, b.bearing.mean_diameter
        shape = K_Z * (bore + outside) / (outside - bore)
        ball.append(1e-3 * 0.4 * b.drag_loss_factor * shape * 1e-12 * mean**5)
        angle = 2 * np.arccos(np.clip(1 - b.oil_height / (0.6 * mean), -1, 1))
        reach = np.sin(angle / 2) if angle <= np.pi else 1.0
        surface = 0.36 * mean**2 * (angle - np.sin(angle)) * 0.05 * shape
        layer.append(
            1e-3 * 1.093e-7 * mean**3 * surface * (mean**2 * reach) ** -1.379 if b.oil_height else 0.0
        )
    balls, layers = np.array(ball), np.array(layer)
    still = not any(ball) and not any(layer)

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, drag losses")
    def bearing_drag_moment(bearing_speed, kinematic_viscosity):
        """Drag moment of each bearing in the oil bath."""
        if still:
            return np.zeros_like(bearing_speed)
        speed = RPM * bearing_speed
        moment = _column(balls, speed) * speed**2
        return moment + _column(layers, speed) * speed**0.621 * (1e6 * kinematic_viscosity) ** 1.379

    return bearing_drag_moment


def _seals(bearings: Sequence[PlacedBearing]) -> Quantity:
    moments = np.array([b.seal_torque for b in bearings])

    @quantity(unit="N*m", axes=AXES, reference=f"{SKF}, frictional moment of seals")
    def bearing_seal_moment(bearing_speed):
        """Moment of each bearing's own rubbing seals; open and shielded bearings have none."""
        return np.broadcast_to(_column(moments, bearing_speed), np.shape(bearing_speed))

    return bearing_seal_moment


# The constants are those that text books hand down (f0 2, z 0.0009, P0/C0 to the power 0.55, P1 = 3 Fa - 0.1 Fr);
# they were not held against the standard, which is not free. A factor on the whole is fitted.
PALMGREN = "Palmgren; Harris, Rolling Bearing Analysis; SKF General Catalogue 1989; ISO/TR 14179-2"
SLOW = 2000.0  # nu n in mm^2/s r/min below which the moment without load no longer falls


def _palmgren(bearings: Sequence[PlacedBearing]) -> list[Quantity]:
    diameters = np.array([b.bearing.mean_diameter for b in bearings])
    ratings = np.array([b.bearing.static_rating for b in bearings])

    @quantity(unit="N*m", axes=AXES, reference=f"{PALMGREN}; ISO/TR 14179-1")
    def bearing_load_moment(bearing_radial_load, bearing_axial_load):
        """Moment of each bearing that its load makes, by Palmgren: z (P0/C0)^0.55 P1 d_m."""
        diameter, rating = _column(diameters, bearing_radial_load), _column(ratings, bearing_radial_load)
        static = np.maximum(0.6 * bearing_radial_load + 0.5 * bearing_axial_load, bearing_radial_load)
        load = np.maximum(3.0 * bearing_axial_load - 0.1 * bearing_radial_load, bearing_radial_load)
        return 1e-3 * 0.0009 * (static / rating) ** 0.55 * load * diameter

    @quantity(unit="N*m", axes=AXES, reference=PALMGREN)
    def bearing_oil_moment(bearing_speed, kinematic_viscosity):
        """Moment of each bearing that its oil makes, by Palmgren: 1e-7 f0 (nu n)^(2/3) d_m^3."""
        flow = np.maximum(1e6 * RPM * kinematic_viscosity * np.abs(bearing_speed), SLOW)
        return 1e-3 * 2.0 * 1e-7 * flow ** (2 / 3) * _column(diameters, bearing_speed) ** 3

    return [bearing_load_moment, bearing_oil_moment]


@quantity(unit="N*m", axes=AXES, reference=SKF)
def bearing_moment(bearing_rolling_moment, bearing_sliding_moment, bearing_drag_moment, bearing_seal_moment):
    """Friction moment of each bearing by the catalogue."""
    return bearing_rolling_moment + bearing_sliding_moment + bearing_drag_moment + bearing_seal_moment


@quantity(unit="N*m")
def worm_bearing_torque():
    """Torque that the bearings take from the worm shaft; an ideal gear's take none."""
    return 0.0


@quantity(unit="N*m")
def wheel_bearing_torque():
    """Torque that the bearings take from the wheel shaft; an ideal gear's take none."""
    return 0.0


@quantity(unit="W")
def bearing_loss(worm_bearing_torque, wheel_bearing_torque, worm_speed, wheel_speed):
    """Power lost in the bearings."""
    return worm_bearing_torque * worm_speed + wheel_bearing_torque * wheel_speed
