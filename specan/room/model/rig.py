"""The room's rig file: dimensions, piston, microphones, cards and what is uncertain about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from specan.errors import RequestError
from specan.room.model.known_walls import KnownWall
from specan.schema import Settings, parse, read_toml

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Point = tuple[float, float, float]
WALLS = ("x0", "x1", "y0", "y1", "z0", "z1")


class Room(Settings):
    """A box, or a mesh whose walls are named surfaces."""

    dims_m: tuple[Positive, Positive, Positive] | None = None
    mesh: str | None = None
    tied_walls: tuple[tuple[str, ...], ...] = ()


class Piston(Settings):
    """The loudspeaker's diaphragm."""

    wall: str
    centre_m: Point
    radius_m: Positive


class Loudspeaker(Piston):
    """A further diaphragm, driven by the same generator, or alone in recordings of its own."""

    level_dB: float = 0.0
    delay_s: float = 0.0
    inverted: bool = False
    u_level_dB: NotNegative = 0.5
    u_delay_s: NotNegative = 1e-5


class OwnRecording(Settings):
    """What is otherwise in one recording than in the others."""

    file: str
    position_m: tuple[Point, ...] | None = None
    temperature_C: Annotated[float, Field(gt=-50, lt=80)] | None = None
    driven: tuple[int, ...] | None = None


class Air(Settings):
    """State of the air."""

    nominal_temperature_C: Annotated[float, Field(gt=-50, lt=80)] = 20.0
    nominal_pressure_Pa: Annotated[float, Field(gt=5e4, lt=2e5)] = 101325.0
    relative_humidity_percent: Annotated[float, Field(ge=0, le=100)] = 50.0
    temperature_log: str | None = None


class Band(Settings):
    """Frequencies that the study looks at."""

    f_max_hz: Positive
    f_min_hz: NotNegative = 20.0
    block_s: Annotated[float, Field(ge=0.5, le=20)] | None = None
    hum_hz: Positive | None = None
    left_out_hz: tuple[tuple[NotNegative, Positive], ...] = ()


# Of an edge: places in another unit reach as far into the room, one coordinate mistyped does not.
REACHES = 0.2


class Mics(Settings):
    """Microphones in the order of their channels."""

    position_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    nominal_sensitivity_mV_per_Pa: Positive = 50.0
    cards: tuple[tuple[int, int], ...] = ()


class Vibrometer(Settings):
    """The laser vibrometer on the diaphragm."""

    sensitivity_mm_s_per_V: Positive = 50.0
    point: str = "diaphragm centre"


class Background(Settings):
    """What is heard while the loudspeaker is silent."""

    recording: str | None = None


class Identity(Settings):
    """Recordings of one rig share a calibration."""

    id: int | str = 1


NUMERICAL_PERCENT = 0.005  # the model's natural frequencies against finite elements (docs/room.md)
# From here on natural_frequency_percent means each mode by itself: four times what numerical errors are, and a
# thirtieth of the half width of a mode that decays in a second at 400 Hz (1.1 Hz), less than which no shift is seen.
MODE_BY_MODE_PERCENT = 0.02
USUAL_DAMPING = 30.0  # per cent of damping beside one of frequency: 0.1 % and 3 % are usual of built rooms


class Uncertainty(Settings):
    """Standard uncertainties."""

    temperature_K: NotNegative = 0.5
    position_m: NotNegative | tuple[NotNegative, ...] = 0.002
    frame_m: NotNegative = 0.0
    frame_tilt_deg: NotNegative = 0.0
    dimension_percent: NotNegative = 0.1
    calibration_dB: NotNegative = 0.1
    calibration_phase_deg: NotNegative = 0.3
    calibrator_dB: NotNegative = 0.0
    card_delay_s: NotNegative = 8e-8
    vibrometer_delay_s: NotNegative = 1e-5
    vibrometer_gain_percent: NotNegative = 1.0
    model_discrepancy_percent: NotNegative = 0.5
    natural_frequency_percent: NotNegative = NUMERICAL_PERCENT
    mode_frequency_percent: NotNegative | None = None
    mode_damping_percent: NotNegative | None = None

    @property
    def smooth_percent(self) -> float:
        """Uncertainty of natural frequencies that neighbouring modes share."""
        given = self.natural_frequency_percent
        return NUMERICAL_PERCENT if given >= MODE_BY_MODE_PERCENT else given

    @property
    def of_each_mode(self) -> tuple[float, float]:
        """Relative uncertainties of each mode's natural frequency and damping; zeros where none is declared."""
        frequency = self.mode_frequency_percent
        if frequency is None:
            given = self.natural_frequency_percent
            frequency = given if given >= MODE_BY_MODE_PERCENT else 0.0
        damping = self.mode_damping_percent
        return frequency / 100, (USUAL_DAMPING * frequency if damping is None else damping) / 100


class Rig(Settings):
    """Everything that a room's rig file says."""

    room: Room
    piston: Piston
    loudspeakers: tuple[Loudspeaker, ...] = ()
    recordings: tuple[OwnRecording, ...] = ()
    walls: dict[str, KnownWall] = Field(default_factory=dict)
    air: Air = Air()
    band: Band
    mics: Mics
    vibrometer: Vibrometer = Vibrometer()
    background: Background = Background()
    rig: Identity = Identity()
    uncertainty: Uncertainty = Uncertainty()

    @property
    def pistons(self) -> dict[str, Piston]:
        """All diaphragms, by what they are called in messages."""
        further = {f"loudspeaker {i}": one for i, one in enumerate(self.loudspeakers, 2)}
        return {"piston": self.piston, **further}

    @property
    def moved(self) -> dict[str, tuple[Point, ...]]:
        """Places of the microphones in recordings in which they stand elsewhere."""
        return {own.file: own.position_m for own in self.recordings if own.position_m is not None}

    @property
    def places(self) -> list[np.ndarray]:
        """Where the microphones stand: as a rule, then in those recordings."""
        return [np.array(places, dtype=float) for places in (self.mics.position_m, *self.moved.values())]

    @property
    def driven_sets(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the loudspeakers that move, counted from 0: all, then those of recordings with others."""
        own = [tuple(n - 1 for n in one.driven) for one in self.recordings if one.driven is not None]
        return (tuple(range(1 + len(self.loudspeakers))), *dict.fromkeys(own))


def read_rig(content: Mapping[str, Any]) -> Rig:
    """Check a parsed rig file.

    Raises
    ------
    RequestError
        Unknown or missing key, a microphone outside the box or two in one place, a piston off its wall.
    """
    rig = parse(Rig, content, "the rig file")
    if (rig.room.dims_m is None) == (rig.room.mesh is None):
        raise RequestError("[room] gives neither or both of dims_m and mesh", expected="one of them")
    if rig.room.mesh is not None and (
        rig.uncertainty.mode_frequency_percent or rig.uncertainty.mode_damping_percent
    ):
        raise RequestError(
            "[uncertainty] mode_frequency_percent and mode_damping_percent are for rooms that dims_m describes",
            remedy="leave them out, or give dims_m",
        )
    if rig.band.f_max_hz <= rig.band.f_min_hz:
        raise RequestError(
            f"[band] f_max_hz is {rig.band.f_max_hz}, f_min_hz {rig.band.f_min_hz}",
            expected="f_max_hz above f_min_hz",
        )
    given = rig.uncertainty.position_m
    if isinstance(given, tuple) and len(given) != len(rig.mics.position_m):
        raise RequestError(
            f"[uncertainty] position_m has {len(given)} values for {len(rig.mics.position_m)} microphones",
            expected="one value, or one per microphone",
        )
    for low, high in rig.band.left_out_hz:
        if low >= high:
            raise RequestError(f"[band] left_out_hz says [{low:g}, {high:g}]", expected="the lower end first")
    for places in rig.places:
        _check_apart(places)
    if rig.room.dims_m is not None:
        dims = np.array(rig.room.dims_m)
        for places in rig.places:
            _check_inside(places, dims)
        for name, piston in rig.pistons.items():
            _check_in_wall(name, piston, dims)
    _check_cards(rig)
    _check_recordings(rig)
    return rig


def _check_recordings(rig: Rig) -> None:
    count, files = len(rig.mics.position_m), [own.file for own in rig.recordings]
    for own in rig.recordings:
        where = f"[[recordings]] {own.file}"
        if files.count(own.file) > 1:
            raise RequestError(f"{where} occurs twice", expected="one table per recording")
        if own.position_m is not None and len(own.position_m) != count:
            raise RequestError(
                f"{where} has {len(own.position_m)} positions, [mics] {count}",
                expected="the same microphones in the same order",
            )
        numbers = range(1, 2 + len(rig.loudspeakers))
        if own.driven is not None and (not own.driven or not set(own.driven) <= set(numbers)):
            raise RequestError(
                f"{where} says driven = {list(own.driven)}",
                expected=f"numbers of loudspeakers, 1 (the piston) to {numbers[-1]}, that of the vibrometer first",
            )


def microphone_outside(number: int, place: Sequence[float], expected: str) -> RequestError:
    """What to say of a microphone that is not in the room."""
    return RequestError(
        f"microphone {number} is at {list(place)} m, outside the room",
        expected=expected,
        remedy="correct [mics] position_m or the room",
    )


def _check_apart(points: np.ndarray) -> None:
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    for first, second in np.argwhere(np.triu(apart < 1e-3, 1)).tolist():
        raise RequestError(
            f"microphones {first + 1} and {second + 1} are in the same place",
            expected="places at least 1 mm apart",
            remedy="correct [mics] position_m",
        )


def _check_inside(places: np.ndarray, dims: np.ndarray) -> None:
    for size, unit in ((100, "centimetres"), (1000, "millimetres")):
        inside = np.all((places >= 0) & (places / size <= dims))
        if np.any(places > dims) and inside and np.max(places / size / dims) > REACHES:
            raise RequestError(
                f"[mics] position_m goes up to {places.max():g}, in a room of {dims.tolist()} m",
                expected="metres",
                remedy=f"divide the positions by {size}: they look like {unit}",
            )
    for number, point in enumerate(places, 1):
        if np.any(point < 0) or np.any(point > dims):
            raise microphone_outside(number, point, f"coordinates between 0 and {dims.tolist()} m")


def _check_in_wall(name: str, piston: Piston, dims: np.ndarray) -> None:
    if piston.wall not in WALLS:
        raise RequestError(
            f"[piston] wall is {piston.wall!r}" if name == "piston" else f"wall of {name} is {piston.wall!r}",
            expected="one of " + ", ".join(WALLS),
            remedy="correct it",
        )
    axis, far = "xyz".index(piston.wall[0]), piston.wall[1] == "1"
    centre = np.array(piston.centre_m)
    if abs(centre[axis] - (dims[axis] if far else 0.0)) > 1e-6:
        raise RequestError(
            f"the {name}'s centre {centre.tolist()} m does not lie in wall {piston.wall}",
            expected=f"{'xyz'[axis]} = {dims[axis] if far else 0.0}",
        )
    for other in {0, 1, 2} - {axis}:
        if not piston.radius_m <= centre[other] <= dims[other] - piston.radius_m:
            raise RequestError(
                f"the {name} of radius {piston.radius_m} m at {centre.tolist()} m reaches over the wall's edge",
                remedy="correct its centre_m or radius_m",
            )


def _check_cards(rig: Rig) -> None:
    count = len(rig.mics.position_m)
    seen: set[int] = set()
    for low, high in rig.mics.cards:
        numbers = set(range(low, high + 1))
        if low < 1 or high > count or low > high or numbers & seen:
            raise RequestError(
                f"[mics] cards says [{low}, {high}] for {count} microphones",
                expected="ranges that do not overlap",
            )
        seen |= numbers


EXAMPLE_RIG = read_toml(Path(__file__).with_name("example.toml"))
