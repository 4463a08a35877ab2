"""Where points lie among tetrahedra or triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Numbers = NDArray[np.int64]


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
