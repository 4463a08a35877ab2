"""Recordings for models of rates: channels by name, inputs and what is measured over the same time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import InputError, RequestError
from specan.io.open import open_recording
from specan.models import Condition, Model, Observable
from specan.models.rates import TIME, Rates
from specan.models.trial import try_model
from specan.study.data.held_out import Column, put_aside
from specan.study.data.recordings import reads as reads
from specan.study.estimation.growing import growing as growing
from specan.study.localisation.by_frequency import localise as localise
from specan.study.observation import Array, DataFile, MeasuredFiles, OpenedData
from specan.study.observation.time import TimeObservation
from specan.units import convert, is_compatible, spoken

TITLE = "a recording (TDMS, WAV, CSV, MAT, HDF5, UFF)"


@dataclass(frozen=True)
class _Part:
    """A recording, or a piece of one: conditions, measured values, and what was found."""

    file: str
    conditions: dict[str, Array]
    measured: dict[str, Array]
    said: str = ""
    begin_s: float | None = None

    @property
    def name(self) -> str:
        return self.file if self.begin_s is None else f"{self.file} from {self.begin_s:.6g} s"

    def begun(self, model: Model) -> _Part:
        """With the first values that states of a model start from."""
        firsts = _rates(model).firsts(model, self.conditions[TIME], self.measured)
        size = self.conditions[TIME].size
        return replace(self, conditions=self.conditions | {n: np.full(size, v) for n, v in firsts.items()})

    def pieces(self, model: Model, seconds: float) -> list[_Part]:
        """Pieces of equal length, the last one with what remains if that is less than half of one."""
        time = self.conditions[TIME]
        # 20: samples
        each = max(round(seconds / float(time[1])), 20)
        begins = [*range(0, max(time.size - each // 2, 1), each)]
        spans = [slice(a, b) for a, b in zip(begins, [*begins[1:], time.size], strict=True)]
        return [
            replace(
                self, begin_s=float(time[span.start]),
                conditions={n: v[span] for n, v in self.conditions.items()},
                measured={n: v[span] for n, v in self.measured.items()},
            ).begun(model)
            for span in spans
        ]  # fmt: skip


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
    statements = [one.said for one in (*fitted, *checked)]
    noise = {name: _noise(model, name, [one.measured[name] for one in fitted]) for name in model.observables}
    rates = _rates(model)
    model = rates.sized(model, [(one.conditions, one.measured) for one in fitted])
    rates.allow({name: size for name, (size, _) in noise.items()})
    if rates.window_s:
        model = rates.in_pieces(model, [(one.conditions, one.measured) for one in fitted])
        fitted, checked = (
            [p for one in some for p in one.pieces(model, rates.window_s)] for some in (fitted, checked)
        )
        statements.append(
            f"compared in {len(fitted)} pieces of {rates.window_s:g} s, each with its own start"
        )
    whole = _observation(model, fitted, noise)
    columns = {
        TIME: Column(whole.conditions[TIME], model.conditions[TIME], reach=lambda value: 0.0),
        "channel": Column(whole.observable),
    }
    files = tuple(one.file for one in fitted)
    aside = put_aside(columns, wanted, files, np.asarray(whole.recording))
    kept = whole.take(~aside) if np.any(aside) else whole
    held_out = [whole.take(aside)] if np.any(aside) else []
    held_out += [_observation(model, checked, noise)] if checked else []
    # samples on which a user's functions are tried; they are compiled before, which takes seconds
    few = {n: v[:1000] for n, v in fitted[0].conditions.items()}
    model.assemble(model.base_effects).evaluate({n: v[:2] for n, v in few.items()})
    try_model(model.assemble(model.base_effects), few)
    statements.append(f"solved by {model.solver.method()}")
    for name, (size, stated) in noise.items():
        how = "as stated" if stated else "from the fastest changes"
        statements.append(
            f"{name}: noise of {spoken(size, unit=model.observables[name].unit)}, {how}; a diagnosis corrects it by "
            "what the likeliest explanation leaves"
        )
    return OpenedData((kept,), tuple(held_out), tuple(statements), model=model)


def inputs_of(model: Model, file: DataFile) -> tuple[Model, dict[str, Array], float]:
    """Conditions of a recording that need only hold inputs, the exact model for these, and the sampling rate."""
    found = _read(model, file, None, needs_outputs=False)
    sized = _rates(model).sized(model, [(found.conditions, found.measured)])
    exact = replace(sized, rates=replace(_rates(sized), exact=True))
    return exact, found.conditions, 1 / float(found.conditions[TIME][1])


def for_check(model: Model, file: DataFile) -> tuple[Model, dict[str, Array]]:
    """A model that knows the noise of a recording's channels, and the first conditions of that."""
    found = _read(model, file, None)
    noise = {name: _noise(model, name, [values])[0] for name, values in found.measured.items()}
    known = _rates(model).sized(model, [(found.conditions, found.measured)])
    known = replace(known, rig=replace(model.rig, reading={**model.rig.reading, **noise}))
    # 2000: samples that a model is checked with
    return known, {name: values[:2000] for name, values in found.conditions.items()}


def _rates(model: Model) -> Rates:
    assert model.rates is not None  # other models have no measurements of this kind
    return model.rates


def _read(model: Model, file: DataFile, calibration: Path | None, needs_outputs: bool = True) -> _Part:
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
    channels = ", ".join(channel.name for channel, _ in found.values())
    said = f"{file.name}: {channels}; {size} samples at {rate:g} Hz" + "".join(notes)
    return _Part(file.name, conditions, measured, said).begun(model)


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
    model: Model, parts: Sequence[_Part], noise: dict[str, tuple[float, bool]]
) -> TimeObservation:
    """Everything that was measured in some files, one observable behind the other."""
    names = list(noise)
    sizes = [one.conditions[TIME].size for one in parts]
    series = {n: np.concatenate([one.conditions[n] for one in parts]) for n in parts[0].conditions}
    recording = np.repeat(np.arange(len(parts)), sizes)
    measured = np.concatenate([np.concatenate([one.measured[name] for one in parts]) for name in names])
    count, every = sum(sizes), len(names)
    position = np.tile(np.arange(count), every)
    sigma = np.repeat([noise[name][0] for name in names], count)
    return TimeObservation(
        name=parts[0].name if len(parts) == 1 else f"{len(parts)} recordings",
        observable=np.repeat(names, count),
        measured=measured,
        conditions={n: v[position] for n, v in series.items()},
        covariance=sigma**2,
        recordings=tuple(one.name for one in parts),
        recording=recording[position],
        # a noise that is stated is known with ten degrees of freedom, one that the data tell with one
        noise_dof=10.0 if all(stated for _, stated in noise.values()) else 1.0,
        stated=tuple(name for name in names if noise[name][1]),
        series=(series, recording),
        position=position,
        lines=np.concatenate([np.arange(1, n + 1) for n in sizes] * every),
    )
