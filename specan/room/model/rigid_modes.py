"""Modes of a box with rigid walls: their numbers along the edges, frequencies and names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_SUFFIXES = {1: "st", 2: "nd", 3: "rd"}


def rigid_modes(
    dims_m: Sequence[float], sound_speed: float, low_hz: float, high_hz: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Numbers along the edges (n, 3) and frequencies of the modes in a band, the lowest first.

    ``f = c / 2 sqrt((l / X)^2 + (m / Y)^2 + (n / Z)^2)`` (Kuttruff, Room Acoustics, 6th ed., eq. 3.17).
    """
    edges = np.array(dims_m, dtype=float)
    most = np.floor(2 * high_hz * edges / sound_speed).astype(int)
    orders = np.array(list(np.ndindex(*(most + 1))))
    frequency = sound_speed / 2 * np.linalg.norm(orders / edges, axis=1)
    inside = np.flatnonzero((frequency >= low_hz) & (frequency <= high_hz))
    inside = inside[np.argsort(frequency[inside], kind="stable")]
    return orders[inside], frequency[inside]


def mode_names(dims_m: Sequence[float], sound_speed: float, f_max_hz: float) -> list[tuple[float, str]]:
    """Natural frequency and name of every mode but the uniform pressure, the lowest first.

    Examples
    --------
    >>> mode_names([2.0, 1.0, 0.5], 340.0, 200.0)
    [(85.0, '1st axial mode along x'), (170.0, '1st axial mode along y'), (170.0, '2nd axial mode along x'), \
(190.1, 'tangential mode x1 y1')]
    """
    orders, frequency = rigid_modes(dims_m, sound_speed, 0.0, f_max_hz)
    return [(round(f, 1), _name(n)) for n, f in zip(orders[1:].tolist(), frequency[1:].tolist(), strict=True)]


def numbers(orders: Sequence[int]) -> str:
    """``x1 y2``, those along the edges that are not zero."""
    return " ".join(f"{axis}{order}" for axis, order in zip("xyz", orders, strict=True) if order)


def _name(orders: Sequence[int]) -> str:
    along = [(axis, order) for axis, order in zip("xyz", orders, strict=True) if order]
    if len(along) == 1:
        axis, order = along[0]
        return f"{order}{_SUFFIXES.get(order, 'th')} axial mode along {axis}"
    return f"{'tangential' if len(along) == 2 else 'oblique'} mode {numbers(orders)}"
