"""From recordings with a tacho to observations of order lines: what is fitted, what is held out."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from specan.analysis.orders import Orders
from specan.analysis.section import aligned
from specan.analysis.shaft import Shaft, tracked_shaft
from specan.data.orders import OrderLines as FoundLines
from specan.data.orders import TachoReport
from specan.data.recording import Recording
from specan.dsp.tacho import Pulses, pulse_times, repair
from specan.errors import InputError, RequestError
from specan.io.open import open_recording
from specan.models import Model
from specan.planetary_gear.model.kinematics import OrderLines
from specan.planetary_gear.study.by_order_family import localise  # noqa: F401  where a model of lines fails
from specan.planetary_gear.study.explanations import diagnosed, near_the_data  # noqa: F401  see `brought`
from specan.planetary_gear.study.order_lines import OrderLinesObservation, joined, strongest
from specan.planetary_gear.study.teeth import check_teeth
from specan.study.data.recordings import parted, reads  # noqa: F401  a recording is one by its content
from specan.study.observation import DataFile, MeasuredFiles, OpenedData, Variable
from specan.units import convert, printed_unit

TITLE = "a recording"
INDEX, TORQUE = "Tacho carrier", "Torque carrier"  # channels: phases are those at pulses of the first
WHOLE = 1 << 20  # turns of a block: all of a recording
NEIGHBOURS = 2  # lines to either side over which the noise is averaged
# Of that noise: medians of 24 bins (48 real values, of which a median of powers is worth a half: ln(2)^2) over 5 lines.
NOISE_DOF = 100.0
# Of the strongest line about the same harmonic, and of the strongest of all: what converters and resampling put
# elsewhere (lines of simulated recordings without noise have 1e-7 to 1e-4 of the one, up to 3e-5 of the other).
LEAKAGE, RANGE = 1e-4, 3e-5
# Second over first order of a stiffening contact: of F = K x^e a force that swings by the part r of its mean has a line
# at twice the frequency of (e - 1) / (4 e) r of the first; e = 1.3. Lines that one fault alone makes mix so.
PRODUCTS = 0.06
SHOWN = 1e-6  # of a harmonic's strongest line: less is rounding
MARKS = 8  # multiples of the tacho's turn at which errors of its marks are looked for
ONE_SPEED = 0.03  # of it: as far as resonances of housings stay where they are
LIKE_ENOUGH = 25.0  # chi-square that turning a recording by whole turns must gain; 1e-5 for the best of 28


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the recordings of a study.

    Raises
    ------
    InputError
        No tacho, or too few turns.
    RequestError
        The model predicts no order lines, or what is held out is not there.
    """
    known: OrderLines | None = model.for_kinds.get("orders")
    if known is None:
        raise RequestError(f"the model {model.name} predicts no order lines", remedy="give a table instead")
    wholes: list[OrderLinesObservation] = []
    statements = []
    for file in (*wanted.measurements, *wanted.validations):
        whole, said = observe(model, known, wanted, file)
        if wholes:
            whole, turned = like(wholes[0], whole)
            said += turned
        # A sensor's path is that of another recording at nearly its speed.
        speed = whole.point["sun_speed"][0]
        heard = (o.path for o in wholes if abs(np.log(speed / o.point["sun_speed"][0])) < ONE_SPEED)
        wholes.append(replace(whole, path=next(heard, len(wholes) * whole.path.size + whole.path)))
        statements += said
    files = (*wanted.measurements, *wanted.validations)
    fitted, held_out = parted(zip(files, wholes, strict=True), wanted)
    together = joined(fitted)
    unseen = (replace(joined(held_out), learned=together),) if held_out else ()
    near, path, response = (f"{100 * part:.3g} %" for part in (known.near, known.path, known.response))
    common = (
        f"every line: model discrepancy {near}, common to lines within a few orders; lines three passages beside: "
        f"{path} for the path of each harmonic to each sensor, nearer ones in proportion, common to recordings at one "
        f"speed; lines that the ideal set does not have: {response} about the first harmonic, twice that about others, "
        "common to neighbours of one kind of mode at one speed (from the rig file or its "
        "defaults); a free gain for every harmonic of each sensor"
    )
    return OpenedData((together,), unseen, (*statements, common), True, 100 * known.near)


def observe(
    model: Model, known: OrderLines, wanted: MeasuredFiles, file: DataFile
) -> tuple[OrderLinesObservation, list[str]]:
    """The order lines of one recording."""
    recording = open_recording(file.path, calibration=wanted.calibration, label=file.name)
    recording, _ = aligned(recording, recording.channels)
    names = tuple(c.name for c in recording.channels)
    sensors = tuple(model.axes["sensor"])
    missing = [n for n in sensors if n not in names]
    if missing:
        raise InputError(
            f"{file.name} has no channel {missing[0]}", expected=f"channels {', '.join(sensors)}"
        )
    tachos = {"Tacho sun": known.sun_turns, INDEX: 1.0}  # turns per turn of the carrier, the finest first
    tacho = next((name for name in tachos if name in names), None)
    if tacho is None:
        raise InputError(f"{file.name} has no tacho", expected=f"a channel {' or '.join(tachos)}")
    settings = Orders(
        channels=sensors, tacho=tacho, ratio=tachos[tacho], orders=tuple(known.order.tolist()), turns=WHOLE
    )
    found = settings(recording)
    lines = found.lines
    assert lines is not None
    unseen = check_teeth(found, settings, model.settings["parsed_rig"].gear)
    zero = 0.0
    if INDEX in names and tacho != INDEX:
        zero = _turn_zero(recording, tracked_shaft(recording, tacho, None, tachos[tacho]))
    place = [found.channels.index(n) for n in sensors]
    amplitude = lines.amplitude[place] * np.exp(2j * np.pi * known.order * zero)
    torque, how = _torque(recording, model, known, file)
    point = {"sun_speed": found.tacho.mean_hz * known.sun_turns, "carrier_torque": torque}
    levels = {name: _as_printed(model, name, value) for name, value in point.items()}
    (observable,) = (o for o in model.observables.values() if o.kind == "orders")
    beyond = ~_shown(model, observable.quantity, known, point)
    uneven = _uneven(recording, tacho)
    parts = (
        _smooth(_noise(lines)[place], known.harmonic),
        *_leakage(amplitude, known, found.tacho),
        _products(amplitude, beyond, known.harmonic),
        _marks(amplitude, known.order, tachos[tacho], uneven),
    )
    rows = np.ones(len(sensors))
    observation = OrderLinesObservation(
        name=file.name,
        of_row=(file.name,) * len(sensors),
        quantity=observable.quantity,
        channels=sensors,
        known=known,
        amplitude=amplitude,
        noise=np.sqrt(sum(part**2 for part in parts)),
        beyond=beyond,
        path=np.arange(len(sensors)),
        kept=np.ones(amplitude.shape, dtype=bool),
        point={name: value * rows for name, value in point.items()},
        levels={name: (value * rows, words) for name, (value, words) in levels.items()},
        noise_dof=NOISE_DOF,
        observable=observable.name,
    )
    said = ", ".join(f"{words.words} {value:g} {words.unit}" for value, words in levels.values())
    notes = [
        f"{len(sensors)} sensors, {known.order.size} order lines over {lines.turns} turns, angle from {tacho}; {said} "
        f"(carrier torque {how})"
    ]
    if uneven.any():
        notes.append(
            f"marks of {tacho} uneven by up to {np.degrees(uneven.max()):.2g} degree, or the speed varies so; the "
            "uncertainty of lines beside strong ones includes it"
        )
    return observation, [f"{file.name}: {note}" for note in (*notes, *unseen, *found.notes)]


def _as_printed(model: Model, name: str, value: float) -> tuple[float, Variable]:
    """The value of a condition in the unit of its column, with three digits, and its words."""
    condition = model.conditions[name]
    shown = float(convert(value, condition.unit, condition.column_unit))
    return float(f"{shown:.3g}"), Variable(name.replace("_", " "), printed_unit(condition.column_unit))


def _shown(model: Model, quantity: str, known: OrderLines, point: Mapping[str, float]) -> NDArray[np.bool_]:
    """Lines that the model shows without effects, (sensors, lines); all others are evidence of an effect."""
    conditions = {"order": known.order, **{c: np.full(known.order.size, v) for c, v in point.items()}}
    found = model.assemble(model.base_effects).evaluate(conditions, None, [quantity])[quantity]
    return np.abs(found) > SHOWN * strongest(found, known.harmonic)


def _leakage(
    amplitude: NDArray[np.complex128], known: OrderLines, tacho: TachoReport
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What strong lines put elsewhere, by the instruments and by jitter of the pulses: beside them, and anywhere.

    White jitter of N pulses has sqrt(2 / N) of it in either part of every line of the angle; an angle that turns by b
    modulates order o by o b, half of which lies at either side.
    """
    jitter = 2 * np.pi * known.order * tacho.mean_hz * tacho.jitter_s / np.sqrt(2 * max(tacho.pulses, 1))
    beside = np.hypot(LEAKAGE, jitter) * strongest(amplitude, known.harmonic)
    return beside, RANGE * np.abs(amplitude).max(axis=1, keepdims=True)


def _uneven(recording: Recording, tacho: str) -> NDArray[np.float64]:
    """By how much the tacho's marks are off at multiples of its turn, peaks in rad of its shaft; 0 below rounding.

    A mark's place is compared with the mean over the turn about it. What the shaft itself does with each turn looks
    the same and is in it.
    """
    count = round(float(recording.channel(tacho).properties.get("PulsesPerRevolution", 1)))
    pulses = _pulses(recording, tacho)
    multiple = np.arange(1, min(MARKS, (count - 1) // 2) + 1)
    turns = pulses.number[-1] // max(count, 1)
    if not multiple.size or turns < 3:
        return np.zeros(multiple.size)
    time = np.interp(np.arange(turns * count), pulses.number, pulses.time)
    # Turn by turn the marks' instants over a straight line from one turn to the next; a change of speed cancels.
    place = time[: (turns - 1) * count].reshape(-1, count)
    turn = np.diff(time[::count])[:, None]
    off = (place - place[:, :1]) / turn - np.arange(count) / count
    mean = 2 * np.pi * (off - off.mean(axis=1, keepdims=True)).mean(axis=0)
    found = np.abs(np.fft.rfft(mean))[multiple] * 2 / count
    return np.where(found > 2 * np.pi * np.spacing(time[-1]) / turn.min(), found, 0.0)


def _pulses(recording: Recording, tacho: str) -> Pulses:
    channel = recording.channel(tacho)
    return repair(pulse_times(recording.read([channel])[0], channel.sampling_rate))


def _marks(
    amplitude: NDArray[np.complex128],
    order: NDArray[np.float64],
    turns: float,
    uneven: NDArray[np.float64],
) -> NDArray[np.float64]:
    """What marks of the tacho that are `uneven` make of other lines, (sensors, lines): half o b of one of order o."""
    found = np.zeros(amplitude.shape)
    for multiple, peak in enumerate(uneven, 1):
        beside = np.abs(np.abs(order[:, None] - order) - multiple * turns) < 1e-3  # from the one to the other
        found += (0.5 * order * peak / turns * np.abs(amplitude)) ** 2 @ beside
    return np.sqrt(found)


def _products(
    amplitude: NDArray[np.complex128], beyond: NDArray[np.bool_], harmonic: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Lines that the strongest fault may put elsewhere because contacts are no linear springs, (sensors, lines).

    The lines that the ideal machine does not have, over those that it has, tell by which part forces swing.
    """
    swing = strongest(np.where(beyond, amplitude, 0.0), harmonic)
    mean = strongest(np.where(beyond, 0.0, amplitude), harmonic)
    return PRODUCTS * swing * np.minimum(swing / np.where(mean > 0, mean, np.inf), 1.0)


def _turn_zero(recording: Recording, shaft: Shaft) -> float:
    """Place in its turn, by the finer tacho, at which the index gives its pulses (circular mean)."""
    times = _pulses(recording, INDEX).time - recording.channel(INDEX).delay_s
    times = times[(times >= shaft.start_s) & (times <= shaft.stop_s)]
    return float(np.angle(np.mean(np.exp(2j * np.pi * shaft.turns(times)))) / (2 * np.pi))


def _noise(lines: FoundLines) -> NDArray[np.float64]:
    """From the bins that belong to no line; the scatter of blocks of turns, where there are enough and it is larger."""
    scatter = np.nan_to_num(lines.u_scatter)
    both = np.fmax(lines.u, np.where(scatter > 2 * np.nan_to_num(lines.u), scatter, 0.0))
    middle = np.nanmedian(np.where(both > 0, both, np.nan), axis=1, keepdims=True)
    if not np.all(np.isfinite(middle)):
        raise InputError(
            "the lines are too close to each other to estimate their noise", remedy="record more turns"
        )
    return np.where(np.isfinite(both) & (both > 0), both, middle)


def _smooth(noise: NDArray[np.float64], harmonic: NDArray[np.intp]) -> NDArray[np.float64]:
    """Geometric mean over neighbouring lines of the same harmonic: single estimates have heavy tails."""
    number = np.arange(harmonic.size)
    near = np.abs(number[:, None] - number) <= NEIGHBOURS
    weight = (near & (harmonic[:, None] == harmonic)).astype(float)
    return np.exp(np.log(noise) @ weight.T / weight.sum(axis=1))


def like(
    first: OrderLinesObservation, other: OrderLinesObservation
) -> tuple[OrderLinesObservation, list[str]]:
    """A recording turned by whole turns until lines of slower families stand as in another one.

    Pulses of the reference shaft do not tell in which of its `period` turns a recording begins: lines at broken orders
    are turned by ``exp(2j pi o n)``. Lines at whole orders of each harmonic give the gain between the recordings, and
    lines at broken orders, by denominators, then are best alike at one n. Where no n is clearly better, nothing is
    turned.
    """
    known = first.known
    if known.period == 1:
        return other, []
    parts = np.array([Fraction(float(o)).limit_denominator(known.period).denominator for o in known.order])
    clear = np.zeros(known.period)
    for d in np.unique(parts[(parts > 1) & (known.period % parts == 0)]):
        gain = _alike(first, other, parts == d)
        if gain.max() - np.median(gain) > LIKE_ENOUGH:
            clear += gain
    n = int(np.argmax(clear))
    if not n:
        return other, []
    turned = replace(other, amplitude=other.amplitude * np.exp(2j * np.pi * known.order * n))
    return turned, [f"{other.name}: begins {n} turns after {first.name} in the machine's period"]


def _alike(
    first: OrderLinesObservation, other: OrderLinesObservation, mine: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Gain in chi-square, at each number of turns, if lines of another recording are a real multiple of these.

    Of every sensor and harmonic; the phase of its gain is that between its strongest whole lines.
    """
    order, harmonic, period = first.known.order, first.known.harmonic, first.known.period
    total = np.zeros(period)
    whole = np.abs(order - np.rint(order)) < 1e-6
    for a, b, noise in zip(first.amplitude, other.amplitude, np.hypot(first.noise, other.noise), strict=True):
        for h in np.unique(harmonic):
            near = harmonic == h
            phase = np.vdot(a[whole & near], b[whole & near])
            if not abs(phase):
                continue
            chosen = mine & near
            both = np.conj(a[chosen]) * b[chosen] * np.conj(phase) / abs(phase)
            turned = both[:, None] * np.exp(2j * np.pi * np.outer(order[chosen], np.arange(period)))
            # unit vectors of what stands out of the noise, so that no strong line decides alone
            size = np.minimum(np.abs(a[chosen]), np.abs(b[chosen])) / noise[chosen]
            same = turned.real / np.maximum(np.abs(both), 1e-300)[:, None]
            total += (np.minimum(size, 10.0) ** 2) @ same
    return total


def _torque(recording: Recording, model: Model, known: OrderLines, file: DataFile) -> tuple[float, str]:
    """Torque on the carrier in N m, and what told it."""
    condition = model.conditions["carrier_torque"]
    for key in (condition.name, condition.column):
        if key in file.conditions:
            return float(file.conditions[key]), "as the study says"
    for properties in (recording.properties, *recording.group_properties.values()):
        for key, value in properties.items():
            if key.partition("_")[0].lower() == "torque":
                with suppress(ValueError):
                    return float(str(value).replace(",", ".")), f"from the property {key}"
    if any(c.name == TORQUE for c in recording.channels):
        return float(np.mean(recording.read([recording.channel(TORQUE)])[0])), f"from the channel {TORQUE}"
    return known.torque, "as the rig file says"
