"""What a truncated modal sum of a box lacks: nearly static, so a polynomial in the squared wave number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.room.model.axis_modes import AxisModes, axis_modes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


KEPT = 100  # places along an axis
KEPT_BYTES = 16_000_000  # of a wall's rows to all places
DIED = 37.0  # exp(-37) is no more than rounding
FAR = 6.0  # times the wave number, above which a mode is taken in powers of the ratio squared
_ROOTS = (1.0, 1 / 2, 3 / 8, 5 / 16, 35 / 128)  # of (1 - x)^(-1/2); those of 1 / (1 - x) are all one


CENTRE, CIRCLE = 0.5, 0.6  # of the largest k^2: about which, and in units of which, polynomials are taken


def corrections_at(coefficients: Real, k2_max: float, k2: Complex, source_wall: Complex) -> Complex:
    """Values (lines, receivers) of what `static_correction` gives; `source_wall` is ``j k beta`` of the closed wall."""
    t = ((k2 - CENTRE * k2_max) / (CIRCLE * k2_max))[:, None]
    rigid, soft = (np.zeros((len(t), len(coefficients)), dtype=complex) for _ in range(2))
    for power in reversed(range(coefficients.shape[2])):
        rigid = rigid * t + coefficients[:, 0, power]
        soft = soft * t + coefficients[:, 1, power]
    return rigid + source_wall[:, None] * soft


def static_correction(
    lengths: tuple[float, float, float],
    counts: tuple[int, ...],
    k2_max: float,
    source: tuple[float, float, float],
    axis: int,
    radius: float,
    points: Real,
    radii: Real,
    order: int = 4,
) -> Real:
    """Rigid-box coupling above the truncation `counts`, for ``0 <= k^2 <= k2_max``.

    Along `axis` all modes are summed in closed form,
    ``cosh(kappa x_<) cosh(kappa (L - x_>)) / (kappa sinh(kappa L))``; along the other two they are added
    until they have died out between source and receiver. The values at points on a circle in the plane
    of k^2, where no mode is near, give the Taylor coefficients (Cauchy's formula).

    Parameters
    ----------
    lengths, counts : tuples
        Edges in m and modes kept along each axis.
    source, axis, radius : position in m, number of the closed axis, radius of the patch (0: a point)
    points, radii : arrays (receivers, 3), (receivers,)
    order : int
        Order of the polynomials.

    Returns
    -------
    array (receivers, 2, order + 1)
        Coefficients between rigid walls, and of the change by a soft source wall; see `corrections_at`.
    """
    nodes = 2 * order + 4
    angles = 2 * np.pi * (np.arange(nodes // 2) + 0.5) / nodes  # the lower half is the conjugate
    k2 = k2_max * (CENTRE + CIRCLE * np.exp(1j * angles))
    closed = _Closed.along(lengths, counts, axis, source[axis] < lengths[axis] / 2, tuple(k2.tolist()))
    terms = _Terms.prepare(closed, source, radius)
    values = np.array([terms.sums(p, r) for p, r in zip(points, radii, strict=True)])
    powers = np.exp(-1j * np.outer(np.arange(order + 1), angles))
    return np.asarray(np.einsum("on,rsn->rso", powers, values).real * (2 / nodes))


@dataclass(frozen=True, eq=False)
class _Plane:
    """In-plane modes of a box across one axis, in rising order of their wave number; of the geometry alone."""

    lengths: tuple[float, float, float]
    axis: int
    plane: tuple[int, int]
    m: NDArray[np.intp]
    n: NDArray[np.intp]
    kt2: Real
    double: Real
    low: NDArray[np.bool_]
    top: float

    LIMIT = 900.0  # 1/m; beyond, only ports less than 3 cm apart couple

    @classmethod
    @lru_cache(maxsize=12)
    def across(cls, lengths: tuple[float, float, float], counts: tuple[int, ...], axis: int) -> _Plane:
        i, j = (a for a in range(3) if a != axis)
        limit = max(cls.LIMIT, 1.5 * np.pi * counts[i] / lengths[i], 1.5 * np.pi * counts[j] / lengths[j])
        most = [int(limit * lengths[a] / np.pi) + 1 for a in (i, j)]
        m, n = (np.ravel(number) for number in np.indices(most))
        kt2 = (np.pi * m / lengths[i]) ** 2 + (np.pi * n / lengths[j]) ** 2
        order = np.argsort(kt2, kind="stable")
        order = order[kt2[order] <= limit**2]
        m, n, kt2 = m[order], n[order], kt2[order]
        double = np.where(m == 0, 1.0, 2.0) * np.where(n == 0, 1.0, 2.0) / (lengths[i] * lengths[j])
        low = (m < counts[i]) & (n < counts[j])
        return cls(lengths, axis, (i, j), m, n, kt2, double, low, limit)

    def shape(self, point: Sequence[float] | Real, some: slice = slice(None)) -> Real:
        """Mode shapes at a point."""
        found = 1.0
        for edge, number in zip(self.plane, (self.m[some], self.n[some]), strict=True):
            along = np.arange(int(number.max()) + 1) * (np.pi * point[edge] / self.lengths[edge])
            found = found * np.cos(along)[number]
        return np.asarray(found)

    @lru_cache(maxsize=24)  # noqa: B019 - planes are few, and kept anyway
    def mean(self, radius: float) -> Real:
        """Mean of each mode over a patch, relative to its centre."""
        return _bessel_mean(self.kt2, radius)

    @cached_property
    def fade(self) -> Real:
        """What is left of each mode before the top wave number."""
        return _fade(np.sqrt(self.kt2), self.top)

    def far(self, k2: float, last: int) -> int:
        """The first mode far above a wave number, and above what is kept."""
        first = int(np.searchsorted(self.kt2, FAR**2 * k2))
        return min(max(first, int(np.flatnonzero(self.low)[-1]) + 1), last)

    def beside(self, first: int, last: int, weight: Real, k2: Complex) -> Complex:
        """Far modes between two places of one wall: ``1 / kappa`` and ``-1 / kappa^2`` in powers of k^2 / k_t^2."""
        rigid, soft = (weight[first:last] @ self._inverse[first:last]).reshape(2, -1)
        powers = k2[:, None] ** np.arange(len(_ROOTS))
        return np.stack([powers @ (np.array(_ROOTS) * rigid), -(powers @ soft)])

    @cached_property
    def _inverse(self) -> Real:
        """``1 / k_t^(2p + 1)``, then ``1 / k_t^(2p + 2)``, array (modes, 2 powers)."""
        power = np.arange(len(_ROOTS))
        kt2 = np.maximum(self.kt2, 1.0)[:, None]  # far modes are well above
        return np.asarray(kt2 ** -np.concatenate([power + 0.5, power + 1.0]))


@dataclass(frozen=True, eq=False)
class _Closed:
    """The closed axis between the modes of a plane, at some squared wave numbers; of the geometry alone."""

    flat: _Plane
    near: bool  # whether the soft wall is the one at 0
    k2: Complex
    modes: tuple[AxisModes, AxisModes, AxisModes]  # rigid; with that wall a little soft, and a little active

    STEP = 1e-4  # 1/m, of j k beta: for a derivative

    @classmethod
    @lru_cache(maxsize=24)
    def along(
        cls,
        lengths: tuple[float, float, float],
        counts: tuple[int, ...],
        axis: int,
        near: bool,
        k2: tuple[complex, ...],
    ) -> _Closed:
        rigid, softer, harder = (
            axis_modes(lengths[axis], *((step, 0.0) if near else (0.0, step)), counts[axis])
            for step in (0.0, cls.STEP * lengths[axis], -cls.STEP * lengths[axis])
        )
        return cls(_Plane.across(lengths, counts, axis), near, np.array(k2), (rigid, softer, harder))

    @property
    def length(self) -> float:
        return self.flat.lengths[self.flat.axis]

    @property
    def wall(self) -> float:
        return 0.0 if self.near else self.length

    @cached_property
    def _roots(self) -> list[Complex]:
        return []

    @cached_property
    def _from_wall(self) -> dict[float, Complex]:
        return {}

    @cached_property
    def _truncated(self) -> dict[tuple[float, float], tuple[Complex, Complex]]:
        return {}

    def kappa(self, last: int) -> Complex:
        """``sqrt(k_t^2 - k^2)`` of the first modes of the plane, array (k2, modes)."""
        if not self._roots or self._roots[0].shape[1] < last:
            self._roots[:] = [np.sqrt(self.flat.kt2[:last] - self.k2[:, None] + 0j)]
        return self._roots[0][:, :last]

    def from_wall(self, last: int, there: float) -> Complex:
        """All modes of the rigid axis between its soft wall and a place; microphones stay where they are."""
        kept = self._from_wall
        if there not in kept or kept[there].shape[1] < last:
            _make_room(kept)
            kept[there] = _closed_form(self.kappa(last), self.length, self.wall, there)
        return kept[there][:, :last]

    @cached_property
    def _between(self) -> dict[tuple[float, int], Real]:
        return {}

    def between(self, last: int, there: float) -> Real:
        """`beyond` from the soft wall, real and imaginary parts as rows: wherever on the wall a source is."""
        kept, key = self._between, (there, last)
        if key not in kept:
            found = np.stack([(part.real, part.imag) for part in self.beyond(last, self.wall, there)])
            if sum(rows.nbytes for rows in kept.values()) + found.nbytes > KEPT_BYTES:
                kept.clear()
            kept[key] = found.reshape(-1, last)
        return kept[key]

    def beyond(self, last: int, here: float, there: float) -> tuple[Complex, Complex]:
        """Each mode of the plane above the truncation between two places, and its change by the soft wall."""
        if here == self.wall:
            along = self.from_wall(last, there).copy()
            softer = -self.from_wall(last, here) * along
        else:
            along = _closed_form(self.kappa(last), self.length, here, there)
            softer = -self.from_wall(last, here) * self.from_wall(last, there)
        low = np.flatnonzero(self.flat.low[:last])
        rigid, change = self.truncated(here, there)
        along[:, low] -= rigid
        softer[:, low] -= change
        return along, softer

    @cached_property
    def _resolvents(self) -> list[Complex]:
        gap = self.flat.kt2[self.flat.low] - self.k2[:, None]
        return [1 / ((modes.q2[0] + gap[..., None]) * modes.norm[0]) for modes in self.modes]

    def truncated(self, x: float, y: float) -> tuple[Complex, Complex]:
        """What a truncated sum has of the axis between two places, and its change by the soft wall."""
        if (x, y) not in self._truncated:
            _make_room(self._truncated)
            self._truncated[x, y] = self._summed(x, y)
        return self._truncated[x, y]

    def _summed(self, x: float, y: float) -> tuple[Complex, Complex]:
        at = [modes.at(np.array([x, y]))[0] for modes in self.modes]
        rigid, softer, harder = (r @ (a[:, 0] * a[:, 1]) for r, a in zip(self._resolvents, at, strict=True))
        return rigid, (softer - harder) / (2 * self.STEP)


@dataclass(frozen=True)
class _Terms:
    """The modes that a source drives."""

    closed: _Closed
    source: tuple[float, float, float]
    weight: Real

    REACH = 18.0  # exp(-18) of a hundredth of the field: a mode that has died out

    @classmethod
    def prepare(cls, closed: _Closed, source: tuple[float, float, float], radius: float) -> _Terms:
        flat = closed.flat
        return cls(closed, source, flat.double * flat.shape(source) * flat.mean(radius))

    def sums(self, point: Real, radius: float) -> tuple[Complex, Complex]:
        """StaticCorrection of the rigid box, and its change by a soft source wall."""
        closed, flat = self.closed, self.closed.flat
        here, there, k2 = self.source[flat.axis], float(point[flat.axis]), closed.k2
        gap = abs(there - here)
        last = int(np.searchsorted(flat.kt2, (self.REACH / max(gap, 1e-9)) ** 2))
        last = max(last, int(np.flatnonzero(flat.low)[-1]) + 1)
        some = slice(0, last)
        weight = self.weight[some] * flat.shape(point, some)
        if radius > 0:
            weight = weight * flat.mean(radius)[some]
        if last == len(flat.kt2):
            weight = weight * flat.fade
        rest = np.zeros((2, len(k2)), dtype=complex)
        if radius > 0 and tuple(point) == self.source:
            rest[0] = _beyond(flat.top, tuple(k2.tolist()), radius)
        if here == there == closed.wall:
            last = flat.far(float(np.abs(k2).max()), last)
            rest += flat.beside(last, len(weight), weight, k2)
            weight = weight[:last]
        if here == closed.wall:
            sums = (closed.between(last, there) @ weight).reshape(2, 2, len(k2))
            return sums[0, 0] + 1j * sums[0, 1] + rest[0], sums[1, 0] + 1j * sums[1, 1] + rest[1]
        along, softer = closed.beyond(last, here, there)
        return along @ weight + rest[0], softer @ weight + rest[1]


def _make_room(kept: dict[Any, Any]) -> None:
    if len(kept) >= KEPT:
        kept.clear()


def _fade(kappa: Real, top: float) -> Real:
    """1 up to half the top wave number, from there smoothly to 0: a sharp end would ring."""
    part = np.clip(2 * kappa / top - 1, 0.0, 1.0)
    return 0.5 + 0.5 * np.cos(np.pi * part)


@lru_cache(maxsize=24)
def _beyond(top: float, k2: tuple[complex, ...], radius: float) -> Complex:
    """What the faded sum leaves out of a patch's coupling with itself: there the room is a half-space.

    ``(1 / 2 pi) int (1 - fade) (2 J1(kappa a)/(kappa a))^2 kappa / sqrt(kappa^2 - k^2) dkappa``; without
    the fade and for k = 0 it would be 8 / (3 pi^2 a), the radiation mass of a baffled piston.
    """
    edge = np.linspace(top / 2, top, 400)
    far = np.geomspace(top, max(400 / radius, 10 * top), 20_000)
    total = np.zeros(len(k2), dtype=complex)
    for kappa, left in ((edge, 1 - _fade(edge, top)), (far, np.ones_like(far))):
        value = left * _bessel_mean(kappa**2, radius) ** 2 * kappa
        total += np.trapezoid(value / np.sqrt(kappa**2 - np.array(k2)[:, None]), kappa)
    return np.asarray(total / (2 * np.pi), dtype=np.complex128)


def _bessel_mean(kt2: Real, radius: float) -> Real:
    from scipy.special import j1

    z = np.sqrt(kt2) * radius
    flat = z < 1e-8
    return np.where(flat, 1.0, 2 * j1(z) / np.where(flat, 1.0, z))


def _closed_form(kappa: Complex, length: float, x: float, y: float) -> Complex:
    """Rigid axis summed over all its modes between `x` and `y`; `kappa` (values of k^2, modes) rises."""
    low, high = min(x, y), max(x, y)
    found: Complex = _echoed(kappa, low) * _echoed(kappa, length - high) / (2 * kappa)
    if high > low:
        found *= np.exp(-kappa * (high - low))
    some = _alive(kappa, length)
    found[:, some] /= 1 - np.exp(-2 * kappa[:, some] * length)
    return found


def _echoed(kappa: Complex, distance: float) -> Complex | float:
    """1 + exp(-2 kappa distance): a port and its mirror image behind a wall."""
    if distance == 0.0:
        return 2.0
    total = np.ones_like(kappa)
    some = _alive(kappa, distance)
    total[:, some] += np.exp(-2 * kappa[:, some] * distance)
    return total


def _alive(kappa: Complex, distance: float) -> slice:
    """Modes that have not died out on the way to a wall and back."""
    return slice(0, int(np.searchsorted(kappa.real.min(axis=0), DIED / (2 * distance))))
