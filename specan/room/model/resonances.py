"""Modes that resonate in the band as poles, what is left of the modal sum from few lines.

A mode is ``Psi(r) Psi(s) / (Lambda (K^2 - k^2))``. All of it but the resonance varies slowly with frequency. With the
pole ``p`` of the last factor, its residue ``R`` and the shapes there,

    G(f) = sum_N a_N / (f - p_N) + smooth(f),   a_N = R Psi(r) Psi(s) / Lambda at p_N,

where the smooth part follows from the exact sum at few lines. At all lines a coupling is one matrix product. A mode
whose rest is not smooth (the one without a node, whose pole is at no frequency; two that are about to change places)
is summed at every line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Flags, Real
from specan.room.model.axis_modes import AxisModes
from specan.room.model.frequency_interpolation import LOOKED_AT, FrequencyInterpolation, mixed
from specan.room.model.modal_sum import Shapes
from specan.room.model.port import Port

MOST_STEPS = 12  # of Newton's iteration: quadratic, so a mode that takes more has no pole near the band
SETTLED = 1e-12  # half-widths of the band
SMOOTH = 1e-11  # what a polynomial through the few lines may lack of a pole that stays in the smooth part
EVERY = 4  # of the lines that are looked at
EXACT = 1e-9  # part of a mode's largest value to which its smooth rest must follow from the few lines


@dataclass(frozen=True, eq=False)
class Resonances:
    """Poles of a box, and modes that are summed at every line.

    Attributes
    ----------
    poles : Shapes
        At their poles, arrays (modes,).
    residue : array (modes,)
        Of ``1 / (K^2 - k^2)``, over the shapes' norms.
    curves : array (lines, modes)
        ``1 / (f - p)``.
    others : Shapes
        At the few lines, arrays (few, modes).
    factors : array (lines, modes)
        ``1 / (K^2 - k^2)`` of the others.
    """

    few: FrequencyInterpolation
    poles: Shapes
    residue: Complex
    curves: Complex
    others: Shapes
    factors: Complex

    def everywhere(self, source: Port, receivers: Sequence[Port], exact: Complex) -> Complex:
        """Couplings (lines, receivers) from the exact ones at the few lines (few, receivers)."""
        size = (self.residue * self.poles.at(source))[:, None] * self.poles.at_all(receivers)
        smooth = exact - self.curves[self.few.chosen] @ size
        if not self.factors.shape[1]:
            return self.curves @ size + self.few.everywhere(smooth)
        own = (self.others.at(source) / self.others.norm)[..., None] * self.others.at_all(receivers)
        smooth -= np.einsum("fn,fnr->fr", self.factors[self.few.chosen], own)
        beside = np.einsum("fn,fnr->fr", self.factors, self.few.everywhere(own))
        return np.asarray(self.curves @ size + beside + self.few.everywhere(smooth))


def resonances(
    axes: tuple[AxisModes, ...],
    few: FrequencyInterpolation,
    k2: Complex,
    counts: Sequence[int],
    highest: float,
    moved: tuple[NDArray[np.intp], Complex] | None = None,
) -> Resonances:
    """Poles of the modes that may resonate in the band.

    Parameters
    ----------
    axes : three AxisModes
        At the few lines.
    few : FrequencyInterpolation
    k2 : array (lines,)
        Squared wave number, 1/m^2.
    counts : sequence of int
        Modes along each edge among which they are.
    highest : float
        Wave number up to which a mode may resonate in the band, 1/m.
    moved : array of int (3, n) and array (n,), optional
        See `Modes`.
    """
    orders = np.indices(tuple(counts)).reshape(3, -1)
    distance = _distance(axes, orders) - k2[few.chosen, None]
    more = np.zeros(len(orders[0]), dtype=complex)
    if moved is not None:
        within = np.all(np.array(counts) > moved[0].T, axis=1)
        more[np.ravel_multi_index(tuple(moved[0][:, within]), tuple(counts))] = moved[1][within]
        distance = distance + more
    near = np.min((distance + k2[few.chosen, None]).real, axis=0) <= highest**2
    orders, distance, more = orders[:, near], distance[:, near], more[near]
    pole, slope, found = _poles(few, distance, k2[few.chosen])
    residue = np.where(found, 1 / slope, 0)
    some = slice(LOOKED_AT.start, None, EVERY * LOOKED_AT.step)
    there = _distance(axes, orders, few.matrix[some]) - k2[some, None] + more
    exact, seen = 1 / distance, 1 / there
    rest = exact - residue / (few.place[few.chosen, None] - pole)
    off = mixed(few.matrix[some], rest) - (seen - residue / (few.place[some, None] - pole))
    smooth = np.max(np.abs(off), axis=0) <= EXACT * np.max(np.abs(seen), axis=0)
    kept, left = smooth & found, ~smooth
    values, _ = chebyshev(pole[kept], len(few.chosen))
    weights = values @ few.series  # from the few lines to the poles
    w = [np.einsum("nk,kn->n", weights, axis.w[:, n]) for axis, n in zip(axes, orders[:, kept], strict=True)]
    a0 = [weights @ np.broadcast_to(axis.a0[:, 0], len(few.chosen)) for axis in axes]
    poles = Shapes([axis.length for axis in axes], w, a0)
    others = Shapes.of(axes, orders[:, left])
    return Resonances(
        few,
        poles,
        residue[kept] / poles.norm,
        1 / (few.place[:, None] - pole[kept]),
        others,
        1 / (_distance(axes, orders[:, left], few.matrix) - k2[:, None] + more[left]),
    )


def _distance(axes: Sequence[AxisModes], orders: NDArray[np.intp], matrix: Real | None = None) -> Complex:
    """Squared wave numbers K^2 of modes at the few lines, or at others, array (lines, modes)."""
    squares = (axis.q2[:, : n.max(initial=0) + 1] for axis, n in zip(axes, orders, strict=True))
    x, y, z = (q2 if matrix is None else mixed(matrix, q2) for q2 in squares)
    return np.asarray(x[:, orders[0]] + y[:, orders[1]] + z[:, orders[2]])


def _poles(few: FrequencyInterpolation, distance: Complex, k2: Complex) -> tuple[Complex, Complex, Flags]:
    """Zeros of ``K^2 - k^2`` by Newton's method, the slopes there, and which are near the band."""
    series = mixed(few.series, distance)
    place = few.place[few.chosen]
    frequency = few.middle + few.half * place
    speed = np.sqrt(k2) / frequency
    start = np.sqrt((distance + k2[:, None])[len(k2) // 2]) / speed[len(k2) // 2]
    line = np.clip(np.searchsorted(frequency, start.real), 0, len(k2) - 1)
    start = np.sqrt(distance[line, np.arange(len(line))] + k2[line]) / speed[line]
    here = (start - few.middle) / few.half + 0j
    for _ in range(MOST_STEPS):
        polynomials = chebyshev(here, len(series))  # each series (terms, modes) at a place of its own
        value, slope = (np.einsum("nk,kn->n", one, series) for one in polynomials)
        step = value / slope
        here = here - step
        if np.max(np.abs(step), initial=0.0) < SETTLED:
            break
    found = (np.abs(step) < 1e3 * SETTLED) & (reach(here) ** -float(len(k2)) > SMOOTH)
    return np.where(found, here, 2j), slope, found


def reach(place: Complex) -> Real:
    """Half the sum of the axes of the ellipse with the foci -1 and 1 through a place (Bernstein)."""
    return np.abs(place + np.sqrt(place - 1) * np.sqrt(place + 1))


def chebyshev(place: Complex, count: int) -> tuple[Complex, Complex]:
    """Chebyshev polynomials and their derivatives at complex places, arrays (places, count).

    ``T_n = (z^n + z^-n) / 2`` and ``T_n' = n (z^n - z^-n) / (2 root)`` with ``root = sqrt(t^2 - 1)``, ``z = t + root``.
    """
    root = np.sqrt(place - 1) * np.sqrt(place + 1)
    root = np.where(np.abs(root) < 1e-9, 1e-9, root)
    power: Complex = np.vander(place + root, count, increasing=True).astype(complex)
    back = 1 / power
    return (power + back) / 2, np.arange(count) * (power - back) / (2 * root[:, None])
