"""Meshes of rooms, made of small bricks and written as Gmsh writes them."""

import meshio
import numpy as np
import pytest
from skfem import MeshTet


class Bricks:
    """A room of tetrahedra on a grid: `keep` says which bricks are air, `names` how its faces are called."""

    def __init__(self, axes, keep=lambda centre: np.full(centre.shape[1], True), uneven=0.0):
        whole = MeshTet.init_tensor(*axes)
        moved = whole.p.copy()
        for axis, row in zip(axes, moved, strict=True):
            inner = ~np.isin(row, [axis[0], axis[-1]])
            row[inner] += uneven * np.diff(axis).min() * np.random.default_rng(7).uniform(-1, 1, inner.sum())
        chosen = keep(whole.p[:, whole.t].mean(axis=1))
        self.mesh = MeshTet(moved, whole.t[:, chosen]).remove_unused_nodes()
        faces = self.mesh.facets[:, self.mesh.boundary_facets()].T
        self.points, self.tetrahedra = self.mesh.p.T.copy(), self.mesh.t.T.copy()
        self.surfaces = {}
        for axis, grid in enumerate(axes):
            flat = np.ptp(self.points[faces][..., axis], axis=1) < 1e-9
            for place in grid:
                here = flat & (np.abs(self.points[faces][..., axis].mean(axis=1) - place) < 1e-9)
                if here.any():
                    number = {grid[0]: "0", grid[-1]: "1"}.get(place, "m")
                    self.surfaces["xyz"[axis] + number] = faces[here]

    def write(self, path):
        """Write the mesh with its named surfaces."""
        parts = list(self.surfaces.values())
        cells = [("triangle", part) for part in parts] + [("tetra", self.tetrahedra)]
        tags = [np.full(len(data), i + 1) for i, (_, data) in enumerate(cells)]
        names = {name: np.array([i + 1, 2]) for i, name in enumerate(self.surfaces)}
        content = meshio.Mesh(
            self.points,
            [cell for cell in cells if len(cell[1])],
            cell_data={k: [t for t in tags if len(t)] for k in ("gmsh:physical", "gmsh:geometrical")},
            field_data={**names, "air": np.array([len(cells), 3])} if names else {},
        )
        meshio.write(path, content, file_format="gmsh22", binary=False)
        return path


@pytest.fixture(scope="session")
def bricks():
    return Bricks
