"""Sound pressure at the microphones per velocity of the piston, and what the instruments make of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.arrays import Complex
from specan.models.effect import Parameter
from specan.models.kept import kept
from specan.models.quantity import quantity
from specan.room.model.box_field import BoxField, box, with_leans
from specan.room.model.port import Port, point

if TYPE_CHECKING:
    from specan.room.model.mesh_field import MeshField

COLD = 325.0  # m/s, at -11 degC


@dataclass(frozen=True)
class WallPlace:
    """A round patch of the wall at which an effect acts, in parts of the wall's edges.

    Of a wall that is not a rectangle: of the edges of the one around it.
    """

    across: float
    along: float
    radius: float


@dataclass(frozen=True)
class Acting:
    """What acts at a place: a further source, or a load that takes volume velocity, ``q = -Y p``.

    Its strength is the volume velocity per velocity of the piston (m^2) of a source, the admittance Y (m^3/(s Pa)) of a
    load.
    """

    port: Port | WallPlace
    strength: Complex


def opening(place: WallPlace, area: float, impedance: Complex, mass_factor: Complex, end: float) -> Acting:
    """An opening whose `impedance` (Pa s/m) counts the air on the room's side already.

    The coupling of a patch with itself holds the mass of that air once more, ``end / (pi a)`` for a patch in a baffle,
    with an `end` correction of 8 / (3 pi) radii where it moves as one; it is taken off. `mass_factor` is ``j w rho``.
    """
    return Acting(place, area / (impedance - area * mass_factor * end / (np.pi * place.radius)))


@quantity(unit="1", axes=("wall",))
def wall_admittance(
    frequency,
    wall_of_face,
    known_admittance,
    known_walls,
    *,
    common=Parameter(0.005, "1", min=0.0, max=0.03, doc="the same on all walls of which nothing is known"),
):
    """Specific admittance rho c / Z of each wall, of tied walls together, array (walls, lines)."""
    found = np.full((max(wall_of_face) + 1, len(frequency)), common, dtype=complex)
    found[known_walls] = known_admittance
    return found


@quantity(unit="1", axes=("face",))
def face_admittance(wall_admittance, wall_of_face):
    """Specific admittance of each face of the room, array (faces, lines): tied walls have one for all of theirs."""
    return wall_admittance[wall_of_face]


@quantity(unit="1", opaque=True)
@kept(3)  # a fit changes one parameter at a time, most of which leave the modes alone
def room_modes(
    frequency,
    sound_speed,
    air_attenuation,
    air_dispersion,
    face_admittance,
    room_dimensions,
    drawn_dimensions,
    mode_margin,
    modes_apart,
    mode_shift,
    wall_lean,
):
    """The room's modes, and the couplings that were asked of them."""
    lengths, as_drawn = point(room_dimensions), point(drawn_dimensions)
    k = 2 * np.pi * np.asarray(frequency, dtype=float) / (sound_speed * (1 + air_dispersion))
    # Counts and the static_correction's range belong to the drawn room in cold air: while temperature or an edge
    # is fitted they must not jump.
    k_max = 2 * np.pi * float(np.max(frequency)) / COLD
    counts = mode_counts(as_drawn, k_max, float(mode_margin))
    k2 = (k - 1j * air_attenuation) ** 2
    soft = 1j * k * face_admittance
    found = box(frequency, lengths, k2, soft, as_drawn, k_max, counts, modes_apart, mode_shift)
    return with_leans(found, wall_lean)


def mode_counts(lengths: tuple[float, ...], k_max: float, margin: float) -> tuple[int, ...]:
    """Modes along each axis, so that the truncated sum reaches `margin` times the largest wave number."""
    return tuple(int(np.ceil(margin * k_max * length / np.pi)) + 2 for length in lengths)


@quantity(unit="m^2", opaque=True)
def pistons(
    room_modes,
    wall_names,
    piston_wall,
    source_position,
    piston_radius,
    piston_velocity_profile,
    further_loudspeakers,
    loudspeaker_velocity,
):
    """Number of the wall, port, and volume velocity over the vibrometer's velocity, of each loudspeaker."""
    all_of_them = [(int(piston_wall), source_position, float(piston_radius)), *further_loudspeakers]
    first, *others = loudspeaker_velocity
    ports = [room_modes.patch(wall_names[wall], centre, radius) for wall, centre, radius in all_of_them]
    velocities = [piston_velocity_profile * first, *others]
    walls = [wall for wall, _, _ in all_of_them]
    strengths = [np.pi * port.radius**2 * moving for port, moving in zip(ports, velocities, strict=True)]
    return tuple(zip(walls, ports, strengths, strict=True))


@quantity(unit="Pa*s/m", axes=("place",))
def field(
    frequency,
    room_modes,
    pistons,
    density,
    sound_speed,
    face_admittance,
    receiver_position,
    sources,
    local_loads,
    loudspeaker_velocity,
):
    """Sound pressure over the velocity at the vibrometer's point, array (places, lines).

    ``p = j w rho sum_s G(r, s) q_s``: the pistons with their area times mean velocity, further sources, and
    what local loads give back. A piston, moving or at rest, does not yield to the pressure as the wall around it
    does: it is a load with the negative admittance of its area.
    """
    omega = 2 * np.pi * frequency
    microphones = _points(np.asarray(receiver_position, dtype=float).tobytes(), pistons[0][1].axis)
    given = [(port, strength) for _, port, strength in pistons]
    given += [(port, strength * loudspeaker_velocity[0]) for port, strength in _placed(sources, room_modes)]
    loads = [
        (port, -np.pi * port.radius**2 * face_admittance[wall] / (density * sound_speed))
        for wall, port, _ in pistons
    ]
    factor = 1j * omega * density
    loads = [one for one in (*loads, *_placed(local_loads, room_modes)) if np.any(one[1])]
    room_modes.prepare([port for port, _ in (*given, *loads)])
    receivers = [*(port for port, _ in loads), *microphones]
    couplings = {
        port: room_modes.coupling(port, receivers) for port in dict.fromkeys([*dict(given), *dict(loads)])
    }
    total = np.zeros((len(frequency), len(microphones)), dtype=complex)
    for port, strength in [*given, *_load_strengths(couplings, factor, given, loads)]:
        total += strength[:, None] * couplings[port][:, len(loads) :]
    return (factor[:, None] * total).T


@lru_cache(maxsize=64)
def _points(positions: bytes, axis: int) -> tuple[Port, ...]:
    """Ports of microphones; the same ones where they stand still, as they mostly do in a fit."""
    return tuple(Port(point(p), axis) for p in np.frombuffer(positions).reshape(-1, 3))


def _placed(collection: Any, modes: BoxField | MeshField) -> Iterator[tuple[Port, Complex]]:
    """Ports and strengths of what joined a collection; an effect at one wall comes as ``(wall, thing)``."""
    for item in collection:
        wall, thing = item if isinstance(item, tuple) and isinstance(item[0], str) else ("", item)
        for one in thing if isinstance(thing, tuple) else (thing,):
            place = one.port
            if isinstance(place, WallPlace):
                place = modes.place(wall, place.across, place.along, place.radius)
            yield place, one.strength


def _load_strengths(
    couplings: Mapping[Port, Complex],
    factor: Complex,
    sources: Sequence[tuple[Port, Complex]],
    loads: Sequence[tuple[Port, Complex]],
) -> list[tuple[Port, Complex]]:
    """Volume velocity that each load returns: ``(1 + F G Y) p = F G q`` at the loads, ``q = -Y p``.

    `couplings` are those of each port with the loads first of all.
    """
    if not loads:
        return []
    count, lines = len(loads), len(factor)
    driven = factor[:, None] * sum(
        strength[:, None] * couplings[port][:, :count] for port, strength in sources
    )
    between = np.stack([couplings[port][:, :count] for port, _ in loads], axis=2)  # (lines, at, from)
    admittance = np.stack([y * np.ones(lines) for _, y in loads], axis=1)
    matrix = np.eye(count) + factor[:, None, None] * between * admittance[:, None, :]
    pressure = np.linalg.solve(matrix, driven[..., None])[..., 0]
    return list(zip((port for port, _ in loads), (-admittance * pressure).T, strict=True))


@quantity(unit="1", collection=True)
def sources():
    """Further sources of sound."""
    return ()


@quantity(unit="1", collection=True)
def local_loads():
    """Resonators, openings, objects: each condensed to what it does at its place."""
    return ()


@quantity(unit="1", axes=("loudspeaker",))
def loudspeaker_ratio(frequency, loudspeaker_nominal):
    """Velocity of each further loudspeaker over that of the piston where all are driven, array (others, lines)."""
    level_dB, delay_s, sign = loudspeaker_nominal
    size = sign * 10 ** (level_dB / 20)
    return size[:, None] * np.exp(-2j * np.pi * np.outer(delay_s, frequency))


@quantity(unit="1")
def loudspeaker_velocity(loudspeaker_ratio, driven, driven_sets):
    """Velocity of the piston and the others over that of the vibrometer's in this recording; zero of one at rest."""
    all_driven = np.pad(loudspeaker_ratio, ((1, 0), (0, 0)), constant_values=1.0)
    seen, *others = driven_sets[int(driven)]
    moving = np.zeros_like(all_driven)
    moving[seen] = 1.0
    for number in others:
        moving[number] = all_driven[number] / all_driven[seen]
    return moving


@quantity(unit="s", axes=("microphone",))
def receiver_delay(card_delay, card_of_microphone):
    """Delay of each microphone channel: that of its card."""
    return card_delay[card_of_microphone]


@quantity(unit="Pa*s/m", axes=("place",))
def indicated_frf(
    frequency, field, receiver_gain, receiver_delay, vibrometer_delay, vibrometer_gain, microphone_at_place
):
    """Transfer function as the instruments indicate it, array (places of microphones, lines)."""
    # the microphones of a card are late together
    delay, own = np.unique(receiver_delay[microphone_at_place] - vibrometer_delay, return_inverse=True)
    turned = np.exp(-2j * np.pi * np.outer(delay, frequency)) / vibrometer_gain
    return field * (receiver_gain[microphone_at_place, None] * turned[own])
