"""A room as a mesh file gives it: tetrahedra, and walls as named surfaces."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import RequestError, library

Numbers = NDArray[np.int64]

LARGEST_M = 100.0  # a room longer than this was most likely drawn in millimetres
FACES = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))


@dataclass(frozen=True, eq=False)
class RoomMesh:
    """Tetrahedra whose whole surface is made of named walls.

    Attributes
    ----------
    points : array (points, 3)
        Corners in m.
    tetrahedra : array (elements, 4)
        Numbers of their corners, rising.
    walls : mapping
        ``{name: array (triangles, 3)}``, numbers of corners, rising; in the order of the file.
    digest : str
        SHA-256 of the file's bytes.
    """

    points: Real
    tetrahedra: Numbers
    walls: Mapping[str, Numbers]
    digest: str

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RoomMesh) and other.digest == self.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @property
    def volumes(self) -> Real:
        """Volume of each tetrahedron, m^3."""
        corners = self.points[self.tetrahedra]
        return np.asarray(np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6)

    @property
    def volume(self) -> float:
        """Volume of the room, m^3."""
        return float(self.volumes.sum())

    @property
    def surface(self) -> float:
        """Area of all walls, m^2."""
        return float(sum(triangle_areas(self.points, t).sum() for t in self.walls.values()))

    @property
    def origin(self) -> Real:
        """Lowest coordinates, m."""
        return np.asarray(self.points.min(axis=0), dtype=float)

    @property
    def edges(self) -> Real:
        """Edges of the box around the room, m."""
        return np.asarray(np.ptp(self.points, axis=0), dtype=float)


def triangle_areas(points: Real, triangles: Numbers) -> Real:
    """Area of each triangle, m^2."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def read_room_mesh(path: Path) -> RoomMesh:
    """Read a mesh and make sure that it is a room.

    Any format that meshio reads and that names surfaces: Gmsh's physical surfaces, or sets of triangles.
    Quadratic elements are taken by their corners.

    Raises
    ------
    RequestError
        The file cannot be read, has no tetrahedra or no named surfaces, a hole, a wall inside the room,
        pieces that do not touch, or an impossible size.
    """
    raw = _load(path)
    name = path.name
    cells = [block.data[:, :4] for block in raw.cells if block.type.startswith("tetra")]
    if not sum(map(len, cells)):
        kinds = sorted({block.type for block in raw.cells})
        raise RequestError(
            f"the mesh {name} holds no tetrahedra, only {', '.join(kinds) or 'nothing'}",
            expected="the room's volume in tetrahedra and its walls as named surfaces of triangles",
            remedy="mesh the volume (gmsh -3) and save the physical volume too",
        )
    walls = _walls(raw, name)
    used, flat = np.unique(np.concatenate(cells), return_inverse=True)
    number = np.full(len(raw.points), -1)
    number[used] = np.arange(len(used))
    mesh = RoomMesh(
        np.asarray(raw.points, dtype=float)[used, :3],
        np.sort(flat.reshape(-1, 4), axis=1),
        {wall: np.sort(number[triangles], axis=1) for wall, triangles in walls.items()},
        hashlib.sha256(path.read_bytes()).hexdigest(),
    )
    _check_size(mesh, name)
    _check_walls(mesh, name)
    _check_whole(mesh, name)
    return mesh


def _load(path: Path) -> Any:
    meshio = library("meshio", "mesh")
    if not path.is_file():
        raise RequestError(f"the mesh {path} does not exist", remedy="check [room] mesh in the rig file")
    said = StringIO()
    try:
        with redirect_stdout(said):  # meshio prints what is wrong, and leaves
            return meshio.read(path)
    except (SystemExit, Exception) as fault:  # a reader may raise anything over a broken file
        text = " ".join(said.getvalue().split()) or str(fault) or type(fault).__name__
        raise RequestError(
            f"the mesh {path.name} cannot be read ({text})",
            expected="a mesh that meshio reads, such as Gmsh's .msh",
        ) from None


def _walls(raw: Any, name: str) -> dict[str, Numbers]:
    """Triangles of each named surface: Gmsh's physical groups, else sets of cells."""
    triangles = [i for i, block in enumerate(raw.cells) if block.type.startswith("triangle")]
    tags = raw.cell_data.get("gmsh:physical")
    if tags is not None:
        named = {wall: tag for wall, (tag, dimension) in raw.field_data.items() if dimension == 2}
        chosen = {wall: [np.asarray(tags[i]) == tag for i in triangles] for wall, tag in named.items()}
    else:
        chosen = {
            wall: [np.asarray([] if sets[i] is None else sets[i], dtype=int) for i in triangles]
            for wall, sets in raw.cell_sets.items()
        }
    walls = {}
    for wall, which in chosen.items():
        parts = [raw.cells[i].data[some, :3] for i, some in zip(triangles, which, strict=True)]
        if sum(map(len, parts)):
            walls[wall] = np.concatenate(parts).astype(np.int64)
    if not walls:
        raise RequestError(
            f"the mesh {name} has no named surfaces",
            expected="each wall a named surface",
            remedy='name them, in Gmsh by Physical Surface("floor") = {...}',
        )
    for wall in walls:
        if set(wall) & set(".@,="):
            raise RequestError(
                f"the surface {wall!r} of the mesh {name} has a name that cannot be used",
                expected="names without . @ , =",
                remedy="rename it",
            )
    return walls


def _check_size(mesh: RoomMesh, name: str) -> None:
    if mesh.edges.max() > LARGEST_M:
        large = " x ".join(f"{edge:.4g}" for edge in mesh.edges)
        raise RequestError(
            f"the mesh {name} is {large} m large",
            expected=f"coordinates in metres, at most {LARGEST_M:.0f} m",
            remedy="scale it if it was drawn in millimetres",
        )
    flat = int(np.count_nonzero(mesh.volumes < 1e-9 * np.median(mesh.volumes)))
    if flat:
        raise RequestError(
            f"{flat} tetrahedra of the mesh {name} have no volume", remedy="mesh the room again"
        )


def _check_walls(mesh: RoomMesh, name: str) -> None:
    """Every outer face must belong to one wall, and every wall's triangle must be an outer face."""
    faces, counts = np.unique(_faces(mesh.tetrahedra), axis=0, return_counts=True)
    if np.any(counts > 2):
        raise RequestError(f"tetrahedra of the mesh {name} overlap", remedy="mesh the room again")
    wall_of = dict.fromkeys(map(tuple, faces[counts == 1].tolist()), "")
    for wall, triangles in mesh.walls.items():
        for triangle in map(tuple, triangles.tolist()):
            if triangle not in wall_of:
                raise RequestError(
                    f"the surface {wall!r} of the mesh {name} has triangles that are no outer face of the room",
                    expected="named surfaces where the air ends",
                    remedy="name walls only, and cut from the volume what is not air",
                )
            if wall_of[triangle] not in ("", wall):
                raise RequestError(
                    f"a triangle of the mesh {name} belongs to {wall_of[triangle]!r} and to {wall!r}",
                    expected="each in one named surface",
                )
            wall_of[triangle] = wall
    bare = np.array([face for face, wall in wall_of.items() if not wall])
    if len(bare):
        area = triangle_areas(mesh.points, bare).sum()
        place = mesh.points[bare[0]].mean(axis=0).round(3).tolist()
        raise RequestError(
            f"the mesh {name} has a hole: {area:.3g} m² of its surface, at {place} m for one, are in no named surface",
            expected="a closed room whose every outer face belongs to a wall",
            remedy="name the surface that is missing, or close the gap in the volume",
        )


def _faces(tetrahedra: Numbers) -> Numbers:
    return np.asarray(tetrahedra[:, FACES].reshape(-1, 3))


def _check_whole(mesh: RoomMesh, name: str) -> None:
    """The tetrahedra must hang together by their faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, face = np.unique(_faces(mesh.tetrahedra), axis=0, return_inverse=True)
    element = np.repeat(np.arange(len(mesh.tetrahedra)), 4)
    shape = (len(mesh.tetrahedra), int(face.max()) + 1)
    touches = coo_array((np.ones(face.size), (element, face.ravel())), shape=shape).tocsr()
    pieces, _ = connected_components(touches @ touches.T, directed=False)
    if pieces > 1:
        raise RequestError(
            f"the mesh {name} consists of {pieces} pieces that do not touch",
            expected="one room",
            remedy="let the volumes share their common faces, or mesh one of them",
        )
