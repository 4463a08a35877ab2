"""Modes of a box by the names that acousticians give them: axial, tangential, oblique, with orders and directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from specan.models.measurement_kinds import NamedModes

_SUFFIXES = {1: "st", 2: "nd", 3: "rd"}


def mode_names(dims_m: Any, sound_speed: float, f_max_hz: float) -> list[tuple[float, str]]:
    """Natural frequency and name of every mode of a box with rigid walls, the lowest first.

    ``f = c / 2 sqrt((l / X)^2 + (m / Y)^2 + (n / Z)^2)`` (Kuttruff, Room Acoustics, 6th ed., eq. 3.17).

    Examples
    --------
    >>> mode_names([2.0, 1.0, 0.5], 340.0, 200.0)
    [(85.0, '1st axial mode along x'), (170.0, '1st axial mode along y'), (170.0, '2nd axial mode along x'), \
(190.1, 'tangential mode x1 y1')]
    """
    edges = np.array(dims_m, dtype=float)
    most = np.floor(2 * f_max_hz * edges / sound_speed).astype(int)
    found = []
    for orders in np.ndindex(*(most + 1)):
        frequency = sound_speed / 2 * float(np.sqrt(np.sum((np.array(orders) / edges) ** 2)))
        if any(orders) and frequency <= f_max_hz:
            found.append((round(frequency, 1), _name(orders)))
    return sorted(found, key=lambda mode: mode[0])


def _name(orders: tuple[int, ...]) -> str:
    along = [(axis, order) for axis, order in zip("xyz", orders, strict=True) if order]
    if len(along) == 1:
        axis, order = along[0]
        return f"{order}{_SUFFIXES.get(order, 'th')} axial mode along {axis}"
    family = "tangential" if len(along) == 2 else "oblique"
    return f"{family} mode " + " ".join(f"{axis}{order}" for axis, order in along)


def _of(quantities: Mapping[str, Any], f_max_hz: float) -> list[tuple[float, str]]:
    return mode_names(quantities["room_dimensions"], float(quantities["sound_speed"]), f_max_hz)


NAMED = NamedModes(reads=("room_dimensions", "sound_speed"), names=_of)
