"""What the set answers: dynamic forces of the meshes, and acceleration of the ring where the sensors are."""

import numpy as np

from specan.models.quantity import quantity
from specan.planetary_gear.model.parting import parting, without_pull
from specan.planetary_gear.model.simulated_recording import RIM_STIFFNESS

_NEGLIGIBLE = 1e-10  # of the strongest line of the transmission error


@quantity(
    unit="N",
    axes=("planet",),
    reference="linear equations of motion with periodic coefficients: Hill's method (Nayfeh and Mook, Nonlinear "
    "Oscillations, 1979, section 5.2)",
)
def mesh_force(transmission_error, mesh_spring, mesh_damping, planet_load, planet_phase, torque_ripple,
               sun_error, ring_error, operating_points, base_radii, carrier_inertia, planet_inertia,
               carrier_ratio, carrier_turn, ring_teeth, shaft_receptance):  # fmt: skip
    """Forces of the ring's and the sun's meshes, (points, 2, planets, angle).

    The meshes are springs, whose stiffness changes over the pitch, and dampers between the sun, which turns steadily,
    the planets, the carrier and the ring. What excites at one order so moves at that order and at all that lie whole
    meshes beside it; they are solved together. The mean forces are those of `planet_load`.
    """
    points, _, planets, samples = transmission_error.shape
    turns = int(np.rint(samples * carrier_turn[1]))
    period = ring_teeth * turns  # bins from one harmonic of the mesh to the next
    reach = samples // 2 // period
    side = np.arange(-reach, reach + 1)
    spectra = np.fft.rfft(transmission_error, axis=-1).reshape(points, 2 * planets, -1)
    ripple = np.zeros(samples // 2 + 1, complex)
    if np.any(torque_ripple):
        ripple = np.fft.rfft(torque_ripple[:samples])
    # Springs answer to what the approach is beyond the steady deflection, dampers to the whole of it.
    errors = np.concatenate([sun_error, ring_error])[:, :samples]
    uneven, steady = np.any(errors, axis=-1), spectra.copy()
    steady[:, uneven] += np.fft.rfft(errors[uneven], axis=-1)
    moment, mass = _freedom(base_radii, carrier_inertia, planet_inertia, planets)

    def moved(omega):
        """Turn of each part by a torque on it, (..., parts); the sun on its shaft is the last."""
        parts = 1.0 / (mass * omega[..., None] ** 2)
        return np.concatenate([parts, -shaft_receptance(omega)[..., None]], axis=-1)

    found = np.zeros_like(spectra)
    for c in range(points):
        rest = _excited(spectra[c], ripple, period)
        bins = rest[:, None] + period * side
        still = bins == 0
        omega = 2 * np.pi * bins / turns * operating_points[c, 0] * carrier_ratio
        turning = np.where(still, 1.0, omega)
        moves = np.where(still[..., None], 0.0, moved(turning))
        drag = 1j * omega[..., None] * mesh_damping[c].ravel()
        dragged = drag * _at(steady[c], bins)
        torques = dragged @ moment
        torques[..., 0] += operating_points[c, 1] * _at(ripple[None], bins)[..., 0]
        pushed = np.where(still[..., None], 0.0, (moves * torques) @ moment.T - _at(spectra[c], bins))
        spring = beside(mesh_spring[c], planet_phase, side)
        beyond = dragged
        if rest[0] == 0:
            beyond[0] += _at_rest(spring, drag[0], moves[0], pushed[0], still[0], moment)
        off = slice(int(rest[0] == 0), None)  # bins beside the mesh
        if rest[off].size:
            beyond[off] += _coupled(spring, drag[off], moves[off], pushed[off], moment)
        if rest[0] == 0:

            def dynamics(further, c=c):
                turning = 2 * np.pi * ring_teeth * operating_points[c, 0] * carrier_ratio * further
                moves = moved(np.where(further == 0, 1.0, turning))
                return (
                    beside(mesh_spring[c], planet_phase, further),
                    1j * turning[:, None] * mesh_damping[c].ravel(),
                    (moment * moves[:, None]) @ moment.T,
                )

            beyond[0] += samples * parting(
                np.tile(planet_load[c], 2), beyond[0] / samples, moment[:, :-1], dynamics
            )
        inside = np.abs(bins) < spectra.shape[-1]
        place, values = bins[inside], beyond[inside]
        found[c][:, np.abs(place)] = np.where(place[:, None] < 0, values.conj(), values).T
    forces = np.fft.irfft(found.reshape(points, 2, planets, -1), samples, axis=-1)
    return without_pull(planet_load[:, None, :, None] + forces)


def _freedom(base_radii, carrier_inertia, planet_inertia, planets):
    """What turns of carrier, planets and sun make of each approach (meshes, parts); inertias of all but the sun."""
    sun, planet, ring = base_radii
    moment = np.zeros((2 * planets, 2 + planets))
    moment[:planets, 0], moment[planets:, 0] = -(sun + planet), planet - ring
    moment[:planets, -1] = sun
    for i in range(planets):
        moment[i, 1 + i], moment[planets + i, 1 + i] = planet, -planet
    return moment, np.array([carrier_inertia, *([planet_inertia] * planets)])


def _at_rest(spring, drag, moves, pushed, still, moment):
    """`_coupled` of the harmonics of the mesh and order zero, where the springs' mean forces stay as they are."""
    orders, meshes = pushed.shape
    size = orders * meshes
    force = spring.copy()
    row, mesh = np.arange(orders)[:, None], np.arange(meshes)
    force[row, mesh, row, mesh] += drag
    force = force.reshape(orders, meshes, size)
    matrix = np.eye(size).reshape(orders, meshes, size) - (moment * moves[:, None]) @ moment.T @ force
    matrix[still] = force[still] / np.abs(spring).max()
    approach = np.linalg.solve(matrix.reshape(size, size), pushed.reshape(size))
    return (force.reshape(size, size) @ approach).reshape(pushed.shape)


def _coupled(spring, drag, moves, pushed, moment):
    """Forces of springs and dampers: approach - moment moves moment^T (springs + dampers) approach = pushed.

    Solved for the torques on the parts, moment^T (springs + dampers) approach: parts are fewer than meshes.
    Forces and what pushes are (sets, orders, meshes).
    """
    sets, orders, meshes = pushed.shape
    parts = moment.shape[1]
    if not moves[..., -1].any():  # the sun turns steadily
        parts -= 1
        moment, moves = moment[:, :parts], moves[..., :parts]
    whole = spring.reshape(orders * meshes, orders * meshes)
    within = moment.T @ (spring @ moment).reshape(orders, meshes, orders * parts)
    matrix = np.tile(-within.reshape(orders, parts, orders, parts), (sets, 1, 1, 1, 1))
    row = np.arange(orders)
    matrix[:, row, :, row, :] -= np.swapaxes(moment.T @ (drag[..., None] * moment), 0, 1)
    matrix *= moves[:, None, None]
    size = orders * parts
    matrix = matrix.reshape(sets, size, size)
    matrix[:, np.arange(size), np.arange(size)] += 1.0

    def pressed(approach):
        return (approach.reshape(sets, -1) @ whole.T).reshape(approach.shape) + drag * approach

    torques = np.linalg.solve(matrix, (pressed(pushed) @ moment).reshape(sets, size, 1))
    return pressed(pushed + (moves * torques.reshape(sets, orders, parts)) @ moment.T)


def _excited(spectra, ripple, period):
    """Bins between zero and half a mesh to which what excites belongs, whole meshes aside."""
    size = np.abs(spectra).max(axis=0)
    bins = np.flatnonzero(size > _NEGLIGIBLE * size.max())
    if np.any(ripple):
        bins = np.append(bins, np.flatnonzero(np.abs(ripple) > _NEGLIGIBLE * np.abs(ripple).max()))
    rest = bins % period
    return np.unique(np.minimum(rest, period - rest))


def _at(spectra, bins):
    """Spectra of real signals, (signals, bins), at bins that may be negative; the signals' axis becomes the last."""
    inside = np.abs(bins) < spectra.shape[-1]
    values = np.moveaxis(spectra[:, np.where(inside, np.abs(bins), 0)], 0, -1)
    return np.where(bins[..., None] < 0, values.conj(), values) * inside[..., None]


def beside(spring, phase, side):
    """Stiffness as what each order beside a bin makes of each other, (orders, meshes, orders, meshes)."""
    apart = side[:, None] - side[None, :]
    phases = spring.shape[-1]
    number = np.arange(-2 * side.max(), 2 * side.max() + 1)
    table = np.fft.fft(spring, axis=-1)[..., number % phases] / phases
    table = (table * np.exp(2j * np.pi * number * phase[..., None])).reshape(-1, number.size)
    found = np.zeros((side.size, table.shape[0], side.size, table.shape[0]), complex)
    meshes = np.arange(table.shape[0])
    found[:, meshes, :, meshes] = table[:, apart + 2 * side.max()]
    return found


@quantity(unit="m", axes=("sensor",))
def rim_displacement(mesh_force, transfer_path, friction_share):
    """How far the ring's rim gives way at the sensors, (points, sensors, angle)."""
    angles = mesh_force.shape[-1]
    pressed = mesh_force[:, 1] * (1.0 + friction_share[:, :angles])
    return np.einsum("cis,kis->cks", pressed, transfer_path[..., :angles]) / RIM_STIFFNESS


@quantity(unit="m/s^2", axes=("sensor",))
def order_lines(rim_displacement, order, sun_speed, point_of_line, carrier_turn, carrier_ratio, housing_response,
                harmonic_gain, harmonic_of_line, line_coherence, tacho_angle, unlike_response, ideal_line):  # fmt: skip
    """Complex peak amplitude of the acceleration at each line, (sensors, lines)."""
    samples = rim_displacement.shape[-1]
    spectra = np.fft.rfft(rim_displacement, axis=-1) * (2.0 / samples)
    place = np.asarray(order) * np.rint(samples * carrier_turn[1])
    nearest = np.rint(place).astype(int)
    inside = (np.abs(place - nearest) < 0.01) & (nearest < spectra.shape[-1])
    lines = spectra[point_of_line, :, np.where(inside, nearest, 0)].T * inside
    omega = 2 * np.pi * np.asarray(order) * sun_speed * carrier_ratio
    turned = np.exp(1j * np.asarray(order) * tacho_angle)
    gain = housing_response * harmonic_gain[harmonic_of_line] * line_coherence * turned
    return -(omega**2) * lines * gain * np.where(ideal_line, 1.0, unlike_response[harmonic_of_line])


@quantity(unit="1")
def harmonic_of_line(order, ring_teeth, harmonic_count):
    """Number (from zero) of the mesh harmonic that each line belongs to."""
    return np.clip(np.rint(np.asarray(order) / ring_teeth), 1, harmonic_count).astype(int) - 1


@quantity(unit="1", reference="Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677")
def ideal_line(order, planet_angle):
    """Whether planets that are alike add up to a line at an order: it is whole, and exp(j n psi) does not cancel."""
    order = np.asarray(order)
    together = np.abs(np.exp(1j * np.outer(np.rint(order), planet_angle)).mean(axis=1))
    return (np.abs(order - np.rint(order)) < 1e-6) & (together.reshape(order.shape) > 1e-9)


@quantity(unit="1", axes=("harmonic",))
def unlike_response(harmonic_count):
    """How much more than computed the set answers to what its planets do not do alike, one a mesh harmonic."""
    return np.ones(harmonic_count)


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
    harmonic_gain, ideal_line, unlike_response,
)  # fmt: skip
