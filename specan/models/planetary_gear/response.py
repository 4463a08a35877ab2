"""What the set answers: dynamic forces of the meshes, and acceleration of the ring where the sensors are."""

import numpy as np

from specan.models.planetary_gear.simulated_recording import RIM_STIFFNESS
from specan.models.quantity import quantity

_NEGLIGIBLE = 1e-10  # of the strongest line of the transmission error


@quantity(
    unit="N",
    axes=("planet",),
    reference="linear equations of motion of carrier and planets, harmonic by harmonic",
)
def mesh_force(transmission_error, mesh_stiffness, mesh_damping, planet_load, operating_points, base_radii,
               inertias, carrier_ratio, carrier_turn, shaft_receptance):  # fmt: skip
    """Forces of the ring's and the sun's meshes, (points, 2, planets, angle).

    The meshes are springs and dampers between the sun, which turns steadily, the planets, the carrier and the ring.
    """
    points, _, planets, samples = transmission_error.shape
    turns = samples * carrier_turn[1]
    spectra = np.fft.rfft(transmission_error, axis=-1)
    size = np.abs(spectra).max(axis=(1, 2))
    found = np.zeros_like(spectra)
    toward = _compliance(base_radii, inertias, planets)
    torsion = np.zeros((2 * planets, 2 * planets))
    torsion[:planets, :planets] = base_radii[0] ** 2
    for c in range(points):
        bins = np.flatnonzero(size[c] > _NEGLIGIBLE * size[c].max())
        bins = bins[bins > 0]
        omega = 2 * np.pi * bins / turns * operating_points[c, 0] * carrier_ratio
        spring = mesh_stiffness[c].ravel()[None, :] + 1j * omega[:, None] * mesh_damping[c].ravel()[None, :]
        matrix = -toward[None] / (omega**2)[:, None, None] + shaft_receptance(omega)[:, None, None] * torsion
        rows = np.arange(2 * planets)
        matrix[:, rows, rows] += 1.0 / spring
        wanted = -spectra[c].reshape(2 * planets, -1)[:, bins].T[..., None]
        found[c].reshape(2 * planets, -1)[:, bins] = np.linalg.solve(matrix, wanted)[..., 0].T
    return planet_load[:, None, :, None] + np.fft.irfft(found, samples, axis=-1)


def _compliance(base_radii, inertias, planets):
    """B M^-1 B^T: what a force at a mesh accelerates at another."""
    sun, planet, ring = base_radii
    b = np.zeros((2 * planets, 1 + planets))
    b[:planets, 0], b[planets:, 0] = -(sun + planet), planet - ring
    for i in range(planets):
        b[i, 1 + i], b[planets + i, 1 + i] = planet, -planet
    mass = np.array([inertias[0], *([inertias[1]] * planets)])
    return b / mass @ b.T + 0j


@quantity(unit="m", axes=("sensor",))
def rim_displacement(mesh_force, transfer_path, friction_share):
    """How far the ring's rim gives way at the sensors, (points, sensors, angle)."""
    angles = mesh_force.shape[-1]
    pressed = mesh_force[:, 1] * (1.0 + friction_share[:, :angles])
    return np.einsum("cis,kis->cks", pressed, transfer_path[..., :angles]) / RIM_STIFFNESS


@quantity(unit="m/s^2", axes=("sensor",))
def order_lines(rim_displacement, order, sun_speed, point_of_line, carrier_turn, carrier_ratio, housing_response,
                harmonic_gain, harmonic_of_line, line_coherence, tacho_angle):  # fmt: skip
    """Complex peak amplitude of the acceleration at each line, (sensors, lines)."""
    samples = rim_displacement.shape[-1]
    spectra = np.fft.rfft(rim_displacement, axis=-1) * (2.0 / samples)
    place = np.asarray(order) * np.rint(samples * carrier_turn[1])
    nearest = np.rint(place).astype(int)
    inside = (np.abs(place - nearest) < 0.01) & (nearest < spectra.shape[-1])
    lines = spectra[point_of_line, :, np.where(inside, nearest, 0)].T * inside
    omega = 2 * np.pi * np.asarray(order) * sun_speed * carrier_ratio
    turned = np.exp(1j * np.asarray(order) * tacho_angle)
    return -(omega**2) * lines * housing_response * harmonic_gain[harmonic_of_line] * line_coherence * turned


@quantity(unit="1")
def harmonic_of_line(order, ring_teeth, harmonic_count):
    """Number (from zero) of the mesh harmonic that each line belongs to."""
    return np.clip(np.rint(np.asarray(order) / ring_teeth), 1, harmonic_count).astype(int) - 1


@quantity(unit="1")
def housing_response(order):
    """Gain between rim and sensor, one a line."""
    return np.ones(np.shape(order), dtype=complex)


@quantity(unit="1")
def line_coherence(order):
    """What remains of a line that the order analysis smears, one a line."""
    return np.ones(np.shape(order))


@quantity(unit="1", axes=("harmonic",))
def harmonic_gain(harmonic_count):
    """Gain of everything between mesh and sensor that is not known, one a mesh harmonic."""
    return np.ones(harmonic_count, dtype=complex)


QUANTITIES = (
    mesh_force, rim_displacement, order_lines, harmonic_of_line, housing_response, line_coherence,
    harmonic_gain,
)  # fmt: skip
