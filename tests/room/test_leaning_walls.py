"""Walls that lean, against one spectral element that is mapped onto the leaning room."""

from functools import lru_cache

import numpy as np
import pytest
from numpy.polynomial import legendre

from specan.room.model.box_field import box, with_leans
from specan.room.model.leaning_walls import LEANS
from specan.room.model.port import Port

EDGES = (0.9, 0.6, 0.7)  # along the wall's normal, across it, and along which its distance changes
DEGREES = (11, 8, 8)
BETA = 0.02
SLOPE = np.tan(np.radians(1.5))
CENTRE, RADIUS = (0.0, 0.246, 0.3229), 0.05  # in the opposite wall
PLACES = np.array([[0.2, 0.1, 0.14], [0.6, 0.41, 0.33], [0.8, 0.12, 0.6]])
K = np.linspace(0.8, 5.5, 12)


def polynomials(degree, at, slopes=False):
    """Orthonormal over 0 to 1, array (points, degree + 1), or their slopes."""
    series = np.diag(np.sqrt(2 * np.arange(degree + 1) + 1))
    if slopes:
        return np.stack([2 * legendre.legval(2 * at - 1, legendre.legder(row)) for row in series], axis=1)
    return np.stack([legendre.legval(2 * at - 1, row) for row in series], axis=1)


def at_points(points):
    wide = EDGES[0] + SLOPE * (points[:, 2] - EDGES[2] / 2)
    parts = points[:, 0] / wide, points[:, 1] / EDGES[1], points[:, 2] / EDGES[2]
    along = [polynomials(d, part) for d, part in zip(DEGREES, parts, strict=True)]
    return np.einsum("pa,pb,pc->pabc", *along).reshape(len(points), -1)


@lru_cache(maxsize=1)
def element():
    """Stiffness, mass and skin of the room, and what a resting disc drives: x = xi X(z) maps a brick onto the room."""
    s, w = legendre.leggauss(30)
    s, w = (s + 1) / 2, w / 2
    shape = [polynomials(d, s) for d in DEGREES]
    slope = [
        polynomials(d, s, slopes=True) / length for d, length in zip(DEGREES, (1.0, *EDGES[1:]), strict=True)
    ]
    wide = EDGES[0] + SLOPE * EDGES[2] * (s - 0.5)

    def over(left, right, by=1.0):
        return left.T @ ((w * by)[:, None] * right)

    def product(x, y, z):
        return np.kron(x, np.kron(y, z)) * EDGES[1] * EDGES[2]

    (vx, vy, vz), (dx, dy, dz) = shape, slope
    one, plain = over(vy, vy), over(vz, vz, wide)
    turned = product(over(dx, vx, s), one, over(vz, dz))
    stiffness = product(over(dx, dx, 1 + SLOPE**2 * s**2), one, over(vz, vz, 1 / wide))
    stiffness += product(over(vx, vx), over(dy, dy), plain) + product(over(vx, vx), one, over(dz, dz, wide))
    stiffness -= SLOPE * (turned + turned.T)
    mass = product(over(vx, vx), one, plain)
    ends = [[np.outer(e, e) for e in polynomials(d, np.array([0.0, 1.0]))] for d in DEGREES]
    skin = product(ends[0][0], one, over(vz, vz)) + np.hypot(1, SLOPE) * product(
        ends[0][1], one, over(vz, vz)
    )
    skin += product(over(vx, vx), sum(ends[1]), plain) / EDGES[1]
    low, high = EDGES[0] - SLOPE * EDGES[2] / 2, EDGES[0] + SLOPE * EDGES[2] / 2
    skin += product(over(vx, vx), one, low * ends[2][0] + high * ends[2][1]) / EDGES[2]
    r, weight = legendre.leggauss(6)
    r, weight = (r + 1) / 2 * RADIUS, weight / 2 * RADIUS
    turn = 2 * np.pi * np.arange(16) / 16
    disc = np.array([[0.0, CENTRE[1] + a * np.cos(t), CENTRE[2] + a * np.sin(t)] for a in r for t in turn])
    mean = np.repeat(weight * r, 16) / 16 * 2 / RADIUS**2
    driven = mean @ at_points(disc)
    return stiffness, mass, skin, driven


@lru_cache(maxsize=1)
def of_the_element():
    """Mean of Green's function over the disc, array (K, places)."""
    stiffness, mass, skin, driven = element()
    solved = [np.linalg.solve(stiffness + 1j * k * BETA * skin - k**2 * mass, driven) for k in K]
    return np.array(solved) @ at_points(PLACES).T


def of_the_box(name, slope):
    """The same from modes of the box, with its edges in the order that the leaning wall asks for."""
    normal, along = "xyz".index(name[0]), "xyz".index(name[-1])
    order = [normal, 3 - normal - along, along]

    def placed(point):
        own = np.array(point, dtype=float)
        own[0] = own[0] if name[1] == "1" else EDGES[0] - own[0]
        there = np.empty(3)
        there[order] = own
        return tuple(there.tolist())

    lengths = np.empty(3)
    lengths[order] = EDGES
    counts = tuple(int(2.5 * K.max() * length) + 6 for length in lengths)
    soft = np.tile(1j * K * BETA, (6, 1))
    room = box(
        K, tuple(lengths.tolist()), (K**2).astype(complex), soft, tuple(lengths.tolist()), K.max(), counts
    )
    room = with_leans(room, np.where(np.array(LEANS) == name, slope, 0.0))
    return room.coupling(Port(placed(CENTRE), normal, RADIUS), [Port(placed(p), normal) for p in PLACES])


@pytest.mark.parametrize("name", LEANS)
def test_the_field_beside_a_leaning_wall_is_that_of_an_element_of_its_shape(name):
    truth = of_the_element()
    size = np.sqrt(np.mean(np.abs(truth) ** 2))
    off = [np.sqrt(np.mean(np.abs(of_the_box(name, slope) - truth) ** 2)) / size for slope in (0.0, SLOPE)]
    assert off[0] > 0.01
    assert off[1] < 0.04 * off[0]
