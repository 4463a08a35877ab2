"""What a truncated modal sum of a box lacks: nearly static, so a polynomial in the squared wave number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.models.kept import forgotten_by
from specan.room.model.axis_modes import axis_modes

Point = tuple[float, float, float]

LIMIT = 900.0  # 1/m, largest wave number in a plane; beyond, only ports less than 3 cm apart couple
REACH = 18.0  # exp(-18) of a hundredth of the field: a mode that has died out between two places
STEP = 1e-4  # 1/m, of j k beta: for a derivative
CENTRE, CIRCLE = 0.5, 0.6  # of the largest k^2: about which, and in units of which, polynomials are taken
ORDER = 4  # of these polynomials
_ANGLES = np.pi * (np.arange(ORDER + 2) + 0.5) / (ORDER + 2)


def corrections_at(coefficients: Real, k2_max: float, k2: Complex, source_wall: Complex) -> Complex:
    """Values (lines, receivers) of what `static_correction` gives; `source_wall` is ``j k beta`` of the closed wall."""
    t = (k2 - CENTRE * k2_max) / (CIRCLE * k2_max)
    rigid, soft = np.polynomial.polynomial.polyval(t, coefficients.T)
    return np.asarray(rigid + source_wall * soft).T


@lru_cache(maxsize=4000)  # of geometry alone: fits ask for the same hundreds of times
def static_correction(
    lengths: Point, counts: tuple[int, ...], k2_max: float, axis: int,
    source: tuple[Point, float], receiver: tuple[Point, float],
) -> Real:  # fmt: skip
    """Rigid-box coupling above the truncation `counts`, for ``0 <= k^2 <= k2_max``.

    Along `axis` all modes are summed in closed form,
    ``cosh(kappa x_<) cosh(kappa (L - x_>)) / (kappa sinh(kappa L))``; along the other two they are added
    until they have died out between source and receiver. The values at points on a circle in the plane
    of k^2, where no mode is near, give the Taylor coefficients (Cauchy's formula).

    Parameters
    ----------
    lengths, counts : tuples
        Edges in m and modes kept along each axis.
    k2_max : float
    axis : int
        Number of the closed axis.
    source, receiver : position in m, and radius of the patch (0: a point)

    Returns
    -------
    array (2, ORDER + 1)
        Coefficients between rigid walls, and of the change by a soft source wall; see `corrections_at`.
    """
    plane = _Plane.across(lengths, counts, axis)
    (place, radius), (there, other) = source, receiver
    each = _along(plane, k2_max, place[axis], there[axis])
    some = slice(0, each.shape[1])
    driven = plane.shape(place, some)  # each mode of the plane, by the source
    weight = driven * (driven if place == there else plane.shape(there, some))
    weight *= plane.mean(radius, other)[some]
    if some.stop == len(plane.kt2):
        weight *= plane.fade
    found = (each @ weight).reshape(2, -1)
    if radius > 0 and source == receiver:
        found[0] += _beyond(plane.top, k2_max, radius)
    return found


def _circle(k2_max: float) -> Complex:
    """Squared wave numbers about which Cauchy's formula runs: half of them, the others are their conjugates."""
    return np.asarray(k2_max * (CENTRE + CIRCLE * np.exp(1j * _ANGLES)))


def _taylor(values: Complex) -> Real:
    """Coefficients (ORDER + 1, ...) from the values on the circle (nodes, ...)."""
    powers = np.exp(-1j * np.outer(np.arange(ORDER + 1), _ANGLES))
    return np.asarray(np.tensordot(powers, values, axes=1).real / len(_ANGLES))


forgotten_by(static_correction.cache_clear)


@dataclass(frozen=True, eq=False)
class _Plane:
    """In-plane modes of a box across one axis, in rising order of their wave number; of the geometry alone."""

    lengths: Point
    counts: tuple[int, ...]
    axis: int
    m: NDArray[np.intp]
    n: NDArray[np.intp]
    kt2: Real
    top: float

    @classmethod
    @lru_cache(maxsize=12)
    def across(cls, lengths: Point, counts: tuple[int, ...], axis: int) -> _Plane:
        i, j = (a for a in range(3) if a != axis)
        top = max(LIMIT, 1.5 * np.pi * counts[i] / lengths[i], 1.5 * np.pi * counts[j] / lengths[j])
        m, n = (
            np.ravel(number) for number in np.indices([int(top * lengths[a] / np.pi) + 1 for a in (i, j)])
        )
        kt2 = (np.pi * m / lengths[i]) ** 2 + (np.pi * n / lengths[j]) ** 2
        order = np.argsort(kt2, kind="stable")
        order = order[kt2[order] <= top**2]
        return cls(lengths, counts, axis, m[order], n[order], kt2[order], top)

    @property
    def edges(self) -> list[int]:
        """Numbers of the two axes."""
        return [axis for axis in range(3) if axis != self.axis]

    @cached_property
    def low(self) -> NDArray[np.intp]:
        """Modes that the truncated sum has too."""
        i, j = self.edges
        return np.flatnonzero((self.m < self.counts[i]) & (self.n < self.counts[j]))

    def shape(self, point: Sequence[float], some: slice = slice(None)) -> Real:
        """Mode shapes at a point."""
        along = [
            np.cos(np.arange(number.max() + 1) * (np.pi * point[edge] / self.lengths[edge]))[number[some]]
            for edge, number in zip(self.edges, (self.m, self.n), strict=True)
        ]
        return np.asarray(along[0] * along[1])

    @cached_property
    def fade(self) -> Real:
        """What is left of each mode before the top wave number."""
        return _fade(np.sqrt(self.kt2), self.top)

    @lru_cache(maxsize=24)  # noqa: B019 - planes are few, and kept anyway
    def mean(self, radius: float, other: float) -> Real:
        """Product of the means of each mode over two patches, relative to their centres, over its norm."""
        i, j = self.edges
        double = np.where(self.m == 0, 1.0, 2.0) * np.where(self.n == 0, 1.0, 2.0)
        square = double / (self.lengths[i] * self.lengths[j])
        return square * _bessel_mean(self.kt2, radius) * _bessel_mean(self.kt2, other)


@lru_cache(maxsize=100)
def _along(plane: _Plane, k2_max: float, here: float, there: float) -> Real:
    """The closed axis beyond the truncation between two places, for each mode of the plane that has not died out.

    Rows are the coefficients between rigid walls, then of the changes by ``j k beta`` of the wall next to the source.
    """
    k2 = _circle(k2_max)[:, None]
    length = plane.lengths[plane.axis]
    near = here < length / 2
    wall = 0.0 if near else length
    last = int(np.searchsorted(plane.kt2, (REACH / max(abs(there - here), 1e-9)) ** 2))
    last = max(last, int(plane.low[-1]) + 1)
    kappa = np.sqrt(plane.kt2[:last] - k2)
    rigid = _closed_form(kappa, length, here, there)
    soft = -_closed_form(kappa, length, wall, here) * _closed_form(kappa, length, wall, there)
    gap = plane.kt2[plane.low] - k2
    truncated = []
    for a in (0.0, STEP * length, -STEP * length):
        modes = axis_modes(length, *((a, 0.0) if near else (0.0, a)), plane.counts[plane.axis])
        at = modes.at(np.array([here, there]))[0]
        truncated.append((at[:, 0] * at[:, 1] / modes.norm[0] / (modes.q2[0] + gap[..., None])).sum(axis=-1))
    rigid[:, plane.low] -= truncated[0]
    soft[:, plane.low] -= (truncated[1] - truncated[2]) / (2 * STEP)
    return np.concatenate([_taylor(rigid), _taylor(soft)])


def _fade(kappa: Real, top: float) -> Real:
    """1 up to half the top wave number, from there smoothly to 0: a sharp end would ring."""
    part = np.clip(2 * kappa / top - 1, 0.0, 1.0)
    return 0.5 + 0.5 * np.cos(np.pi * part)


@lru_cache(maxsize=24)
def _beyond(top: float, k2_max: float, radius: float) -> Real:
    """What the faded sum leaves out of a patch's coupling with itself: there the room is a half-space.

    ``(1 / 2 pi) int (1 - fade) (2 J1(kappa a)/(kappa a))^2 kappa / sqrt(kappa^2 - k^2) dkappa``; without
    the fade and for k = 0 it would be 8 / (3 pi^2 a), the radiation mass of a baffled piston.
    """
    edge = np.linspace(top / 2, top, 400)
    far = np.geomspace(top, max(400 / radius, 10 * top), 20_000)
    k2 = _circle(k2_max)
    total = np.zeros(len(k2), dtype=complex)
    for kappa, left in ((edge, 1 - _fade(edge, top)), (far, np.ones_like(far))):
        value = left * _bessel_mean(kappa**2, radius) ** 2 * kappa
        total += np.trapezoid(value / np.sqrt(kappa**2 - k2[:, None]), kappa)
    return _taylor(np.asarray(total / (2 * np.pi), dtype=np.complex128))


def _bessel_mean(kt2: Real, radius: float) -> Real:
    from scipy.special import j1

    z = np.sqrt(kt2) * radius
    flat = z < 1e-8
    return np.where(flat, 1.0, 2 * j1(z) / np.where(flat, 1.0, z))


def _closed_form(kappa: Complex, length: float, x: float, y: float) -> Complex:
    """Rigid axis summed over all its modes between `x` and `y`, array as `kappa`.

    The sum over a port's mirror images: ``(1 + e^(-2 kappa x_<)) (1 + e^(-2 kappa (L - x_>))) e^(-kappa |x - y|) /
    (2 kappa (1 - e^(-2 kappa L)))``.
    """
    low, high = min(x, y), max(x, y)
    echoes = (1 + np.exp(-2 * kappa * low)) * (1 + np.exp(-2 * kappa * (length - high)))
    found: Complex = echoes * np.exp(-kappa * (high - low)) / (2 * kappa * -np.expm1(-2 * kappa * length))
    return found
