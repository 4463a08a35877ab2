"""Walls that lean: what a wall that stands a little elsewhere than that of a box makes of the box's field.

A wall that is displaced outwards by ``h(y, z)`` asks of the field on the plane where it should be, to first order,

    dp/dn + j k beta p = h k^2 p + div_t (h grad_t p)

(Taylor's series about the plane; Morse & Feshbach, Methods of Theoretical Physics, 9.2). It is a surface that answers
to the pressure. With S the matrix of the right side over the plane's waves ``Y_m Z_n``, ``gamma`` the parts of Green's
function of the box there and D those of the plane with itself, all modes along the normal summed in closed form,

    G' = G + gamma(r) S (1 - D S)^-1 gamma(s).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.room.model.axis_modes import characteristic, norms, waves
from specan.room.model.port import Port, point
from specan.room.model.shapes import Shapes

AXES = "xyz"
LEANS = tuple(f"{a}{end} along {b}" for a in AXES for end in "01" for b in AXES if b != a)


@dataclass(eq=False)
class LeaningWall:
    """A wall that is turned about its middle.

    Attributes
    ----------
    name : str
        Of `LEANS`: the wall, and the edge along which its distance changes.
    slope : float
        Displacement outwards a metre of that edge.
    lengths : three floats
        Edges of the box, m.
    k2 : array (lines,)
        Squared wave number, 1/m^2.
    soft : array (6, lines)
        ``j k beta`` of the walls, 1/m.
    w : three arrays (lines, n)
        Squared dimensionless wave numbers of the box along its edges.
    """

    name: str
    slope: float
    lengths: tuple[float, float, float]
    k2: Complex
    soft: Complex
    w: Sequence[Complex]
    _parts: dict[Port, Complex] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.normal, self.along = AXES.index(self.name[0]), AXES.index(self.name[-1])
        self.far = self.name[1] == "1"
        self.across = 3 - self.normal - self.along

    def change(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """What its lean adds to couplings, array (lines, receivers)."""
        answer = (self._answer @ self._at(source)[..., None])[..., 0]
        return np.stack([np.sum(self._at(port) * answer, axis=(1, 2)) for port in receivers], axis=1)

    @cached_property
    def _walls(self) -> list[tuple[Complex, Complex]]:
        """``j k beta L`` of both walls of every edge, arrays (lines, 1, 1)."""
        return [
            (self.soft[2 * i][:, None, None] * length, self.soft[2 * i + 1][:, None, None] * length)
            for i, length in enumerate(self.lengths)
        ]

    @cached_property
    def _squares(self) -> list[Complex]:
        """``w`` of the waves of the plane along every edge, arrays that go with (lines, across, along)."""
        across, along = self.w[self.across][:, :, None], self.w[self.along][:, None, :]
        plane = across / self.lengths[self.across] ** 2 + along / self.lengths[self.along] ** 2
        normal = (self.k2[:, None, None] - plane) * self.lengths[self.normal] ** 2
        found = {self.across: across, self.along: along, self.normal: normal}
        return [found[i] for i in range(3)]

    @cached_property
    def _driven(self) -> Complex:
        """Pressure at the wall of a unit flow there, over the field's own function, m, and over the waves' norms."""
        value, _ = characteristic(self._squares[self.normal], *self._walls[self.normal])
        size = self.lengths[self.normal] / -value
        for i in (self.across, self.along):
            size = size / (self.lengths[i] * norms(self._squares[i], self._walls[i][0]))
        return np.asarray(size)

    def _at(self, port: Port) -> Complex:
        """Parts of Green's function between a port and the wall's waves, array (lines, across, along)."""
        if port not in self._parts:
            lengths, place = list(self.lengths), np.array(port.position)
            a0 = [walls[0] for walls in self._walls]
            if not self.far:  # along the normal the function that obeys the opposite wall
                place[self.normal] -= lengths[self.normal]
                lengths[self.normal], a0[self.normal] = -lengths[self.normal], self._walls[self.normal][1]
            moved = replace(port, position=point(place))
            self._parts[port] = self._driven * Shapes(lengths, self._squares, a0).at(moved)
        return self._parts[port]

    @cached_property
    def _answer(self) -> Complex:
        """``S (1 - D S)^-1``, array (lines, across, along, along)."""
        edge, across = self.lengths[self.along], self._squares[self.across]
        displaced, sheared = _moments(self._squares[self.along].shape[2], edge)
        plane = self.k2[:, None, None] - across / self.lengths[self.across] ** 2
        norm = self.lengths[self.across] * norms(across, self._walls[self.across][0])
        matrix = self.slope * norm[..., None] * (plane[..., None] * displaced - sheared)
        normal = self._walls[self.normal]
        own = self._driven * waves(self._squares[self.normal], normal[0 if self.far else 1], 1.0)
        return matrix @ np.linalg.inv(np.eye(len(displaced)) - own[..., None] * matrix)


def _moments(count: int, edge: float) -> tuple[Real, Real]:
    """``int t c_m c_n``, and of the cosines' slopes ``int t c_m' c_n'``, with t the distance from the middle."""
    m, n = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")

    def cosine(number: NDArray[np.intp]) -> Real:  # int t cos(number pi z / L): nothing but for odd numbers
        odd = number % 2 == 1
        return np.where(odd, -2 * (edge / (np.pi * np.where(odd, number, 1))) ** 2, 0.0)

    sum_, difference = cosine(m + n), cosine(np.abs(m - n))
    return (difference + sum_) / 2, (np.pi / edge) ** 2 * m * n * (difference - sum_) / 2
