"""Poles of a box of which two modes along one axis change places within the band.

Between soft walls two wave numbers of an axis may become equal at a complex frequency near the band. There each of them
is a root of something, and neither is smooth. The sum over the modes of that axis is: its poles are the zeros of

    H(f) = F(w(f), a0(f), a1(f)),   w = L^2 (k^2 - q_m^2 - q_n^2),

the axis' characteristic function at what is left for it of the squared wave number, one function for each pair of modes
m, n along the other two axes. Nothing in it tells one mode of the soft axis from another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specan.room.model.axis_modes import AxisModes, axis_modes, characteristic, wall_slopes
from specan.room.model.frequency_interpolation import FrequencyInterpolation
from specan.room.model.resonances import (
    EVERY,
    EXACT,
    MOST_STEPS,
    SETTLED,
    SMOOTH,
    Resonances,
    Shapes,
    chebyshev,
    reach,
)

Complex = NDArray[np.complex128]

FARTHEST_START = 0.7  # half-widths of the band, from a line to where its tangent leads
FARTHEST = 4.0  # half-widths of the band from its middle: no pole there is of interest
ABOUT = (0.6, 1.0, 1.6)  # times the second pole of the mode without a node, where it is looked for
SAME = 1e-7  # half-widths: the same pole, found twice


def resonances_across(
    axes: tuple[AxisModes, AxisModes, AxisModes],
    few: FrequencyInterpolation,
    k2: Complex,
    soft: Complex,
    across: int,
    counts: Sequence[int],
    highest: float,
) -> Resonances | None:
    """Poles of the modes that may resonate in the band; None where what they leave is not smooth.

    Parameters
    ----------
    axes : three AxisModes
        At the few lines.
    few : FrequencyInterpolation
    k2 : array (lines,)
        Squared wave number, 1/m^2.
    soft : array (2, lines)
        ``j k beta L`` of the two walls of the soft axis.
    across : int
        Number of that axis.
    counts : sequence of int
        Modes along each edge among which they are.
    highest : float
        Wave number up to which a mode may resonate in the band, 1/m.
    """
    axis, (i, j) = axes[across], (n for n in range(3) if n != across)
    m, n = (order.ravel() for order in np.indices((counts[i], counts[j])))
    left = axes[i].q2[:, m] + axes[j].q2[:, n] - k2[few.chosen, None]
    least = np.min((axis.q2[:, :, None] + axes[i].q2[:, None, m] + axes[j].q2[:, None, n]).real, axis=(0, 1))
    m, n, left = m[least <= highest**2], n[least <= highest**2], left[:, least <= highest**2]
    families = _Families(
        few, axis, few.series @ left, few.series @ soft[:, few.chosen].T, complex(k2[few.chosen[0]])
    )
    pole, family, w, residue = families.poles(left)
    some = slice(few.looked_at.start, None, EVERY * few.looked_at.step)
    there = axis_modes(axis.length, soft[0, some], soft[1, some], axis.w.shape[1])
    beside = few.matrix[some] @ left
    seen, exact = (
        (1 / (modes.q2[:, :, None] + rest[:, None, :])).sum(axis=1)
        for modes, rest in ((there, beside), (axis, left))
    )
    of_poles = np.zeros((len(pole), left.shape[1]), dtype=complex)
    of_poles[np.arange(len(pole)), family] = residue
    curves = 1 / (few.place[:, None] - pole)
    off = few.matrix[some] @ (exact - curves[few.chosen] @ of_poles) - (seen - curves[some] @ of_poles)
    if np.any(np.max(np.abs(off), axis=0) > EXACT * np.max(np.abs(seen), axis=0)):
        return None
    values, _ = chebyshev(pole, len(few.chosen))
    weights = values @ few.series
    shapes_w: list[Complex] = [w, w, w]
    for other, order in ((i, m), (j, n)):
        shapes_w[other] = np.einsum("nk,kn->n", weights, axes[other].w[:, order[family]])
    a0 = tuple(weights @ np.broadcast_to(one.a0[:, 0], len(few.chosen)) for one in axes)
    lengths = tuple(one.length for one in axes)
    at_poles = Shapes(lengths, tuple(shapes_w), a0)
    empty = np.empty((len(few.chosen), 0), dtype=complex)
    others = Shapes(lengths, (empty, empty, empty), (empty, empty, empty))
    factors = np.empty((len(k2), 0), dtype=complex)
    orders = np.empty((3, len(pole)), dtype=np.intp)
    orders[i], orders[j] = m[family], n[family]
    # Along the soft axis a mode has no number of its own: that of the rigid axis which rings nearest.
    left_over = (np.sqrt(k2[few.chosen]) / (few.middle + few.half * few.place[few.chosen])).real.mean()
    along = (left_over * (few.middle + few.half * pole.real)) ** 2 - (np.pi / axes[i].length * m[family]) ** 2
    along -= (np.pi / axes[j].length * n[family]) ** 2
    orders[across] = np.round(np.sqrt(np.maximum(along, 0)) * axis.length / np.pi)
    return Resonances(few, at_poles, residue / at_poles.norm, curves, others, factors, orders=orders)


class _Families:
    """The functions H, one for each pair of modes along the other two axes, as series over the band."""

    def __init__(
        self, few: FrequencyInterpolation, axis: AxisModes, left: Complex, walls: Complex, k2: complex
    ) -> None:
        self.few, self.axis, self.left, self.walls, self.k2 = few, axis, left, walls, k2

    def poles(self, left: Complex) -> tuple[Complex, NDArray[np.intp], Complex, Complex]:
        """Zeros of H near the band: places, families, ``w`` there, and residues of ``1 / (K^2 - k^2)``."""
        here, family = self._starts(left)
        with np.errstate(all="ignore"):  # a start that leads far away is dropped
            for _ in range(MOST_STEPS):
                w, by_w, moved, bent = self._at(here, family)
                step = moved[0] / (by_w * bent + moved[1])
                here = here - step
                inside = np.abs(here) < FARTHEST
                here, family, step = here[inside], family[inside], step[inside]
                if np.max(np.abs(step), initial=0.0) < SETTLED:
                    break
        found = (np.abs(step) < 1e3 * SETTLED) & (reach(here) ** -float(len(self.left)) > SMOOTH)
        here, family = _once(here[found], family[found])
        w, by_w, moved, bent = self._at(here, family)
        # K^2 - k^2 = w_l / L^2 + left; along a mode w_l' = -(dF/da a') / F_w, and left' = -bent / L^2
        slope = (-moved[1] / by_w - bent) / self.axis.length**2
        return here, family, w, 1 / slope

    def _at(
        self, place: Complex, family: NDArray[np.intp]
    ) -> tuple[Complex, Complex, tuple[Complex, Complex], Complex]:
        """``w``, ``dF/dw``, (F, its change by the walls alone), and ``dw / dt`` at places of families."""
        values, slopes = chebyshev(place, len(self.left))
        scale = -(self.axis.length**2)
        own = self.left[:, family]
        w, bent = (scale * np.einsum("nk,kn->n", t, own) for t in (values, slopes))
        (a0, a1), (a0_slope, a1_slope) = ((t @ self.walls).T for t in (values, slopes))
        value, by_w = characteristic(w, a0, a1)
        by_a0, by_a1 = wall_slopes(w, a0, a1)
        return w, by_w, (value, by_a0 * a0_slope + by_a1 * a1_slope), bent

    def _starts(self, left: Complex) -> tuple[Complex, NDArray[np.intp]]:
        """Where tangents at the few lines lead, for every mode where that is nearest to its line; and f = 0."""
        few, axis = self.few, self.axis
        place = few.place[few.chosen]
        _, turn = chebyshev(place.astype(complex), len(place))
        walls = (turn @ self.walls).T[:, :, None]
        by_a0, by_a1 = wall_slopes(axis.w, axis.a0, axis.a1)
        _, by_w = characteristic(axis.w, axis.a0, axis.a1)
        w_slope = -(by_a0 * walls[0] + by_a1 * walls[1]) / by_w
        value = axis.q2[:, :, None] + left[:, None, :]
        slope = (w_slope / axis.length**2)[:, :, None] + (turn @ self.left)[:, None, :]
        way = -value / slope
        length = np.pad(np.abs(way), ((1, 1), (0, 0), (0, 0)), constant_values=np.inf)
        near = (length[1:-1] <= length[:-2]) & (length[1:-1] <= length[2:]) & (length[1:-1] < FARTHEST_START)
        line, _, family = np.nonzero(near)
        # The mode without a node has a pole at f = 0, and one where its K^2, in proportion to f there, meets k^2.
        lowest = few.middle + few.half * place[0]
        turned = 1 + value[0, np.argmin(np.abs(value[0, :, 0])), 0] / self.k2
        still = (np.append(lowest * turned * np.array(ABOUT), 0) - few.middle) / few.half
        return np.concatenate([place[line] + way[near], still]), np.append(
            family, np.zeros(still.size, dtype=int)
        )


def _once(place: Complex, family: NDArray[np.intp]) -> tuple[Complex, NDArray[np.intp]]:
    """Each pole of each family once."""
    same = (np.abs(place[:, None] - place) < SAME) & (family[:, None] == family)
    first = np.argmax(same, axis=1) == np.arange(len(place))
    return place[first], family[first]
