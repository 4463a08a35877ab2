"""The gear on the simulated bench: its geometry, its oil and the properties that differ from one gear to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATIO = 7.5
WORM_RADIUS = 0.0175
WHEEL_RADIUS = 0.045
CENTRE_DISTANCE = WORM_RADIUS + WHEEL_RADIUS
NORMAL_PRESSURE_ANGLE = np.deg2rad(20.0)
AXIAL_PITCH = np.pi * 2.0 * WHEEL_RADIUS / 30
FACE_ANGLE = np.deg2rad(38.0)  # half the angle over which the wheel rim wraps the worm and touches it
OIL_DENSITY = 1000.0
VISCOSITY_40, VISCOSITY_100 = 220.0, 36.0
REFERENCE_VISCOSITY = 110.0  # mm^2/s, near 59 degC; only a unit for the strengths below
REFERENCE_SPEED = 1500.0
CHART_OFFSET = 0.8
ZERO_CELSIUS = 273.15
AMBIENT = 22.0


@dataclass(frozen=True)
class Bearing:
    """A deep groove ball bearing by its rolling elements; dimensions in m, position along the shaft from the mesh."""

    designation: str
    shaft: str
    position: float
    pitch_diameter: float
    ball_diameter: float
    balls: int
    locating: bool


# Ball complements as usually published for the three sizes; positions as in the rig file.
BEARINGS = (
    Bearing("6009", "worm", -0.031, 0.060, 0.00873, 12, locating=True),
    Bearing("6202", "worm", +0.031, 0.025, 0.00595, 8, locating=False),
    Bearing("6211", "wheel", -0.0548, 0.0775, 0.01429, 10, locating=True),
    Bearing("6211", "wheel", +0.0622, 0.0775, 0.01429, 10, locating=False),
)
SHAFT_WEIGHT = {"worm": 6.0, "wheel": 25.0}  # N: a shaft of 0.6 kg, a wheel of 2.5 kg


@dataclass(frozen=True)
class Gear:
    """One specimen: what differs between two gears of the same type and is not written on the name plate.

    Parameters
    ----------
    film_friction : float
        Friction coefficient of the fully lubricated mesh.
    boundary_friction : float
        What is added to it at standstill.
    boundary_speed : float
        Sliding speed at which half of that is gone, m/s.
    drag_torque : float
        No-load torque of the oil at 1500 rpm, 110 mm^2/s and full level, Nm at the worm.
    drag_speed : float
        Speed, relative to 1500 rpm, at which the oil carried along saturates.
    bearing_roughness : float
        Factor on the friction of all bearings.
    bearing_seat : float
        Axial load of the bearings that the running gear always has, N.
    oil_batch : float
        Viscosity over that of the data sheet.
    """

    film_friction: float = 0.036
    boundary_friction: float = 0.09
    boundary_speed: float = 0.06
    drag_torque: float = 0.62
    drag_speed: float = 0.06
    bearing_roughness: float = 1.0
    bearing_seat: float = 0.3
    oil_batch: float = 1.0


def draw(rng: np.random.Generator) -> Gear:
    """Draw one specimen; ranges as two gears off the same line would differ, friction 0.03 to 0.05."""
    return Gear(
        film_friction=rng.uniform(0.030, 0.050),
        boundary_speed=rng.uniform(0.05, 0.07),
        drag_torque=rng.uniform(0.5, 0.72),
        drag_speed=rng.uniform(0.04, 0.09),
        bearing_roughness=rng.uniform(0.97, 1.03),
        oil_batch=rng.uniform(0.97, 1.03),
    )


def viscosity(gear: Gear, temperature: Array, offset: float = CHART_OFFSET) -> Array:
    """Kinematic viscosity, mm^2/s, by the standard chart of lubricating oils through the data sheet's two points.

    Ubbelohde and Walther: ``log log(nu + 0.8) = K - m log T`` with T in kelvin (DIN 51563; ASTM D341 has 0.7),
    times what the batch in the gear differs from the data sheet.

    Parameters
    ----------
    gear : Gear
        Whose oil.
    temperature : array
        degC.
    offset : float
        Added to the viscosity in the chart, mm^2/s.

    Examples
    --------
    >>> viscosity(Gear(), np.array([40.0, 100.0])).round(6)
    array([220.,  36.])
    """
    at_40, at_100 = (np.log10(np.log10(nu + offset)) for nu in (VISCOSITY_40, VISCOSITY_100))
    slope = (at_40 - at_100) / np.log10((100.0 + ZERO_CELSIUS) / (40.0 + ZERO_CELSIUS))
    line = at_40 - slope * np.log10((temperature + ZERO_CELSIUS) / (40.0 + ZERO_CELSIUS))
    return gear.oil_batch * (10.0 ** (10.0**line) - offset)
