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
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.room.model.axis_modes import characteristic, norms, waves
from specan.room.model.modal_sum import Shapes
from specan.room.model.port import Port, point

AXES = "xyz"
LEANS = tuple(f"{a}{end} along {b}" for a in AXES for end in "01" for b in AXES if b != a)


class LeaningWall:
    """A wall that is turned about its middle.

    Parameters
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

    def __init__(
        self,
        name: str,
        slope: float,
        lengths: Sequence[float],
        k2: Complex,
        soft: Complex,
        w: Sequence[Complex],
    ) -> None:
        normal, along, far = AXES.index(name[0]), AXES.index(name[-1]), name[1] == "1"
        across = 3 - normal - along
        walls = soft.reshape(3, 2, -1, 1, 1) * np.reshape(lengths, (3, 1, 1, 1, 1))  # j k beta L
        # ``w`` of the waves of the plane along every edge: arrays that go with (lines, across, along)
        squares = [np.expand_dims(one, 1 if i == along else 2) for i, one in enumerate(w)]
        beside = k2[:, None, None] - squares[across] / lengths[across] ** 2
        squares[normal] = (beside - squares[along] / lengths[along] ** 2) * lengths[normal] ** 2
        first, second = (lengths[i] * norms(squares[i], walls[i, 0]) for i in (across, along))
        value, _ = characteristic(squares[normal], *walls[normal])
        # Pressure at the wall of a unit flow there, over the field's own function, m, and over the waves' norms.
        self._driven = lengths[normal] / -value / first / second
        displaced, sheared = _moments(squares[along].shape[2], lengths[along])
        matrix = slope * first[..., None] * (beside[..., None] * displaced - sheared)
        own = self._driven * waves(squares[normal], walls[normal, 0 if far else 1], 1.0)
        self._answer = matrix @ np.linalg.inv(np.eye(len(displaced)) - own[..., None] * matrix)
        self._origin, edges, a0 = np.zeros(3), list(lengths), list(walls[:, 0])
        if not far:  # along the normal the function that obeys the opposite wall
            self._origin[normal], edges[normal], a0[normal] = (
                lengths[normal],
                -lengths[normal],
                walls[normal, 1],
            )
        self._shapes, self._parts = Shapes(edges, squares, a0), dict[Port, Complex]()

    def change(self, source: Port, receivers: Sequence[Port]) -> Complex:
        """What its lean adds to couplings, array (lines, receivers)."""
        answer = (self._answer @ self._at(source)[..., None])[..., 0]
        return np.stack([np.sum(self._at(port) * answer, axis=(1, 2)) for port in receivers], axis=1)

    def _at(self, port: Port) -> Complex:
        """Parts of Green's function between a port and the wall's waves, array (lines, across, along)."""
        if port not in self._parts:
            moved = replace(port, position=point(np.array(port.position) - self._origin))
            self._parts[port] = self._driven * self._shapes.at(moved)
        return self._parts[port]


def _moments(count: int, edge: float) -> tuple[Real, Real]:
    """``int t c_m c_n``, and of the cosines' slopes ``int t c_m' c_n'``, with t the distance from the middle."""
    m, n = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")

    def cosine(number: NDArray[np.intp]) -> Real:  # int t cos(number pi z / L): nothing but for odd numbers
        odd = number % 2 == 1
        return np.where(odd, -2 * (edge / (np.pi * np.where(odd, number, 1))) ** 2, 0.0)

    sum_, difference = cosine(m + n), cosine(np.abs(m - n))
    return (difference + sum_) / 2, (np.pi / edge) ** 2 * m * n * (difference - sum_) / 2
