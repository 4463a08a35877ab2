"""The room model against a converged finite-element solution of the same box.

High-order elements on Gauss-Lobatto-like polynomials, assembled as Kronecker products of one-dimensional
matrices; the piston is integrated over its disc by quadrature. Nothing of it uses modes.
"""

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.linalg import eig, lu_factor, lu_solve

from specan.models.catalogue import load_model
from specan.room.model.axis_modes import axis_modes

pytestmark = pytest.mark.long

LENGTHS = np.array([0.9, 0.6, 0.7])
BETA = 0.012
ORDERS = (
    12,
    11,
    11,
)  # polynomials along each axis: at 450 Hz some 9 points a wavelength, of spectral accuracy
RADIUS, CENTRE = 0.05, np.array([0.0, 0.246, 0.3229])


class Axis:
    """Legendre polynomials on [0, L]: mass, stiffness, values."""

    def __init__(self, length, order):
        self.length, self.order = length, order
        x, w = legendre.leggauss(order + 4)
        values = self.at(length * (x + 1) / 2)
        slopes = (
            np.stack([legendre.legval(x, legendre.legder(row)) for row in np.eye(order + 1)]) * 2 / length
        )
        weight = w * length / 2
        self.mass = values * weight @ values.T
        self.stiffness = slopes * weight @ slopes.T
        ends = self.at(np.array([0.0, length]))
        self.wall = [np.outer(ends[:, i], ends[:, i]) for i in (0, 1)]

    def at(self, x):
        return np.stack(
            [legendre.legval(2 * np.asarray(x) / self.length - 1, row) for row in np.eye(self.order + 1)]
        )


AXES = [Axis(length, order) for length, order in zip(LENGTHS, ORDERS, strict=True)]


def kron(a, b, c):
    return np.kron(a, np.kron(b, c))


def matrices():
    x, y, z = AXES
    mass = kron(x.mass, y.mass, z.mass)
    stiffness = kron(x.stiffness, y.mass, z.mass) + kron(x.mass, y.stiffness, z.mass)
    stiffness = stiffness + kron(x.mass, y.mass, z.stiffness)
    walls = (
        kron(sum(x.wall), y.mass, z.mass)
        + kron(x.mass, sum(y.wall), z.mass)
        + kron(x.mass, y.mass, sum(z.wall))
    )
    return stiffness, mass, walls


def values_at(points):
    """Shape functions at points: (functions, points)."""
    x, y, z = (axis.at(points[:, i]) for i, axis in enumerate(AXES))
    return np.einsum("ap,bp,cp->abcp", x, y, z).reshape(-1, len(points))


def disc():
    """Points and weights of a quadrature over the piston."""
    r, wr = legendre.leggauss(12)
    r, wr = RADIUS * (r + 1) / 2, wr * RADIUS / 2
    angle = 2 * np.pi * np.arange(24) / 24
    y = CENTRE[1] + np.outer(r, np.cos(angle))
    z = CENTRE[2] + np.outer(r, np.sin(angle))
    weight = np.outer(r * wr, np.full(24, 2 * np.pi / 24))
    return np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1), weight.ravel()


@pytest.fixture(scope="module")
def system():
    return matrices()


def test_transfer_functions(system):
    stiffness, mass, walls = system
    places = np.random.default_rng(8).uniform(0.08, 0.92, (5, 3)) * LENGTHS
    rig = {
        "room": {"dims_m": LENGTHS.tolist()},
        "piston": {"wall": "x0", "centre_m": CENTRE.tolist(), "radius_m": RADIUS},
        "band": {"f_max_hz": 500.0},
        "mics": {"position_m": places.tolist()},
    }
    model = load_model("room", rig)
    # ten lines in each of two third octaves, chosen once
    frequency = np.concatenate([np.linspace(224.0, 281.0, 10), np.linspace(400.0, 446.0, 10)])
    got = model.assemble().evaluate({"frequency": frequency}, {"wall_admittance.common": BETA})
    c, rho = float(got["sound_speed"]), float(got["density"])
    points, weight = disc()
    on_piston = values_at(points)
    piston_wall = (on_piston * weight) @ on_piston.T
    force, seen = on_piston @ weight, values_at(places)
    expected = np.empty((len(places), len(frequency)), dtype=complex)
    for i, f in enumerate(frequency):
        k = 2 * np.pi * f / (c * (1 + got["air_dispersion"][i]))
        k_air = k - 1j * got["air_attenuation"][i]
        matrix = stiffness - k_air**2 * mass + 1j * k * BETA * (walls - piston_wall)
        expected[:, i] = seen.T @ lu_solve(lu_factor(matrix), 1j * 2 * np.pi * f * rho * force)
    for part in (slice(0, 10), slice(10, 20)):
        rms = np.sqrt(np.mean(np.abs(expected[:, part]) ** 2))
        assert np.max(np.abs(got["field"][:, part] - expected[:, part])) < 3e-3 * rms


def test_natural_frequencies(system):
    stiffness, mass, walls = system
    size = len(mass)
    # (K + j k beta W - k^2 M) p = 0 as a linear problem in k, on a coarser space where it is small
    nx, ny, nz = (order + 1 for order in ORDERS)
    keep = np.arange(nx * ny * nz).reshape(nx, ny, nz)[:8, :6, :6].ravel()
    stiffness, mass, walls = (m[np.ix_(keep, keep)] for m in (stiffness, mass, walls))
    assert size > len(keep)
    zero, one = np.zeros_like(mass), np.eye(len(keep))
    left = np.block([[zero, one], [stiffness, 1j * BETA * walls]])
    right = np.block([[one, zero], [zero, mass]])
    k = eig(left, right, right=False)
    expected = np.sort_complex(k[(k.real > 1.0) & (k.real < 7.0)])[:5]
    for value in expected:
        assert abs(_nearest_mode(value) / value - 1) < 5e-5


def _nearest_mode(start):
    """Solve sum_i w_i(k) / L_i^2 = k^2 for the mode next to `start`."""

    def soft(k):
        return [
            axis_modes(L, np.array([1j * k * BETA * L]), np.array([1j * k * BETA * L]), 6) for L in LENGTHS
        ]

    squares = [axis.q2[0] for axis in soft(start)]
    total = squares[0][:, None, None] + squares[1][:, None] + squares[2]
    index = np.unravel_index(np.argmin(np.abs(total - start**2)), total.shape)
    k = start
    for _ in range(8):
        k = np.sqrt(sum(axis.q2[0][i] for axis, i in zip(soft(k), index, strict=True)))
    return k
