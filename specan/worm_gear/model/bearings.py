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
from specan.worm_gear.model.rig import K_Z, SERIES, SIZES, BearingEntry, Gear

WORM, WHEEL = slice(0, 2), slice(2, 4)
AXES = ("bearing",)

SKF = "SKF, The SKF model for calculating the frictional moment (catalogue 10000 EN 2013, 17000 EN 2018)"
RPM = 30 / np.pi  # r/min in a rad/s
MU_BOUNDARY = 0.12  # sliding friction of the bare contact in motion
MU_FULL_FILM = 0.04  # full film, synthetic oils; 0.05 for mineral ones


def bearing_quantities(bearings: Sequence[BearingEntry], gear: Gear) -> list[Quantity]:
    """Forces between the flanks; loads, speeds and moments of the bearings. Factors make N*m of N and mm."""

    bore, outside, rating = np.array([SIZES[b.size] for b in bearings]).T
    r1, r2, s1, s2 = np.array([SERIES[b.size[:2]] for b in bearings]).T
    locating, seal = (
        np.array([getattr(b, n) for b in bearings], float) for n in ("locating", "seal_torque_Nm")
    )
    d, turn = 0.5 * (bore + outside), gear.z_worm / gear.z_wheel
    bath = [_in_the_bath(*one) for one in zip(bearings, bore, outside, strict=True)]
    listed = [
        ("bearing_bore", 1e-3 * bore, "m", "Bore."),
        ("bearing_outside", 1e-3 * outside, "m", "Outside diameter."),
        ("bearing_diameter", d, "mm", "Mean of bore and outside diameter."),
        ("bearing_rating", 1e3 * rating, "N", "Static load rating C0."),
        ("bearing_locating", locating, "1", "1 where a bearing takes the axial force of its shaft."),
        ("bearing_turn", np.array([1.0, 1.0, turn, turn]), "1", "Speed over that of the worm."),
        ("bearing_levers", _levers(gear), "1", "Shares of a force in the mesh plane, and of an axial force's couple."),
        ("bearing_rolling", 1e-3 * r1 * d**1.96, "1", "Factor of the rolling moment."),
        ("bearing_rolling_axial", r2 * locating, "1", "Weight of the axial load in rolling."),
        ("bearing_sliding", 1e-3 * s1 * d ** np.where(locating, -0.145, -0.26), "1",
         "Factor of the sliding moment."),
        ("bearing_sliding_axial", s2 * d**1.5 * locating, "1", "Weight of the axial load in sliding."),
        ("bearing_bath", np.array(bath), "1", "Factors of the drag of balls, and of the layer of oil."),
        ("bearing_seal", seal, "N*m", "Torque of rubbing seals; open and shielded ones have none."),
    ]  # fmt: skip
    return [
        *(constant(*one, AXES) for one in listed),
        *(value for value in globals().values() if isinstance(value, Quantity)),
    ]


def _levers(gear: Gear) -> np.ndarray:
    """Forces in the mesh plane go by the lever rule, an axial force at the pitch radius acts as a couple; (4, 2)."""
    found = []
    for positions, diameter, side in (
        (gear.worm_bearing_positions_mm, gear.worm_pitch_diameter_mm, 1.0),
        (gear.wheel_bearing_positions_mm, gear.wheel_pitch_diameter_mm, -1.0),
    ):
        low, high = positions
        couple = side * diameter / 2 / (high - low)
        found += [(high / (high - low), couple), (-low / (high - low), -couple)]
    return np.array(found)


def _in_the_bath(bearing: BearingEntry, bore: float, outside: float) -> tuple[float, float]:
    """Factors of the drag of balls and of the layer; nothing where neither oil height nor drag loss factor is given."""
    mean, height = 0.5 * (bore + outside), bearing.oil_height_mm
    shape = K_Z * (bore + outside) / (outside - bore)
    balls = 1e-3 * 0.4 * bearing.drag_loss_factor * shape * 1e-12 * mean**5
    angle = 2 * np.arccos(np.clip(1 - height / (0.6 * mean), -1, 1))
    reach = np.sin(angle / 2) if angle <= np.pi else 1.0
    surface = 0.36 * mean**2 * (angle - np.sin(angle)) * 0.05 * shape
    return balls, 1e-3 * 1.093e-7 * mean**3 * surface * (mean**2 * reach) ** -1.379 if height else 0.0


def without_load(factor: np.ndarray, share: Any) -> np.ndarray:
    """What a factor on the bearings' rolling moments makes of the viscous loss without load.

    A `share` of that loss is the bearings', and most of it that of the larger one on the fast shaft, whose
    factor lies furthest from one.
    """
    return 1.0 - share * (1.0 - factor[WORM].min(axis=0))


def _column(values: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Values of the bearings, shaped to multiply an array whose first axis is theirs."""
    return values.reshape((-1,) + (1,) * (np.ndim(like) - 1))


def _of_shafts(worm: Any, wheel: Any) -> np.ndarray:
    """What each bearing gets of its shaft, array (4, ...)."""
    return np.stack(np.broadcast_arrays(worm, worm, wheel, wheel))


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


@quantity(unit="N", axes=AXES, reference="statics of the two shafts")
def bearing_radial_load(
    worm_axial_force, worm_tangential_force, radial_force, bearing_levers, bearing_dead_load
):
    """Radial load of each bearing, with the dead load that keeps an idle bearing rolling."""
    along = _of_shafts(worm_axial_force, worm_tangential_force)
    share, couple = (_column(lever, along) for lever in bearing_levers.T)
    apart = share * radial_force + couple * along
    across = share * _of_shafts(worm_tangential_force, worm_axial_force)
    return np.sqrt(apart * apart + across * across + bearing_dead_load**2)


@quantity(unit="N", axes=AXES, reference="the locating bearing of a shaft takes its axial force")
def bearing_axial_load(worm_axial_force, worm_tangential_force, bearing_locating):
    """Axial load of each bearing."""
    along = _of_shafts(worm_axial_force, worm_tangential_force)
    return np.abs(_column(bearing_locating, along) * along)


@quantity(unit="rad/s", axes=AXES)
def bearing_speed(worm_speed, bearing_turn):
    """Speed of each bearing."""
    return np.multiply.outer(bearing_turn, worm_speed)


@quantity(unit="1", axes=AXES, reference=f"{SKF}, angle 24.6 (Fa/C0)^0.24 degrees")
def bearing_contact(bearing_axial_load, bearing_rating, bearing_locating):
    """Sine of the angle under which the balls of each locating bearing carry its axial load; one for the others."""
    share = np.maximum(bearing_axial_load, 1e-6) / _column(bearing_rating, bearing_axial_load)
    sine = np.sin(np.deg2rad(24.6 * share**0.24))
    return np.where(_column(bearing_locating, sine), sine, 1.0)


@quantity(unit="N*m", axes=AXES, reference=f"{SKF}, rolling frictional variable")
def bearing_rolling_variable(
    bearing_radial_load, bearing_axial_load, bearing_contact, bearing_rolling, bearing_rolling_axial
):
    """Rolling moment of each bearing where the product of viscosity in mm^2/s and speed in r/min is one: G_rr."""
    axial = _column(bearing_rolling_axial, bearing_radial_load) * bearing_axial_load / bearing_contact
    return _column(bearing_rolling, axial) * (bearing_radial_load + axial) ** 0.54


@quantity(unit="N*m", axes=AXES, reference=f"{SKF}, rolling frictional moment")
def bearing_rolling_moment(bearing_rolling_variable, bearing_speed, kinematic_viscosity):
    """Rolling moment of each bearing: G_rr (nu n)^0.6, without the factors for heating and starvation."""
    return bearing_rolling_variable * (1e6 * RPM * kinematic_viscosity * bearing_speed) ** 0.6


@quantity(unit="N*m", axes=AXES, reference=f"{SKF}, sliding frictional variable")
def bearing_sliding_variable(
    bearing_radial_load, bearing_axial_load, bearing_contact, bearing_sliding, bearing_sliding_axial
):
    """Sliding moment of each bearing where the coefficient of friction is one: G_sl."""
    axial = _column(bearing_sliding_axial, bearing_radial_load) * bearing_axial_load**4 / bearing_contact
    return _column(bearing_sliding, axial) * np.cbrt(bearing_radial_load**5 + axial)


@quantity(unit="N*m", axes=AXES, reference=f"{SKF}, sliding frictional moment")
def bearing_sliding_moment(bearing_sliding_variable, bearing_speed, kinematic_viscosity, bearing_diameter):
    """Sliding moment of each bearing: G_sl times a coefficient between bare and full-film contact."""
    film = (1e6 * RPM * kinematic_viscosity * bearing_speed) ** 1.4
    bare = np.exp(-2.6e-8 * _column(bearing_diameter, film) * film)
    return bearing_sliding_variable * (MU_FULL_FILM + (MU_BOUNDARY - MU_FULL_FILM) * bare)


@quantity(unit="N*m", axes=AXES, reference=f"{SKF}, drag losses")
def bearing_drag_moment(bearing_speed, kinematic_viscosity, bearing_bath):
    """Drag moment of each bearing in the oil bath."""
    if not bearing_bath.any():
        return np.zeros_like(bearing_speed)
    speed = RPM * bearing_speed
    balls, layer = (_column(part, speed) for part in bearing_bath.T)
    return balls * speed**2 + layer * speed**0.621 * (1e6 * kinematic_viscosity) ** 1.379


# The constants are those that text books hand down (f0 2, z 0.0009, P0/C0 to the power 0.55, P1 = 3 Fa - 0.1 Fr);
# they were not compared with the standard, which is not free. A factor on the whole is fitted.
PALMGREN = "Palmgren; Harris, Rolling Bearing Analysis; SKF General Catalogue 1989; ISO/TR 14179-2"
SLOW = 2000.0  # nu n in mm^2/s r/min below which the moment without load no longer falls


@quantity(unit="N*m", axes=AXES, reference=f"{PALMGREN}; ISO/TR 14179-1")
def bearing_load_moment(bearing_radial_load, bearing_axial_load, bearing_diameter, bearing_rating):
    """Moment of each bearing that its load makes, by Palmgren: z (P0/C0)^0.55 P1 d_m."""
    diameter, rating = (_column(part, bearing_radial_load) for part in (bearing_diameter, bearing_rating))
    static = np.maximum(0.6 * bearing_radial_load + 0.5 * bearing_axial_load, bearing_radial_load)
    load = np.maximum(3.0 * bearing_axial_load - 0.1 * bearing_radial_load, bearing_radial_load)
    return 1e-3 * 0.0009 * (static / rating) ** 0.55 * load * diameter


@quantity(unit="N*m", axes=AXES, reference=PALMGREN)
def bearing_oil_moment(bearing_speed, kinematic_viscosity, bearing_diameter):
    """Moment of each bearing that its oil makes, by Palmgren: 1e-7 f0 (nu n)^(2/3) d_m^3."""
    flow = np.maximum(1e6 * RPM * kinematic_viscosity * np.abs(bearing_speed), SLOW)
    return 1e-3 * 2.0 * 1e-7 * flow ** (2 / 3) * _column(bearing_diameter, bearing_speed) ** 3


@quantity(unit="N*m", axes=AXES, reference=SKF)
def bearing_moment(bearing_rolling_moment, bearing_sliding_moment, bearing_drag_moment, bearing_seal):
    """Friction moment of each bearing by the catalogue."""
    turning = bearing_rolling_moment + bearing_sliding_moment + bearing_drag_moment
    return turning + _column(bearing_seal, turning)


@quantity(unit="W")
def bearing_loss(worm_bearing_torque, wheel_bearing_torque, worm_speed, wheel_speed):
    """Power lost in the bearings."""
    return worm_bearing_torque * worm_speed + wheel_bearing_torque * wheel_speed
