"""Transfer functions of any response over any reference, for models whose observables name both.

They come from recordings, through the analyser, or from files that other programs have written
(`specan.study.data.transfer_file`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from specan.arrays import Flags
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import InputError, RequestError, SpecanError, nearest
from specan.io.open import open_recording
from specan.models import Model, Observable
from specan.models.quantity import KIND
from specan.models.trial import try_model
from specan.study.data.estimated_lines import LEAST_BLOCKS, EstimatedLines
from specan.study.data.recordings import parted
from specan.study.data.recordings import reads as is_recording
from specan.study.data.transfer_file import MeasuredFrf, find, is_transfer_file, read_transfer_file, sigma_of
from specan.study.localisation.by_band_and_channel import curve_errors as curve_errors
from specan.study.localisation.by_band_and_channel import localise as localise
from specan.study.observation import Array, DataFile, MeasuredFiles, OpenedData
from specan.study.observation.frf import LINE_CORRELATION, FrfObservation, piecewise_linear_basis
from specan.study.observation.window_leakage import Folding
from specan.units import convert, is_compatible, scale_to

TITLE = "transfer functions (a recording, a universal file 58, or text with frequency, re and im)"

# what was found of them in words, and whether their uncertainty is known
Lines = tuple[FrfObservation, str, bool]


def reads(path: Path) -> bool:
    """Whether a file is a recording, a universal file, or text with a column of frequencies."""
    return is_transfer_file(path) or is_recording(path)


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the transfer functions of a study.

    Raises
    ------
    InputError
        A file holds none of what the model predicts, or in another unit.
    RequestError
        The model has no condition that is a frequency; a held-out channel that no file has.
    """
    frequency = _frequency_of(model)
    files = (*wanted.measurements, *wanted.validations)
    opened = [(f, *one) for f in files for one in _Opened(model, frequency, f).read(wanted.calibration)]
    fitted, held_out = parted([(file, whole) for file, whole, _, _ in opened], wanted)
    statements, known = [said for _, _, said, _ in opened], all(told for *_, told in opened)
    if model.is_own:
        try_model(model.assemble(model.base_effects), fitted[0].conditions_at_nodes)
    if not known:
        names = ", ".join(o.name for o in model.observables.values() if o.kind == KIND)
        statements.append(
            f"the uncertainty of {names} is not stated: no column u, no coherence with a number of averages "
            "(Frf(..., averages=)), no uncertainty_percent"
        )
    percent = model.rig.discrepancy_percent
    return OpenedData(tuple(fitted), tuple(held_out), tuple(statements), known, percent)


def _frequency_of(model: Model) -> str:
    """The model's condition that is the frequency of a line."""
    found = [c.name for c in model.conditions.values() if c.unit.lower() in ("hz", "khz")]
    if "frequency" in found:
        return "frequency"
    if len(found) != 1:
        raise RequestError(
            f"the model {model.name} has no single condition in Hz",
            expected='a condition frequency, {"frequency": ("Hz", 5, 60)}',
            remedy="give the functions a frequency in Hz, and let them convert it to an angular frequency",
        )
    return found[0]


@dataclass(frozen=True)
class _Opened:
    """A measured file as transfer functions, for the observables of a model; `frequency` is its condition."""

    model: Model
    frequency: str
    file: DataFile

    @property
    def observables(self) -> list[Observable]:
        return [o for o in self.model.observables.values() if o.kind == KIND]

    @property
    def band(self) -> tuple[float, float]:
        """Ends of the model's band, Hz."""
        low, high = self.model.rig.limits.get(self.frequency, (0.0, np.inf))
        unit = self.model.conditions[self.frequency].unit
        return float(convert(low, unit, "Hz")), float(convert(high, unit, "Hz"))

    def read(self, calibration: Path | None) -> list[Lines]:
        if is_transfer_file(self.file.path):
            return self.from_file()
        recording = open_recording(self.file.path, calibration=calibration, label=self.file.name)
        return self.from_recording(recording)

    def observation(
        self, observables: Sequence[Observable], common: tuple[Array, Array], **lines: Any
    ) -> FrfObservation:
        """Transfer functions of one file over one reference, in the units of the observables.

        Parameters
        ----------
        common : pair of array (responses,)
            Standard uncertainties of the calibration, relative and in rad.
        lines
            Fields of the observation.
        """
        response, folding = lines["response"], lines["folding"]
        condition = self.model.conditions[self.frequency]
        at = {self.frequency: np.asarray(convert(folding.nodes, "Hz", condition.unit), dtype=float)}
        at |= {name: np.full(folding.nodes.size, value) for name, value in self.constants().items()}
        lacking = [c.column for c in self.model.conditions.values() if c.name not in at and c.default is None]
        if lacking:
            raise InputError(
                f"{self.file.name}: nothing says at which {lacking[0]} it was measured",
                remedy=f"write conditions = {{{lacking[0]} = ...}} below the measurement in study.toml",
            )
        errors = [turn * response * size[:, None] for turn, size in zip((1, 1j), common) if np.any(size)]
        if self.model.rig.discrepancy_percent:
            size = self.model.rig.discrepancy_percent / 100
            errors += [
                p * size * t * response
                for p in piecewise_linear_basis(lines["frequency_hz"])
                for t in (1, 1j)
            ]
        return FrfObservation(
            name=self.file.name,
            recording=self.file.name,
            quantities=tuple(o.quantity for o in observables),
            channels=tuple(o.response for o in observables),
            random=lines["noise"],
            conditions_at_nodes=at,
            shared=np.nan_to_num(np.stack(errors, axis=-1))
            if errors
            else np.empty((*response.shape, 0), complex),
            kept=np.isfinite(response),
            observables=tuple(o.name for o in observables),
            **lines,
        )

    def constants(self) -> dict[str, float]:
        """Conditions of a whole file, as the model's functions receive them."""
        by_column = {c.column: c for c in self.model.conditions.values()}
        found = {}
        for column, value in self.file.conditions.items():
            if column not in by_column or isinstance(value, str):
                raise RequestError(
                    f"{self.file.name}: {column} = {value!r} is not a condition with a number",
                    remedy=nearest(column, by_column),
                )
            known = by_column[column]
            found[known.name] = float(convert(value, known.column_unit, known.unit))
        return found

    # --- files of transfer functions ------------------------------------------------------------------

    def from_file(self) -> list[Lines]:
        found = read_transfer_file(self.file.path)
        chosen = [
            (o, one) for o in self.observables if (one := find(found, o.response, o.reference)) is not None
        ]
        if not chosen:
            there = ", ".join(one.said for one in found[:12])
            raise InputError(
                f"{self.file.name} holds {there}",
                expected=" or ".join(
                    f"{o.response} over {o.reference or 'a reference'}" for o in self.observables
                ),
                remedy='name what the file holds in the model: Frf("um/N", response="2Z", reference="1Z")',
            )
        return [self.lines_of_file(observable, one) for observable, one in chosen]

    def lines_of_file(self, observable: Observable, one: MeasuredFrf) -> Lines:
        band = self.band
        inside = (one.frequency_hz >= band[0]) & (one.frequency_hz <= band[1])
        if not inside.any():
            raise InputError(
                f"{self.file.name}: {one.said} has no line between {band[0]:g} and {band[1]:g} Hz",
                expected=f"a band within {one.frequency_hz[0]:g} to {one.frequency_hz[-1]:g} Hz",
            )
        frequency = one.frequency_hz[inside]
        factor, unit_said = _factor(self.file.name, one.said, one.unit, observable)
        response = factor * one.values[inside]
        sigma, how = self.sigma_of(observable, one, inside, factor)
        known = sigma is not None
        if sigma is None:
            # something to divide by, so that errors can be shown: all lines alike
            sigma = np.full(response.shape, float(np.sqrt(np.mean(np.abs(response) ** 2))))
        elif not np.all(sigma > 0):
            raise InputError(f"{self.file.name}: {one.said} has lines with no uncertainty above zero")
        found = self.observation(
            [observable], frequency_hz=frequency, line_hz=float(np.min(np.diff(frequency), initial=np.inf)),
            response=response[None], noise=sigma[None], folding=Folding.none(frequency),
            common=(np.array([one.common]), np.zeros(1)), line_correlation=LINE_CORRELATION if one.windowed else (1.0,),
        )  # fmt: skip
        said = (
            f"{self.file.name}: {observable.name} is {one.said}, {frequency.size} lines from {frequency[0]:g} to "
            f"{frequency[-1]:g} Hz{unit_said}; uncertainty {how}"
            + ("" if one.windowed else "; lines count as independent")
        )
        return found, said, known

    def sigma_of(
        self, observable: Observable, one: MeasuredFrf, inside: Flags, factor: float
    ) -> tuple[Array | None, str]:
        if one.sigma is not None:
            return factor * one.sigma[inside], "as the file says"
        size = factor * np.abs(one.values[inside])
        if one.coherence is not None and observable.averages:
            found = sigma_of(size, one.coherence[inside], observable.averages)
            return found, f"from the coherence and {observable.averages:g} averages"
        percent = self.model.rig.reading_percent.get(observable.name, 0.0)
        floor = self.model.rig.reading.get(observable.name, 0.0)
        if not percent and not floor:
            return None, "unknown"
        parts = [f"{percent:g} %" if percent else "", f"{floor:g} {observable.unit}" if floor else ""]
        said = " and ".join(p for p in parts if p)
        return np.hypot(percent / 100 * size, floor), f"of {said} as declared"

    # --- recordings -----------------------------------------------------------------------------------

    def from_recording(self, recording: Recording) -> list[Lines]:
        from specan.analysis.section import aligned

        by_reference: dict[str, tuple[Channel, list[tuple[Observable, Channel]]]] = {}
        missing = []
        recording, _ = aligned(recording, recording.channels, _reference(recording, self.observables[0]))
        for observable in self.observables:
            reference = _reference(recording, observable)
            try:
                response = recording.channel(observable.response)
            except SpecanError:
                missing.append(observable.response)
                continue
            by_reference.setdefault(reference.label, (reference, []))[1].append((observable, response))
        if not by_reference:
            names = [c.label for c in recording.channels]
            raise InputError(
                f"{recording.label} has no channel {missing[0]!r}",
                expected=f"one of {', '.join(names[:12])}",
                remedy='name it in the model: Frf("um/N", response=CHANNEL, reference=CHANNEL)',
            )
        return [self.lines_of_recording(recording, *group) for group in by_reference.values()]

    def lines_of_recording(
        self, recording: Recording, reference: Channel, pairs: Sequence[tuple[Observable, Channel]]
    ) -> Lines:
        from specan.analysis.transfer_function import TransferFunction, quotient

        settings = TransferFunction(
            reference=reference.label,
            channels=tuple(channel.label for _, channel in pairs),
            estimator=self.file.estimator or "H1",  # type: ignore[arg-type]
            align=False,
        )
        rate, seen = reference.sampling_rate, settings(recording)
        settings = settings.model_copy(update={"lines": seen.settings["lines"]})
        if reference.n_samples >= (1 + LEAST_BLOCKS) * settings.block:
            # What the system remembers of the time before the record dies out within a block.
            settings = settings.model_copy(update={"start_s": settings.block / rate})
        found = EstimatedLines(
            recording, reference, settings, (self.band[0], min(self.band[1], float(seen.frequency_hz[-1])))
        )
        f, spacing = found.frequency_hz, rate / found.block
        gain = np.stack([np.abs(c.correction(f) / reference.correction(f)) for _, c in pairs])
        factors = []
        for observable, channel in pairs:
            unit = quotient(channel.target_unit, reference.target_unit)
            said = f"{channel.label} over {reference.label}"
            factors.append(_factor(recording.label, said, "" if unit == "1" else unit, observable))
        factor = np.array([[size] for size, _ in factors])
        observation = self.observation(
            [o for o, _ in pairs], frequency_hz=f, line_hz=spacing, response=factor * found.response,
            noise=factor * gain * found.noise, folding=found.folding, line_correlation=LINE_CORRELATION,
            common=(found.u_common_percent / 100, np.radians(found.u_common_deg)),
        )  # fmt: skip
        names = ", ".join(f"{o.name} is {c.label} over {reference.label}{text}"
                          for (o, c), (_, text) in zip(pairs, factors, strict=True))  # fmt: skip
        said = (
            f"{recording.label}: {names}; {f.size} lines of {spacing:.3g} Hz, {settings.estimator}, blocks of "
            f"{1 / spacing:.3g} s; the model filters the recorded {reference.label} and is analysed in the same blocks"
            + "".join(f"; {note}" for note in found.notes if note.startswith("leakage"))
        )
        return observation, said, True


def _factor(name: str, said: str, unit: str, observable: Observable) -> tuple[float, str]:
    """What turns a file's values into the observable's unit."""
    if not unit:
        return 1.0, f" (no unit stated: assumed to be in {observable.unit})"
    try:
        fits = is_compatible(unit, observable.unit)
    except SpecanError:
        fits = False
    if not fits:
        raise InputError(
            f"{name}: {said} is in {unit!r}",
            expected=f"a unit of {observable.name}, which the model has in {observable.unit}",
            remedy="declare the unit that is measured, and let the function return it (an acceleration is "
            "-(2 pi f)^2 times a displacement)",
        )
    return scale_to(unit, observable.unit), ""


def _reference(recording: Recording, observable: Observable) -> Channel:
    if observable.reference:
        return recording.channel(observable.reference)
    for role in ("force", "vibrometer", "generator"):
        found = recording.by_role(role)
        if len(found) == 1:
            return found[0]
    others = [c for c in recording.channels if observable.response not in (c.name, c.path)]
    if len(others) == 1:
        return others[0]
    raise InputError(
        f"{recording.label}: {observable.name} names no reference, and several channels could be it",
        expected=", ".join(c.label for c in others[:12]),
        remedy='name it in the model: Frf("um/N", reference=CHANNEL)',
    )
