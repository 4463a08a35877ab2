"""What the set answers: dynamic forces of the meshes, and acceleration of the ring where the sensors are."""

import numpy as np
from numpy.typing import NDArray

from specan.models.model import Model
from specan.models.quantity import quantity
from specan.planetary_gear.model.simulated_recording import RIM_STIFFNESS

HARMONICS = 12  # of the mesh that are followed: 25 places within a pitch
ROUNDS = 20  # of the active set; three to eight are usual


def parting(load, beyond, moment, dynamics):
    """What is added to the forces at whole meshes where teeth would pull, Fourier coefficients (orders, meshes).

    With u the force of a mesh's spring and damper its force is max(u, 0). Forces n that undo the pull act on the set as
    any others do: f = f0 + G n with f >= 0, n >= 0, f n = 0, a linear complementarity problem at places within a pitch,
    solved by its active set (Cottle, Pang and Stone, The Linear Complementarity Problem, 1992, chapter 4). Where it
    does not settle, teeth bounce with another period than a pitch: nothing is added then, rather than what rounding
    decides.

    Parameters
    ----------
    load : array (meshes,)
        Mean forces.
    beyond : complex array (2 r + 1, meshes)
        What springs and dampers add to them, Fourier coefficients at the orders -r to r of the mesh.
    moment : array (meshes, bodies)
        What the turn of each body adds to the approach of each mesh; a force takes as much off its torque. The last one
        is held at order zero.
    dynamics : callable
        ``dynamics(orders) -> spring, drag, moves``: stiffness as what each order makes of each other (orders, meshes,
        orders x meshes); force of the dampers over the approach (orders, meshes); turn of each body by a torque on it
        (orders, bodies), which is not read at order zero.
    """
    middle, reach, meshes = HARMONICS, beyond.shape[0] // 2, load.size
    side = np.arange(-middle, middle + 1)
    orders = side.size
    wave = np.exp(2j * np.pi * np.outer(np.arange(orders), side) / orders)
    near = slice(middle - reach, middle + reach + 1)
    force = load[:, None] + (wave[:, near] @ beyond).T.real  # meshes, places
    if force.min() >= 0:
        return np.zeros_like(beyond)
    answer = _receptance(moment, *dynamics(side)).reshape(orders, meshes, orders, meshes)
    inside = np.tensordot(wave, answer, axes=(1, 0))
    both = np.tensordot(inside, wave.conj(), axes=(2, 1)).real.swapaxes(0, 1) / orders
    size = orders * meshes
    both, force = both.reshape(size, size) + np.eye(size), force.ravel()
    pulled = force < 0
    for _ in range(ROUNDS):
        push = np.zeros(size)
        push[pulled] = np.linalg.solve(both[np.ix_(pulled, pulled)], -force[pulled])
        before, pulled = pulled, force + both @ push - push < 0
        if np.array_equal(before, pulled) or not pulled.any():
            break
    else:
        return np.zeros_like(beyond)
    added = ((both @ push).reshape(meshes, orders) @ wave.conj() / orders).T
    return added[near]


def with_dampers(spring, drag):
    """Forces of springs and dampers by the approach at each order, (..., orders, meshes, orders x meshes)."""
    orders, meshes = drag.shape[-2:]
    diagonal = np.eye(orders * meshes).reshape(orders, meshes, -1)
    return spring + drag[..., None] * diagonal


def _receptance(moment, spring, drag, moves):
    """Forces of springs and dampers by forces at the meshes, all as Fourier coefficients, (size, size).

    Approach a = moves (springs a + dampers a + n). At order zero, parts stand where all torques are in balance: the
    approaches are those of their turns, and moment^T (springs a + n) = 0.
    """
    orders, meshes = drag.shape
    size, middle = orders * meshes, orders // 2
    force = with_dampers(spring, drag)
    moves = (moment * moves[:, None]) @ moment.T
    matrix = np.eye(size, dtype=complex).reshape(orders, meshes, size) - moves @ force
    right = np.zeros((orders, meshes, orders, meshes), complex)
    right[np.arange(orders), :, np.arange(orders), :] = moves
    free = moment[:, :-1]
    bodies = free.shape[1]
    across = np.linalg.qr(free, mode="complete")[0][:, bodies:]
    scale = np.abs(spring).max() * np.abs(free).max()
    matrix[middle] = right[middle] = 0
    matrix[middle, :bodies] = free.T @ force[middle] / scale
    matrix[middle, bodies:, middle * meshes : (middle + 1) * meshes] = across.T
    right[middle, :bodies, middle, :] = -free.T / scale
    approach = np.linalg.solve(matrix.reshape(size, size), right.reshape(size, size))
    return force.reshape(size, size) @ approach


def without_pull(forces):
    """Forces of meshes of which none pulls: what those that part leave is borne by the others, (..., planets, angle).

    So slow errors of teeth act, far below the natural frequencies: the carrier turns until the torque is carried.
    """
    apart = np.flatnonzero(forces.reshape(-1, forces.shape[-1]).min(axis=0) < 0)
    if not apart.size:
        return forces
    found = forces.copy()
    some = np.take(forces, apart, axis=-1)  # not [..., apart]: sums would go across memory
    whole = np.maximum(some.sum(axis=-2, keepdims=True), 0.0)
    for _ in range(forces.shape[-2]):  # each round takes out meshes that part, at the latest all but one
        some = np.maximum(some, 0.0)
        bearing = some > 0
        few = np.maximum(bearing.sum(axis=-2, keepdims=True), 1)
        some = some - bearing * ((some.sum(axis=-2, keepdims=True) - whole) / few)
    found[..., apart] = np.maximum(some, 0.0)
    return found


_NEGLIGIBLE = 1e-10  # of the strongest line of the transmission error


@quantity(
    unit="N",
    axes=("planet",),
    reference="linear equations of motion with periodic coefficients: Hill's method (Nayfeh and Mook, Nonlinear "
    "Oscillations, 1979, section 5.2)",
)
def mesh_force(transmission_error, mesh_spring, mesh_damping, planet_load, planet_phase, torque_ripple,
               sun_error, ring_error, operating_points, base_radii, carrier_inertia, planet_inertia,
               carrier_ratio, carrier_turn, ring_teeth, sun_shaft, sun_softness):  # fmt: skip
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
        return np.concatenate([parts, -_twist(sun_shaft, omega)[..., None]], axis=-1)

    def answered(c, spectra, steady, ripple):
        """Spectra of the forces beyond the mean ones at an operating point, (meshes, orders)."""
        turn_hz = operating_points[c, 0] * carrier_ratio

        def dynamics(orders):
            """Springs, dampers, and what forces move, at orders per turn of the carrier; see `parting`."""
            omega = 2 * np.pi * orders * turn_hz
            moves = np.where(orders[..., None] == 0, 0.0, moved(np.where(orders == 0, 1.0, omega)))
            spring = beside(mesh_spring[c], planet_phase[c], orders.shape[-1] // 2)
            return spring, 1j * omega[..., None] * mesh_damping[c].ravel(), moves

        rest = _excited(spectra, ripple, period)
        bins = rest[:, None] + period * side
        spring, drag, moves = dynamics(bins / turns)
        dragged = drag * _at(steady, bins)
        torques = dragged @ moment
        torques[..., 0] += operating_points[c, 1] * _at(ripple[None], bins)[..., 0]
        pushed = np.where(bins[..., None] == 0, 0.0, (moves * torques) @ moment.T - _at(spectra, bins))
        beyond = dragged + _answer(spring, drag, moves, pushed, bins == 0, moment)
        if rest[0] == 0:
            loads = np.tile(planet_load[c], 2)
            beyond[0] += samples * parting(
                loads, beyond[0] / samples, moment, lambda orders: dynamics(ring_teeth * orders)
            )
        found, inside = np.zeros_like(spectra), np.abs(bins) < spectra.shape[-1]
        place, values = bins[inside], beyond[inside]
        found[:, np.abs(place)] = np.where(place[:, None] < 0, values.conj(), values).T
        return np.fft.irfft(found.reshape(2, planets, -1), samples, axis=-1)

    forces = np.stack([answered(c, spectra[c], steady[c], ripple) for c in range(points)])
    forces += planet_load[:, None, :, None]
    if np.any(sun_softness):
        # A softer pair of teeth gives way under all of the force, in proportion to it (first order in the softness).
        place = (
            (ring_teeth * carrier_turn[:samples] + planet_phase[:, 0, :, None]) % 1.0 * mesh_spring.shape[-1]
        )
        spring = np.take_along_axis(mesh_spring[:, 0], place.astype(int) % mesh_spring.shape[-1], axis=-1)
        gives = np.zeros_like(forces)
        gives[:, 0] = sun_softness[:, :samples] * forces[:, 0] / spring
        softer = np.fft.rfft(gives, axis=-1).reshape(spectra.shape)
        forces += np.stack(
            [answered(c, softer[c], np.zeros_like(steady[c]), np.zeros_like(ripple)) for c in range(points)]
        )
    return without_pull(forces)


def _twist(shaft, omega):
    """Receptance of a shaft with one torsional mode, rad/(N m); nothing of one that is stiff."""
    compliance, resonance, damping = shaft
    if not compliance:
        return np.zeros(np.shape(omega))
    ratio = omega / (2 * np.pi * resonance)
    return compliance / (1 - ratio**2 + 2j * damping * ratio)


def _freedom(base_radii, carrier_inertia, planet_inertia, planets):
    """What turns of carrier, planets and sun make of each approach (meshes, parts); inertias of all but the sun."""
    sun, planet, ring = base_radii
    moment = np.zeros((2 * planets, 2 + planets))
    moment[:planets, 0], moment[planets:, 0] = -(sun + planet), planet - ring
    moment[:planets, -1] = sun
    for i in range(planets):
        moment[i, 1 + i], moment[planets + i, 1 + i] = planet, -planet
    return moment, np.array([carrier_inertia, *([planet_inertia] * planets)])


def _answer(spring, drag, moves, pushed, still, moment):
    """Forces of springs and dampers: approach - moment moves moment^T (springs + dampers) approach = pushed.

    Forces and what pushes are (sets, orders, meshes). At order zero the springs' mean forces stay as they are.
    """
    sets, orders, meshes = pushed.shape
    size, each = orders * meshes, np.arange(orders)
    answer = (moment * moves[:, :, None]) @ moment.T
    matrix = -answer @ spring
    own = matrix.reshape(sets, orders, meshes, orders, meshes)  # by order and mesh of the approach too
    own[:, each, :, each] -= np.moveaxis(answer * drag[:, :, None], 1, 0)
    matrix += np.eye(size).reshape(orders, meshes, size)
    some = still.any(axis=1)
    matrix[still] = with_dampers(spring, drag[some])[still[some]] / np.abs(spring).max()
    approach = np.linalg.solve(matrix.reshape(sets, size, size), pushed.reshape(sets, size, 1))
    return (spring.reshape(size, size) @ approach).reshape(pushed.shape) + drag * approach.reshape(
        pushed.shape
    )


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


def beside(spring, phase, reach):
    """Stiffness as what each order makes of each other up to `reach` to either side, (orders, meshes, both)."""
    side = np.arange(2 * reach + 1)
    number = np.arange(-2 * reach, 2 * reach + 1)
    table = np.fft.fft(spring, axis=-1)[..., number % spring.shape[-1]] / spring.shape[-1]
    table = (table * np.exp(2j * np.pi * number * phase[..., None])).reshape(-1, number.size)
    found = np.zeros((side.size, table.shape[0], side.size, table.shape[0]), complex)
    meshes = np.arange(table.shape[0])
    found[:, meshes, :, meshes] = table[:, side[:, None] - side + 2 * reach]
    return found.reshape(side.size, table.shape[0], -1)


@quantity(unit="m", axes=("sensor",))
def rim_displacement(mesh_force, transfer_path, friction_share):
    """How far the ring's rim gives way at the sensors, (points, sensors, angle)."""
    angles = mesh_force.shape[-1]
    pressed = mesh_force[:, 1] * (1.0 + friction_share[:, :angles])
    return np.einsum("cis,kis->cks", pressed, transfer_path[..., :angles]) / RIM_STIFFNESS


@quantity(unit="m/s^2", axes=("sensor",))
def order_lines(rim_displacement, order, sun_speed, point_of_line, carrier_turn, carrier_ratio, housing_response,
                line_coherence, tacho_angle):  # fmt: skip
    """Complex peak amplitude of the acceleration at each line, (sensors, lines)."""
    samples = rim_displacement.shape[-1]
    spectra = np.fft.rfft(rim_displacement, axis=-1) * (2.0 / samples)
    place = np.asarray(order) * np.rint(samples * carrier_turn[1])
    nearest = np.rint(place).astype(int)
    inside = (np.abs(place - nearest) < 0.01) & (nearest < spectra.shape[-1])
    lines = spectra[point_of_line, :, np.where(inside, nearest, 0)].T * inside
    omega = 2 * np.pi * np.asarray(order) * sun_speed * carrier_ratio
    turned = np.exp(1j * np.asarray(order) * tacho_angle)
    return -(omega**2) * lines * housing_response * line_coherence * turned


def torsional_frequencies(model: Model) -> NDArray[np.float64]:
    """Natural frequencies, Hz, of the set as it is fitted: parts turn only, the sun turns steadily, the ring is fixed.

    Meshes have their mean stiffness at the rig file's speed and torque. Planets that move alike take the carrier with
    them (two modes); against each other they leave it where it is (as many modes as planets less one).

    Parameters
    ----------
    model : Model
        Of a planetary set, as `build` makes it.
    """
    operation = model.settings["parsed_rig"].operation
    at = {"order": np.ones(1), "sun_speed": np.full(1, operation.sun_speed_hz),
          "carrier_torque": np.full(1, operation.carrier_torque_Nm)}  # fmt: skip
    wanted = ["mesh_spring", "carrier_inertia", "planet_inertia", "base_radii"]
    found = model.assemble(model.base_effects).evaluate(at, None, wanted)
    stiffness, (sun, planet, ring) = found["mesh_spring"][0].mean(axis=(-2, -1)), found["base_radii"]
    planets = found["mesh_spring"].shape[-2]
    # Approach of the sun and of the ring mesh by a turn of the carrier and of a planet.
    geometry = np.array([[sun + planet, planet], [ring - planet, -planet]])
    one = geometry.T @ (stiffness[:, None] * geometry)  # of one planet with its part of the carrier
    together = one / np.array([found["carrier_inertia"] / planets, found["planet_inertia"]])[:, None]
    squares = [*np.linalg.eigvals(together).real, *[one[1, 1] / found["planet_inertia"]] * (planets - 1)]
    return np.sort(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi))
