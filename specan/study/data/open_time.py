"""Recordings for models of rates: channels by name, inputs and what is measured over the same time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import InputError, RequestError
from specan.io.open import open_recording
from specan.models import Condition, Model, Observable
from specan.models.rates import TIME, Rates
from specan.models.trial import try_model
from specan.study.data.held_out import Column, chosen, of_file
from specan.study.data.recordings import reads as reads
from specan.study.observation import Array, DataFile, MeasuredFiles, OpenedData
from specan.study.observation.time import TimeObservation
from specan.units import convert, is_compatible

CHECKED = 2000  # samples that a model is checked with
TITLE = "a recording (TDMS, WAV, CSV, MAT, HDF5, UFF)"


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the recordings of a study.

    Raises
    ------
    InputError
        A channel that the model needs is missing, or in another unit.
    RequestError
        Nothing is left to fit.
    """
    fitted = [_read(model, file, wanted.calibration) for file in wanted.measurements]
    checked = [_read(model, file, wanted.calibration) for file in wanted.validations]
    noise = {name: _noise(model, name, [one[1][name] for one in fitted]) for name in model.observables}
    rates = _rates(model)
    model = rates.sized(model, [one[:2] for one in fitted])
    rates.allow({name: size for name, (size, _) in noise.items()})
    whole = _observation(model, wanted.measurements, fitted, noise)
    aside = np.zeros(whole.n, dtype=bool)
    columns = {
        TIME: Column(whole.conditions[TIME], model.conditions[TIME], reach=lambda value: 0.0),
        "channel": Column(whole.observable),
    }
    for file, where in wanted.hold_out:
        aside |= chosen(columns, where) & of_file(file, whole.recordings, np.asarray(whole.recording))
    if np.all(aside):
        raise RequestError(
            "all samples are held out", expected="some to fit", remedy="hold out a shorter time"
        )
    kept = whole.take(~aside) if np.any(aside) else whole
    held_out = [whole.take(aside)] if np.any(aside) else []
    held_out += [_observation(model, wanted.validations, checked, noise)] if checked else []
    few = {n: v[:1000] for n, v in fitted[0][0].items()}  # samples on which a user's functions are tried
    # compiles, which takes seconds
    model.assemble(model.base_effects).evaluate({n: v[:2] for n, v in few.items()})
    try_model(model, few)
    statements = [said for *_, said in (*fitted, *checked)]
    statements.append(f"solved by {model.solver.method()}")
    for name, (size, stated) in noise.items():
        how = "as stated" if stated else "from the quickest changes"
        statements.append(
            f"{name}: noise of {size:.3g} {model.observables[name].unit}, {how}; a diagnosis corrects it by what the "
            "likeliest explanation leaves"
        )
    return OpenedData((kept,), tuple(held_out), tuple(statements), model=model)


def inputs_of(model: Model, file: DataFile) -> tuple[Model, dict[str, Array], float]:
    """Conditions of a recording that need only hold inputs, the exact model for these, and the sampling rate."""
    conditions, measured, _ = _read(model, file, None, needs_outputs=False)
    sized = _rates(model).sized(model, [(conditions, measured)])
    return (
        replace(sized, rates=replace(_rates(sized), exact=True)),
        conditions,
        1 / float(conditions[TIME][1]),
    )


def for_check(model: Model, file: DataFile) -> tuple[Model, dict[str, Array]]:
    """A model that knows the noise of a recording's channels, and the first conditions of that."""
    conditions, measured, _ = _read(model, file, None)
    noise = {name: _noise(model, name, [values])[0] for name, values in measured.items()}
    known = _rates(model).sized(model, [(conditions, measured)])
    known = replace(known, rig=replace(model.rig, reading={**model.rig.reading, **noise}))
    return known, {name: values[:CHECKED] for name, values in conditions.items()}


def _rates(model: Model) -> Rates:
    assert model.rates is not None  # other models have no measurements of this kind
    return model.rates


def _read(
    model: Model, file: DataFile, calibration: Path | None, needs_outputs: bool = True
) -> tuple[dict[str, Array], dict[str, Array], str]:
    """Conditions and measured values of a file, and what was found."""
    recording = open_recording(file.path, calibration=calibration)
    inputs = {c.name: c for c in model.conditions.values() if c.name in _rates(model).inputs.values()}
    firsts = {name.removesuffix("_first") for name in model.conditions if name.endswith("_first")}
    outputs = {n: o for n, o in model.observables.items() if needs_outputs or n in firsts}
    found: dict[str, tuple[Channel, Array]] = {}
    notes: list[str] = []
    targets: dict[str, Condition | Observable] = {**inputs, **outputs}
    for name, target in targets.items():
        wanted = file.columns.get(target.column, target.column)
        found[name] = _channel(recording, wanted, target, notes)
    rates = {channel.sampling_rate for channel, _ in found.values()}
    if len(rates) > 1:
        raise InputError(
            f"{file.name}: its channels have {min(rates):g} and {max(rates):g} Hz", expected="one sampling rate",
            remedy="resample one of them",
        )  # fmt: skip
    size = min(values.size for _, values in found.values())
    rate = rates.pop()
    conditions = {TIME: np.arange(size) / rate}
    conditions |= {name: found[name][1][:size] for name in inputs}
    measured = {name: found[name][1][:size] for name in outputs}
    for name in model.conditions:
        of = name.removesuffix("_first")
        if name != of and of in measured:
            unit = model.observables[of].unit
            conditions[name] = np.full(size, convert(measured[of][0], unit, model.conditions[name].unit))
    channels = ", ".join(channel.name for channel, _ in found.values())
    return conditions, measured, f"{file.name}: {channels}; {size} samples at {rate:g} Hz" + "".join(notes)


def _channel(
    recording: Recording, wanted: str, target: Condition | Observable, notes: list[str]
) -> tuple[Channel, Array]:
    """A channel in the unit of the model."""
    try:
        channel = recording.channel(wanted)
    except RequestError as fault:
        said = f'--column "{target.column}=CHANNEL"'
        raise RequestError(fault.found, expected=fault.expected, remedy=f"{fault.remedy}; {said}") from None
    (values,) = recording.read([channel])
    unit = channel.unit
    if unit in ("", "1") and target.unit != "1":
        unit = target.unit
        notes.append(f"; {channel.name} has no unit, taken as {unit}")
    if not is_compatible(unit, target.unit):
        raise InputError(
            f"{recording.label}: {channel.name} is in {unit}", expected=f"a unit like {target.unit}",
            remedy="correct the unit of the channel or of the model",
        )  # fmt: skip
    if not np.all(np.isfinite(values)):
        raise InputError(
            f"{recording.label}: {channel.name} holds values that are not finite", remedy="cut them off"
        )
    return channel, np.asarray(convert(values, unit, target.unit), float)


def _noise(model: Model, name: str, values: Sequence[Array]) -> tuple[float, bool]:
    """Standard deviation of a channel's noise, and whether it is stated."""
    stated = model.rig.reading.get(name)
    if stated:
        return stated, True
    quick = [np.diff(v, 3) for v in values]
    size = np.sqrt(np.mean(np.concatenate(quick) ** 2) / 20)  # 1 + 9 + 9 + 1: of white noise
    least = max(1e-6 * float(np.std(np.concatenate(values))), 1e-300)
    return max(float(size), least), False


def _observation(
    model: Model, files: Sequence[DataFile], parts: Sequence[Any], noise: dict[str, tuple[float, bool]]
) -> TimeObservation:
    """Everything that was measured in some files, one observable behind the other."""
    names = list(noise)
    sizes = [next(iter(conditions.values())).size for conditions, *_ in parts]
    series = {n: np.concatenate([conditions[n] for conditions, *_ in parts]) for n in parts[0][0]}
    recording = np.repeat(np.arange(len(parts)), sizes)
    measured = np.concatenate([np.concatenate([own[name] for _, own, _ in parts]) for name in names])
    count, every = sum(sizes), len(names)
    position = np.tile(np.arange(count), every)
    sigma = np.repeat([noise[name][0] for name in names], count)
    return TimeObservation(
        name=files[0].name if len(files) == 1 else f"{len(files)} recordings",
        observable=np.repeat(names, count),
        measured=measured,
        conditions={n: v[position] for n, v in series.items()},
        covariance=sigma**2,
        recordings=tuple(file.name for file in files),
        recording=recording[position],
        # a noise that is stated is known with ten degrees of freedom, one that the data tell with one
        noise_dof=10.0 if all(stated for _, stated in noise.values()) else 1.0,
        available=frozenset(series),
        series=(series, recording),
        position=position,
        lines=np.concatenate([np.arange(1, n + 1) for n in sizes] * every),
    )
