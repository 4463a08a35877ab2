"""Natural frequencies and kinds of modes published by Lin and Parker (1999), tables 1 and 2."""

import numpy as np
import pytest

from specan.models.planetary_gear.modes import Part, natural_modes

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
