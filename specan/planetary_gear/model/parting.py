"""Teeth that part: meshes push, and do not pull."""

import numpy as np

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
    answer = _answer(moment, *dynamics(side)).reshape(orders, meshes, orders, meshes)
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


def _answer(moment, spring, drag, moves):
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
