"""Inertia of the parts of a set, from their sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from specan.models.planetary_gear.rig import Gear, Rig
from specan.models.planetary_gear.rig import Rotors as Known

STEEL = 7850.0  # kg/m^3


@dataclass(frozen=True)
class Rotors:
    """Inertias in kg m^2 about the own axis; the carrier's holds the planets' masses on it and the load."""

    carrier_inertia: float
    planet_inertia: float
    planet_mass: float
    centre_distance: float


def disc(diameter: float, width: float) -> tuple[float, float]:
    """Mass and inertia of a steel disc.

    Examples
    --------
    >>> round(disc(0.042, 0.02)[0], 4)
    0.2175
    """
    mass = STEEL * math.pi * diameter**2 / 4 * width
    return mass, mass * diameter**2 / 8


def rotors(gear: Gear, known: Known) -> Rotors:
    """Unless known, planets are discs of the pitch circle and the carrier is a plate that reaches to their centres."""
    width = 1e-3 * gear.face_width_mm
    mass, inertia = disc(1e-3 * gear.module_mm * gear.z_planet, width)
    centre = 1e-3 * (gear.centre_distance_mm or gear.module_mm * (gear.z_sun + gear.z_planet) / 2)
    carrier = known.carrier_kg_m2 or disc(2 * centre, width)[1] + gear.planets * mass * centre**2
    return Rotors(carrier + known.load_kg_m2, known.planet_kg_m2 or inertia, mass, centre)


def inertia_uncertainty(rig: Rig) -> float:
    """Standard uncertainty of the natural logarithm of what turns with the carrier."""
    percent = rig.uncertainty.carrier_inertia_percent or (10.0 if rig.rotors.carrier_kg_m2 else 100.0)
    return percent / 100
