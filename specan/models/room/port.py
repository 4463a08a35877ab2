"""Places where sound enters, leaves or is picked up, and the means of modes over patches and balls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


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
        Averaged over a ball instead of a patch.
    slope : int or None
        Number of the axis along which the field's derivative is meant instead of the field.
    drawn : tuple of float or None
        Where a place in parts of a wall's edges lies in the room as drawn, whose static_correction serves it.
    """

    position: tuple[float, float, float]
    axis: int
    radius: float = 0.0
    ball: bool = False
    slope: int | None = None
    drawn: tuple[float, float, float] | None = None


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


def ball_above(port: Port, top: tuple[float, ...]) -> float:
    """What modes above a truncation add to a ball's coupling with itself, 1/m; of slopes 1/m^3.

    There the room is free space, where modes are plane waves: with ``b`` from `ball_mean` and V the volume,
    ``(2 pi)^-3 int b^2 / k^2 d^3k = 3 / (10 pi a)``, and with ``k_i^2`` for a slope along i, ``1 / (3 V)``; less the
    part with wave numbers below the truncation.

    Parameters
    ----------
    port : Port
        A ball.
    top : tuple of float
        Largest wave number along each axis that the modes have, 1/m.
    """
    size, weights = _waves_below(top)
    below = weights[0 if port.slope is None else 1 + port.slope] @ ball_mean(size, port.radius) ** 2
    whole = 0.3 / (np.pi * port.radius) if port.slope is None else 1 / (4 * np.pi * port.radius**3)
    return float(whole - below)


@lru_cache(maxsize=12)
def _waves_below(top: tuple[float, ...], order: int = 10) -> tuple[Real, Real]:
    """Squares of plane waves' numbers up to a top along each axis, and weights of ``1 / k^2`` and ``k_i^2 / k^2``.

    Three pyramids ``k = u K (1, v, w)``, whose volume element holds ``u^2``.
    """
    points, weights = np.polynomial.legendre.leggauss(order)
    u, v, w = (a.ravel() for a in np.meshgrid(*3 * [(points + 1) / 2], indexing="ij"))
    each = np.prod(np.meshgrid(*3 * [weights / 2], indexing="ij"), axis=0).ravel()
    sizes, parts = [], []
    for axis in range(3):
        direction = np.roll([np.ones_like(u), v, w], axis, axis=0) * np.array(top)[:, None]
        square = np.sum(direction**2, axis=0)
        sizes.append(u**2 * square)
        parts.append(np.stack([each / square, *(each * u**2 * direction**2 / square)]))
    return np.concatenate(sizes), np.concatenate(parts, axis=1) * np.prod(top) / np.pi**3
