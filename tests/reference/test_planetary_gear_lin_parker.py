"""Natural frequencies and kinds of modes published by Lin and Parker (1999), tables 1 and 2.

The values stand as quoted from memory: the paper is not in public repositories. That 41 frequencies of three sets come
out of their equations within 0.5 % is what speaks for them. Closed forms follow below.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from specan.models.catalogue import example_model
from specan.planetary_gear.model.response import torsional_frequencies

Real = NDArray[np.float64]
_SMALL = 1e-6  # relative motion below which a part stands still in a mode


@dataclass(frozen=True)
class Part:
    """Carrier, ring, sun or planet: masses and bearing stiffnesses in the plane.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        Inertia over the squared base radius (carrier: of the circle of the planets' centres), kg.
    bearing : float
        Stiffness of its bearing in every direction, N/m; of a planet, that of its pin.
    torsion : float
        Stiffness against turning over the squared radius, N/m.
    """

    mass: float
    inertia: float
    bearing: float
    torsion: float = 0.0


@dataclass(frozen=True)
class Modes:
    """Natural frequencies in Hz, rising, and the kind of each mode: rotational, translational or planet."""

    frequency_hz: Real
    kind: tuple[str, ...]
    shape: Real


def natural_modes(
    parts: Mapping[str, Part], planet_angle: Real, pressure_angle: float, sun_mesh: float, ring_mesh: float
) -> Modes:
    """Undamped modes of the linear model with 3 (planets + 3) degrees of freedom, at rest.

    J. Lin and R. G. Parker, Analytical characterization of the unique properties of planetary gear free vibration,
    J. Vib. Acoust. 121 (1999) 316, equations 1 to 11: every part has two displacements and a rotation (as arc length
    on its base circle), every mesh and pin is a spring.

    Parameters
    ----------
    parts : mapping
        ``carrier``, ``ring``, ``sun``, ``planet``.
    planet_angle : array
        rad.
    pressure_angle : float
        rad, of both meshes.
    sun_mesh, ring_mesh : float
        Mesh stiffnesses, N/m.
    """
    n = planet_angle.size
    size = 9 + 3 * n
    masses = [m for name in ("carrier", "ring", "sun") for m in _masses(parts[name])]
    masses += _masses(parts["planet"]) * n
    stiffness = np.zeros((size, size))
    for k, name in enumerate(("carrier", "ring", "sun")):
        part = parts[name]
        stiffness[[3 * k, 3 * k + 1], [3 * k, 3 * k + 1]] += part.bearing
        stiffness[3 * k + 2, 3 * k + 2] += part.torsion
    cos, sin = np.cos(pressure_angle), np.sin(pressure_angle)
    for i, place in enumerate(planet_angle):
        own = 9 + 3 * i
        before, after = place - pressure_angle, place + pressure_angle
        springs = [
            (
                sun_mesh,
                {6: -np.sin(before), 7: np.cos(before), 8: 1.0, own: -sin, own + 1: -cos, own + 2: 1.0},
            ),
            (
                ring_mesh,
                {3: -np.sin(after), 4: np.cos(after), 5: 1.0, own: sin, own + 1: -cos, own + 2: -1.0},
            ),
            (parts["planet"].bearing, {0: np.cos(place), 1: np.sin(place), own: -1.0}),
            (parts["planet"].bearing, {0: -np.sin(place), 1: np.cos(place), 2: 1.0, own + 1: -1.0}),
        ]
        for spring, stretch in springs:
            row = np.zeros(size)
            row[list(stretch)] = list(stretch.values())
            stiffness += spring * np.outer(row, row)
    root = np.sqrt(np.array(masses))
    squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
    shape = vectors / root[:, None]
    return Modes(
        np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), tuple(_kind(shape[:, k]) for k in range(size)), shape
    )


def _masses(part: Part) -> list[float]:
    return [part.mass, part.mass, part.inertia]


def _kind(shape: Real) -> str:
    """By what the central parts do: turn alone, shift alone, or stand still."""
    central = np.abs(shape[:9])
    top = np.abs(shape).max()
    turns, shifts = central[2::3].max(), max(central[0::3].max(), central[1::3].max())
    if max(turns, shifts) < _SMALL * top:
        return "planet"
    if shifts < _SMALL * turns:
        return "rotational"
    return "translational" if turns < _SMALL * shifts else "mixed"


PARTS = {
    "sun": Part(0.4, 0.39, 1e8),
    "ring": Part(2.35, 3.00, 1e8, 1e9),
    "carrier": Part(5.43, 6.29, 1e8),
    "planet": Part(0.66, 0.61, 1e8),
}
MESH, PRESSURE = 5e8, np.radians(24.6)
ROTATIONAL = {
    3: [0.0, 1475.7, 1930.3, 2658.3, 7462.8, 11775.3],
    4: [0.0, 1536.6, 1970.6, 2625.7, 7773.6, 13071.1],
    5: [0.0, 1567.4, 2006.1, 2614.8, 8065.4, 14253.1],
}
TRANSLATIONAL = {
    3: [743.2, 1102.4, 1896.0, 2276.4, 6986.3, 9647.9],
    4: [727.0, 1091.0, 1892.8, 2342.5, 7189.9, 10437.6],
    5: [710.0, 1072.0, 1888.1, 2425.3, 7382.4, 11172.3],
}
PLANET = [1808.2, 5963.8, 6981.7]


@pytest.mark.parametrize("planets", [3, 4, 5])
def test_frequencies_and_kinds(planets):
    found = natural_modes(PARTS, 2 * np.pi * np.arange(planets) / planets, PRESSURE, MESH, MESH)
    kinds = np.array(found.kind)
    for kind, published, times in (
        ("rotational", ROTATIONAL[planets], 1),
        ("translational", TRANSLATIONAL[planets], 2),
        ("planet", PLANET, planets - 3),
    ):
        own = np.sort(found.frequency_hz[kinds == kind])
        wanted = np.sort(np.repeat(published, times))
        assert own.size == wanted.size, kind
        assert np.all(np.abs(own - wanted) <= 0.005 * wanted + 0.5), kind


def test_planet_modes_are_the_roots_of_a_cubic():
    """Central parts stand still, planets move as their amplitudes add up to nothing: three degrees of freedom.

    Lin and Parker (1999), equation 25: a planet on its pin and its two meshes, the coupling to the others cancelled.
    """
    pin, sin, cos = PARTS["planet"].bearing, np.sin(PRESSURE), np.cos(PRESSURE)
    sun, ring = np.array([-sin, -cos, 1.0]), np.array([sin, -cos, -1.0])
    own = np.diag([pin, pin, 0.0]) + MESH * (np.outer(sun, sun) + np.outer(ring, ring))
    mass = np.array([PARTS["planet"].mass, PARTS["planet"].mass, PARTS["planet"].inertia])
    expected = np.sqrt(np.sort(np.linalg.eigvals(own / mass[:, None]).real)) / (2 * np.pi)
    found = natural_modes(PARTS, 2 * np.pi * np.arange(5) / 5, PRESSURE, MESH, MESH)
    planet = found.frequency_hz[np.array(found.kind) == "planet"]
    assert planet[::2] == pytest.approx(expected, rel=1e-9)
    assert planet[1::2] == pytest.approx(expected, rel=1e-9)


def test_parts_that_turn_only_are_those_that_are_held_stiffly():
    """Two ways to the same modes: everything but carrier and planets held by springs a million times as stiff."""
    model = example_model("planetary-gear")
    at = {"order": np.ones(1), "sun_speed": np.full(1, 30.0), "carrier_torque": np.full(1, 60.0)}
    wanted = ["mesh_spring", "carrier_inertia", "planet_inertia", "base_radii", "centre_distance"]
    got = model.assemble([]).evaluate(at, None, wanted)
    sun, ring = got["mesh_spring"][0].mean(axis=(-2, -1))
    held = 1e6 * ring
    parts = {
        "sun": Part(1.0, 1.0, held, held),
        "ring": Part(1.0, 1.0, held, held),
        "carrier": Part(1.0, got["carrier_inertia"] / got["centre_distance"] ** 2, held),
        "planet": Part(1e-6, got["planet_inertia"] / got["base_radii"][1] ** 2, held),
    }
    found = natural_modes(parts, 2 * np.pi * np.arange(3) / 3, np.radians(20.0), sun, ring)
    assert torsional_frequencies(model) == pytest.approx(found.frequency_hz[:4], rel=1e-3)
