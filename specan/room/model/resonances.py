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
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Flags, Real
from specan.room.model.axis_modes import AxisModes, norms, waves, waves_or_slopes
from specan.room.model.frequency_interpolation import LOOKED_AT, FrequencyInterpolation, mixed
from specan.room.model.port import Port

MOST_STEPS = 12  # of Newton's iteration: quadratic, so a mode that takes more has no pole near the band
SETTLED = 1e-12  # half-widths of the band
SMOOTH = 1e-11  # what a polynomial through the few lines may lack of a pole that stays in the smooth part
EVERY = 4  # of the lines that are looked at
EXACT = 1e-9  # part of a mode's largest value to which its smooth rest must follow from the few lines


@dataclass(frozen=True, eq=False)
class Shapes:
    """Some modes of a box: at one frequency each, or all at some lines.

    Attributes
    ----------
    lengths : tuple of float
        Edges, m.
    w, a0 : three arrays
        Squared dimensionless wave numbers and first walls along the edges; see `AxisModes`.
    """

    lengths: tuple[float, ...]
    w: tuple[Complex, ...]
    a0: tuple[Complex, ...]
    _at: dict[tuple[Port, ...], Complex] = field(default_factory=dict, repr=False)
    _ports: dict[Port, Complex] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, axes: Sequence[AxisModes], orders: NDArray[np.intp]) -> Shapes:
        """Modes of the given orders (3, modes), at the lines of the axes."""
        w = tuple(axis.w[:, n] for axis, n in zip(axes, orders, strict=True))
        a0 = tuple(np.broadcast_to(axis.a0, w[0].shape) for axis in axes)
        return cls(tuple(axis.length for axis in axes), w, a0)

    @property
    def norm(self) -> Complex:
        """Integral of the squared shapes over the box, m^3."""
        x, y, z = (length * norms(w, a0) for length, w, a0 in zip(self.lengths, self.w, self.a0, strict=True))
        return np.asarray(x * y * z)

    def at(self, port: Port) -> Complex:
        """Shapes at a port, averaged over it, or their derivative there."""
        if port not in self._ports:
            self._ports[port] = self._at_one(port)
        return self._ports[port]

    def _at_one(self, port: Port) -> Complex:
        found = np.ones_like(self.w[0])
        for i, length in enumerate(self.lengths):
            part = port.position[i] / length
            found *= waves_or_slopes(self.w[i], self.a0[i], part, length, port.slope == i)
        if port.radius == 0:
            return found
        return found * port.mean([w / length**2 for w, length in zip(self.w, self.lengths, strict=True)])

    def at_all(self, ports: Sequence[Port]) -> Complex:
        """The same for several ports, the last axis."""
        key = tuple(ports)
        if key not in self._at:
            if len(self._at) >= 4:
                self._at.clear()
            self._at[key] = self._at_each(ports)
        return self._at[key]

    def _at_each(self, ports: Sequence[Port]) -> Complex:
        places = np.array([port.position for port in ports])
        x, y, z = (
            waves(w[..., None], a0[..., None], places[:, i] / length)
            for i, (length, w, a0) in enumerate(zip(self.lengths, self.w, self.a0, strict=True))
        )
        found = x * y * z
        for k, port in enumerate(ports):
            if port.radius > 0 or port.slope is not None:
                found[..., k] = self.at(port)
        return np.asarray(found)


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
    axes: tuple[AxisModes, AxisModes, AxisModes],
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
    w = (np.einsum("nk,kn->n", weights, axis.w[:, n]) for axis, n in zip(axes, orders[:, kept], strict=True))
    a0 = (weights @ np.broadcast_to(axis.a0[:, 0], len(few.chosen)) for axis in axes)
    poles = Shapes(tuple(axis.length for axis in axes), tuple(w), tuple(a0))
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
