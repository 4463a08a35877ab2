"""Loads of the four bearings: rows 0 and 1 are the worm's, 2 and 3 the wheel's.

Torque of the bearings themselves is left out of the statics: it is some thousandths of the output torque,
and with it in, loads and moments would depend on each other in a circle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from specan.models.quantity import Quantity, quantity
from specan.models.worm_gear.rig import PlacedBearing, Rig

WORM, WHEEL = slice(0, 2), slice(2, 4)
AXES = ("bearing",)


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
