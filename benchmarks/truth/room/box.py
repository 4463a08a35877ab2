"""The box as a grid in three directions: what its faces, discs and points are in terms of the nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, nearest
from truth.room.line import Line, Real, line

WALLS = ("x0", "x1", "y0", "y1", "z0", "z1")
_RINGS, _SPOKES = 10, 40  # quadrature of a disc


def axis_of(wall: str) -> int:
    """Axis that a wall is normal to: 0 for ``x0`` and ``x1``."""
    if wall not in WALLS:
        raise RequestError(f"there is no wall {wall!r}", remedy=nearest(wall, WALLS))
    return WALLS.index(wall) // 2


@dataclass(frozen=True)
class Disc:
    """A disc in a wall; `centre_m` is a point in the room whose coordinate along the wall's normal is not used."""

    wall: str
    centre_m: tuple[float, float, float]
    radius_m: float

    @property
    def area_m2(self) -> float:
        """Area."""
        return float(np.pi * self.radius_m**2)


class Box:
    """Nodes of the box, numbered with the last axis running fastest.

    Parameters
    ----------
    dims_m : tuple of float
        Edges.
    """

    def __init__(self, dims_m: tuple[float, float, float]) -> None:
        self.lines: tuple[Line, Line, Line] = (line(dims_m[0]), line(dims_m[1]), line(dims_m[2]))
        self.shape = (len(self.lines[0].nodes), len(self.lines[1].nodes), len(self.lines[2].nodes))
        x, y, z = (axis.weights for axis in self.lines)
        self.volume: Real = np.einsum("i,j,k->ijk", x, y, z)
        self._curvature = [axis.stiffness / axis.weights[:, None] for axis in self.lines]
        self._columns = [np.ascontiguousarray(matrix.T) for matrix in self._curvature]

    def minus_laplacian(self, field: Real) -> Real:
        """The weak form of minus the Laplacian with rigid walls, over the mass: one matrix an axis."""
        n, across, deep = self.shape
        result = field.reshape(-1, deep) @ self._columns[2]
        result = result.reshape(n, across * deep)
        result += self._curvature[0] @ field.reshape(n, across * deep)
        result = result.reshape(self.shape)
        result += np.matmul(self._curvature[1], field)
        return result

    def minus_laplacian_on(self, wall: str, values: Real) -> Real:
        """The same within a wall, for values at the nodes of `face`; nothing holds the edges."""
        first, second = (i for i in range(3) if i != axis_of(wall))
        grid = values.reshape(self.shape[first], self.shape[second])
        return (self._curvature[first] @ grid + grid @ self._columns[second]).ravel()

    def yield_of(self, shape: Real) -> float:
        """How far a static field gives way to a load, measured by the load itself: ``g K^-1 g``, no constant part.

        The stiffness is a sum of products, so that the shapes of the three edges solve it.
        """
        values, part = [], shape
        for number, axis in enumerate(self.lines):
            root = np.sqrt(axis.weights)
            eigenvalues, vectors = np.linalg.eigh(axis.stiffness / root[:, None] / root)
            values.append(eigenvalues)
            along = np.tensordot((vectors / root[:, None]).T, part, axes=(1, number))
            part = np.moveaxis(along, 0, number)
        total = values[0][:, None, None] + values[1][:, None] + values[2]
        total[0, 0, 0] = np.inf
        return float(np.sum(part**2 / total))

    def largest_eigenvalue(self) -> float:
        """Largest eigenvalue of `minus_laplacian`, 1/m^2: it limits the time step."""
        total = 0.0
        for axis in self.lines:
            root = np.sqrt(axis.weights)
            total += float(np.linalg.eigvalsh(axis.stiffness / root[:, None] / root)[-1])
        return total

    def at(self, position_m: Real) -> Real:
        """Interpolation from the nodes to points, shape (points, nodes)."""
        position = np.atleast_2d(position_m)
        x, y, z = (axis.basis(position[:, i]) for i, axis in enumerate(self.lines))
        return np.einsum("pi,pj,pk->pijk", x, y, z).reshape(len(position), -1)

    def face(self, wall: str) -> tuple[NDArray[np.intp], Real]:
        """Numbers of the nodes on a wall, and their integration weights, m^2."""
        axis = axis_of(wall)
        number = np.arange(self.volume.size).reshape(self.shape)
        nodes = np.take(number, -1 if wall.endswith("1") else 0, axis=axis).ravel()
        first, second = (self.lines[i].weights for i in range(3) if i != axis)
        return nodes, np.outer(first, second).ravel()

    def disc(self, disc: Disc) -> tuple[Real, Real]:
        """Quadrature over a disc: basis functions of the wall's nodes at its points, and weights, m^2.

        Gauss-Legendre in the square of the radius, equal angles: exact for polynomials far beyond the grid's.
        """
        axes = [i for i in range(3) if i != axis_of(disc.wall)]
        points, weights = np.polynomial.legendre.leggauss(_RINGS)
        radius = disc.radius_m * np.sqrt((points + 1.0) / 2.0)
        angle = 2.0 * np.pi * np.arange(_SPOKES) / _SPOKES
        first = disc.centre_m[axes[0]] + np.outer(radius, np.cos(angle)).ravel()
        second = disc.centre_m[axes[1]] + np.outer(radius, np.sin(angle)).ravel()
        basis = np.einsum("pi,pj->pij", self.lines[axes[0]].basis(first), self.lines[axes[1]].basis(second))
        share = np.repeat(weights / 2.0, _SPOKES) / _SPOKES
        return basis.reshape(len(first), -1), disc.area_m2 * share
