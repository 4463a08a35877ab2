"""Modes of a box that ring each a little elsewhere than those of the ideal box, and decay a little faster or slower.

Seams, suspensions and cables move every mode of a real room by an amount of its own. A shift belongs to the room:
all microphones, recordings and loudspeakers meet the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.models.effect import Parameter
from specan.models.model import Model
from specan.models.quantity import Quantity, constant, quantity
from specan.room.model.places import receivers_of
from specan.room.model.port import Port, point
from specan.room.model.rig import Rig

USUAL_PERCENT = 0.1  # of natural frequencies of built rooms; see docs/room.md
BESIDE_BAND = 0.03  # of the ends of the band: modes so near beside it may move too, 30 shifts of 0.1 %
SOUND_SPEED = 343.2  # m/s, at 20 degrees Celsius (ISO 9613-1): which modes there are needs no better one


SHIFT = Parameter(
    0.0, "1", min=-3.0, max=3.0, fixed=True, per="mode", doc="of each mode, in standard uncertainties"
)


@quantity(unit="1")
def mode_shift(mode_shift_sd, *, frequency=SHIFT, damping=SHIFT):
    """Relative changes of each mode's natural frequency and of its decay rate, array (2, modes)."""
    return np.stack([size * value for size, value in zip(mode_shift_sd, (frequency, damping), strict=True)])


def modes_of(rig: Rig) -> NDArray[np.intp]:
    """Numbers along the edges (n, 3) of the rigid box's modes in the band, the lowest first; none if none may shift."""
    if rig.room.dims_m is None or not any(rig.uncertainty.of_each_mode):
        return np.empty((0, 3), dtype=np.intp)
    low, high = rig.band.f_min_hz * (1 - BESIDE_BAND), rig.band.f_max_hz * (1 + BESIDE_BAND)
    return rigid_modes(rig.room.dims_m, SOUND_SPEED, low, high)[0]


def quantities(rig: Rig, modes: NDArray[np.intp]) -> tuple[Quantity, ...]:
    """Which modes may be shifted, and by how much; no parameters where no mode may."""
    listed = constant("modes_apart", modes, "1", "Numbers along the edges of modes that may be shifted.")
    if not len(modes):
        return listed, constant("mode_shift", np.zeros((2, 0)), "1", "No mode is shifted.")
    sd = np.outer(rig.uncertainty.of_each_mode, np.ones(len(modes)))
    sizes = constant("mode_shift_sd", sd, "1", "Standard uncertainties of the shifts.")
    return listed, sizes, mode_shift


def axes(modes: NDArray[np.intp]) -> dict[str, tuple[str, ...]]:
    """Names of the modes: ``x1 y2``; no axis where none may be shifted."""
    return {"mode": tuple(map(numbers, modes.tolist()))} if len(modes) else {}


def with_usual_shifts(model: Model) -> Model | None:
    """The model with what built rooms usually have; None where shifts are declared, or the modes have no numbers."""
    receivers = receivers_of(model)
    rig = receivers.rig
    if receivers.shifts or rig.room.dims_m is None:
        return None
    usual = {"mode_frequency_percent": USUAL_PERCENT}
    declared = rig.model_copy(update={"uncertainty": rig.uncertainty.model_copy(update=usual)})
    apart = modes_of(declared)
    return replace(
        model,
        quantities={**model.quantities, **{q.name: q for q in quantities(declared, apart)}},
        axes={**model.axes, **axes(apart)},
        for_kinds={"frf": replace(receivers, shifts=len(apart))},
    )


def notes(rig: Rig, modes: NDArray[np.intp]) -> tuple[str, ...]:
    """What is to be told of a freedom of single modes."""
    frequency, damping = (100 * part for part in rig.uncertainty.of_each_mode)
    declared = (
        f"each of {len(modes)} modes by itself {frequency:.3g} % in frequency and {damping:.3g} % in damping"
    )
    return (f"uncertain: {declared} ([uncertainty])",) if len(modes) else ()


def columns(known: Mapping[str, Any]) -> Iterator[tuple[Complex, tuple[complex, complex]]]:
    """Change of the transfer functions with each mode, and how far one standard uncertainty moves it.

    Sound that loads give back is not followed: a diaphragm, a resonator hear the mode where it was.
    """
    lines = np.ones(len(known["frequency"]))
    sources = [(port, strength * lines) for _, port, strength in known["pistons"]]
    heard = 2j * np.pi * known["frequency"] * known["density"] * known["indicated_frf"] / known["field"]
    receivers = [Port(point(p), 0) for p in known["receiver_position"]]
    each = known["room_modes"].mode_slopes(sources, receivers, known["modes_apart"])
    for (change, sizes), (frequency, damping) in zip(each, known["mode_shift_sd"].T, strict=True):
        yield heard * change, (sizes[0] * frequency, sizes[1] * damping)


COLUMNS_READ = ("frequency", "room_modes", "pistons", "modes_apart", "mode_shift_sd", "density", "receiver_position",
                "indicated_frf", "field")  # fmt: skip


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
