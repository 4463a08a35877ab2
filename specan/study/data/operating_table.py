"""The rows of all tables of a study, with what belongs together; checked against the rig and against each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Condition, Model, SettingError
from specan.result import first_of
from specan.study.data.setpoints import TIME, SetPoints, cells, grouped, grouping_of
from specan.study.data.table_file import MOST_NAMED, Table
from specan.study.data.table_reader import MARKS
from specan.study.observation import Array, Variable
from specan.study.observation.table import TableObservation
from specan.units import convert, often_mistaken_for, printed_unit, scale_to


@dataclass(frozen=True, eq=False, kw_only=True)
class Rows(TableObservation):
    """Measured values of one or several tables, one a row: a line that holds several observables is several rows.

    Attributes
    ----------
    levels : dict
        Of each condition, the value that a row was meant to be at.
    is_set : dict
        Whether a condition's column holds set values rather than readings.
    steps : dict
        Printed step of each condition, and under ``""`` that of the observable; SI.
    setup : array of int
        Rows that were read without setting anything in between share a number.
    setups_from : str
        How set-ups were distinguished: ``setup``, ``repeat`` or ``order``.
    units : mapping
        Units of the tables' own columns, of those conditions that all tables have in one unit.
    """

    recording: NDArray[np.intp]
    lines: NDArray[np.int_]
    replicate_group: NDArray[np.intp]
    levels: dict[str, Array]
    is_set: dict[str, bool]
    steps: dict[str, Array]
    setup: NDArray[np.intp]
    setups_from: str
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """Keep some of the rows, as if there were no others."""
        levels, steps = ({n: v[mask] for n, v in of.items()} for of in (self.levels, self.steps))
        kept = super().take(mask)
        return replace(kept, levels=levels, steps=steps, setup=self.setup[mask], series=None, position=None)

    def names_of_first(self, mask: NDArray[np.bool_]) -> Rows:
        """The same with groups that hold the names of some rows only; other names have numbers behind them."""
        conditions, levels, groups = dict(self.conditions), dict(self.levels), dict(self.groups)
        for axis, names in self.groups.items():
            codes = self.conditions[axis].astype(int)
            used = [k for k in range(len(names)) if k in set(codes[mask].tolist())]
            order = [*used, *(k for k in range(len(names)) if k not in used)]
            conditions[axis] = levels[axis] = np.argsort(order)[codes].astype(float)
            groups[axis] = tuple(names[k] for k in used)
        return replace(self, conditions=conditions, levels=levels, groups=groups)

    def place(self, row: int) -> str:
        """File and line of a row, for messages."""
        return f"{self.recordings[self.recording[row]]}, line {self.lines[row]}"

    def observed(self, **known: Any) -> TableObservation:
        """As an observation of which more is known."""
        return TableObservation(**{f.name: getattr(self, f.name) for f in fields(TableObservation)} | known)

    def variables_of(self, model: Model) -> dict[str, Variable]:
        """Words and unit of each label."""
        known = {c.column: Variable(c.words, printed_unit(c.column_unit)) for c in model.conditions.values()}
        return {name: known.get(name, Variable(name)) for name in self.labels_of(model)}

    def labels_of(self, model: Model) -> dict[str, NDArray[Any]]:
        """Levels of the operating variables that vary, in the units of their columns; where from."""
        found: dict[str, NDArray[Any]] = {}
        for name, level in self.levels.items():
            condition = model.conditions[name]
            if condition.group:
                if np.unique(level).size > 1:
                    names = (*self.groups[name], "another")
                    found[name] = np.array(names)[np.minimum(level.astype(int), len(names) - 1)]
                continue
            if condition.varies and np.unique(level).size > 1:
                shown = np.asarray(convert(grouped(level), condition.unit, condition.column_unit))
                digits = 6 if self.is_set[name] else 3
                found[condition.column] = np.array([float(f"{value:.{digits}g}") for value in shown])
        if len(self.recordings) > 1:
            found["measurement"] = np.array(self.recordings)[self.recording]
        return found


def join(tables: Sequence[Table], model: Model) -> Rows:
    """Put the rows of several tables under each other.

    A condition that some tables lack takes its default there; without a default it is left out of all.
    """
    frame = pd.concat([t.frame for t in tables], keys=range(len(tables)))
    recording, lines = (np.asarray(frame.index.get_level_values(k)) for k in (0, 1))
    recordings = tuple(t.name for t in tables)
    places = [f"{recordings[k]}, line {line}" for k, line in zip(recording, lines, strict=True)]
    conditions, steps, groups, notes = _conditions(tables, frame, model)
    outside = check_limits(conditions, places, model)
    marks = {how: frame[how].to_numpy() for how in MARKS if all(how in t.frame for t in tables)}
    said = {n: {t.units.get(model.conditions[n].column, "") for t in tables} for n in conditions}
    units = {n: next(iter(found)) for n, found in said.items() if len(found) == 1 and "" not in found}
    points = SetPoints(conditions, model, recording, marks, units)

    def place(rows: NDArray[np.intp]) -> str:
        file = f"{recordings[int(recording[rows[0]])]}, " if len(recordings) > 1 else ""
        return f"{file}lines {', '.join(str(lines[k]) for k in rows)}"

    # From rows of the tables to measured values, of which a row may hold several.
    row, observable, measured, printed = _measured(tables, frame, model)
    kinds = cells(observable)
    return Rows(
        name=", ".join(dict.fromkeys(recordings)),
        covariance=np.ones(row.size),
        recordings=recordings,
        recording=recording[row],
        lines=lines[row],
        observable=observable,
        measured=measured,
        conditions={name: values[row] for name, values in conditions.items()},
        levels={name: values[row] for name, values in points.levels.items()},
        is_set=points.is_set,
        steps={**{name: values[row] for name, values in steps.items()}, "": printed},
        replicate_group=cells(points.replicate_group[row], kinds),
        setup=points.setup[row],
        setups_from=points.setups_from,
        notes=(
            *(f"{t.name}: {note}" for t in tables for note in t.notes),
            *notes,
            *outside,
            *points.said(place),
        ),
        doubts=tuple(f"{t.name}: {doubt}" for t in tables for doubt in t.doubts),
        groups=groups,
        units=units,
    )


def _steps(tables: Sequence[Table], column: str) -> Array:
    """Printed step of every row."""
    return np.concatenate([np.broadcast_to(t.steps.get(column, 0.0), len(t.frame)) for t in tables])


def _measured(
    tables: Sequence[Table], frame: pd.DataFrame, model: Model
) -> tuple[NDArray[np.intp], NDArray[np.str_], Array, Array]:
    """Every measured value, those of a row together: its row, observable, value and printed step."""
    parts = []
    for o in model.observables.values():
        if o.kind == "table" and o.header in frame:
            unit = o.column_unit or o.unit
            values = np.asarray(convert(frame[o.header].to_numpy(), unit, o.unit), dtype=float)
            row = np.flatnonzero(np.isfinite(values))
            step = _steps(tables, o.header)[row] * scale_to(unit, o.unit)
            parts.append((row, np.full(row.size, o.name, dtype="U64"), values[row], step))
    row, observable, measured, printed = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(row, kind="stable")
    return row[order], observable[order], measured[order], printed[order]


def _conditions(
    tables: Sequence[Table], frame: pd.DataFrame, model: Model
) -> tuple[dict[str, Array], dict[str, Array], dict[str, tuple[str, ...]], list[str]]:
    """Conditions in SI and their printed steps; names of the groups, whose numbers are in the conditions; notes."""
    conditions: dict[str, Array] = {}
    steps: dict[str, Array] = {}
    groups: dict[str, tuple[str, ...]] = {}
    notes = []
    for name, condition in model.conditions.items():
        column = condition.column
        default = None if condition.default is None or np.isnan(condition.default) else condition.default
        lacking = [t.name for t in tables if column not in t.frame]
        if len(lacking) == len(tables):
            continue
        if lacking and default is None:
            notes.append(f"{column} is left out: {', '.join(lacking)} has no such column")
            continue
        if lacking:
            notes.append(f"{column} is taken as {default:g} where a table has no such column")
        steps[name] = _steps(tables, column)
        if condition.group:
            codes, names = pd.factorize(frame[column])
            conditions[name], groups[name] = codes.astype(float), tuple(names)
            continue
        values = frame[column].to_numpy() if default is None else frame[column].fillna(default).to_numpy()
        conditions[name] = np.asarray(convert(values, condition.column_unit, condition.unit), dtype=float)
        steps[name] *= scale_to(condition.column_unit, condition.unit)
    return conditions, steps, groups, notes


def check_varied(rows: Rows, model: Model) -> None:
    """Refuse a single condition, or rows that are all alike: no model can be tested on them."""
    if all(np.unique(values).size < 2 for name, values in rows.levels.items() if name != TIME):
        there = ", ".join(rows.recordings)
        what = "one row" if rows.n == 1 else f"{rows.n} rows, all at the same condition"
        near = [model.conditions[n].column for n, v in rows.conditions.items() if n != TIME and np.ptp(v) > 0]
        remedy = f"measure at other {model.words.vary}"
        if near:
            what = f"{rows.n} rows that differ in {' and '.join(near)} by no more than the scatter of setting"
            remedy += f", or declare a smaller {near[0]}_setting_percent"
        raise InputError(
            f"{there}: {what}", expected="at least two different operating conditions", remedy=remedy
        )


SCATTER = 3.0  # standard deviations of setting by which a limit may be passed


def check_limits(conditions: Mapping[str, Array], places: Sequence[str], model: Model) -> list[str]:
    """Refuse values that the bench cannot run; a likely unit is named.

    What lies outside by less than the whole range, and in no other unit inside, is only remarked on: a bench may run a
    little further than its file says.

    Parameters
    ----------
    conditions : mapping
        SI values by the model's names.
    places : sequence of str
        File and line of every row.
    model : Model
        Its rig holds the ``[limits]``.

    Returns
    -------
    list of str
        Remarks.

    Raises
    ------
    InputError
        Values far outside the limits, or in another unit.
    """
    remarks = []
    for name, (low, high) in model.rig.limits.items():
        if name not in conditions:
            continue
        values, condition = conditions[name], model.conditions[name]
        outside = partial(
            _outside, low=low, high=high, condition=condition, setting=grouping_of(model, condition)
        )
        bad = outside(values)
        if not np.any(bad):
            continue
        shown = _shown(values[bad], condition)
        ends = _shown(np.array([low, high]), condition)
        most = bad.sum() >= 0.5 * np.count_nonzero(values)  # a wrong unit is that of the whole column
        unit = _likely_unit(values, condition, outside) if most else ""
        span = f"{shown.min():.4g} to {shown.max():.4g}" if np.ptp(shown) > 0 else f"{shown[0]:.4g}"
        said = f"{_named(places, bad)}: {condition.column} is {span} {condition.column_unit}"
        if not unit and values.min() > low - (high - low) and values.max() < high + (high - low):
            remarks.append(f"{said}, outside its limits ({ends[0]:.4g} to {ends[1]:.4g})")
            continue
        raise InputError(
            said,
            expected=f"{ends[0]:.4g} to {ends[1]:.4g} {condition.column_unit}, its limits",
            remedy=f"{unit}; convert the column" if unit else "correct the rows or the limits",
        )
    return remarks


def _outside(
    values: Array, low: float, high: float, condition: Condition, setting: SettingError
) -> NDArray[np.bool_]:
    # 0.05: and the share of the limits' range
    reach = SCATTER * np.asarray(setting.at(values)) + 0.05 * (high - low)
    bad = (values < low - reach) | (values > high + reach)
    if condition.idles:
        # a condition that `idles` does so below a twentieth of its upper limit
        bad &= ~(np.abs(values) <= 0.05 * high)
    return np.asarray(bad)


def _likely_unit(values: Array, condition: Condition, outside: Callable[[Array], NDArray[np.bool_]]) -> str:
    """``rev/s?``: a unit in which all values lie within the limits; empty where none does."""
    shown = _shown(values, condition)
    for unit, name in often_mistaken_for(condition.column_unit).items():
        meant = np.asarray(
            convert(convert(shown, unit, condition.column_unit), condition.column_unit, condition.unit)
        )
        if not np.any(outside(meant)):
            return f"they are likely in {name}"
    # 1000.0: a point that parts thousands, read as a decimal point
    meant = np.asarray(convert(1000.0 * shown, condition.column_unit, condition.unit))
    if not np.any(outside(meant)):
        return "a thousands separator was probably read as a decimal point (1.200 for 1200)"
    return ""


def _shown(values: Array, condition: Condition) -> Array:
    return np.asarray(convert(values, condition.unit, condition.column_unit), dtype=float)


def _named(places: Sequence[str], rows: NDArray[np.bool_]) -> str:
    first, *others = [places[int(k)] for k in np.flatnonzero(rows)]
    return first_of([first, *(place.rpartition("line ")[2] for place in others)], MOST_NAMED, " rows")


def check_repeats(rows: Rows, where: NDArray[np.intp], part: Rows, rest: Array, declared: Array) -> None:
    """Refuse repeats that no scatter explains; where the time is given they may drift, which an effect may explain."""
    _, index, counts = np.unique(part.replicate_group, return_inverse=True, return_counts=True)
    if TIME in part.conditions:
        return
    centre = np.array([np.median(rest[index == k]) for k in range(counts.size)])
    off = np.abs(rest - centre[index])
    repeated = counts[index] > 1
    if not np.any(repeated):
        return
    size = np.maximum(np.abs(part.measured), 1e-300)
    # 8: standard deviations beyond which a repeat is no scatter
    limit = np.maximum(0.1 * size, 8 * np.sqrt(declared))
    moved = repeated & (off > 0)  # the one in the middle of three is not a measure of their scatter
    if np.sum(counts > 1) >= 4 and np.any(moved):
        usual, usual_share = np.median(off[moved]), np.median((off / size)[moved])
        limit = np.maximum(limit, 8 * 1.4826 * np.maximum(usual, usual_share * size))
    bad = repeated & (off > limit)
    if np.any(bad):
        k = int(np.argmax(np.where(bad, np.abs(rest), -1.0)))
        others = [i for i in np.flatnonzero(index == index[k]) if i != k]
        other = others[int(np.argmax(np.abs(part.measured[others] - part.measured[k])))]
        raise InputError(
            f"repeats contradict each other: {rows.place(where[k])} gives {part.measured[k]:g}, "
            f"{rows.place(where[other])} gives {part.measured[other]:g} at the same condition",
            expected="repeats that differ by their scatter",
            remedy="correct or remove the wrong one",
        )
