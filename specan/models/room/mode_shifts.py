"""Modes of a box that ring each a little elsewhere than those of the ideal box, and decay a little faster or slower.

Seams, suspensions and cables move every mode of a real room by an amount of its own. A shift belongs to the room:
all microphones, recordings and loudspeakers meet the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models.effect import Parameter
from specan.models.measurement_kinds import ModeShifts
from specan.models.quantity import Quantity, constant, quantity
from specan.models.room.port import Port, point
from specan.models.room.rig import Rig

Complex = NDArray[np.complex128]

BESIDE_BAND = 0.03  # of the ends of the band: modes so near beside it may move too, 30 shifts of 0.1 %
SOUND_SPEED = 343.2  # m/s, at 20 degrees Celsius (ISO 9613-1): which modes there are needs no better one


@quantity(unit="1")
def mode_shift(
    mode_shift_sd,
    *,
    frequency=Parameter(
        0.0, "1", min=-3.0, max=3.0, fixed=True, per="mode", doc="of each mode, in standard uncertainties"
    ),
    damping=Parameter(
        0.0, "1", min=-3.0, max=3.0, fixed=True, per="mode", doc="of each mode, in standard uncertainties"
    ),
):
    """Relative changes of each mode's natural frequency and of its decay rate, array (2, modes)."""
    return np.stack([size * value for size, value in zip(mode_shift_sd, (frequency, damping), strict=True)])


def modes_of(rig: Rig) -> NDArray[np.intp]:
    """Numbers along the edges (n, 3) of the modes of a rigid box in the band, the lowest first.

    ``f = c / 2 sqrt((l / X)^2 + (m / Y)^2 + (n / Z)^2)`` (Kuttruff, Room Acoustics, 6th ed., eq. 3.17).
    """
    edges = np.array(rig.room.dims_m)
    low, high = rig.band.f_min_hz * (1 - BESIDE_BAND), rig.band.f_max_hz * (1 + BESIDE_BAND)
    most = np.floor(2 * high * edges / SOUND_SPEED).astype(int)
    orders = np.indices(most + 1).reshape(3, -1).T
    frequency = SOUND_SPEED / 2 * np.linalg.norm(orders / edges, axis=1)
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    return np.asarray(orders[inside[np.argsort(frequency[inside])]])


def quantities(rig: Rig, modes: NDArray[np.intp]) -> tuple[Quantity, ...]:
    """Which modes may be shifted, and by how much; no parameters where no mode may."""
    listed = constant("modes_apart", modes, "1", "Numbers along the edges of modes that may be shifted.")
    if not len(modes):
        return listed, constant("mode_shift", np.zeros((2, 0)), "1", "No mode is shifted.")
    sd = np.array([[rig.uncertainty.of_each_mode[0]], [rig.uncertainty.of_each_mode[1]]])
    sizes = constant(
        "mode_shift_sd", np.broadcast_to(sd, (2, len(modes))), "1", "Standard uncertainties of the shifts."
    )
    return listed, sizes, mode_shift


def _columns(known: Mapping[str, Any]) -> Iterator[tuple[Complex, tuple[complex, complex]]]:
    """Change of the transfer functions with each mode's pole, and what one standard uncertainty moves it.

    Of ``G = sum_N a_N / (f - p_N) + ...`` it is ``a_N / (f - p_N)^2``: sound that loads give back is not followed.
    """
    room, table, sd = known["room_modes"], known["modes_apart"], known["mode_shift_sd"]
    found = room.resonances
    nowhere = np.zeros(np.shape(known["indicated_frf"]), dtype=complex)
    if found is None:
        yield from ((nowhere, (0j, 0j)) for _ in table)
        return
    pistons = [
        (known["piston_wall"], known["source_position"], known["piston_radius"]), *known["further_loudspeakers"]
    ]  # fmt: skip
    driven = np.zeros((len(found.residue), nowhere.shape[1]), dtype=complex)
    for number, (wall, centre, radius) in enumerate(pistons):
        port = room.patch(known["wall_names"][int(wall)], centre, float(radius))
        velocity = known["loudspeaker_velocity"][number] * (known["piston_velocity_profile"] if not number else 1)
        driven += np.outer(found.poles.at(port) * np.pi * port.radius**2, velocity)
    heard = found.residue[:, None] * found.poles.at_all([Port(point(p), 0) for p in known["receiver_position"]])
    factor = 2j * np.pi * known["frequency"] * known["density"] * known["indicated_frf"] / known["field"]
    hertz = found.few.middle + found.few.half * found.pole
    which: dict[tuple[int, ...], list[int]] = {}
    for index, order in enumerate(found.orders.T.tolist()):
        which.setdefault(tuple(order), []).append(index)
    for order, sizes in zip(table.tolist(), sd.T, strict=True):
        own = which.get(tuple(order), [])
        if not own:
            yield nowhere, (0j, 0j)
            continue
        column = sum(np.outer(heard[k], driven[k] * found.curves[:, k] ** 2) for k in own)
        pole = hertz[own[0]] / found.few.half
        yield factor * column, (complex(sizes[0] * pole.real), complex(1j * sizes[1] * pole.imag))


def mode_shifts(modes: NDArray[np.intp]) -> ModeShifts | None:
    """What a fit needs to find the shifts of all modes; None where none may be shifted."""
    if not len(modes):
        return None
    return ModeShifts(
        parameters=("mode_shift.frequency", "mode_shift.damping"),
        size=len(modes),
        reads=(
            "frequency", "room_modes", "modes_apart", "mode_shift_sd", "wall_names", "piston_wall", "source_position",
            "piston_radius", "further_loudspeakers", "loudspeaker_velocity", "piston_velocity_profile", "density",
            "receiver_position", "indicated_frf", "field",
        ),
        columns=_columns,
    )  # fmt: skip
