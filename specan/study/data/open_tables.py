"""From table files to observations with their covariance: what is fitted, what is held out, what only validates.

The covariance keeps apart by origin what repeats, instruments and printed digits say:
V = reading + setting anew + declared discrepancy of the model. What all rows share (the gain and the
zero of a sensor) is not in it: those are nuisance parameters with a prior. Repeats that were set anew
each time hold reading and setting together and are believed first; back-to-back repeats hold the reading
only, so that the setting's scatter must come from the rig file - taken for the whole, they would make
every model fail. A condition that was read and is in the table is known, however it scatters.
Decisions: docs/decisions/covariance.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.models import Model
from specan.models.groups import grouped
from specan.models.trial import try_model
from specan.result import first_of
from specan.study.data.held_out import Column, put_aside
from specan.study.data.operating_table import SCATTER, Rows, check_repeats, check_varied, join
from specan.study.data.replicate_variance import (
    ASKED_FOR,
    SETTING,
    Reference,
    VarianceFunction,
    crude,
    pooled,
    reference,
)
from specan.study.data.setpoints import ENOUGH, TIME, grouping_of, operating
from specan.study.data.table_file import beginning
from specan.study.data.table_reader import read_measurement
from specan.study.observation import Array, MeasuredFiles, OpenedData
from specan.study.observation.table import TableObservation
from specan.units import base_unit, convert, printed_unit, spoken


@dataclass(frozen=True)
class Noise:
    """Scatter of one observable: of a reading, and of a set-up; variances as functions of the condition."""

    reading: VarianceFunction | None = None
    setup: VarianceFunction | None = None
    dof: float = np.inf
    pure_error_dof: float = 0.0
    known: bool = True


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How uncertain rows of a measurement are; worked out on the rows that are fitted, used on any.

    Attributes
    ----------
    noise : mapping
        `Noise` of each observable.
    known : bool
        False where the uncertainty is unknown: residuals can then be shown, but nothing be concluded.
    statements : tuple of str
        What was found and assumed, for a person.
    """

    model: Model
    reference: Reference
    noise: Mapping[str, Noise]
    ranges: Mapping[str, tuple[float, float]]
    statements: tuple[str, ...]

    @property
    def known(self) -> bool:
        """Whether every observable's uncertainty is known."""
        return all(noise.known for noise in self.noise.values())

    def observe(self, rows: Rows) -> TableObservation:
        """Rows with their covariance; `pure_error_dof` holds for the rows that this was worked out on."""
        reading, setup = self._variances(rows)
        together = (rows.setup[:, None] == rows.setup) & (rows.observable[:, None] == rows.observable)
        # Scatter of set-ups without any of readings: too few second readings to tell, which count as set anew.
        told = np.array([self.noise[name].reading is not None for name in rows.observable.tolist()])
        declared = np.array([self.noise[name].setup is None for name in rows.observable.tolist()])
        together &= (told | declared)[:, None] | np.eye(rows.n, dtype=bool)
        root = np.sqrt(setup)
        covariance = np.diag(reading) + np.where(together, np.outer(root, root), 0.0)
        part = self.model.rig.discrepancy_percent / 100 * self.reference.effects_part(rows)
        for name, (quantity, percent) in self.model.rig.discrepancies.items():
            own = percent / 100 * self.reference.quantity(rows, quantity)
            part = np.where(rows.observable == name, own, part)
        part = np.where(np.isfinite(part), part, 0.0)
        covariance += np.outer(part, part) * self._discrepancy_correlation(rows)
        return rows.observed(
            covariance=covariance,
            labels=rows.labels_of(self.model),
            variables=rows.variables_of(self.model),
            noise_dof=self._dof(rows),
            pure_error_dof=sum(noise.pure_error_dof for noise in self.noise.values()),
            parts={"reading": np.sqrt(reading), "setting": root, "discrepancy": np.abs(part)},
        )

    def _variances(self, rows: Rows) -> tuple[Array, Array]:
        reading, setup = np.zeros(rows.n), declared_setting(self.model, self.reference, rows)
        parts = components(self.model, self.reference, rows)
        declared = declared_reading(self.model, self.reference, rows)
        resolution = rows.steps[""] ** 2 / 12
        for name, noise in self.noise.items():
            mine = rows.observable == name
            own = {n: c[mine] for n, c in parts.items()}
            if noise.reading is not None:
                reading[mine] = noise.reading.at(own, int(mine.sum()))
            elif noise.setup is None:
                # Repeats hold the rounding already; it stays the least that there is.
                reading[mine] = declared[mine] + resolution[mine]
            if noise.setup is not None:
                setup[mine] = noise.setup.at(own, int(mine.sum()))
            total = reading[mine] + setup[mine]
            reading[mine] += np.maximum(resolution[mine] - total, 0.0)
            if not noise.known:
                reading[mine] = crude(rows).covariance[mine]
        return reading, setup

    def _dof(self, rows: Rows) -> float:
        share = {name: float(np.mean(rows.observable == name)) for name in self.noise}
        spread = sum(share[name] ** 2 / noise.dof for name, noise in self.noise.items())
        return 1 / spread if spread > 0 else np.inf

    def _discrepancy_correlation(self, rows: Rows) -> Array:
        """Correlation of the discrepancy between rows, which is smooth over the operating variables.

        Equations tend to fail over one variable or two: every choice of them has an equal share of the variance. Half
        of it is common to all observables.
        """
        # 0.5: ranges of an operating variable, over which the declared discrepancy changes
        squares = [
            ((u[:, None] - u) / 0.5) ** 2
            for u in (stretched(rows.conditions[name], *ends) for name, ends in self.ranges.items())
        ]
        kernels = [
            np.exp(-0.5 * sum(squares[k] for k in chosen)) * np.ones((rows.n, rows.n))
            for chosen in choices(len(squares))
        ]
        alike = np.where(rows.observable[:, None] == rows.observable, 1.0, 0.5)
        return np.asarray(np.mean(kernels, axis=0) * alike)


def uncertainty(model: Model, rows: Rows) -> Uncertainty:
    """Work out the uncertainty of a measurement.

    Parameters
    ----------
    model : Model
        Its rig states the uncertainties of instruments and settings.
    rows : Rows
        The rows that are fitted.

    Raises
    ------
    InputError
        Repeats that contradict each other.
    """
    centre = reference(model, rows)
    noise, statements = {}, [*rows.notes, *_about_conditions(model, rows)]
    for observable in sorted(set(rows.observable.tolist())):
        noise[observable], said = _noise_of(model, centre, rows, rows.observable == observable)
        statements += [f"{model.observables[observable].header}: {text}" for text in said]
    ranges = {
        name: (float(x.min()), float(x.max()))
        for name in operating(model, rows.conditions)
        if np.ptp(x := rows.conditions[name]) > 0
    }
    percent, stated = model.rig.discrepancy_percent, model.rig.discrepancies
    if percent:
        what = model.words.discrepancy_of
        own_zero = "" if model.base_effects else _from_a_zero(model)
        statements.append(
            f"model discrepancy {percent:g} % of the {what}{own_zero}, smooth over the operating variables"
        )
    elif not stated:
        statements.append("no model discrepancy is declared")
    statements += [
        f"{name}: model discrepancy {of:g} % of {quantity}, smooth over the operating variables"
        for name, (quantity, of) in stated.items()
    ]
    return Uncertainty(model, centre, noise, ranges, tuple(statements))


def _from_a_zero(model: Model) -> str:
    """A word where a percentage is one of a unit with a zero of its own."""
    units = {o.column_unit for o in model.observables.values() if o.name not in model.rig.discrepancies}
    zeros = [unit for unit in sorted(units) if convert(0.0, unit, base_unit(unit)) != 0]
    return (
        f" from 0 {printed_unit(zeros[0])} (of a difference: Reading(..., discrepancy=(QUANTITY, PERCENT)))"
        if zeros
        else ""
    )


def components(model: Model, centre: Reference, rows: Rows) -> dict[str, Array]:
    """What a variance may grow with: the reading squared, and what a setting's scatter does to it."""
    predicted = centre.predict(rows)
    found = {"the reading": np.where(np.isfinite(predicted), predicted, rows.measured) ** 2}
    for name in operating(model, rows.conditions):
        if not np.ptp(rows.levels[name]) > 0:
            continue
        condition = model.conditions[name]
        size = 1.0 if condition.setting.absolute else rows.conditions[name]
        found[f"the scatter of {condition.column}"] = (centre.slope(rows, name) * size) ** 2
    if any(_stated(model, name) for name in rows.conditions):
        found["the reading noise of conditions that the rig declares"] = declared_conditions(
            model, centre, rows
        )
    return {**found, SETTING: declared_setting(model, centre, rows)}


def declared_reading(model: Model, centre: Reference, rows: Rows) -> Array:
    """Variance of a reading from the instruments of the rig; zero where it states none."""
    variance = np.zeros(rows.n)
    for name in set(rows.observable.tolist()):
        mine = rows.observable == name
        source = model.observables[name].reading_of
        if _stated(model, name):
            variance[mine] = _of_reading(model, name, rows.measured[mine])
        elif _stated(model, source):
            part = rows.take(mine)
            read = centre.predict(replace(part, observable=np.full(part.n, source, dtype="U64")))
            variance[mine] = (rows.measured[mine] / read) ** 2 * _of_reading(model, source, read)
    return variance + declared_conditions(model, centre, rows)


def declared_conditions(model: Model, centre: Reference, rows: Rows) -> Array:
    """Variance that the rounding and the reading noise of read conditions put into the observable."""
    variance = np.zeros(rows.n)
    for name, condition in model.conditions.items():
        if name not in rows.conditions or rows.is_set[name]:
            continue
        rounded = not condition.setting.absolute
        if not rounded and not _stated(model, name):
            continue
        step = rows.steps[name] if rounded else 0.0
        of_condition = np.square(step) / 12 + _of_reading(model, name, rows.conditions[name])
        variance += centre.slope(rows, name) ** 2 * of_condition
    return variance


def _stated(model: Model, name: str) -> bool:
    return name in model.rig.reading or name in model.rig.reading_percent


def _of_reading(model: Model, name: str, read: Array) -> Array:
    """Variance of a reading by the rig: an absolute part and one in percent."""
    rig = model.rig
    return np.asarray(
        rig.reading.get(name, 0.0) ** 2 + (rig.reading_percent.get(name, 0.0) / 100 * read) ** 2
    )


def declared_setting(model: Model, centre: Reference, rows: Rows) -> Array:
    """Variance that the scatter of set values adds, from the rig file; values that were read add none."""
    variance = np.zeros(rows.n)
    for name, x in rows.conditions.items():
        setting = model.rig.setting.get(name)
        if setting is not None and rows.is_set[name]:
            variance += (centre.slope(rows, name) * setting.at(x)) ** 2
    return variance


def _scatter_of(
    part: Rows, grows: Mapping[str, Array], declared: Array, near: Array, told: bool
) -> tuple[VarianceFunction | None, VarianceFunction | None]:
    """What repeats of one observable tell of the scatter of readings, and of set-ups; None where they tell nothing.

    `told`: whether the rig declares the uncertainty of a reading.
    """
    rest, slopes = part.measured - near, _slopes(part, near)
    _, first, index, counts = np.unique(
        part.setup, return_index=True, return_inverse=True, return_counts=True
    )
    mean = (index == np.arange(counts.size)[:, None]) / counts[:, None]  # over the rows of each set-up
    # Readings of one set-up differ by what their conditions were read to be, not by time.
    read = _slopes(part, near, in_time=False)
    reading = pooled(rest, part.setup, read, {n: c for n, c in grows.items() if n == "the reading"})
    reading, instrument, in_means = _usable(reading, told), mean @ declared / counts if told else None, None
    if reading is not None:  # back-to-back readings tell what an instrument puts into the means
        in_means, instrument = mean @ reading.at(grows, part.n) / counts, None
    means = {n: mean @ c for n, c in grows.items()}
    group = part.replicate_group[first]
    setup = _usable(pooled(mean @ rest, group, mean @ slopes, means, instrument, in_means), told)
    if reading is not None and setup is not None and part.setups_from == "order":
        one = _usable(pooled(rest, part.replicate_group, slopes, grows, declared if told else None), told)
        both = reading.at(grows, part.n) + setup.at(grows, part.n)
        # rows that follow each other by chance were set anew too
        if one and _misfit(part, rest, both) - _misfit(part, rest, one.at(grows, part.n)) > ASKED_FOR:
            return None, one
    return reading, setup


def _misfit(part: Rows, rest: Array, variance: Array) -> float:
    """Minus twice the log-likelihood of the scatter inside groups of repeats, up to a constant."""
    _, index, counts = np.unique(part.replicate_group, return_inverse=True, return_counts=True)
    gaps, expected = rest - (np.bincount(index, rest) / counts)[index], np.bincount(index, variance) / counts
    return float(np.sum((counts - 1) * np.log(expected) + np.bincount(index, gaps**2) / expected))


def _noise_of(
    model: Model, centre: Reference, rows: Rows, mine: NDArray[np.bool_]
) -> tuple[Noise, list[str]]:
    part = rows.take(mine)
    predicted = centre.predict(part)
    near = np.where(np.isfinite(predicted), predicted, part.measured)
    grows, declared = components(model, centre, part), declared_reading(model, centre, part)
    check_repeats(rows, np.flatnonzero(mine), part, part.measured - near, declared + grows[SETTING])
    measured = model.observables[str(part.observable[0])]
    told = _stated(model, measured.name) or _stated(model, measured.reading_of)
    reading, setup = _scatter_of(part, grows, declared, near, told)
    column, unit = measured.header, f" {printed_unit(measured.unit)}".rstrip()
    said = [_told(reading, rows.setups_from, "back to back", unit, grows)] if reading else []
    if setup is not None:
        pure = setup.dof + (reading.dof if reading else 0.0)
        return Noise(reading, setup, setup.dof, pure), [
            _told(setup, rows.setups_from, "set anew", unit, grows),
            *said,
        ]
    if reading is not None:
        total = reading.at(grows, part.n) + declared_setting(model, centre, part)
        dof = float(np.mean(total) ** 2 / np.mean(reading.at(grows, part.n) ** 2 / reading.dof))
        said.append("such repeats contain no scatter of setting: " + _anew(model, rows))
        return Noise(reading, None, dof, reading.dof), said
    if told:
        size, step = np.sqrt(np.median(declared)), np.median(part.steps[""])
        rounding = f", rounding in steps of {step:g}" if step > 0.01 * size else ""
        return Noise(), [
            f"declared uncertainty {spoken(size, digits=2)}{unit}{rounding}, {_anew(model, rows)}"
        ]
    share = np.median(part.steps[""] / np.sqrt(12) / np.maximum(np.abs(part.measured), 1e-300))
    # 1e-3: rounding below this share of the reading is no account of a measurement's uncertainty
    if share >= 1e-3:
        return Noise(), [
            f"printed in steps of {np.median(part.steps['']):g}: uncertainty at least that over root 12; "
            + _anew(model, rows)
        ]
    return Noise(known=False), [
        f"its uncertainty is not stated: repeat conditions, or give {column!r} in [uncertainty]"
    ]


def _usable(found: VarianceFunction | None, declared: bool) -> VarianceFunction | None:
    # 3: degrees of freedom below which repeats say nothing
    known = found is not None and found.dof >= (ENOUGH if declared else 3) and found.level > 0
    return found if known else None


def _slopes(rows: Rows, predicted: Array, *, in_time: bool = True) -> Array:
    """What repeats of a condition may differ by without being scattered, most likely first.

    A setting that was read differed: the reference's slope may be a little wrong, so that a correction
    linear in the deviation, and in the condition, is left to be fitted. Time went on: a machine runs in,
    quickly at first, by an amount or by a share of the reading.
    """
    scaled = [
        (x - x.mean()) / x.std()
        for n, x in rows.levels.items()
        if np.ptp(x) > 0 and n != TIME and n not in rows.groups
    ]
    deviations = {
        n: x - rows.levels[n] for n, x in rows.conditions.items() if n != TIME and not rows.is_set[n]
    }
    columns = list(deviations.values())
    if in_time and TIME in rows.conditions:
        basis = _piecewise_linear_basis(rows.conditions[TIME])
        columns += [part * weight for weight in (predicted, np.ones(rows.n)) for part in basis]
    columns += [deviation * u for deviation in deviations.values() for u in scaled]
    return np.stack(columns, axis=1) if columns else np.empty((rows.n, 0))


def _piecewise_linear_basis(time: Array) -> list[Array]:
    """Piecewise straight functions of time whose corners lie closer together at the start."""
    span = max(float(np.ptp(time)), 1e-300)
    corners = time.min() + span * np.linspace(0, 1, 7) ** 2
    return [np.interp(time, corners, unit) for unit in np.eye(7)]


def choices(count: int) -> list[tuple[int, ...]]:
    """Which of some operating variables something may depend on: any one, any two, all."""
    sizes = sorted({min(size, count) for size in (1, 2, count)})
    return [chosen for size in sizes for chosen in combinations(range(count), size)]


def stretched(x: Array, low: float, high: float) -> Array:
    """A variable on a scale of 0 to 1 over the fitted range; logarithmic where it spans much."""
    if low >= 0 and high > 3 * max(low, 1e-300):
        offset = 0.1 * high
        x, low, high = np.log(np.maximum(x, 0.0) + offset), np.log(low + offset), np.log(high + offset)
    return (x - low) / (high - low)


# --- in words -----------------------------------------------------------------------------------


def _about_conditions(model: Model, rows: Rows) -> list[str]:
    said = []
    for name, x in rows.conditions.items():
        condition = model.conditions[name]
        if name == TIME or not condition.varies:
            continue
        distinct = np.unique(rows.levels[name]).size
        kind = "set values" if rows.is_set[name] else "values as read (reading noise neglected)"
        if condition.group:
            names = rows.groups[name]
            said.append(f"{name}: {len(names)} groups of rows, {first_of(names, 8)}")
        elif np.ptp(x) > 0:
            said.append(f"{condition.column}: {kind}, {distinct} levels")
    return said


def _told(found: VarianceFunction, how: str, kind: str, unit: str, grows: Mapping[str, Array]) -> str:
    sigma = np.sqrt(found.at(grows, next(iter(grows.values())).size))
    ends = spoken(*((sigma.min(), sigma.max()) if found.component else (sigma.mean(),)), digits=2)
    grown = f", growing with {found.component}" if found.component else ""
    if found.component == SETTING:
        grown = ", the scatter of setting that the rig declares in it"
    by = {"setup": "column 'setup'", "repeat": "column 'repeat'", "order": "the order of the rows"}[how]
    return f"scatter {ends}{unit} from repeats {kind} ({by}), {found.dof:.0f} degrees of freedom{grown}"


def _anew(model: Model, rows: Rows) -> str:
    given = []
    for name in rows.conditions:
        setting, condition = model.rig.setting.get(name), model.conditions[name]
        if setting is not None and rows.is_set[name]:
            share = (100 * setting.relative, "percent")
            size, unit = share if setting.relative else (setting.absolute, condition.unit)
            given.append(f"{condition.column} is set to {spoken(size, unit=unit, digits=6)}")
    return " and ".join(given) + " (declared)" if given else "no scatter of setting is declared"


TITLE = "a table (text with a header line, .xlsx, Parquet)"


def reads(path: Path) -> bool:
    """Whether a file is text, a workbook or Parquet, whatever its name."""
    start = beginning(path)
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):  # UTF-16
        return True
    # an archive of another name is not a table
    workbook = start.startswith(b"PK") and path.suffix.lower() in (".xlsx", ".xlsm")
    if start.startswith(b"PAR1") or workbook:
        return True
    return bool(start) and b"\0" not in start and not start.startswith((b"RIFF", b"TDSm", b"PK"))


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the tables of a study and work out their uncertainty on the rows that are fitted.

    Raises
    ------
    InputError
        See `read_measurement`; or all rows are alike.
    RequestError
        A condition that no row meets, or nothing left to fit.
    """
    fitted = [read_measurement(f, model) for f in wanted.measurements]
    checked = [read_measurement(f, model) for f in wanted.validations]
    rows = join([*fitted, *checked], model)
    if model.is_own:
        try_model(model.assemble(model.base_effects), rows.conditions)
    columns = {model.conditions[name].column: _column(rows, model, name) for name in rows.conditions}
    unseen = rows.recording >= len(fitted)
    aside = put_aside(columns, wanted, rows.recordings, rows.recording, unseen)
    rows = rows.names_of_first(~aside)
    model = grouped(model, rows.groups)
    check_varied(rows.take(~aside), model)
    found = uncertainty(model, rows.take(~aside))
    whole = found.observe(rows)
    kept = replace(whole.take(~aside), pure_error_dof=whole.pure_error_dof) if np.any(aside) else whole
    return OpenedData(
        fitted=(kept,),
        held_out=(whole.take(aside),) if np.any(aside) else (),
        statements=found.statements,
        known=found.known,
        discrepancy_percent=model.rig.discrepancy_percent,
        doubts=rows.doubts,
    )


def _column(rows: Rows, model: Model, name: str) -> Column:
    condition = model.conditions[name]
    if condition.group:
        return Column(np.array([*rows.groups[name], ""])[rows.conditions[name].astype(int)])
    setting = grouping_of(model, condition)

    def reach(value: float) -> float:
        read = 0.0 if rows.is_set[name] else SCATTER * float(setting.at(value))
        return max(read, 5e-4 * abs(value), 1e-12)  # levels are printed to four digits

    return Column(rows.levels[name], condition, rows.units.get(name, ""), reach)
