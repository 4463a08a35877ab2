"""Ball bearings ball by ball: contact angle, ball loads, rolling through the oil, spinning in the pressed contact."""

from __future__ import annotations

import numpy as np

from truth.worm_gear.gear import OIL_DENSITY, Array, Bearing

MODULUS = 227e9  # effective elastic modulus of steel on steel, Pa
AXIAL_CONSTANT = 896e6  # axial deflection constant of grooves with 0.52 of the ball diameter, Pa (Harris)
FREE_ANGLE = np.deg2rad(6.0)  # contact angle that the clearance gives without load
ELLIPTICITY = 7.0
SLIDING_FRICTION = 0.07
ROLLING = 4.4
LOAD_EXPONENT = 0.5
_NEWTON_STEPS = 8


def contact_angle(bearing: Bearing, axial: Array) -> Array:
    """Contact angle under an axial load, rad: the balls climb the groove until the grooves carry.

    Root of ``F = Z D^2 K sin(a) (cos(a0)/cos(a) - 1)^1.5`` (Hertz contact of the displaced rings).
    """
    target = np.maximum(axial, 1e-12) / (bearing.balls * bearing.ball_diameter**2 * AXIAL_CONSTANT)
    start = np.cos(FREE_ANGLE) ** 2
    rise = (target / np.sin(FREE_ANGLE)) ** (2.0 / 3.0)  # cos(a0) / cos(a) - 1, upper bound
    for _ in range(_NEWTON_STEPS):  # on the logarithm of the equation over the logarithm of the rise
        sine2 = 1.0 - start / (1.0 + rise) ** 2
        slope = 1.0 + 2.0 / 3.0 * rise * start / ((1.0 + rise) ** 3 * sine2)
        excess = np.log(rise) + np.log(sine2) / 3.0 - 2.0 / 3.0 * np.log(target)
        rise = rise * np.exp(-excess / slope)
    return np.arccos(np.cos(FREE_ANGLE) / (1.0 + rise))


def ball_loads(bearing: Bearing, radial: Array, axial: Array, angle: Array) -> Array:
    """Load of each ball, N, shape (conditions, balls)."""
    place = 2.0 * np.pi * np.arange(bearing.balls) / bearing.balls
    share = np.maximum(np.cos(place), 0.0) ** 1.5  # point contact, no clearance
    share /= np.sum(share * np.cos(place))
    thrust = axial / (bearing.balls * np.sin(angle))
    return thrust[:, None] + radial[:, None] * share


def rolling_torque(bearing: Bearing, loads: Array, speed: Array, viscosity: Array) -> Array:
    """Torque of pumping oil into the contacts, Nm.

    Force at a ball ``c E R^2 k^0.35 U^0.6 W^0.5`` with the dimensionless speed U and load W: the form of the
    solutions for elastohydrodynamic rolling, with the exponents that whole bearings show. The factor c is a
    property of the simulated bearings: such that they have the friction of catalogue bearings.
    """
    radius = bearing.ball_diameter / 2.0
    entrainment = speed * bearing.pitch_diameter / 4.0
    u = OIL_DENSITY * viscosity * 1e-6 * entrainment / (MODULUS * radius)
    w = loads / (MODULUS * radius**2)
    force = ROLLING * MODULUS * radius**2 * ELLIPTICITY**0.35 * u[:, None] ** 0.6 * w**LOAD_EXPONENT
    return np.sum(force, axis=1) * bearing.pitch_diameter / 2.0


def spinning_torque(bearing: Bearing, loads: Array, angle: Array) -> Array:
    """Torque of the balls that spin on the inclined inner contact, Nm.

    Each moment is 3/8 of friction, load and half-width (Hertz pressure); the outer race holds the ball's axis, so
    that the inner one spins by the sine of the contact angle per turn.
    """
    radius = bearing.ball_diameter / 2.0
    half_width = (1.5 * loads * radius / MODULUS) ** (1.0 / 3.0) * ELLIPTICITY ** (2.0 / 3.0)
    return 0.375 * SLIDING_FRICTION * np.sum(loads * half_width, axis=1) * np.sin(angle)
