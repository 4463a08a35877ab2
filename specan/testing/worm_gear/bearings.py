"""Ball bearings ball by ball: rolling through the oil and sliding inside the pressed contact."""

from __future__ import annotations

import numpy as np

from specan.testing.worm_gear.gear import OIL_DENSITY, Array, Bearing

MODULUS = 227e9  # effective elastic modulus of steel on steel, Pa
CONFORMITY = 0.52  # groove radius over ball diameter
ELLIPTICITY = 7.0
CONTACT_ANGLE = np.deg2rad(15.0)
SLIDING_FRICTION = 0.05
HEATHCOTE = 0.12  # share of the spin-free differential slip that a conforming groove makes


def ball_loads(bearing: Bearing, radial: Array, axial: Array) -> Array:
    """Load of each ball, N, shape (conditions, balls)."""
    angle = 2.0 * np.pi * np.arange(bearing.balls) / bearing.balls
    share = np.maximum(np.cos(angle), 0.0) ** 1.5  # point contact, no clearance
    share /= np.sum(share * np.cos(angle))
    thrust = axial / (bearing.balls * np.sin(CONTACT_ANGLE))
    return thrust[:, None] + radial[:, None] * share


def rolling_torque(bearing: Bearing, loads: Array, speed: Array, viscosity: Array) -> Array:
    """Torque of pumping oil into the contacts, Nm.

    Force at a contact ``2.86 E R^2 k^0.35 U^0.66 W^0.47`` with the dimensionless speed U and load W: the form of
    Houpert's solutions for elastohydrodynamic contacts. The magnitude is a property of the simulated specimen.
    """
    radius = bearing.ball_diameter / 2.0
    entrainment = speed * bearing.pitch_diameter / 4.0
    u = OIL_DENSITY * viscosity * 1e-6 * entrainment / (MODULUS * radius)
    w = loads / (MODULUS * radius**2)
    force = 2.86 * MODULUS * radius**2 * ELLIPTICITY**0.35 * u[:, None] ** 0.66 * w**0.47
    return np.sum(force, axis=1) * bearing.pitch_diameter / 2.0


def sliding_torque(bearing: Bearing, loads: Array) -> Array:
    """Torque of the slip inside the contact ellipse, Nm: friction times the square of its half-width (Hertz)."""
    radius = bearing.ball_diameter / 2.0
    circle = (1.5 * loads * radius / MODULUS) ** (1.0 / 3.0)
    half_width = circle * ELLIPTICITY ** (2.0 / 3.0)
    slip = HEATHCOTE * (half_width / radius) ** 2
    return 2.0 * np.sum(SLIDING_FRICTION * slip * loads, axis=1) * bearing.pitch_diameter / 2.0
