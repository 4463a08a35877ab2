"""Places where sound enters, leaves or is picked up, and the means of modes over patches and balls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
