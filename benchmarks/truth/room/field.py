"""The sound field of a room in the time domain: what a point hears after the diaphragm has moved.

The wave equation in its weak form on spectral elements (Patera, J. Comput. Phys. 54, 1984; Komatitsch and Vilotte,
Bull. Seism. Soc. Am. 88, 1998) with a diagonal mass matrix, marched by central differences.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from truth.room.box import WALLS, Box, Disc
from truth.room.branch import Branch, Lining, Plug
from truth.room.line import Real
from truth.room.losses import NITROGEN, Air
from truth.room.obstacle import Block, Obstacle

OUTPUT_HZ = 4096.0
HIGHEST_HZ = 800.0  # responses are given up to here
_PULSE_S = (
    4.2e-4  # standard deviation of the driving pulse; what the output rate folds onto the band is below 1e-16
)
_QUIET = 3e-5  # the march ends when the field has fallen to this share of its maximum
_CHECK_S = 0.1
_RUNAWAY = 10.0  # times the loudest so far: no room answers so, an unstable march does
LONGEST_S = 4.0
_LINES_AT_ONCE = 64  # bounds the memory of the transform
_MARGIN = 0.8  # of the largest stable step; the linings' springs need some of it

Part = Lining | Plug


@dataclass(frozen=True)
class Uneven:
    """A mode of the rigid box, by its numbers along the edges, that is stiffer and duller than the box makes it.

    What the walls hang on, what stands in the corners, seams: of each mode, as a share of its stiffness and of the
    damping that walls of equal admittance give it.
    """

    orders: tuple[int, int, int]
    stiffer: float
    duller: float


@dataclass(frozen=True)
class Room:
    """A box with everything that sounds in it; SI units.

    Attributes
    ----------
    dims_m : tuple of float
        Edges.
    sound_speed, density : float
        Speed of sound above the relaxation of nitrogen (in the band it is up to 6e-5 slower), m/s; kg/m^3.
    admittance : tuple of float
        rho c / Z of each wall in the order of `WALLS`, real. The diaphragm is rigid.
    piston : Disc
        Where the prescribed velocity is.
    position_m : tuple of tuple of float
        The listening points.
    parts : tuple
        Linings and plugs, in parallel with the walls' own admittance.
    second : Disc, optional
        Another place of a wall that moves with the piston's velocity times `second_gain`, `second_delay_s` later.
    air_losses : bool
        Whether sound is lost in the air.
    humidity_percent : float
        Relative humidity, which decides how much.
    block : Block, optional
        A rigid object.
    uneven : tuple of Uneven
        Modes that ring elsewhere than the box lets them.
    """

    dims_m: tuple[float, float, float]
    sound_speed: float
    density: float
    admittance: tuple[float, ...]
    piston: Disc
    position_m: tuple[tuple[float, float, float], ...]
    parts: tuple[Part, ...] = ()
    second: Disc | None = None
    second_gain: float = 0.0
    second_delay_s: float = 0.0
    air_losses: bool = True
    humidity_percent: float = 50.0
    block: Block | None = None
    uneven: tuple[Uneven, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class Heard:
    """Pressure at the listening points (points, samples), and the pulse of velocity at the middles of the steps."""

    pressure: Real
    pulse: Real
    step_s: float
    every: int  # steps per sample of the pressure


class _Losses:
    """Inverse of mass plus half a step of the walls' damping, less what the diaphragm and an object take from them.

    Under the rigid diaphragm the wall takes nothing, and where an object is no air is compressed: matrices of low
    rank. As a share of the wall the diaphragm's eigenvalues lie between 0 and 1; where the quadrature of a disc across
    elements overshoots, they are cut, or the march would be unstable.
    """

    def __init__(self, box: Box, room: Room, step_s: float, obstacle: Obstacle | None) -> None:
        mass = box.volume.ravel().copy()
        half = 0.5 * step_s * room.sound_speed
        for wall, admittance in zip(WALLS, room.admittance, strict=True):
            nodes, weights = box.face(wall)
            mass[nodes] += half * admittance * weights
        self.inverse = 1.0 / mass
        rows = _under_the_diaphragm(box, room, half)
        if obstacle is not None:
            rows = np.vstack([rows, obstacle.pressure])
        self.nodes = np.flatnonzero(np.any(rows, axis=0))
        rows = rows[:, self.nodes]
        spread = rows * self.inverse[self.nodes]
        inner = np.eye(len(rows)) - spread @ rows.T
        self._out, self._in = spread.T @ np.linalg.inv(inner), spread

    def solve(self, load: Real) -> Real:
        """Change of the pressure over two steps from the load vector."""
        change = load * self.inverse
        change[self.nodes] += self._out @ (self._in @ load[self.nodes])
        return change


def _under_the_diaphragm(box: Box, room: Room, half: float) -> Real:
    """Vectors whose products are the damping that the wall does not have under the diaphragm."""
    nodes, area = box.face(room.piston.wall)
    basis, weights = box.disc(room.piston)
    taken = half * room.admittance[WALLS.index(room.piston.wall)] * area
    _, share, shapes = np.linalg.svd(np.sqrt(weights)[:, None] * basis / np.sqrt(area), full_matrices=False)
    kept = share > 1e-6
    rows = np.zeros((int(kept.sum()), box.volume.size))
    rows[:, nodes] = np.minimum(share[kept], 1.0)[:, None] * shapes[kept] * np.sqrt(taken)
    return rows


def _step(box: Box, room: Room) -> tuple[float, int]:
    """Time step, and how many of them make a sample of the output."""
    longest = _MARGIN * 2.0 / (room.sound_speed * np.sqrt(box.largest_eigenvalue()))
    every = int(np.ceil(1.0 / (OUTPUT_HZ * longest)))
    return 1.0 / (OUTPUT_HZ * every), every


def _source(box: Box, disc: Disc, room: Room) -> Real:
    """Load of a disc that moves with unit acceleration: density times the integral of each basis function."""
    load = np.zeros(box.volume.size)
    nodes, _ = box.face(disc.wall)
    basis, weights = box.disc(disc)
    load[nodes] = room.density * (weights @ basis)
    return load


def march(room: Room, shortest_s: float = 0.3, longest_s: float = LONGEST_S) -> Heard:
    """Let the diaphragm move by one smooth pulse of velocity and listen until the room is quiet.

    Parameters
    ----------
    room : Room
        What stands where.
    shortest_s, longest_s : float
        Bounds of the time that is listened for.

    Returns
    -------
    Heard

    Raises
    ------
    ComputationError
        The field grows without bound.
    """
    box = Box(room.dims_m)
    step, every = _step(box, room)
    obstacle = None if room.block is None else Obstacle(box, room.block)
    losses = _Losses(box, room, step, obstacle)
    air = Air.at_humidity(room.humidity_percent)
    branches = [Branch(box, part, step) for part in room.parts]
    sources = _sources(box, room, step)
    pulse = _pulse(step)
    acceleration = np.diff(pulse, prepend=0.0, append=0.0) / step
    points = box.at(np.array(room.position_m))
    mass = box.volume.ravel()
    square = (room.sound_speed * step) ** 2 / (1.0 + NITROGEN * room.air_losses)
    keep = np.exp(-2.0 * np.pi * air.nitrogen_hz * step)

    shapes, stiffer, duller = _uneven(box, room, step)
    old, now, slow = (np.zeros(box.volume.size) for _ in range(3))
    samples: list[Real] = []
    per_check = round(_CHECK_S * OUTPUT_HZ)
    loudest = 0.0
    for n in range(round(longest_s * OUTPUT_HZ) * every):
        if n % every == 0:
            samples.append(points @ now)
            if len(samples) % per_check == 0:
                recent = float(np.max(np.abs(samples[-per_check:])))
                if not np.isfinite(recent) or 0.0 < _RUNAWAY * loudest < recent:
                    raise ComputationError("the simulated sound field grows without bound")
                loudest = max(loudest, recent)
                if len(samples) >= shortest_s * OUTPUT_HZ and recent < _QUIET * loudest:
                    break
        change = now - old
        bent = now
        if room.air_losses:
            slow = keep * slow + (1.0 - keep) * now
            bent = now + NITROGEN * (now - slow) + (air.viscous_s / step) * change
        load = (2.0 * change - square * box.minus_laplacian(bent.reshape(box.shape)).ravel()) * mass
        if obstacle is not None:
            load -= obstacle.pressure * (2.0 * obstacle.pressure @ change)
            load += square * (obstacle.gradient @ bent) @ obstacle.gradient
        if room.uneven:
            parts = stiffer * (shapes @ (now * mass)) + duller * (shapes @ (change * mass))
            load -= (parts @ shapes) * mass
        for shape, late, gain in sources:
            if 0 <= n - late < len(acceleration):
                load += (square * gain * acceleration[n - late]) * shape
        for branch in branches:
            load[branch.nodes] -= square * room.density * branch.volume_acceleration(now)
        old, now = now, old + losses.solve(load)
    return Heard(np.array(samples).T, pulse, step, every)


def _uneven(box: Box, room: Room, step_s: float) -> tuple[Real, Real, Real]:
    """Shapes of unit mass (modes, nodes), what their fields pull back, and what their changes are held back by."""
    shapes, stiffer, duller = [np.zeros(box.volume.size)], [0.0], [0.0]
    for one in room.uneven:
        x, y, z = (
            np.cos(np.pi * n * axis.nodes / edge)
            for n, axis, edge in zip(one.orders, box.lines, room.dims_m, strict=True)
        )
        shape = np.einsum("i,j,k->ijk", x, y, z).ravel()
        shapes.append(shape / np.sqrt(np.sum(shape**2 * box.volume.ravel())))
        k2 = sum((np.pi * n / edge) ** 2 for n, edge in zip(one.orders, room.dims_m, strict=True))
        rate = room.sound_speed * sum(  # 1/s, twice the decay rate: the walls' share of the mode's energy
            (2.0 if n else 1.0) * (room.admittance[2 * i] + room.admittance[2 * i + 1]) / room.dims_m[i]
            for i, n in enumerate(one.orders)
        )
        stiffer.append((room.sound_speed * step_s) ** 2 * k2 * one.stiffer)
        duller.append(step_s * rate * one.duller)
    return np.array(shapes), np.array(stiffer), np.array(duller)


def _pulse(step_s: float) -> Real:
    time = np.arange(int(np.ceil(14.0 * _PULSE_S / step_s))) * step_s
    return np.exp(-0.5 * ((time - 7.0 * _PULSE_S) / _PULSE_S) ** 2)


def _sources(box: Box, room: Room, step_s: float) -> list[tuple[Real, int, float]]:
    """Load, delay in steps and gain of everything that is driven."""
    sources = [(_source(box, room.piston, room), 0, 1.0)]
    if room.second is not None:
        late = round(room.second_delay_s / step_s)
        sources.append((_source(box, room.second, room), late, room.second_gain))
    return sources


def pressure_per_velocity(heard: Heard, frequency_hz: Real) -> NDArray[np.complex128]:
    r"""Sound pressure over diaphragm velocity, Pa s/m, shape (points, frequencies), exp(+j w t).

    Central differences make of a frequency :math:`\Omega` another,
    :math:`w = (2/\Delta t) \arcsin(\Omega \Delta t / 2)`; the response is read off there, which leaves no error of the
    time step in the natural frequencies.
    """
    omega = 2.0 * np.pi * np.asarray(frequency_hz, float)
    grid = 2.0 / heard.step_s * np.arcsin(0.5 * omega * heard.step_s)
    middle = heard.step_s * (np.arange(len(heard.pulse)) + 0.5)
    interval = heard.step_s * heard.every
    time = interval * np.arange(heard.pressure.shape[1])
    response = np.empty((len(heard.pressure), len(grid)), complex)
    for first in range(0, len(grid), _LINES_AT_ONCE):
        part = slice(first, first + _LINES_AT_ONCE)
        driven = heard.step_s * heard.pulse @ np.exp(-1j * np.outer(middle, grid[part]))
        response[:, part] = interval * heard.pressure @ np.exp(-1j * np.outer(time, grid[part])) / driven
    return response
