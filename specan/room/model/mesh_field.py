"""The field of a room from its mesh: places, and lines over frequency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Flags, Real
from specan.errors import RequestError
from specan.models.kept import kept
from specan.models.quantity import quantity
from specan.room.model.mesh_modes import MeshModes, reduce
from specan.room.model.port import Port, beyond, point

REACH = 1.5  # of the band: lines above it fold into a recording's, and are had with less care


@quantity(unit="1", opaque=True)
@kept(3)  # a fit changes one parameter at a time, most of which leave the field alone
def room_modes(
    frequency,
    sound_speed,
    air_attenuation,
    air_dispersion,
    face_admittance,
    room_mesh,
    room_dimensions,
    drawn_dimensions,
):
    """The room's modes, and the couplings that were asked of them."""
    k = 2 * np.pi * np.asarray(frequency, dtype=float) / (sound_speed * (1 + air_dispersion))
    _, _, k_max = room_mesh
    if k.max() > REACH * k_max:
        raise RequestError(
            f"a line at {np.max(frequency):.1f} Hz lies above what the mesh was solved for",
            expected=f"at most {REACH * k_max / k.max() * np.max(frequency):.1f} Hz",
            remedy="raise [band] f_max_hz in the rig file",
        )
    stretch = np.asarray(room_dimensions) / drawn_dimensions
    return MeshField(reduce(*room_mesh), (k - 1j * air_attenuation) ** 2, 1j * k * face_admittance, stretch)


@dataclass(eq=False)
class MeshField:
    """The reduced room at given lines; couplings between ports are computed on demand.

    Attributes
    ----------
    modes : MeshModes
    k2 : array (lines,)
        Squared wave number with the air's attenuation in it, 1/m^2.
    soft : array (walls, lines)
        ``j k beta`` of each wall in 1/m.
    stretch : array (3,)
        Factors of the room along x, y and z, from the lowest corner of the box around it. Functions are kept on the
        mesh as drawn: slopes along an axis fall with its factor, walls grow as the faces that they are made of, and
        what lies above the modes is taken from the room as drawn.
    """

    modes: MeshModes
    k2: Complex
    soft: Complex
    stretch: Real
    _answers: dict[Port, Complex] = field(default_factory=dict, repr=False)
    _done: dict[tuple[Port, Port], Complex] = field(default_factory=dict, repr=False)

    def prepare(self, ports: Sequence[Port]) -> None:
        """Solve for several sources at once, which costs hardly more than for one."""
        new = [port for port in dict.fromkeys(ports) if port not in self._answers]
        if new:
            answers = self._solve(np.stack([self._at(port) for port in new], axis=1))
            self._answers |= dict(zip(new, answers, strict=True))

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Mean of G over both ports, array (lines, receivers), 1/m."""
        new = [port for port in dict.fromkeys(receivers) if (source, port) not in self._done]
        if new:
            self.prepare([source])
            found = self._answers[source] @ np.stack([self._at(port) for port in new], axis=1)
            plain = [i for i, port in enumerate(new) if not port.ball]
            # A ball averages away what lies above the modes, but for its own field.
            if source.ball and source in new:
                found[:, new.index(source)] += beyond(source, 3 * [self.modes.top])
            if plain and not source.ball:
                rigid, soft = self.modes.near_field(source, [new[i] for i in plain])
                powers = (self.k2 - self.modes.shift)[:, None] ** np.arange(len(rigid))
                found[:, plain] += powers @ rigid + self.soft.T @ soft
            self._done |= {(source, port): column for port, column in zip(new, found.T, strict=True)}
        return np.stack([self._done[source, port] for port in receivers], axis=1)

    def patch(self, wall: str, position: Sequence[float], radius: float) -> Port:
        """A round patch at a position in a wall."""
        return Port(point(self.modes.in_wall(wall, self._as_drawn(position))), 0, radius)

    def _as_drawn(self, position: Sequence[float]) -> Real:
        origin = self.modes.mesh.origin
        return np.asarray(origin + (np.asarray(position) - origin) / self.stretch)

    def _at(self, port: Port) -> Real:
        """Mean of each vector over a port: of a patch, which is known by the wall, or of a place in the room."""
        patch = port.radius and not port.ball
        return self.modes.at(port if patch else replace(port, position=point(self._as_drawn(port.position))))

    def place(self, wall: str, across: float, along: float, radius: float) -> Port:
        """A round patch in parts of the rectangle around a wall."""
        return Port(point(self.modes.wall_place(wall, across, along)), 0, radius)

    def _solve(self, loads: Real) -> Complex:
        """Answers of the vectors to loads (n, sources): array (sources, lines, n)."""
        modes, stretched = self.modes, np.any(self.stretch != 1)
        own = 1 - modes.facing() @ (self.stretch - 1) if stretched else np.ones(len(modes.walls))
        # Walls of one admittance act as one.
        rows, which = np.unique(self.soft, axis=0, return_inverse=True)
        parts = [np.tensordot(own * (which.ravel() == i), modes.walls, axes=1) for i in range(len(rows))]
        if stretched:
            parts += list(modes.along)
            change = np.broadcast_to((self.stretch**-2 - 1)[:, None], (3, len(self.k2)))
            rows = np.concatenate([rows, change])
        found = Lines(modes.values, np.array(parts), self.k2, rows).solve(loads / np.prod(self.stretch))
        return found.transpose(2, 0, 1)


DIRECT = 160  # vectors up to which a direct solution is the faster one
WINDOW = 64  # vectors whose squared wave numbers are the nearest to a line's: solved together, exactly
_TOLERANCE = 1e-8  # of the residual
_MOST = 48  # iterations; lines that need more are solved directly
_AT_ONCE = 64  # lines that are held together


@dataclass(frozen=True, eq=False)
class Lines:
    """``(diag(values) - k2 + sum_g soft_g walls_g) x = load`` for each line.

    Attributes
    ----------
    values : array (n,)
    walls : array (groups, n, n)
    k2 : array (lines,)
    soft : array (groups, lines)
    """

    values: Real
    walls: Real
    k2: Complex
    soft: Complex

    def solve(self, loads: Real) -> Complex:
        """Solutions (lines, n, sources) for loads (n, sources)."""
        parts = [slice(i, i + _AT_ONCE) for i in range(0, len(self.k2), _AT_ONCE)]
        one = self._direct if len(self.values) <= DIRECT else self._by_iteration
        return np.concatenate([one(part, loads) for part in parts])

    def _direct(self, part: slice | NDArray[np.intp], loads: Real) -> Complex:
        size = len(self.values)
        soft, flat = self.soft[:, part].T, self.walls.reshape(len(self.walls), -1)
        matrix = np.empty((len(soft), size, size), dtype=complex)
        matrix.real = (soft.real @ flat).reshape(matrix.shape)
        matrix.imag = (soft.imag @ flat).reshape(matrix.shape)
        matrix[:, np.arange(size), np.arange(size)] += self.values - self.k2[part, None]
        return np.linalg.solve(matrix, loads[None]).astype(complex, copy=False)

    def _by_iteration(self, part: slice, loads: Real) -> Complex:
        lines = np.arange(len(self.k2))[part]
        near = np.argsort(np.abs(self.values - self.k2[part, None].real), axis=1)[:, :WINDOW]
        block = np.einsum(
            "gl,glij->lij", self.soft[:, part], self.walls[:, near[:, :, None], near[:, None, :]]
        )
        away = self.values - self.k2[part, None]
        places = np.arange(len(lines))[:, None]
        block[:, np.arange(WINDOW), np.arange(WINDOW)] += away[places, near]
        inverse = np.linalg.inv(block)
        far = 1 / (away + np.einsum("gl,gii->li", self.soft[:, part], self.walls))
        out = np.zeros((len(lines), len(self.values), loads.shape[1]), dtype=complex)

        def apply(x: Complex) -> Complex:
            pushed = np.array([x.real @ wall + 1j * (x.imag @ wall) for wall in self.walls])
            return away * x + np.einsum("gl,gli->li", self.soft[:, part], pushed)

        def precondition(x: Complex) -> Complex:
            y = far * x
            y[places, near] = (inverse @ x[places, near][..., None])[..., 0]
            return y

        for i in np.flatnonzero(loads.any(axis=0)):
            load = loads[:, i]
            x, done = gmres(apply, precondition, np.broadcast_to(load, away.shape).astype(complex))
            out[..., i] = x
            if not done.all():
                out[~done, :, i] = self._direct(lines[~done], load[:, None])[..., 0]
        return out


def gmres(
    apply: Callable[[Complex], Complex], precondition: Callable[[Complex], Complex], right: Complex
) -> tuple[Complex, Flags]:
    """Generalised minimal residuals for several systems at once (Saad and Schultz 1986, flexible form).

    Parameters
    ----------
    apply, precondition : callable
        Matrix, and an approximate inverse, applied to rows (systems, n).
    right : array (systems, n)
        None of them zero.

    Returns
    -------
    x : array (systems, n)
    done : array of bool
        Which residuals are small enough.
    """
    size = np.linalg.norm(right, axis=1)
    basis, steps = [right / size[:, None]], []
    table = np.zeros((len(right), _MOST + 1, _MOST), dtype=complex)
    for j in range(_MOST):
        steps.append(precondition(basis[j]))
        new = apply(steps[j])
        for _ in range(2):  # twice is enough
            known = np.stack(basis, axis=1)
            share = np.einsum("sjn,sn->sj", known.conj(), new)
            new = new - np.einsum("sjn,sj->sn", known, share)
            table[:, : j + 1, j] += share
        length = np.linalg.norm(new, axis=1)
        table[:, j + 1, j] = length
        basis.append(new / np.where(length > 0, length, 1.0)[:, None])
        if j % 4 == 3 or j == _MOST - 1:
            weights, left = _least_squares(table[:, : j + 2, : j + 1])
            if left.max() < _TOLERANCE:
                break
    found: Complex = np.einsum("sjn,sj->sn", np.stack(steps, axis=1), weights) * size[:, None]
    return found, left < _TOLERANCE


def _least_squares(table: Complex) -> tuple[Complex, Real]:
    """Weights of the steps that leave the smallest part of the right side, and that part."""
    q, r = np.linalg.qr(table)
    r = r + 1e-30 * np.eye(r.shape[-1])  # a system that is solved already steps no further
    weights = np.linalg.solve(r, q[:, :1].conj().transpose(0, 2, 1))
    left = -(table @ weights)[..., 0]
    left[:, 0] += 1
    return weights[..., 0], np.linalg.norm(left, axis=1)
