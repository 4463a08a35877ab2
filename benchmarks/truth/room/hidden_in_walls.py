"""What can be hidden in a wall: linings, layers, panels, resonators, openings, a second source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from truth.room.box import Disc
from truth.room.branch import Lining, Motion, Plug
from truth.room.layer import Layer, layer_motions
from truth.room.layout import Point, as_point, draw_on_wall
from truth.room.truth import Details, Truth, free_wall, with_part

GRAZING_OVER_NORMAL = 2.0  # resonance of a sheet for grazing sound over that for normal incidence


def _resonant(truth: Truth, strength: float, frequency_hz: float, quality: float) -> Motion:
    """Motion whose admittance over that of air is `strength` at its resonance."""
    resistance = truth.room.density * truth.room.sound_speed / strength
    omega = 2.0 * np.pi * frequency_hz
    mass = quality * resistance / omega
    return Motion(mass=mass, resistance=resistance, stiffness=omega**2 * mass)


def _lined(
    truth: Truth,
    strength: float,
    at: str,
    rng: np.random.Generator,
    hz: tuple[float, float],
    q: tuple[float, float],
) -> tuple[Truth, Details]:
    wall = free_wall(truth, at, rng)
    frequency, quality = rng.uniform(*hz), rng.uniform(*q)
    motion = _resonant(truth, strength, frequency, quality)
    details: Details = {
        "wall": wall,
        "frequency_hz": frequency,
        "quality": quality,
        "mass_kg_m2": motion.mass,
    }
    return with_part(truth, Lining(wall, motion)), details


def wall_impedance(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A damped lining of low quality factor."""
    return _lined(truth, strength, at, rng, (150.0, 450.0), (0.3, 0.8))


def panel(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A sharp resonance of a whole wall."""
    return _lined(truth, strength, at, rng, (100.0, 350.0), (5.0, 15.0))


def porous(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A porous layer on a part `strength` of the wall, in strips finer than a wavelength."""
    wall = free_wall(truth, at, rng)
    layer = Layer(rng.uniform(0.03, 0.08), 10.0 ** rng.uniform(3.8, 4.6))
    parts = [
        Lining(wall, motion.spread_over(strength)) for motion in layer_motions(layer, truth.room.density)
    ]
    details: Details = {
        "wall": wall,
        "thickness_m": layer.thickness_m,
        "flow_resistivity_Pa_s_m2": layer.flow_resistivity,
    }
    return with_part(truth, *parts), details


def extended_reaction(
    truth: Truth, strength: float, at: str, rng: np.random.Generator
) -> tuple[Truth, Details]:
    """A damped sheet under tension: what one point does, its neighbours feel, and the admittance depends on the angle.

    For sound that runs along the sheet its resonance lies `GRAZING_OVER_NORMAL` times as high as for normal incidence.
    """
    wall = free_wall(truth, at, rng)
    frequency, quality = rng.uniform(150.0, 300.0), rng.uniform(0.8, 2.0)
    motion = _resonant(truth, strength, frequency, quality)
    along = 2.0 * np.pi * GRAZING_OVER_NORMAL * frequency / truth.room.sound_speed
    tension = motion.stiffness * (GRAZING_OVER_NORMAL**2 - 1.0) / along**2
    details: Details = {"wall": wall, "frequency_hz": frequency, "quality": quality, "tension_N_m": tension}
    return with_part(truth, Lining(wall, motion, tension)), details


def resonator(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A neck before a cavity of `strength` cubic metres: mass of the air plug, spring of the enclosed air.

    ``@z1 corner`` puts it into a corner of that wall, ``@corner`` of any.
    """
    wall = free_wall(truth, at.removesuffix("corner").strip(), rng)
    radius, frequency, quality = rng.uniform(0.02, 0.03), rng.uniform(120.0, 450.0), rng.uniform(8.0, 20.0)
    place = draw_on_wall(rng, truth.layout.dims_m, wall, 0.08)
    if at.endswith("corner"):
        place = _in_a_corner(rng, truth.layout.dims_m, wall)
    disc = Disc(wall, place, radius)
    omega, rho = 2.0 * np.pi * frequency, truth.room.density
    stiffness = rho * truth.room.sound_speed**2 * disc.area_m2 / strength
    mass = stiffness / omega**2
    motion = Motion(mass=mass, resistance=omega * mass / quality, stiffness=stiffness)
    details: Details = {"wall": wall, "place_m": str(place), "frequency_hz": frequency, "quality": quality}
    return with_part(truth, Plug(disc, motion)), details | {"neck_radius_m": radius, "length_m": mass / rho}


def _in_a_corner(rng: np.random.Generator, dims_m: Point, wall: str) -> Point:
    """A point of a wall 4 to 8 cm from two of its edges."""
    off, far = rng.uniform(0.04, 0.08, 3), rng.integers(2, size=3)
    place = np.where(far == 1, np.array(dims_m) - off, off)
    axis = "xyz".index(wall[0])
    place[axis] = dims_m[axis] if wall.endswith("1") else 0.0
    return as_point(place)


def leak(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """An opening of `strength` square metres to the outside: a plug of air with some resistance."""
    wall = free_wall(truth, at, rng)
    radius = float(np.sqrt(strength / np.pi))
    place = draw_on_wall(rng, truth.layout.dims_m, wall, radius + 0.05)
    length = rng.uniform(0.01, 0.03) + 0.85 * radius
    rho, c = truth.room.density, truth.room.sound_speed
    motion = Motion(mass=rho * length, resistance=rng.uniform(0.005, 0.03) * rho * c, stiffness=0.0)
    return with_part(truth, Plug(Disc(wall, place, radius), motion)), {
        "wall": wall,
        "place_m": str(place),
        "length_m": length,
        "resistance_Pa_s_m": motion.resistance,
    }


def flanking(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """Another place of a wall moves with the piston, `strength` times as fast and later."""
    wall = free_wall(truth, at, rng)
    place = draw_on_wall(rng, truth.layout.dims_m, wall, 0.12)
    late = rng.uniform(0.0, 0.002)
    second = Disc(wall, place, truth.layout.piston.radius_m)
    room = replace(truth.room, second=second, second_gain=strength, second_delay_s=late)
    return replace(truth, room=room), {"wall": wall, "place_m": str(place), "delay_s": late}
