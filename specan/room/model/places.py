"""Microphones of a room: their places and errors, which are near a wall, and where further ones can stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.models.model import Model
from specan.room.model.port import Port, point
from specan.room.model.rig import WALLS, OwnRecording, Rig
from specan.room.model.rig_tables import TemperatureLog

EACH_WAY = 4  # places along each edge
FROM_WALL_M = 0.06
FROM_PISTON_M = 0.15
APART_M = 0.05
NEAR = 0.3  # of an edge: within this distance a microphone is near a wall
# Standard deviation over a recording, below which it moves no mode by a hundredth of its width.
DRIFT_K = 0.02


@dataclass(frozen=True)
class ReceiverErrors:
    """Declared standard uncertainties of the receivers and of the model.

    Attributes
    ----------
    position_m : float or array (receivers, 1)
        Of each coordinate of a receiver.
    calibration_dB, calibration_phase_deg : float or array (receivers, 1)
        Of a receiver's calibration.
    discrepancy : float
        Of the model: part of the response, and half of that part of the third octave's RMS response over all
        receivers (where modes cancel, their errors do not).
    detuning : float
        Part of the model's natural frequencies and bandwidths, smooth over neighbouring modes.
    frame_m, frame_tilt_deg : float
        Of each coordinate of all receivers together, and of their rotation about each axis through their middle.
    common_dB : float
        Of the level of the calibrator, common to all receivers.
    """

    position_m: float | Real
    calibration_dB: float | Real
    calibration_phase_deg: float | Real
    discrepancy: float
    detuning: float
    frame_m: float = 0.0
    frame_tilt_deg: float = 0.0
    common_dB: float = 0.0


# Shifts of single modes, of which only a standard uncertainty is known: parameters of the model that no one names,
# vectors over the modes, in standard uncertainties. A fit finds them beside everything else.
SHIFTS = ("mode_shift.frequency", "mode_shift.damping")


def shifts_of(values: Mapping[str, Any], modes: int) -> Real:
    """Shifts out of the values of parameters, natural frequencies before dampings, array (2 modes,)."""
    return np.concatenate([np.broadcast_to(np.asarray(values.get(n, 0.0), float), modes) for n in SHIFTS])


def named_shifts(shifts: Real) -> dict[str, Real]:
    """The parameters, from shifts (2 modes,)."""
    return dict(zip(SHIFTS, np.split(shifts, 2), strict=True))


@dataclass(frozen=True, eq=False)
class InRecording:
    """What of the receivers and the conditions holds in one recording.

    Attributes
    ----------
    rows : array of int
        Receivers of the axis that it has, in the order of its channels.
    conditions : mapping
        Conditions that hold for the whole of it.
    drift : tuple of str and array (n,), optional
        A condition that changed while it was recorded, and by how much it was off its mean, at even steps.
    text : str
        What was found, for a person.
    """

    rows: NDArray[np.intp]
    conditions: Mapping[str, float] = field(default_factory=dict)
    drift: tuple[str, Real] | None = None
    text: str = ""


@dataclass(frozen=True, eq=False)
class FieldReceivers:
    """Microphones at places in a room, compared with the vibrometer.

    Attributes
    ----------
    rig : Rig
        The checked rig file.
    names : tuple of str
        Of the places.
    positions_m : array (places, 3)
    errors : ReceiverErrors
    in_recording : callable
        ``in_recording(file name, start, duration_s) -> InRecording``, `start` a datetime64 (UTC) or None where nothing
        tells.
    box : tuple of float, optional
        Edges of a rectangular room: then modes have names, and places near walls and on them are known.
    shifts : int
        How many modes have shifts of their own.
    """

    rig: Rig
    names: tuple[str, ...]
    positions_m: Real
    errors: ReceiverErrors
    in_recording: Callable[[str, Any, float], InRecording]
    box: tuple[float, float, float] | None
    shifts: int


def receivers_of(model: Model) -> FieldReceivers:
    """The receivers of a room's model."""
    found: FieldReceivers = model.for_kinds["frf"]
    return found


def places_of(rig: Rig, microphones: Sequence[str]) -> tuple[str, ...]:
    """Names of the places of all microphones: ``Mic 3``, and ``Mic 3 in second`` where it stands elsewhere."""
    moved = [f"{name} in {Path(file).stem}" for file in rig.moved for name in microphones]
    return (*microphones, *moved)


def in_recording(
    rig: Rig, log: TemperatureLog | None, file: str, start: np.datetime64 | None, duration_s: float
) -> InRecording:
    """Where the microphones stand in a recording, how warm its air is, and which loudspeakers move."""
    name = Path(file).name
    own = next((one for one in rig.recordings if one.file == name), OwnRecording(file=name))
    count, number = len(rig.mics.position_m), 0
    if own.position_m is not None:
        number = 1 + list(rig.moved).index(name)
    text, drift = "", None
    moving = tuple(n - 1 for n in own.driven or ())
    driven = 1 + rig.driven_sets[1:].index(moving) if moving else 0
    conditions = {"driven": float(driven)} if driven else {}
    if own.temperature_C is not None:
        conditions["temperature_difference"] = own.temperature_C - rig.air.nominal_temperature_C
        text = f"air of {own.temperature_C:g} degrees Celsius"
    elif log is not None and log.time_utc is not None and start is not None:
        during = log.during(start, duration_s)
        conditions["temperature_difference"] = float(during.mean()) - rig.air.nominal_temperature_C
        text = f"air of {during.mean():.2f} degrees Celsius, {np.ptp(during):.2g} K of drift"
        if during.std() > DRIFT_K:
            drift = ("temperature_difference", during - during.mean())
    return InRecording(number * count + np.arange(count), conditions, drift, text)


def errors_of(rig: Rig) -> ReceiverErrors:
    """What the rig file says of the microphones."""
    given, box = rig.uncertainty, rig.room.dims_m is not None
    place = given.position_m
    return ReceiverErrors(
        position_m=np.tile(place, 1 + len(rig.moved))[:, None] if isinstance(place, tuple) else place,
        calibration_dB=given.calibration_dB,
        calibration_phase_deg=given.calibration_phase_deg,
        discrepancy=given.model_discrepancy_percent / 100,
        detuning=(given.smooth_percent if box else given.natural_frequency_percent) / 100,
        frame_m=given.frame_m,
        frame_tilt_deg=given.frame_tilt_deg,
        common_dB=given.calibrator_dB,
    )


def on_wall(rig: Rig, wall: str, across: float, along: float) -> Real:
    """Centre of the diaphragm in parts of a wall's edges, the whole of it inside the wall, m."""
    dims, axis = np.array(rig.room.dims_m), "xyz".index(wall[0])
    centre = np.insert(np.array([across, along]), axis, float(wall[1])) * dims
    inside = np.clip(centre, rig.piston.radius_m, dims - rig.piston.radius_m)
    inside[axis] = centre[axis]
    return np.asarray(inside)


def source_words(rig: Rig, wall: str, across: float, along: float) -> str:
    """That the source is elsewhere than the rig file says."""

    def said(place: Any) -> str:
        return ", ".join(f"{c:.2f}" for c in place)

    there, here = on_wall(rig, wall, across, along), rig.piston.centre_m
    return (
        f"the loudspeaker seems to be in wall {wall} near [{said(there)}] m, "
        f"not in wall {rig.piston.wall} at [{said(here)}] m"
    )


def patterns(quantities: Mapping[str, Any], wall: str, places: Real) -> Complex:
    """Sound at the microphones of a source at places of a wall, without its near field."""
    modes, heard = quantities["room_modes"], quantities["indicated_frf"] / quantities["field"]
    ports = [modes.place(wall, across, along, 0.0) for across, along in places.tolist()]
    found = [modes.modal(Port(point(p), 0), ports) for p in quantities["receiver_position"]]
    return np.stack([column.T for column in found], axis=1) * heard


# Effects that act at one place of a wall, their parameters `across` and `along` in parts of its edges. Such an effect
# changes the response by one factor a line times the response to a source at its place: a place can be looked for
# before anything else of the effect is known (matched-field processing: Baggeroer, Kuperman & Mikhalevsky 1993, IEEE J.
# Oceanic Eng. 18:401).
PLACED = ("helmholtz-resonator", "leak", "flanking-source")
PATTERNS_READ = ("room_modes", "receiver_position", "indicated_frf", "field")


def near_walls(receivers: FieldReceivers, channels: Sequence[str]) -> dict[str, list[int]]:
    """Numbers of the channels near each wall of a box; at least two, and not all."""
    box, found = receivers.box, {}
    if box is None:
        return {}
    place = np.array([receivers.positions_m[receivers.names.index(c)] for c in channels])
    for wall in WALLS:
        near = depth(box, wall, place) <= NEAR * box["xyz".index(wall[0])]
        if 2 <= near.sum() < len(channels):
            found[wall] = np.flatnonzero(near).tolist()
    return found


def free_places(rig: Rig) -> Real:
    """A grid of places (n, 3) in m: off the walls, off the piston, where no microphone stands yet."""
    dims = np.array(rig.room.dims_m)
    margin = np.minimum(FROM_WALL_M, dims / 4)
    along = [np.round(np.linspace(m, edge - m, EACH_WAY), 3) for m, edge in zip(margin, dims, strict=True)]
    grid = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    taken = np.concatenate(rig.places)
    clear = np.min(np.linalg.norm(grid[:, None] - taken[None], axis=2), axis=1) > APART_M
    clear &= np.linalg.norm(grid - np.array(rig.piston.centre_m), axis=1) > FROM_PISTON_M
    return np.asarray(grid[clear])


def with_microphones(model: Model, places: Real) -> tuple[Model, tuple[str, ...]]:
    """The model with further microphones behind its own, on the first card; and their names."""
    names = tuple(f"place {k}" for k in range(1, len(places) + 1))
    further = len(model.axes["microphone"]) + np.arange(len(places))
    more = {"receiver_position": places, "receiver_gain": np.ones(len(places)),
            "card_of_microphone": np.zeros(len(places), dtype=int), "microphone_at_place": further}  # fmt: skip
    wider = model.with_constants({n: np.concatenate([model.quantities[n](), v]) for n, v in more.items()})
    axes = {**model.axes, **{axis: (*model.axes[axis], *names) for axis in ("microphone", "place")}}
    return replace(wider, axes=axes), names


def depth(dims_m: Sequence[float], wall: str, places: Real) -> Real:
    """Distance of places from a wall, m."""
    axis, far = "xyz".index(wall[0]), wall[1] == "1"
    return np.asarray(dims_m[axis] - places[:, axis] if far else places[:, axis])


def wall_areas(dims_m: Sequence[float]) -> Mapping[str, float]:
    """Area of every wall of a box, m^2.

    Examples
    --------
    >>> wall_areas([2.0, 3.0, 4.0])["y1"]
    8.0
    """
    x, y, z = (float(edge) for edge in dims_m)
    return {"x0": y * z, "x1": y * z, "y0": x * z, "y1": x * z, "z0": x * y, "z1": x * y}
