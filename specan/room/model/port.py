"""Places where sound enters, leaves or is picked up, and the means of modes over patches and balls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real


def point(values: Sequence[float] | Real) -> tuple[float, float, float]:
    """Three numbers as a tuple that can be a key."""
    x, y, z = (float(v) for v in values)
    return x, y, z


@dataclass(frozen=True)
class Port:
    """A place where sound enters, leaves or is picked up: a point, or a round patch of a wall.

    Attributes
    ----------
    position : tuple of float
        Point, or centre of the patch, m.
    axis : int
        Number of the axis normal to the patch; for a point the axis that is summed in closed form.
    radius : float
        Radius of the patch or ball, m; 0 for a point.
    ball : bool
        Averaged over an ellipsoid instead of a patch.
    proportions : tuple of float
        Its half axes over the radius of the ball of its volume; a mesh takes the ball for means.
    slope : int or None
        Number of the axis along which the field's derivative is meant instead of the field.
    drawn : tuple of float or None
        Where a place in parts of a wall's edges lies in the room as drawn, whose static_correction serves it.
    """

    position: tuple[float, float, float]
    axis: int
    radius: float = 0.0
    ball: bool = False
    proportions: tuple[float, float, float] = (1.0, 1.0, 1.0)
    slope: int | None = None
    drawn: tuple[float, float, float] | None = None

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Worked out once: couplings are looked up by their ports at every evaluation."""
        return hash((self.position, self.axis, self.radius, self.ball, self.proportions))

    def mean(self, q2: Sequence[NDArray]) -> NDArray:
        """Mean over the patch or ball of modes with squared wave numbers along the axes, relative to its centre."""
        if self.ball:
            a, b, c = np.square(self.proportions)
            return ball_mean(a * q2[0] + b * q2[1] + c * q2[2], self.radius)
        i, j = (axis for axis in range(3) if axis != self.axis)
        return disc_mean(q2[i] + q2[j], self.radius)


def disc_mean(kt2: NDArray, radius: float) -> NDArray:
    """Mean over a disc of a field with in-plane wave number squared `kt2`, relative to its centre.

    ``2 J1(z)/z`` with ``z = kt a``: the mean value property of solutions of the Helmholtz equation. As a
    power series in ``x = -z^2 / 4``, which serves complex arguments and needs no branch; a term is
    ``x / (n (n + 1))`` times the one before.
    """
    return _series(np.asarray(kt2) * (-(radius**2) / 4), lambda n: n * (n + 1))


def ball_mean(big_k2: NDArray, radius: float) -> NDArray:
    """Mean over a ball of a field with wave number squared `big_k2`, relative to its centre.

    ``3 j1(z)/z`` with ``z = K a``; in powers of ``x = -z^2 / 4`` a term is ``x / (n (n + 3/2))`` times the one before.
    """
    return _series(np.asarray(big_k2) * (-(radius**2) / 4), lambda n: n * (n + 1.5))


def _series(x: NDArray, divisor: Callable[[int], float]) -> NDArray:
    """A power series of which each term is ``x / divisor(n)`` times the one before."""
    largest, size, terms = float(np.max(np.abs(x), initial=0.0)), 1.0, 0
    while size > 1e-14 and terms < 80:
        terms += 1
        size *= largest / divisor(terms)
    total = np.ones_like(x)
    for n in range(terms, 0, -1):
        total *= x / divisor(n)
        total += 1
    return total


def beyond(port: Port, top: Sequence[float]) -> float:
    """What modes above a truncation add to an ellipsoid's coupling with itself, 1/m; of slopes 1/m^3.

    There the room is free space, where modes are plane waves. All of them give ``(2 pi)^-3 int b^2 / k^2 d^3k``, with
    ``b`` from `ball_mean`, or ``3 R_F / (10 pi)``; with ``k_i^2`` for a slope along i, ``L_i / V`` with the
    depolarisation factor ``L_i = (a b c / 3) R_D`` and the volume V, 1 / (3 V) for a ball (Lamb, Hydrodynamics, 114).
    R_F and R_D are Carlson's integrals of the squared half axes. The part below the truncation is taken off.

    Parameters
    ----------
    port : Port
        An ellipsoid.
    top : sequence of float
        Largest wave number along each axis that the modes have, 1/m.
    """
    from scipy.special import elliprd, elliprf

    squares, weights = _waves_below(tuple(top))
    half = np.square(port.proportions)
    mean = ball_mean(half @ squares, port.radius)
    a, b, c = half * port.radius**2
    if port.slope is None:
        return float(0.3 / np.pi * elliprf(a, b, c) - weights @ mean**2)
    along = (a, b, c)[port.slope]
    others = [(b, c), (a, c), (a, b)][port.slope]
    whole = elliprd(*others, along) / (4 * np.pi)
    return float(whole - (weights * squares[port.slope]) @ mean**2)


@lru_cache(maxsize=12)
def _waves_below(top: tuple[float, ...]) -> tuple[Real, Real]:
    """Plane waves up to a top along each axis: squared wave numbers (3, waves), and weights of ``1 / k^2``.

    Three pyramids ``k = u K (1, v, w)``, whose volume element holds the ``u^2`` of ``k^2``.
    """
    points, weights = np.polynomial.legendre.leggauss(10)
    u, v, w = (a.ravel() for a in np.meshgrid(*3 * [(points + 1) / 2], indexing="ij"))
    each = np.prod(np.meshgrid(*3 * [weights / 2], indexing="ij"), axis=0).ravel()
    parts = [np.roll([np.ones_like(u), v, w], axis, axis=0) * np.array(top)[:, None] for axis in range(3)]
    squares = np.concatenate([(u * part) ** 2 for part in parts], axis=1)
    inverse = np.concatenate([each / np.sum(part**2, axis=0) for part in parts])
    return squares, inverse * np.prod(top) / np.pi**3
