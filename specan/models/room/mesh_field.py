"""Green's function of a room from a mesh: the reduced room with its walls' admittances, line by line."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.quantity import Quantity, constant, quantity
from specan.models.room.mesh_file import RoomMesh
from specan.models.room.mesh_lines import Lines
from specan.models.room.mesh_modes import MeshModes, reduce
from specan.models.room.port import Port, beyond, point

Complex = NDArray[np.complex128]

REACH = 1.5  # of the band: lines above it fold into a recording's, and are had with less care

_KEPT = (
    3  # rooms, and fields of a room: a fit changes one parameter at a time, most of which leave them alone
)


@dataclass(frozen=True, eq=False)
class MeshRoom:
    """A mesh with elements of some degree, solved when it is first asked for."""

    mesh: RoomMesh
    degree: int
    k_max: float

    def quantity(self) -> Quantity:
        """The room as a quantity of its model."""
        return replace(constant("room_mesh", self, "1", "The room as meshed."), opaque=True)

    @property
    def modes(self) -> MeshModes:
        """The reduced room."""
        key = (self.mesh.digest, self.degree, self.k_max)
        if key not in _REDUCED:
            while len(_REDUCED) >= _KEPT:
                _REDUCED.popitem(last=False)
            _REDUCED[key] = reduce(self.mesh, self.degree, self.k_max)
        return _REDUCED[key]


_REDUCED: OrderedDict[tuple[object, ...], MeshModes] = OrderedDict()
_FIELDS: OrderedDict[tuple[object, ...], MeshField] = OrderedDict()


@quantity(unit="1", opaque=True)
def room_modes(frequency, sound_speed, air_attenuation, air_dispersion, wall_admittance, room_mesh):
    """The room's modes, and the couplings that were asked of them."""
    inputs = (frequency, sound_speed, air_attenuation, air_dispersion, wall_admittance)
    key = (id(room_mesh.modes), *(np.asarray(value).tobytes() for value in inputs))
    if key not in _FIELDS:
        while len(_FIELDS) >= _KEPT:
            _FIELDS.popitem(last=False)
        _FIELDS[key] = _make_field(room_mesh, *inputs)
    return _FIELDS[key]


def _make_field(
    room: MeshRoom, frequency: Any, sound_speed: Any, attenuation: Any, dispersion: Any, admittance: Any
) -> MeshField:
    k = 2 * np.pi * np.asarray(frequency, dtype=float) / (sound_speed * (1 + dispersion))
    if k.max() > REACH * room.k_max:
        raise RequestError(
            f"a line at {np.max(frequency):.1f} Hz lies above what the mesh was solved for",
            expected=f"at most {REACH * room.k_max / k.max() * np.max(frequency):.1f} Hz",
            remedy="raise [band] f_max_hz in the rig file",
        )
    return MeshField(room.modes, (k - 1j * attenuation) ** 2, 1j * k * admittance)


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
    """

    modes: MeshModes
    k2: Complex
    soft: Complex
    _answers: dict[Port, Complex] = field(default_factory=dict, repr=False)
    _done: dict[tuple[Port, Port], Complex] = field(default_factory=dict, repr=False)

    def prepare(self, ports: Sequence[Port]) -> None:
        """Solve for several sources at once, which costs hardly more than for one."""
        new = [port for port in dict.fromkeys(ports) if port not in self._answers]
        if new:
            answers = self._solve(np.stack([self.modes.at(port) for port in new], axis=1))
            self._answers |= dict(zip(new, answers, strict=True))

    def coupling(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """Mean of G over both ports, array (lines, receivers), 1/m."""
        new = [port for port in dict.fromkeys(receivers) if (source, port) not in self._done]
        if new:
            self.prepare([source])
            found = self._answers[source] @ np.stack([self.modes.at(port) for port in new], axis=1)
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
        return Port(point(position), 0, radius)

    def place(self, wall: str, across: float, along: float, radius: float) -> Port:
        """A round patch in parts of the rectangle around a wall."""
        return Port(point(self.modes.wall_place(wall, across, along)), 0, radius)

    def _solve(self, loads: NDArray[np.float64]) -> Complex:
        """Answers of the vectors to loads (n, sources): array (sources, lines, n)."""
        # Walls of one admittance act as one.
        rows, which = np.unique(self.soft, axis=0, return_inverse=True)
        walls = np.array([self.modes.walls[which.ravel() == i].sum(axis=0) for i in range(len(rows))])
        return Lines(self.modes.values, walls, self.k2, rows).solve(loads).transpose(2, 0, 1)
