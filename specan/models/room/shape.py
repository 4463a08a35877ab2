"""What a room's shape decides of its model; and a room of any shape: what a mesh file and its rig make of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from specan.errors import RequestError, nearest
from specan.models.quantity import Quantity, constant
from specan.models.room.field import COLD
from specan.models.room.mesh_elements import Simplices
from specan.models.room.mesh_field import MeshRoom, room_modes
from specan.models.room.mesh_file import RoomMesh, read_room_mesh
from specan.models.room.mesh_size import degree_for, expected_cost, unknowns
from specan.models.room.rig import Rig, microphone_outside

_TOLERANCE = 1e-3  # m, between a curved wall and its triangles

LACKS = {
    "dimension": "a room from a mesh has no edges that could be stretched one by one (its size as a whole acts "
    "as temperature does)"
}


@dataclass(frozen=True)
class RoomShape:
    """A box, or a room from a mesh, as the model's builder needs it.

    Attributes
    ----------
    walls : tuple of str
        Elements of the axis ``wall``.
    quantities : tuple of Quantity
        ``room_origin``, ``room_dimensions``, ``room_modes``, and what the latter reads of the shape.
    axes : mapping
        Axes that only this shape has.
    lacks : mapping
        ``{axis: reason}``: effects that act along such an axis is not available.
    notes : tuple of str
        What is to be known before a study starts.
    """

    title: str
    walls: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    axes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lacks: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def mesh_shape(rig: Rig) -> RoomShape:
    """Read and check the mesh that a rig names.

    Raises
    ------
    RequestError
        Of the mesh: see `read_room_mesh`; a microphone outside, a piston off its wall, too many unknowns.
    """
    path = Path(str(rig.room.mesh))
    mesh = read_room_mesh(path)
    centre = _check_places(mesh, rig)
    k_max = 2 * np.pi * rig.band.f_max_hz / COLD
    degree = degree_for(mesh, k_max, rig.band.f_max_hz, (centre, rig.piston.radius_m))
    return RoomShape(
        title=f"Sound field of the room in {path.name} with a piston in one wall",
        walls=tuple(mesh.walls),
        quantities=(
            constant("room_origin", mesh.origin, "m", "Lowest corner of the box around the room."),
            constant("room_dimensions", mesh.edges, "m", "Edges of the box around the room."),
            MeshRoom(mesh, degree, k_max).quantity(),
            room_modes,
        ),
        lacks=LACKS,
        notes=_notes(mesh, degree, k_max, rig.band.f_max_hz, path.name),
    )


def _notes(mesh: RoomMesh, degree: int, k_max: float, f_max_hz: float, name: str) -> tuple[str, ...]:
    cost = expected_cost(mesh, degree, k_max)
    large = " x ".join(f"{edge:.3g}" for edge in mesh.edges)
    return (
        f"{name}: {len(mesh.tetrahedra)} tetrahedra of degree {degree}, {unknowns(mesh, degree)} unknowns; "
        f"{large} m large, {mesh.volume:.3g} m^3, {len(mesh.walls)} walls: {', '.join(mesh.walls)}",
        f"up to {f_max_hz:.0f} Hz about {cost.vectors} modes and answers of walls: found once in about "
        f"{_one_digit(cost.preparation_s)} s, then {_one_digit(1000 * cost.line_s)} s for each evaluation of "
        "1000 lines",
    )


def _one_digit(seconds: float) -> str:
    return f"{float(f'{seconds:.1g}'):g}"


def _check_places(mesh: RoomMesh, rig: Rig) -> np.ndarray:
    """Microphones must be inside, the piston in its wall; returns its centre on the wall."""
    places = np.array(rig.mics.position_m)
    distance = Simplices(mesh.points[mesh.tetrahedra]).nearest(places)[2]
    outside = np.flatnonzero(distance > 1e-6)
    if outside.size:
        first = int(outside[0])
        raise microphone_outside(first + 1, rig.mics.position_m[first], "a place inside the mesh")
    wall = rig.piston.wall
    if wall not in mesh.walls:
        raise RequestError(
            f"[piston] wall is {wall!r}, no named surface of the mesh", remedy=nearest(wall, mesh.walls)
        )
    skin = Simplices(mesh.points[mesh.walls[wall]])
    number, place, off = skin.nearest(np.array([rig.piston.centre_m]))
    if off[0] > _TOLERANCE:
        raise RequestError(
            f"the piston's centre {list(rig.piston.centre_m)} m lies {off[0]:.3g} m off the wall {wall!r}",
            expected=f"a place in that surface, such as {[round(float(x), 4) for x in place[0]]}",
        )
    a, b, c = skin.corners[number[0]]
    across = (b - a) / np.linalg.norm(b - a)
    along = np.cross(np.cross(across, c - a), across)
    along /= np.linalg.norm(along)
    angle = 2 * np.pi * np.arange(36) / 36
    rim = place[0] + rig.piston.radius_m * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * along)
    if skin.nearest(rim)[2].max() > _TOLERANCE:
        raise RequestError(
            f"the piston of radius {rig.piston.radius_m} m at {list(rig.piston.centre_m)} m reaches over the edge of "
            f"the wall {wall!r}, or the wall is not flat there",
            remedy="correct [piston] centre_m or radius_m",
        )
    return np.asarray(place[0])
