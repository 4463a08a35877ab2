"""Involute geometry of the meshes: contact ratios, phases, gaps before and after contact, conditions of assembly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from specan.arrays import Real
from specan.errors import RequestError
from specan.planetary_gear.model.rig import Gear, Pair, Rotors


@dataclass(frozen=True)
class Mesh:
    """A pair of gears in mesh; lengths in m, along the line of action.

    Attributes
    ----------
    base_pitch : float
    contact_ratio : float
    pressure_angle : float
        At the working pitch circles, rad.
    gap_before, gap_after : float
        1/m: a pair of teeth that is u outside its path of contact, before or after it, is gap u^2 apart.
    """

    base_pitch: float
    contact_ratio: float
    pressure_angle: float
    gap_before: float
    gap_after: float


def gear_mesh(
    driver: int, driven: int, module: float, pressure_angle: float, centre_distance: float | None = None
) -> Mesh:
    """Two gears without profile shift, by their teeth; those of a ring, which is driven, count negative.

    The working pressure angle is ``cos a_w = m z cos a / (2 centre distance)``, z the sum of the teeth; the contact
    ratio the length of the path of contact over the base pitch (ISO 21771:2007, clause 5). Contact begins at the driven
    gear's tip and ends at the driver's.

    Examples
    --------
    >>> [round(gear_mesh(*teeth, 2e-3, math.radians(20)).contact_ratio, 3) for teeth in ((24, 21), (21, -66))]
    [1.586, 1.932]
    """
    teeth, external = abs(driver + driven), driven > 0
    a = centre_distance or module * teeth / 2
    cosine = module * teeth * math.cos(pressure_angle) / (2 * a)
    if not 0 < cosine < 1:
        raise RequestError(
            f"a centre distance of {1e3 * a:g} mm is shorter than the base circles allow",
            expected=f"about {500 * module * teeth:g} mm",
        )
    angle, side = math.acos(cosine), 1 if external else -1
    one = _Wheel(0.0 if external else a, driver, 1, module, pressure_angle)
    two = _Wheel(a if external else 0.0, abs(driven), side, module, pressure_angle)
    if two.tip <= two.base:
        raise RequestError(
            f"a ring of {-driven} teeth has tips inside its base circle", remedy="take more teeth"
        )
    path = one.reach + side * (two.reach - a * math.sin(angle))
    before, after = (
        _tip_gap(*pair, angle, 0.05 * one.pitch, external=external) for pair in ((two, one), (one, two))
    )
    return Mesh(one.pitch, path / one.pitch, angle, before, after)


class _Wheel:
    """Radii of a wheel whose centre lies at x on the line of centres; `side` -1 for a ring, whose tips lie inside."""

    def __init__(self, x: float, teeth: int, side: int, module: float, pressure_angle: float) -> None:
        self.x = x
        self.base = module * teeth * math.cos(pressure_angle) / 2
        self.tip = module * (teeth + 2 * side) / 2
        self.reach = math.sqrt(max(self.tip**2 - self.base**2, 0.0))
        self.pitch = math.pi * module * math.cos(pressure_angle)


def _tip_gap(tip: _Wheel, other: _Wheel, angle: float, step: float, *, external: bool) -> float:
    """Coefficient of the gap between a tip outside the path of contact and the other wheel's flank, 1/m.

    The tip turns on beyond the line of action by u along its base circle, the other wheel with it. Through the tip
    passes one involute of the other wheel; by how much its base point differs from that of the wheel's own flank, times
    the base radius, is the gap along the line of action. It grows with u^2.
    """
    normal = (math.cos(angle), -math.sin(angle))
    along = (math.sin(angle), math.cos(angle))
    mirrored = external and tip.x < other.x  # the pair seen from its other side: the tip's wheel lies right
    x_tip, x_other = (other.x - tip.x, 0.0) if mirrored else (tip.x, other.x)
    side = -1.0 if external else 1.0
    start = (x_tip + side * tip.base * normal[0], side * tip.base * normal[1])
    p0 = (start[0] + side * tip.reach * along[0], start[1] + side * tip.reach * along[1])

    def base_point(p: tuple[float, float]) -> float:
        x, y = p[0] - x_other, p[1]
        inside = math.acos(min(1.0, other.base / math.hypot(x, y)))
        return math.atan2(y, x) - inside + math.tan(inside)

    def gap(u: float) -> float:
        turn = u / tip.base
        x, y = p0[0] - x_tip, p0[1]
        cos, sin = math.cos(turn), math.sin(turn)
        moved = (x_tip + cos * x - sin * y, sin * x + cos * y)
        return other.base * (base_point(moved) - base_point(p0)) - side * u

    return 0.5 * (abs(gap(step)) + abs(gap(-step))) / step**2


def planet_angles(gear: Gear) -> Real:
    """Places of the planets on the carrier, rad; equally spaced unless the rig says otherwise."""
    if gear.planet_angles_deg is not None:
        return np.radians(np.asarray(gear.planet_angles_deg, dtype=float))
    return 2 * np.pi * np.arange(gear.planets) / gear.planets


def mesh_phases(gear: Gear) -> tuple[Real, Real]:
    """Phases of the sun-planet and the ring-planet meshes in tooth pitches, from 0 to 1.

    Parker and Lin, Mesh phasing relationships in planetary and epicyclic gears, J. Mech. Des. 126 (2004) 365: a
    planet at the angle psi is z_sun psi / 2 pi pitches behind one at zero on the sun, which overtakes the carrier, and
    z_ring psi / 2 pi ahead on the ring, which falls behind (the same where the set assembles); between the two
    meshes of one planet lies half a pitch where its number of teeth is even (the other flank, on the other side).

    Examples
    --------
    >>> from specan.planetary_gear.model.rig import Gear
    >>> sun, ring = mesh_phases(Gear(z_sun=31, z_planet=31, z_ring=95, planets=3, module_mm=1.0))
    >>> sun.round(3).tolist(), ring.round(3).tolist()
    ([0.0, 0.667, 0.333], [0.0, 0.667, 0.333])
    """
    turns = planet_angles(gear) / (2 * np.pi)
    other_flank = 0.5 * ((gear.z_planet + 1) % 2)
    return (-gear.z_sun * turns) % 1.0, (gear.z_ring * turns + other_flank) % 1.0


def check_assembly(gear: Gear) -> None:
    """Conditions under which the set can be put together.

    Raises
    ------
    RequestError
        Centre distances that do not agree, planets that do not fit in at their places, or that touch.
    """
    gap = gear.z_ring - gear.z_sun - 2 * gear.z_planet
    if abs(gap) > 2 or (gap and gear.centre_distance_mm is None):
        raise RequestError(
            f"sun {gear.z_sun}, planet {gear.z_planet}, ring {gear.z_ring} have no common centre distance",
            expected=f"a ring of z_sun + 2 z_planet = {gear.z_sun + 2 * gear.z_planet} teeth"
            + (", or a [gear] centre_distance_mm with profile shift" if abs(gap) <= 2 else ""),
        )
    _check_places(gear)
    places = np.sort(planet_angles(gear) % (2 * np.pi))
    nearest = float(np.min(np.diff([*places, places[0] + 2 * np.pi])))
    room = 2e3 * gear.pin_distance_m * math.sin(min(nearest, np.pi) / 2)
    needed = gear.module_mm * (gear.z_planet + 2)
    if places.size > 1 and room <= needed:
        raise RequestError(
            f"neighbouring planets touch: their centres lie {room:.2f} mm apart, their tip circles are "
            f"{needed:.2f} mm wide",
            remedy="take fewer planets or smaller ones",
        )


def _check_places(gear: Gear) -> None:
    """A planet meshes with sun and ring at once at multiples of a turn over the sum of their teeth."""
    total, given = gear.z_sun + gear.z_ring, gear.planet_angles_deg
    step = 360.0 / total
    if given is None and total % gear.planets:
        fits = [n for n in range(2, 9) if total % n == 0]
        raise RequestError(
            f"{gear.planets} planets cannot be equally spaced: z_sun + z_ring = {total} is not a multiple of "
            f"{gear.planets}",
            expected=f"{', '.join(map(str, fits)) or 'no'} planets, or planet_angles_deg in steps of 360/{total} "
            f"= {step:.4f} degrees",
        )
    if given is not None and len(given) != gear.planets:
        raise RequestError(
            f"planet_angles_deg has {len(given)} angles for {gear.planets} planets",
            expected="one angle per planet",
        )
    for angle in given or ():
        if abs(angle / step - round(angle / step)) > 1e-3:
            raise RequestError(
                f"a planet at {angle:g} degrees does not mesh with sun and ring at once",
                expected=f"multiples of 360/{total} = {step:.6f} degrees, such as {round(angle / step) * step:.4f}",
            )


def pair_mesh(pair: Pair) -> Mesh:
    """The mesh of a gear pair."""
    angle = math.radians(pair.pressure_angle_deg)
    mesh = gear_mesh(pair.z_driver, pair.z_driven, 1e-3 * pair.module_mm, angle)
    return replace(mesh, contact_ratio=pair.contact_ratio or mesh.contact_ratio)


def set_meshes(gear: Gear) -> tuple[Mesh, Mesh]:
    """Sun-planet and ring-planet mesh of a set."""
    module, angle = 1e-3 * gear.module_mm, math.radians(gear.pressure_angle_deg)
    a = None if gear.centre_distance_mm is None else 1e-3 * gear.centre_distance_mm
    sun = gear_mesh(gear.z_sun, gear.z_planet, module, angle, a)
    ring = gear_mesh(gear.z_planet, -gear.z_ring, module, angle, a)
    return (
        replace(sun, contact_ratio=gear.contact_ratio_sun_planet or sun.contact_ratio),
        replace(ring, contact_ratio=gear.contact_ratio_ring_planet or ring.contact_ratio),
    )


STEEL = 7850.0  # kg/m^3


def disc(diameter: float, width: float) -> tuple[float, float]:
    """Mass and inertia of a steel disc.

    Examples
    --------
    >>> round(disc(0.042, 0.02)[0], 4)
    0.2175
    """
    mass = STEEL * math.pi * diameter**2 / 4 * width
    return mass, mass * diameter**2 / 8


def inertias(gear: Gear, known: Rotors) -> tuple[float, float]:
    """Of the carrier with the planets' masses on it and the load, and of a planet about its own axis, kg m^2.

    Unless known, planets are discs of the pitch circle and the carrier is a plate that reaches to their centres.
    """
    width = 1e-3 * gear.face_width_mm
    mass, inertia = disc(1e-3 * gear.module_mm * gear.z_planet, width)
    centre = gear.pin_distance_m
    carrier = known.carrier_kg_m2 or disc(2 * centre, width)[1] + gear.planets * mass * centre**2
    return carrier + known.load_kg_m2, known.planet_kg_m2 or inertia
