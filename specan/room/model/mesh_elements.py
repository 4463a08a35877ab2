"""Finite elements on tetrahedra with flat faces: Lagrange polynomials of any degree, integrated exactly.

And where points lie among tetrahedra or triangles. Decisions: docs/decisions/mesh.md.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.room.model.mesh_file import Numbers, RoomMesh, triangle_areas


class Lagrange:
    """Lagrange polynomials on evenly spaced nodes of a simplex.

    Attributes
    ----------
    shares : array (nodes, corners)
        Barycentric coordinates of the nodes times the degree.
    """

    def __init__(self, degree: int, dimension: int) -> None:
        self.degree, self.dimension = degree, dimension
        powers = [p for p in product(range(degree + 1), repeat=dimension) if sum(p) <= degree]
        self.powers = np.array(powers)
        self.shares = np.column_stack([degree - self.powers.sum(axis=1), self.powers])
        self.coefficients = np.linalg.inv(_monomials(self.powers, self.powers / degree))

    def at(self, local: Real) -> Real:
        """Polynomials (points, nodes) at local coordinates (points, dimension)."""
        return _monomials(self.powers, local) @ self.coefficients

    def slopes_at(self, local: Real) -> Real:
        """Their slopes along each local coordinate, array (dimension, points, nodes)."""
        found = []
        for axis in range(self.dimension):
            lower = self.powers.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            found.append(self.powers[:, axis] * _monomials(lower, local) @ self.coefficients)
        return np.array(found)

    def integrals(self) -> tuple[Real, Real]:
        """``int u v`` (nodes, nodes) and ``int du/da dv/db`` (dimension, dimension, nodes, nodes)."""
        points, weights = _quadrature(self.degree + 1, self.dimension)
        value, slope = self.at(points), self.slopes_at(points)
        mass = np.einsum("p,pm,pn->mn", weights, value, value)
        return mass, np.einsum("p,apm,bpn->abmn", weights, slope, slope)


def _monomials(powers: Numbers, local: Real) -> Real:
    found: Real = np.prod(local[:, None, :] ** powers[None], axis=2)
    return found


def _quadrature(count: int, dimension: int) -> tuple[Real, Real]:
    """Gauss points of a cube drawn together to a simplex: exact to degree ``2 count - dimension``."""
    x, w = np.polynomial.legendre.leggauss(count + 1)
    grid = np.stack(np.meshgrid(*[(x + 1) / 2] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    weights = np.prod(np.stack(np.meshgrid(*[w / 2] * dimension, indexing="ij")), axis=0).ravel()
    points, left = np.empty_like(grid), np.ones(len(grid))
    for axis in range(dimension):
        points[:, axis] = grid[:, axis] * left
        weights = weights * left
        left = left * (1 - grid[:, axis])
    return points, weights


class Elements:
    """A room's mesh with elements of one degree: its matrices, and its functions at any point.

    Attributes
    ----------
    along, stiffness, mass : sparse arrays
        ``int du/da dv/da`` for each axis, their sum, and ``int u v`` over the room.
    walls : list of sparse arrays
        ``int u v`` over each wall.
    """

    def __init__(self, mesh: RoomMesh, degree: int) -> None:
        self.inside, on_wall = Lagrange(degree, 3), Lagrange(degree, 2)
        corners = mesh.points[mesh.tetrahedra]
        self.origin, self.edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
        cells = [mesh.tetrahedra, *mesh.walls.values()]
        self.size, (self.numbers, *walls) = _number(cells, [self.inside, *[on_wall] * len(mesh.walls)])
        mass, slopes = self.inside.integrals()
        volume = np.abs(np.linalg.det(self.edges))
        back = np.linalg.inv(self.edges)  # (elements, axis, local): d(local)/d(axis)
        metrics = np.einsum("e,exa,exb->xeab", volume, back, back)
        self.along = [
            self._matrix(self.numbers, np.einsum("eab,abmn->emn", metric, slopes)) for metric in metrics
        ]
        self.stiffness = sum(self.along[1:], self.along[0])
        self.mass = self._matrix(self.numbers, volume[:, None, None] * mass)
        flat, _ = on_wall.integrals()
        self.walls = [
            self._matrix(numbers, 2 * triangle_areas(mesh.points, triangles)[:, None, None] * flat)
            for numbers, triangles in zip(walls, mesh.walls.values(), strict=True)
        ]

    def _matrix(self, numbers: Numbers, blocks: Real) -> Any:
        """Sum of the elements' matrices (elements, nodes, nodes)."""
        from scipy.sparse import coo_array

        rows = np.broadcast_to(numbers[:, :, None], blocks.shape)
        columns = np.broadcast_to(numbers[:, None, :], blocks.shape)
        where = (rows.ravel(), columns.ravel())
        return coo_array((blocks.ravel(), where), shape=(self.size, self.size)).tocsc()

    def functions_at(self, elements: Numbers, points: Real, slope: int | None = None) -> tuple[Numbers, Real]:
        """Numbers and values (points, nodes) of the functions, or of their slopes along one axis."""
        edges = self.edges[elements]
        away = (points - self.origin[elements])[..., None]
        local = np.linalg.solve(edges.transpose(0, 2, 1), away)[..., 0].astype(float)
        if slope is None:
            return self.numbers[elements], self.inside.at(local)
        back = np.linalg.inv(edges)[:, slope, :].astype(float)
        return self.numbers[elements], np.einsum("pa,apn->pn", back, self.inside.slopes_at(local))


def _number(cells: list[Numbers], shapes: list[Lagrange]) -> tuple[int, list[Numbers]]:
    """One number for each node, shared by all cells that touch it; a node is known by its corners' shares."""
    keys = []
    for corners, shape in zip(cells, shapes, strict=True):
        code = corners[:, None, :] * (shape.degree + 1) + shape.shares
        code = np.where(shape.shares > 0, code, -1)
        wide = np.full((*code.shape[:2], 4), -1)
        wide[..., : code.shape[2]] = code
        keys.append(np.sort(wide, axis=2).reshape(-1, 4))
    unique, flat = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
    ends = np.cumsum([len(key) for key in keys])[:-1]
    parts = np.split(flat.ravel(), ends)
    return len(unique), [part.reshape(len(c), -1) for part, c in zip(parts, cells, strict=True)]


class Simplices:
    """Triangles or tetrahedra in space, for finding the one that holds a point.

    Parameters
    ----------
    corners : array (simplices, 3 or 4, 3)
        Their corners, m.
    """

    NEIGHBOURS = 32

    def __init__(self, corners: Real) -> None:
        from scipy.spatial import KDTree

        self.corners = corners
        self.inverse = np.linalg.pinv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
        self.tree = KDTree(corners.mean(axis=1))

    @property
    def normals(self) -> Real:
        """Of triangles, twice as long as their areas, array (triangles, 3)."""
        a, b, c = self.corners.transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    def circle(self, number: int, count: int) -> Real:
        """Unit vectors (count, 3) all round in the plane of a triangle."""
        a, b, c = self.corners[number]
        across = (b - a) / np.linalg.norm(b - a)
        along = c - a - (c - a) @ across * across
        angle = 2 * np.pi * (np.arange(count) + 0.5) / count
        return np.outer(np.cos(angle), across) + np.outer(np.sin(angle), along / np.linalg.norm(along))

    def nearest(self, points: Real) -> tuple[Numbers, Real, Real]:
        """Simplex, the place in it, and the distance from there, for each point (points, 3).

        A point inside a simplex has no distance. Of those outside, the place is near the closest one: the
        barycentric coordinates without their negative parts.
        """
        count = min(self.NEIGHBOURS, len(self.corners))
        near = self.tree.query(points, k=[*range(1, count + 1)])[1]
        number, place, distance = self._best(points, near)
        far = np.flatnonzero(distance > 1e-9)  # a long simplex may have its centre far away
        for i in far:
            alone = points[i : i + 1]
            number[i], place[i], distance[i] = (
                found[0] for found in self._best(alone, np.arange(len(self.corners))[None])
            )
        return number, place, distance

    def _best(self, points: Real, candidates: Numbers) -> tuple[Numbers, Real, Real]:
        corners = self.corners[candidates]
        away = points[:, None] - corners[:, :, 0]
        rest = np.einsum("pcij,pcj->pci", self.inverse[candidates], away)
        share = np.concatenate([1 - rest.sum(axis=2, keepdims=True), rest], axis=2).clip(min=0)
        share /= share.sum(axis=2, keepdims=True)
        place = np.einsum("pck,pckj->pcj", share, corners)
        distance = np.linalg.norm(points[:, None] - place, axis=2)
        best = distance.argmin(axis=1)
        rows = np.arange(len(points))
        return candidates[rows, best], place[rows, best], distance[rows, best]
