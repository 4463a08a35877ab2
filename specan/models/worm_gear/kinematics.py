"""Speeds of the shafts and of the flanks."""

from __future__ import annotations

import math

from specan.models.quantity import Quantity, constant, quantity
from specan.models.worm_gear.rig import Gear


def geometry(gear: Gear) -> list[Quantity]:
    """Constants of the gear, SI."""
    return [
        constant("gear_ratio", gear.z_wheel / gear.z_worm, "1", "Speed of the worm over that of the wheel."),
        constant("worm_radius", 5e-4 * gear.worm_pitch_diameter_mm, "m", "Pitch radius of the worm."),
        constant("wheel_radius", 5e-4 * gear.wheel_pitch_diameter_mm, "m", "Pitch radius of the wheel."),
        constant("lead_angle", math.radians(gear.lead_angle_deg), "rad", "Lead angle of the worm."),
        constant(
            "normal_pressure_angle",
            math.radians(gear.normal_pressure_angle_deg),
            "rad",
            "Pressure angle in the section normal to the flank.",
        ),
        constant("wheel_width", 1e-3 * gear.wheel_width_mm, "m", "Face width of the wheel."),
    ]


@quantity(unit="rad/s")
def wheel_speed(worm_speed, gear_ratio):
    """Speed of the wheel shaft."""
    return worm_speed / gear_ratio


@quantity(unit="m/s", reference="ISO/TS 14521:2020, sliding velocity at the mean diameter")
def sliding_speed(worm_speed, worm_radius, lead_angle):
    """Speed at which the worm's flank slides along the wheel's."""
    return worm_speed * (worm_radius / math.cos(lead_angle))


QUANTITIES = [wheel_speed, sliding_speed]
