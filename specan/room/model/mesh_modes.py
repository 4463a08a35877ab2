"""What a room from a mesh is reduced to: its rigid-wall modes, what walls add to them, and the near field.

The finite-element solution ``(K - k^2 M + j k sum_w beta_w B_w) p = s`` is projected on

- the modes of the rigid room up to `MARGIN` times the band's wave number,
- the room's answer to what these modes do at each wall: ``(K - k0^2 M)^-1 B_w phi``. Rigid modes alone have
  no slope at a wall and would follow a soft one slowly.

Both are made orthonormal by Ritz's method, so that the projected stiffness and mass are diagonal. What a
source has beyond (its near field) is added for rigid walls, as a polynomial in ``k^2``.

Decisions: docs/decisions/mesh.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import ComputationError
from specan.room.model.mesh_elements import Elements, Simplices
from specan.room.model.mesh_file import RoomMesh, triangle_areas
from specan.room.model.port import Port, ball_mean

MARGIN = 1.6  # largest wave number of the modes over that of the band
_TERMS = 4  # of the near field's polynomial
_TRACE = 1e-3  # a combination of modes that a wall feels less than this, of the most, is left out


@dataclass(eq=False)
class MeshModes:
    """A reduced room.

    Attributes
    ----------
    mesh : RoomMesh
    k_max : float
        Largest wave number for which it holds, 1/m.
    values : array (n,)
        Squared wave numbers of the modes and Ritz vectors, 1/m^2.
    vectors : array (unknowns, n)
        Orthonormal in the mass.
    exact : int
        How many of them are modes of the rigid room; the others carry the walls' answer.
    walls : array (walls, n, n)
        Boundary mass of each wall between them, 1/m.
    along : array (3, n, n)
        Part of the stiffness that slopes along each axis have; their sum is diagonal, `values`.
    shift : float
        Squared wave number about which near fields are expanded, 1/m^2.
    """

    mesh: RoomMesh
    k_max: float
    values: Real
    vectors: Real
    exact: int
    walls: Real
    along: Real
    shift: float
    _elements: Elements
    _solve: Any

    def __post_init__(self) -> None:
        corners = self.mesh.points
        self._room = Simplices(corners[self.mesh.tetrahedra])
        self._skin = {name: Simplices(corners[t]) for name, t in self.mesh.walls.items()}
        skin = np.concatenate(list(self.mesh.walls.values()))
        self._weights = lru_cache(maxsize=4096)(self._found_weights)
        self._near = lru_cache(maxsize=64)(self._answers)
        self._edge = float(np.sqrt(2 * np.median(triangle_areas(corners, skin))))

    @property
    def top(self) -> float:
        """Edge of the cube of wave numbers that is as large as the octant of those of the modes, 1/m."""
        return MARGIN * self.k_max * float(np.cbrt(np.pi / 6))

    def at(self, port: Port) -> Real:
        """Mean of each vector over a port, array (n,); beyond the walls that of the nearest place."""
        numbers, weights = self._weights(port)
        found: Real = weights @ self.vectors[numbers]
        return found * ball_mean(self.values, port.radius).real if port.ball else found

    def wall_place(self, wall: str, across: float, along: float) -> Real:
        """The point of a wall nearest to a place in parts of the rectangle around it."""
        corners = self._skin[wall].corners
        first = int(np.argmax(np.abs(self._skin[wall].normals).sum(axis=0)))
        target = corners.reshape(-1, 3).mean(axis=0)
        for axis, part in zip((i for i in range(3) if i != first), (across, along), strict=True):
            low, high = corners[..., axis].min(), corners[..., axis].max()
            target[axis] = low + part * (high - low)
        return self.in_wall(wall, target)

    def in_wall(self, wall: str, position: Real) -> Real:
        """The point of a wall nearest to a place."""
        found: Real = self._skin[wall].nearest(position[None])[1][0]
        return found

    def facing(self) -> Real:
        """Mean square of each wall's normal along each axis, array (walls, 3)."""
        found = []
        for skin in self._skin.values():
            size = np.linalg.norm(skin.normals, axis=1)
            found.append((skin.normals**2 / size[:, None]).sum(axis=0) / size.sum())
        return np.array(found)

    def near_field(self, source: Port, receivers: Sequence[Port]) -> tuple[Real, Real]:
        """What the vectors lack of a coupling, for receivers that are no balls.

        Returns
        -------
        rigid : array (terms, receivers)
            Coefficients over ``k^2 - shift`` between rigid walls.
        soft : array (walls, receivers)
            Change by ``j k beta`` of each wall, to first order.
        """
        rigid, soft, own = self._near(source)
        found = np.zeros((len(rigid), len(receivers))), np.zeros((len(soft), len(receivers)))
        for i, port in enumerate(receivers):
            numbers, weights = self._weights(port)
            for column, terms in zip(found, (rigid, soft), strict=True):
                column[:, i] = weights @ terms[:, numbers].T
            if port == source:
                found[0][0, i] = own
        return found

    def _own(self, port: Port) -> float:
        """A port's coupling with itself at the shift; of a patch too small for the elements, from a larger one.

        About its own centre a patch sees a half-space: the mean of ``cos(k r) / (2 pi r)`` over two points
        of a disc, ``8 / (3 pi^2 a) - k^2 a 128 / (180 pi^2)`` to second order.
        """
        large = Port(port.position, port.axis, max(port.radius, self._edge) if port.radius else 0.0)
        load = self._load(large)
        found = load @ self._quasi_static(load, 1)[0] + self._own_part(large) - self._own_part(port)
        if port.radius:
            found += 8 / (3 * np.pi**2) * (1 / port.radius - 1 / large.radius)
            found -= self.shift * 128 / (180 * np.pi**2) * (port.radius - large.radius)
        return float(found)

    def _own_part(self, port: Port) -> float:
        return float((self.at(port) ** 2 / (self.values - self.shift)).sum())

    def _answers(self, source: Port) -> tuple[Real, Real, float]:
        """Near field of a port at every unknown: between rigid walls, and its change by each wall; and at itself.

        A wall acts on the near field and on what the vectors beyond the band hold of it; both are static
        enough for first order. What the modes of the band do at a wall, the vectors know already.
        """
        load = self._load(source)
        rigid = self._quasi_static(load, _TERMS)
        high = self.values > 1.05 * self.k_max**2
        vectors, gap = self.vectors[:, high], self.values[high] - self.shift
        pushing = rigid[0] + vectors @ (load @ vectors / gap)
        soft = [
            self._quasi_static(wall @ pushing, 1)[0] + vectors @ ((wall @ rigid[0]) @ vectors / gap)
            for wall in self._elements.walls
        ]
        return rigid, -np.array(soft), self._own(source)

    def _quasi_static(self, load: Real, terms: int) -> Real:
        """``(G M)^j G s`` at the shift, without the part that the vectors have; array (terms, unknowns)."""
        modes, ritz = self.vectors[:, : self.exact], self.vectors[:, self.exact :]
        gap = self.values[self.exact :] - self.shift
        mass = self._elements.mass
        share = load @ ritz
        right = load - mass @ (modes @ (load @ modes))
        found = []
        for power in range(1, terms + 1):
            answer = self._solve(right)
            answer -= modes @ (modes.T @ (mass @ answer))
            found.append(answer - ritz @ (share / gap**power))
            right = mass @ answer
        return np.array(found)

    def _load(self, port: Port) -> Real:
        numbers, weights = self._weights(port)
        found: Real = np.bincount(numbers, weights, minlength=self._elements.size).astype(float)
        return found

    def _found_weights(self, port: Port) -> tuple[NDArray[np.int64], Real]:
        """Unknowns and weights that average over a port."""
        points, weights = np.array([port.position]), np.ones(1)
        if port.radius and not port.ball:
            points, weights = self._disc(port)
        element, place, _ = self._room.nearest(points)
        numbers, values = self._elements.functions_at(element, place, port.slope)
        return numbers.ravel(), (weights[:, None] * values).ravel()

    def _disc(self, port: Port) -> tuple[Real, Real]:
        """Points and weights (sum 1) of a quadrature over a patch in the plane of the nearest wall."""
        centre = np.array(port.position)
        skin = min(self._skin.values(), key=lambda s: s.nearest(centre[None])[2][0])
        out = skin.circle(int(skin.nearest(centre[None])[0][0]), 24)
        part, weight = np.polynomial.legendre.leggauss(10)
        radius = port.radius * (part + 1) / 2
        points = centre + (radius[:, None, None] * out).reshape(-1, 3)
        weights = np.repeat(weight * radius, len(out))
        return points, weights / weights.sum()


def expected_modes(mesh: RoomMesh, k: float) -> float:
    """About how many modes a rigid room has up to a wave number: Weyl's law with its surface term."""
    return mesh.volume * k**3 / (6 * np.pi**2) + mesh.surface * k**2 / (16 * np.pi) + 1


@lru_cache(maxsize=3)
def reduce(mesh: RoomMesh, degree: int, k_max: float) -> MeshModes:
    """Solve for the modes and the walls' answers.

    Raises
    ------
    ComputationError
        The modes are not found.
    """
    from scipy.sparse.linalg import splu

    elements = Elements(mesh, degree)
    top = (MARGIN * k_max) ** 2
    shift = 0.5 * k_max**2  # the near field is expanded about it
    matrix = (elements.stiffness - shift * elements.mass).tocsc()
    factors = splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
    )
    values, modes = _modes(elements, factors.solve, shift, top, expected_modes(mesh, MARGIN * k_max))
    answers = _wall_answers(elements, factors.solve, modes, values, k_max)
    ritz_values, ritz = _ritz(elements, modes, answers)
    vectors = np.column_stack([modes, ritz])
    walls, along = (
        np.array([vectors.T @ (part @ vectors) for part in parts])
        for parts in (elements.walls, elements.along)
    )
    return MeshModes(
        mesh,
        k_max,
        np.concatenate([values, ritz_values]),
        vectors,
        len(values),
        walls,
        along,
        shift,
        elements,
        factors.solve,
    )


def _modes(elements: Elements, solve: Any, shift: float, top: float, expected: float) -> tuple[Real, Real]:
    """All modes up to `top`, by shift-invert about a place between them."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    inverse = LinearOperator(elements.mass.shape, solve, dtype=float)
    start = np.ones(elements.size) + np.linspace(0, 1, elements.size)  # the same each time
    count = int(1.1 * expected) + 8
    while count < elements.size - 1:
        try:
            values, vectors = eigsh(
                elements.stiffness, k=count, M=elements.mass, sigma=shift, OPinv=inverse, v0=start
            )
        except ArpackError as fault:
            raise ComputationError(
                f"the modes of the mesh are not found ({fault})", remedy="mesh the room again, more evenly"
            ) from None
        if values.max() > top:  # those nearest to the shift reach beyond the range
            inside = np.flatnonzero(values <= top)
            order = inside[np.argsort(values[inside])]
            return values[order], vectors[:, order]
        count = int(1.3 * count) + 8
    raise ComputationError(
        f"the mesh has {elements.size} unknowns, too few for about {expected:.0f} modes", remedy="refine it"
    )


def _wall_answers(elements: Elements, solve: Any, modes: Real, values: Real, k_max: float) -> Real:
    """The room's answer to what its modes do at each wall; the modes' part is taken out."""
    band = modes[:, values <= 1.05 * k_max**2]
    found = []
    for wall in elements.walls:
        pushed = wall @ band
        strength, mix = np.linalg.eigh(band.T @ pushed)
        felt = strength > _TRACE * strength[-1]
        answer = solve(np.ascontiguousarray(pushed @ (mix[:, felt] / np.sqrt(strength[felt]))))
        found.append(answer - modes @ (modes.T @ (elements.mass @ answer)))
    return np.column_stack(found)


def _ritz(elements: Elements, modes: Real, answers: Real) -> tuple[Real, Real]:
    """Orthonormal combinations of the answers that make stiffness and mass diagonal."""
    answers = answers - modes @ (modes.T @ (elements.mass @ answers))
    size, mix = np.linalg.eigh(answers.T @ (elements.mass @ answers))
    kept = size > 1e-8 * size[-1]
    basis = answers @ (mix[:, kept] / np.sqrt(size[kept]))
    values, turn = np.linalg.eigh(basis.T @ (elements.stiffness @ basis))
    return values, basis @ turn
