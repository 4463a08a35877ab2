"""A rigid object in the room: it takes away air that would be compressed, and air flows around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truth.room.box import Box
from truth.room.line import Real

_POINTS = 4  # of the quadrature along each edge of the object
_SHELLS = 2  # of mirror rooms around the room


@dataclass(frozen=True)
class Block:
    """A rigid body of the proportions of a box: centre and edges, m."""

    centre_m: tuple[float, float, float]
    edges_m: tuple[float, float, float]

    @property
    def volume_m3(self) -> float:
        """Volume of air that it displaces."""
        return float(np.prod(self.edges_m))

    @property
    def flow_factors(self) -> Real:
        """Displaced volume with the air that has to flow around, over the volume, for flow along each axis.

        That of the ellipsoid of the same proportions: ``1 / (1 - L_i)`` with the depolarisation factors
        ``L_i = (a b c / 2) int_0^inf ds / ((s + a_i^2) sqrt((s + a^2) (s + b^2) (s + c^2)))``
        (Lamb, Hydrodynamics, section 114); 3/2 for a cube or a ball.
        """
        from scipy.special import elliprd

        a, b, c = np.square(self.edges_m)
        scale = float(np.prod(self.edges_m)) / 3.0
        factors = scale * np.array([elliprd(b, c, a), elliprd(a, c, b), elliprd(a, b, c)])
        return 1.0 / (1.0 - factors)


class Obstacle:
    """What a block takes from the mass and the stiffness of the grid, as products of vectors over the nodes.

    The mean pressure over the block loses its volume, the mean gradient along each axis the volume times
    `flow_factors`. The grid resolves a part of the flow around the block itself; that part is taken off. What the walls
    near it mirror belongs to the room, and stays.
    """

    def __init__(self, box: Box, block: Block) -> None:
        points, weights = np.polynomial.legendre.leggauss(_POINTS)
        at = [
            centre + edge / 2.0 * points for centre, edge in zip(block.centre_m, block.edges_m, strict=True)
        ]
        means = [weights / 2.0 @ axis.basis(x) for axis, x in zip(box.lines, at, strict=True)]
        slopes = [weights / 2.0 @ axis.slopes(x) for axis, x in zip(box.lines, at, strict=True)]
        pressure = np.einsum("i,j,k->ijk", *means)
        gradient = [
            np.einsum("i,j,k->ijk", *(slopes[i] if i == axis else means[i] for i in range(3)))
            for axis in range(3)
        ]
        self.pressure = np.sqrt(block.volume_m3) * pressure.ravel()
        self.gradient = np.array(
            [
                np.sqrt(_taken(box.yield_of(shape) - mirrored, factor * block.volume_m3)) * shape.ravel()
                for shape, factor, mirrored in zip(
                    gradient, block.flow_factors, _mirrored(box, block), strict=True
                )
            ]
        )


def _taken(free_yield: float, wanted: float) -> float:
    """Coefficient in the grid's equation that gives the wanted one to whoever stands far away in free space."""
    return wanted / (1.0 + wanted * free_yield)


def _mirrored(box: Box, block: Block) -> Real:
    """Gradient along each axis at the block from the mirror images of a unit dipole there along that axis, 1/m^3.

    A static source at a distance d has the field ``1 / (4 pi |d|)``; rigid walls mirror its place, and the dipole along
    an axis turns round in a mirror across it.
    """
    edges, place = np.array([line.nodes[-1] for line in box.lines]), np.array(block.centre_m)
    total = np.zeros(3)
    for number in np.ndindex(*3 * [2 * _SHELLS + 1]):
        n = np.array(number) - _SHELLS
        if not n.any():
            continue
        turned = np.where(n % 2 == 0, 1.0, -1.0)
        away = place - (n * edges + np.where(n % 2 == 0, place, edges - place))
        distance = np.linalg.norm(away)
        total -= turned * (3.0 * away**2 / distance**5 - 1.0 / distance**3) / (4.0 * np.pi)
    return total
