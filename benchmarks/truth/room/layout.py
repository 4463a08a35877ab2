"""Rooms as a laboratory would build them, drawn at random: what the rig file says, and what truly stands there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truth.room.box import WALLS, Disc, axis_of
from truth.room.field import Room
from truth.room.line import Real

F_MAX_HZ = 600.0
EDGE_M = (0.7, 1.2)
ADMITTANCE = (0.004, 0.02)
RADIUS_M = 0.05
MICS_PER_CARD = 8
NOMINAL_C, PRESSURE_PA = 20.0, 101325.0
VIBROMETER_MM_S_PER_V = 50.0
MIC_MV_PER_PA = 50.0
UNCERTAINTY = {
    "temperature_K": 0.5,
    "position_m": 0.002,
    "dimension_percent": 0.1,
    "calibration_dB": 0.1,
    "calibration_phase_deg": 0.3,
    "card_delay_s": 8e-8,
    "vibrometer_delay_s": 1e-5,
    "vibrometer_gain_percent": 1.0,
    "model_discrepancy_percent": 0.5,
}
_FROM_WALL_M, _FROM_PISTON_M, _APART_M = 0.06, 0.2, 0.1

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Layout:
    """What the rig file says: edges, piston and microphones, in metres."""

    dims_m: Point
    piston: Disc
    position_m: tuple[Point, ...]

    @property
    def cards(self) -> list[list[int]]:
        """First and last microphone of each converter card, counted from 1."""
        n = len(self.position_m)
        return [[first + 1, min(first + MICS_PER_CARD, n)] for first in range(0, n, MICS_PER_CARD)]


def as_point(values: Real) -> Point:
    """Three plain floats."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def draw_layout(rng: np.random.Generator, n_mics: int) -> Layout:
    """A room of random edges with the piston in a random wall and microphones anywhere but too near to things."""
    dims = np.round(rng.uniform(*EDGE_M, 3), 3)
    wall = WALLS[rng.integers(6)]
    centre = draw_on_wall(rng, as_point(dims), wall, 2.0 * RADIUS_M)
    positions: list[Real] = []
    while len(positions) < n_mics:
        place = np.round(rng.uniform(_FROM_WALL_M, dims - _FROM_WALL_M), 4)
        far = all(np.linalg.norm(place - other) > _APART_M for other in positions)
        if far and np.linalg.norm(place - np.array(centre)) > _FROM_PISTON_M:
            positions.append(place)
    return Layout(as_point(dims), Disc(wall, centre, RADIUS_M), tuple(as_point(p) for p in positions))


def draw_on_wall(rng: np.random.Generator, dims_m: Point, wall: str, margin_m: float) -> Point:
    """A random point of a wall at least `margin_m` away from its edges."""
    place = np.round(rng.uniform(margin_m, np.array(dims_m) - margin_m), 4)
    place[axis_of(wall)] = dims_m[axis_of(wall)] if wall.endswith("1") else 0.0
    return as_point(place)


def sound_speed(temperature_C: float) -> float:
    """Speed of sound in dry air as an ideal gas of 28.9647 g/mol with a ratio of heat capacities of 1.4, m/s.

    Examples
    --------
    >>> round(sound_speed(20.0), 1)
    343.2
    """
    return float(np.sqrt(1.4 * 8.314463 / 0.0289647 * (temperature_C + 273.15)))


def density(temperature_C: float) -> float:
    """Density of the same gas at `PRESSURE_PA`, kg/m^3."""
    return PRESSURE_PA * 0.0289647 / (8.314463 * (temperature_C + 273.15))


def draw_room(layout: Layout, rng: np.random.Generator) -> tuple[Room, float]:
    """The room as it truly stands, and its temperature: everything off by what the rig's uncertainty allows."""
    temperature = NOMINAL_C + UNCERTAINTY["temperature_K"] * rng.standard_normal()
    edges = np.array(layout.dims_m) * (
        1.0 + UNCERTAINTY["dimension_percent"] / 100.0 * rng.standard_normal(3)
    )
    places = np.array(layout.position_m)
    places = places + UNCERTAINTY["position_m"] * rng.standard_normal(places.shape)
    admittance = float(np.exp(rng.uniform(*np.log(ADMITTANCE))))
    room = Room(
        dims_m=as_point(edges),
        sound_speed=0.0,
        density=0.0,
        admittance=(admittance,) * 6,
        piston=layout.piston,
        position_m=tuple(as_point(p) for p in places),
    )
    return at_temperature(room, temperature), temperature


def at_temperature(room: Room, temperature_C: float) -> Room:
    """The same room with air of another temperature."""
    return replace(room, sound_speed=sound_speed(temperature_C), density=density(temperature_C))


def rig_file(layout: Layout, seed: int) -> dict[str, Any]:
    """Content of the rig file."""
    return {
        "room": {"dims_m": list(layout.dims_m)},
        "piston": {
            "wall": layout.piston.wall,
            "centre_m": list(layout.piston.centre_m),
            "radius_m": layout.piston.radius_m,
        },
        "air": {
            "nominal_temperature_C": NOMINAL_C,
            "nominal_pressure_Pa": PRESSURE_PA,
            "relative_humidity_percent": 50.0,
        },
        "band": {"f_max_hz": F_MAX_HZ},
        "mics": {
            "position_m": [list(p) for p in layout.position_m],
            "nominal_sensitivity_mV_per_Pa": MIC_MV_PER_PA,
            "cards": layout.cards,
        },
        "vibrometer": {"sensitivity_mm_s_per_V": VIBROMETER_MM_S_PER_V, "point": "diaphragm centre"},
        "rig": {"id": seed},
        "uncertainty": dict(UNCERTAINTY),
    }
