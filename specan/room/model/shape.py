"""What a room's shape decides of its model; and a room of any shape: what a mesh file and its rig make of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from pathlib import Path

import numpy as np

from specan.arrays import Real
from specan.errors import RequestError, nearest
from specan.models.quantity import Quantity, constant
from specan.room.model.field import COLD
from specan.room.model.mesh_elements import Simplices
from specan.room.model.mesh_field import room_modes
from specan.room.model.mesh_file import RoomMesh, read_room_mesh, triangle_areas
from specan.room.model.mesh_modes import MARGIN, expected_modes
from specan.room.model.rig import Piston, Rig, microphone_outside

_TOLERANCE = 1e-3  # m, between a curved wall and its triangles


@dataclass(frozen=True)
class RoomShape:
    """A box, or a room from a mesh, as the model's builder needs it.

    Attributes
    ----------
    walls : tuple of str
        Elements of the axis ``face``, and of ``wall`` as long as none are tied.
    areas_m2 : tuple of float
        Their areas.
    quantities : tuple of Quantity
        ``room_origin``, ``room_dimensions``, ``room_modes``, and what the latter reads of the shape.
    notes : tuple of str
        What is to be known before a study starts.
    """

    title: str
    walls: tuple[str, ...]
    areas_m2: tuple[float, ...]
    quantities: tuple[Quantity, ...]
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
    _check_microphones(mesh, rig)
    pistons = [(_centre_in_wall(mesh, name, one), one.radius_m) for name, one in rig.pistons.items()]
    k_max = 2 * np.pi * rig.band.f_max_hz / COLD
    degree = max(degree_for(mesh, k_max, rig.band.f_max_hz, piston) for piston in pistons)
    large = " x ".join(f"{edge:.3g}" for edge in mesh.edges)
    return RoomShape(
        title=f"Sound field of the room in {path.name} with a piston in one wall",
        walls=tuple(mesh.walls),
        areas_m2=tuple(float(triangle_areas(mesh.points, t).sum()) for t in mesh.walls.values()),
        quantities=(
            constant("room_origin", mesh.origin, "m", "Lowest corner of the box around the room."),
            constant("room_dimensions", mesh.edges, "m", "Edges of the box around the room.", ("dimension",)),
            constant("drawn_dimensions", mesh.edges, "m", "The same as drawn."),
            constant(
                "room_mesh",
                (mesh, degree, k_max),
                "1",
                "Mesh, degree and band: see `reduce`.",
                opaque=True,
            ),
            room_modes,
        ),
        notes=(
            f"{path.name}: {len(mesh.tetrahedra)} tetrahedra of degree {degree}, {unknowns(mesh, degree)} unknowns; "
            f"{large} m large, {mesh.volume:.3g} m³, {len(mesh.walls)} walls: {', '.join(mesh.walls)}",
            f"up to {rig.band.f_max_hz:.0f} Hz about {expected_vectors(mesh, k_max)} modes and responses of walls",
        ),
    )


def _check_microphones(mesh: RoomMesh, rig: Rig) -> None:
    for places in rig.places:
        distance = Simplices(mesh.points[mesh.tetrahedra]).nearest(places)[2]
        outside = np.flatnonzero(distance > 1e-6)
        if outside.size:
            first = int(outside[0])
            raise microphone_outside(first + 1, places[first], "a place inside the mesh")


def _centre_in_wall(mesh: RoomMesh, name: str, piston: Piston) -> np.ndarray:
    """A piston must be in its wall; returns its centre on the wall."""
    wall = piston.wall
    if wall not in mesh.walls:
        of = "[piston] wall" if name == "piston" else f"wall of {name}"
        raise RequestError(
            f"{of} is {wall!r}, no named surface of the mesh", remedy=nearest(wall, mesh.walls)
        )
    skin = Simplices(mesh.points[mesh.walls[wall]])
    number, place, off = skin.nearest(np.array([piston.centre_m]))
    if off[0] > _TOLERANCE:
        raise RequestError(
            f"the {name}'s centre {list(piston.centre_m)} m lies {off[0]:.3g} m off the wall {wall!r}",
            expected=f"a place in that surface, such as {[round(float(x), 4) for x in place[0]]}",
        )
    rim = place[0] + piston.radius_m * skin.circle(int(number[0]), 36)
    if skin.nearest(rim)[2].max() > _TOLERANCE:
        raise RequestError(
            f"the {name} of radius {piston.radius_m} m at {list(piston.centre_m)} m reaches over the edge of "
            f"the wall {wall!r}, or the wall is not flat there",
            remedy="correct its centre_m or radius_m",
        )
    return np.asarray(place[0])


DEGREES = (2, 3, 4, 5, 6)
ACCURACY = 1e-5  # of the highest natural frequency: rooms of 0.5 % admittance have modes 1e-3 wide
MOST_UNKNOWNS = 40_000  # about 1 GB and a minute for the modes
ADVISED = 5  # degree for which an edge is advised
AT_PISTON = 0.6  # of the radius: distance between nodes under the piston


def frequency_error(mesh: RoomMesh, degree: int, k: float) -> float:
    """Relative error of natural frequencies at a wave number, to leading order.

    ``1/2 (p! / (2p)!)^2 (k h)^(2p) / (2p + 1)`` for elements of degree p and edge h (Ainsworth 2004, SIAM
    J. Numer. Anal. 42, 553-575), averaged over the room.
    """
    corners, volume = mesh.points[mesh.tetrahedra], mesh.volumes
    longest = np.max(
        [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i in range(4) for j in range(i)], axis=0
    )
    # The cube of which the element is a sixth; of a sliver its edge counts.
    edge = np.maximum((6 * volume) ** (1 / 3), longest / np.sqrt(3))
    return _dispersion(degree) * float((volume * (k * edge) ** (2 * degree)).sum() / volume.sum())


def _dispersion(degree: int) -> float:
    return 0.5 * (factorial(degree) / factorial(2 * degree)) ** 2 / (2 * degree + 1)


def _longest_edge(degree: int, k: float) -> float:
    """Edge at which elements of a degree are just fine enough, m."""
    found: float = (ACCURACY / _dispersion(degree)) ** (1 / (2 * degree)) / k
    return found


def unknowns(mesh: RoomMesh, degree: int) -> int:
    """Number of nodes: on corners, edges, faces and inside."""
    cells = mesh.tetrahedra
    edges = np.unique(np.concatenate([cells[:, [i, j]] for j in range(4) for i in range(j)]), axis=0)
    faces = (4 * len(cells) + sum(len(t) for t in mesh.walls.values())) // 2
    p = degree - 1
    inside = p * (p - 1) // 2 * faces + p * (p - 1) * (p - 2) // 6 * len(cells)
    return len(mesh.points) + p * len(edges) + inside


def degree_for(mesh: RoomMesh, k_max: float, f_max_hz: float, piston: tuple[Real, float]) -> int:
    """Lowest degree that is fine enough for the band and for the piston (centre, radius).

    Raises
    ------
    RequestError
        None is, or it makes too many unknowns.
    """
    edge = 0.8 * _longest_edge(ADVISED, k_max)  # elements are never all alike
    advice = f"mesh it with elements of about {edge:.2g} m, {2 * piston[1]:.2g} m around the piston"
    needed = DEGREES[-1] ** 3 * mesh.volume / _longest_edge(DEGREES[-1], k_max) ** 3
    if needed > MOST_UNKNOWNS:
        lower = f_max_hz * (MOST_UNKNOWNS / needed) ** (1 / 3)
        raise RequestError(
            f"a room of {mesh.volume:.3g} m³ takes about {needed:.2g} unknowns up to {f_max_hz:.0f} Hz",
            expected=f"at most {MOST_UNKNOWNS}",
            remedy=f"lower [band] f_max_hz to about {lower:.2g}",
        )
    under = _edge_under(mesh, *piston)
    if under > DEGREES[-1] * AT_PISTON * piston[1]:
        raise RequestError(
            f"the mesh's triangles under the piston have edges of {under:.2g} m, its radius is {piston[1]:.3g} m",
            expected=f"edges of at most {DEGREES[-1] * AT_PISTON:.2g} times the radius",
            remedy=advice,
        )
    fit = [
        p
        for p in DEGREES
        if p * AT_PISTON * piston[1] >= under and frequency_error(mesh, p, k_max) <= ACCURACY
    ]
    if not fit:
        raise RequestError(
            f"the mesh is too coarse for {f_max_hz:.0f} Hz: natural frequencies would be off by "
            f"{frequency_error(mesh, DEGREES[-1], k_max):.1g}",
            expected=f"at most {ACCURACY:g}",
            remedy=advice,
        )
    if unknowns(mesh, fit[0]) > MOST_UNKNOWNS:
        raise RequestError(
            f"the mesh takes {unknowns(mesh, fit[0])} unknowns, its {len(mesh.tetrahedra)} tetrahedra being of "
            f"degree {fit[0]}",
            expected=f"at most {MOST_UNKNOWNS}",
            remedy=advice,
        )
    return fit[0]


def _edge_under(mesh: RoomMesh, centre: Real, radius: float) -> float:
    """Longest edge of the wall's triangles around a patch."""
    triangles = np.concatenate(list(mesh.walls.values()))
    angle = 2 * np.pi * np.arange(12) / 12
    circle = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    turned = np.concatenate([np.roll(circle, i, axis=0).T for i in range(3)])
    places = np.concatenate([centre[None], centre + turned])
    number, _, distance = Simplices(mesh.points[triangles]).nearest(places)
    chosen = triangles[np.unique(number[distance < 1e-3])]
    return float(np.sqrt(2 * triangle_areas(mesh.points, chosen).max()))


def expected_vectors(mesh: RoomMesh, k_max: float) -> int:
    """About how many modes and responses of walls a room is reduced to, by Weyl's law in it and on its walls."""
    areas = np.array([triangle_areas(mesh.points, t).sum() for t in mesh.walls.values()])
    traces = (areas * k_max**2 / (4 * np.pi) + 4.2 * np.sqrt(areas) * k_max / (4 * np.pi) + 1).sum()
    return int(expected_modes(mesh, MARGIN * k_max) + traces)
