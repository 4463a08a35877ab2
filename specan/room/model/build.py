"""From a rig file to the room model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import RequestError
from specan.models.catalogue import effects_in
from specan.models.effect import Use
from specan.models.model import Model, Nuisance, Words
from specan.models.quantity import Condition, Observable, Quantity, constant, quantities_in
from specan.room.model import air, field, known_walls, mode_shifts
from specan.room.model.leaning_walls import LEANS
from specan.room.model.places import FieldReceivers, errors_of, in_recording, places_of, wall_areas
from specan.room.model.rig import WALLS, Rig, read_rig
from specan.room.model.rig_tables import TemperatureLog, read_temperature_log
from specan.room.model.shape import RoomShape, mesh_shape

WORDS = Words(
    ideal="the ideal room",
    discrepancy_of="response",
    remedy_uncertainty="position_m = 0.002",
    what_else="Positions that would determine more of the walls: specan study impedance {study}",
)
CONDITIONS = (
    Condition("frequency", "Hz", "Frequency of each line.", "frequency_hz", "Hz"),
    Condition("velocity_psd", "m^2/s", "Power spectral density of the vibrometer's signal.", "velocity_psd", "m^2/s"),
    Condition("temperature_difference", "K", "Air of a recording over the nominal temperature.",
              "temperature_difference_K", "K", default=0.0),
    Condition("driven", "1", "Number of the set of loudspeakers that move.", "driven", "1", default=0.0),
)  # fmt: skip
FRF = Observable("frf", "indicated_frf", "Pa*s/m", "Sound pressure over diaphragm velocity.", kind="frf")
MODE_MARGIN = 1.7  # largest wave number of the truncated sum over that of the band
LACKS = {  # why effects at an axis without elements cannot be looked for
    "known_wall": "the rig file states the impedance of no wall ([walls])",
    "loudspeaker": "the rig file has no further loudspeaker ([[loudspeakers]])",
    "lean": "the walls of a mesh have the slopes of the mesh",
}
LARGEST_M = 100.0  # no room is so large along its shortest edge
MOST_MODES = 60_000  # about 60 MB a block of lines


def build(rig: Mapping[str, Any]) -> Model:
    """Build the model of a rectangular room, or of one of any shape from a mesh.

    Raises
    ------
    RequestError
        The rig file has an unknown key, lacks one, says something impossible, or needs too many modes.
    """
    settings, log, notes = _at_logged_temperature(read_rig(rig))
    shape = _box(settings) if settings.room.mesh is None else mesh_shape(settings)
    microphones = tuple(f"Mic {i}" for i in range(1, len(settings.mics.position_m) + 1))
    places = places_of(settings, microphones)
    cards = settings.mics.cards or ((1, len(microphones)),)
    walls = known_walls.tied(shape.walls, settings.room.tied_walls)
    tables = known_walls.known_tables(settings.walls, walls, (settings.band.f_min_hz, settings.band.f_max_hz))
    modes = mode_shifts.modes_of(settings)
    quantities = [
        *quantities_in(air, known_walls, field),
        *shape.quantities,  # a mesh has modes of its own
        *_constants(settings, cards, shape.walls, walls, tables),
        *mode_shifts.quantities(settings, modes),
    ]
    effects = effects_in("specan.room.model.effects")
    loudspeakers = tuple(f"loudspeaker {i}" for i in range(2, 2 + len(settings.loudspeakers)))
    leans = LEANS if settings.room.mesh is None else ()
    there = {"known_wall": tables, "loudspeaker": loudspeakers, "lean": leans}
    unsuited = {n: LACKS[e.at] for n, e in sorted(effects.items()) if e.at in there and not there[e.at]}
    return Model(
        name="room",
        title=shape.title,
        notes=(*shape.notes, *notes, *mode_shifts.notes(settings, modes)),
        conditions={c.name: c for c in CONDITIONS},
        quantities={q.name: q for q in quantities},
        effects={name: effect for name, effect in effects.items() if name not in unsuited},
        unsuited=unsuited,
        observables={"frf": FRF},
        nuisances=tuple(n for n in _nuisances(settings, tables) if Use.parse(n.effect).name not in unsuited),
        axes={
            "wall": tuple(walls),
            "face": shape.walls,
            "known_wall": tuple(tables),
            "octave": tuple(f"{f:.4g} Hz" for f in _bands(settings, per_octave=1)),
            "microphone": microphones,
            "place": places,
            "loudspeaker": loudspeakers,
            "lean": leans,
            "card": tuple(f"card {i}" for i in range(1, len(cards) + 1)),
            "third_octave": tuple(f"{f:.4g} Hz" for f in _bands(settings)),
            **mode_shifts.axes(modes),
            "dimension": ("x", "y", "z"),
        },
        words=WORDS,
        for_kinds={
            "frf": FieldReceivers(
                settings,
                places,
                np.concatenate(settings.places),
                errors_of(settings),
                partial(in_recording, settings, log),
                settings.room.dims_m,
                len(modes),
            )
        },
        settings={"rig": settings.model_dump(), "face_areas_m2": shape.areas_m2},
    )


def _at_logged_temperature(rig: Rig) -> tuple[Rig, TemperatureLog | None, tuple[str, ...]]:
    """The rig with the air as a thermometer has logged it, where it has; the log, and what to tell of it."""
    if rig.air.temperature_log is None:
        return rig, None, ()
    path = Path(rig.air.temperature_log)
    log = read_temperature_log(path)
    mean, span = float(log.celsius.mean()), float(np.ptp(log.celsius))
    known, how = rig.uncertainty.temperature_K, ", of each recording by its own time"
    if log.time_utc is None:
        # The air passed through every value of the span: a rectangular law, span / sqrt(12) (JCGM 100:2008, 4.3.7).
        known, how = float(np.hypot(known, span / np.sqrt(12))), ""
    air = rig.air.model_copy(update={"nominal_temperature_C": mean})
    uncertainty = rig.uncertainty.model_copy(update={"temperature_K": known})
    said = (
        f"{path.name}: air of {mean:.2f} degrees Celsius, {span:.2g} K from the lowest to the highest reading; "
        f"standard uncertainty {known:.2g} K with that of the thermometer{how}"
    )
    return rig.model_copy(update={"air": air, "uncertainty": uncertainty}), log, (said,)


def _box(rig: Rig) -> RoomShape:
    dims = rig.room.dims_m
    assert dims is not None
    k_max = 2 * np.pi * rig.band.f_max_hz / field.COLD
    modes = int(np.prod(field.mode_counts(dims, k_max, MODE_MARGIN)))
    if modes > MOST_MODES and min(dims) > LARGEST_M:
        raise RequestError(
            f"[room] dims_m says {list(dims)}",
            expected="edges in metres",
            remedy="divide them by 1000 if they are millimetres",
        )
    if modes > MOST_MODES:
        # 16 bytes a mode and line, 64 lines at once
        raise RequestError(
            f"the room of {list(dims)} m has {modes} modes up to {MODE_MARGIN} times "
            f"{rig.band.f_max_hz:.0f} Hz, which would take {modes * 64 * 16 * 4 / 1e9:.1f} GB",
            expected=f"at most {MOST_MODES} modes",
            remedy="lower [band] f_max_hz",
        )
    reach = "Reach of the truncated modal sum over the band's wave number."
    return RoomShape(
        title="Sound field of a rectangular room with a piston in one wall",
        walls=WALLS,
        areas_m2=tuple(wall_areas(dims).values()),
        quantities=(
            constant("room_origin", np.zeros(3), "m", "Corner from which the room's edges start."),
            constant("room_dimensions", np.array(dims), "m", "Edges of the room.", ("dimension",)),
            constant("drawn_dimensions", np.array(dims), "m", "Edges of the room as drawn."),
            constant("mode_margin", MODE_MARGIN, "1", reach),
            constant("wall_lean", np.zeros(len(LEANS)), "1", "Slopes of walls along their edges.", ("lean",)),
            field.room_modes,
        ),
    )


def _constants(
    rig: Rig,
    cards: tuple[tuple[int, int], ...],
    faces: tuple[str, ...],
    walls: Mapping[str, tuple[str, ...]],
    tables: Mapping[str, known_walls.WallTable],
) -> list[Quantity]:
    count, everywhere = len(rig.mics.position_m), np.concatenate(rig.places)
    card_of = np.zeros(count, dtype=int)
    for number, (low, high) in enumerate(cards):
        card_of[low - 1 : high] = number
    ratios = [(one.level_dB, one.delay_s, -1.0 if one.inverted else 1.0) for one in rig.loudspeakers]
    names = list(walls)
    wall_of = np.array([next(i for i, n in enumerate(names) if face in walls[n]) for face in faces])
    known = np.array([names.index(name) for name in tables], dtype=int)
    celsius, humidity = rig.air.nominal_temperature_C, rig.air.relative_humidity_percent
    listed: list[tuple[str, Any, str, str, tuple[str, ...]]] = [
        ("nominal_air_temperature", celsius + air.ZERO_CELSIUS, "K", "As the rig file states it.", ()),
        ("air_pressure", rig.air.nominal_pressure_Pa, "Pa", "Static pressure.", ()),
        ("relative_humidity", humidity / 100, "1", "Relative humidity.", ()),
        ("receiver_position", everywhere, "m", "Places of microphones, in all recordings.", ("place",)),
        ("microphone_at_place", np.arange(len(everywhere)) % count, "1", "Number of the microphone at each place.",
         ("place",)),
        ("receiver_gain", np.ones(count), "1", "Indicated over true pressure of each microphone.", ("microphone",)),
        ("card_delay", np.zeros(len(cards)), "s", "Delay of each converter card.", ("card",)),
        ("card_of_microphone", card_of, "1", "Number of the card of each microphone.", ("microphone",)),
        ("source_position", np.array(rig.piston.centre_m), "m", "Centre of the piston.", ()),
        ("piston_wall", faces.index(rig.piston.wall), "1", "Number of the piston's wall.", ()),
        ("piston_radius", rig.piston.radius_m, "m", "Radius of the piston.", ()),
        ("piston_velocity_profile", 1.0, "1", "Mean velocity of the diaphragm over that where it is measured.", ()),
        ("vibrometer_gain", 1.0, "1",
         "Indicated over true velocity; what a noisy reference does to an estimate is in it too.", ()),
        ("vibrometer_delay", 0.0, "s", "Delay of the vibrometer's channel.", ()),
        ("loudspeaker_nominal", np.array(ratios).reshape(-1, 3).T, "1",
         "Level (dB), delay (s) and sign against the piston.", ()),
        ("third_octave_hz", _bands(rig), "Hz", "Third octaves of the band.", ("third_octave",)),
        ("octave_hz", _bands(rig, per_octave=1), "Hz", "Octaves of the band.", ("octave",)),
        ("wall_of_face", wall_of, "1", "Number of the wall that each face belongs to.", ("face",)),
        ("known_walls", known, "1", "Numbers of the walls of which something is stated.", ()),
    ]  # fmt: skip
    further = tuple((faces.index(s.wall), np.array(s.centre_m), s.radius_m) for s in rig.loudspeakers)
    opaque = [
        ("wall_names", faces, "Names of the walls."),
        ("wall_tables", tuple(tables.values()), "What the rig file states of walls."),
        ("further_loudspeakers", further, "Wall, centre and radius of loudspeakers beside the piston."),
        ("driven_sets", rig.driven_sets, "Loudspeakers that move, that of the vibrometer first."),
    ]
    solver = [constant(name, value, "1", doc, opaque=True) for name, value, doc in opaque]
    return [*solver, *(constant(*one) for one in listed)]


def _bands(rig: Rig, per_octave: int = 3) -> np.ndarray:
    """Exact mid-band frequencies of the third octaves or octaves of the band (IEC 61260-1, base 10)."""
    ends = (max(rig.band.f_min_hz, 1.0), rig.band.f_max_hz)
    low, high = (round(10 * np.log10(f / 1000) * per_octave / 3) for f in ends)
    return 1000 * 10.0 ** (np.arange(low, high + 1) * 3 / (10 * per_octave))


def _nuisances(rig: Rig, known: Iterable[str]) -> tuple[Nuisance, ...]:
    """Instrument errors and the state of the air, held by what the rig file says of them."""
    cards = [f"microphone-delay@card {i}" for i in range(1, len(rig.mics.cards) + 1)]
    held = [  # effect, parameter, key of [uncertainty], its unit in that of the parameter
        ("temperature", "offset", "temperature_K", 1.0),
        ("vibrometer-delay", "delay", "vibrometer_delay_s", 1.0),
        ("vibrometer-gain", "gain", "vibrometer_gain_percent", 0.01),
        *((f"dimension-error@{axis}", "error", "dimension_percent", 0.01) for axis in "xyz"),
        *((card, "delay", "card_delay_s", 1.0) for card in cards),
    ]
    listed = [
        (e, p, unit * getattr(rig.uncertainty, key), f"[uncertainty] {key}") for e, p, key, unit in held
    ]
    for number, one in enumerate(rig.loudspeakers, 2):
        for part, sd in (("level", one.u_level_dB), ("delay", one.u_delay_s)):
            listed.append((f"loudspeaker-ratio@loudspeaker {number}", part, sd, "[[loudspeakers]]"))
    for wall in known:
        listed += [(f"wall-data@{wall}", part, 1.0, "[walls]") for part in ("conductance", "susceptance")]
    return tuple(Nuisance(e, p, sd, said, e == "temperature") for e, p, sd, said in listed if sd)
