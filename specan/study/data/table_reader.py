"""From a table file, whatever it calls its columns, to operating points and measured values in SI."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError, RequestError, nearest
from specan.models import Condition, Model, Observable, TableFault, TableRules
from specan.study.data.table_file import TableFile, read_table
from specan.study.observation import Array
from specan.units import convert, is_compatible, scale_to

MARKS = ("repeat", "setup")

# "n [1/min]", "n (1/min)", "n / (1/min)", "n / rpm"
_WITH_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<a>[^]]*)\]|\((?P<b>[^)]*)\)|\s/\s*(?P<c>.+))\s*$")


_PER_SECOND = ("1/s", "/s", "s^-1", "s-1", "s**-1", "s⁻¹", "hz")  # turns or radians: a factor of 2 pi


@dataclass(frozen=True, eq=False)
class Measurement:
    """Rows of one table, checked, in SI.

    Attributes
    ----------
    row : array of int
        Row that each measured value stands in; a row may hold several observables.
    observable : array of str
        Observable of each measured value.
    measured, step : array
        The values, and the steps in which they were printed.
    conditions, steps : dict
        Operating conditions of the rows that the table holds, by the model's names, and the steps of these.
    marks : dict
        The columns of `MARKS` that there are: number of the set-up of a condition; mark that readings of one
        set-up share.
    notes : tuple of str
        What was assumed or left out.
    groups : dict
        Names in the columns of groups, one a row.
    units : mapping
        Unit that the table has of a condition, where it says one.
    """

    name: str
    lines: NDArray[np.int_]
    row: NDArray[np.intp]
    observable: NDArray[np.str_]
    measured: Array
    step: Array
    conditions: dict[str, Array]
    steps: dict[str, Array]
    marks: dict[str, Array]
    notes: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.lines.size)


def read_measurement(
    path: Path,
    model: Model,
    constants: Mapping[str, Any] | None = None,
    name: str = "",
    columns: Mapping[str, str] | None = None,
) -> Measurement:
    """Read a table as a measurement of what a model predicts.

    Parameters
    ----------
    path : Path
    model : Model
        Says which columns there may be.
    constants : mapping, optional
        Conditions of all rows that the table does not hold, by column: ``{"load_kN": 45.0}``.
    name : str, optional
        For messages; the file's name by default.
    columns : mapping, optional
        ``{column of the model: header of the table}`` where the table has names of its own; headers that are nothing
        known are passed over then.

    Raises
    ------
    InputError
        Columns that are missing, unknown or contradict each other; values that cannot be.
    """
    names = ColumnNames(path, model, columns or {})
    table = read_table(path, names.choose, texts=model.groups)
    names.convert(table)
    constants = dict(constants or {})
    groups = {axis: _names(table, axis, constants) for axis in model.groups}
    known = {c.column: c for c in model.conditions.values() if c.column and not c.group}
    measurable = {o.header: o for o in model.observables.values() if o.kind == "table"}
    _check_columns(table, known, measurable, model.table_rules)
    _add_constants(table, constants, known)
    steps = {n: np.full(table.lines.size, s) for n, s in table.steps.items()}
    notes = [*names.notes]
    if model.table_rules is not None:
        notes += _complete(table, model.table_rules, steps)
    row, observable, measured, step = _measured(table, measurable, steps)
    conditions, its_steps = _conditions(table, known, steps)
    return Measurement(
        name=name or path.name,
        lines=table.lines,
        row=row,
        observable=observable,
        measured=measured,
        step=step,
        conditions=conditions,
        steps=its_steps,
        marks={how: _mark(table, how) for how in MARKS if how in table.columns},
        notes=tuple(notes),
        groups=groups,
        units={condition.name: names.units[c] for c, condition in known.items() if c in names.units},
    )


def _names(table: TableFile, axis: str, constants: dict[str, Any]) -> tuple[str, ...]:
    """Names of a group, one a row: a column, or the study's word for the whole file."""
    said = constants.pop(axis, None)
    words = table.words.get(axis)
    if words is None and said is None:
        raise InputError(
            f"{table.path}: the column {axis!r} is missing, which says to which {axis} each row belongs",
            remedy=f'add it, or say which header it has: --column "{axis}=HEADER"',
        )
    if words is None:
        return (str(said),) * table.lines.size
    empty = np.array([not word for word in words])
    _refuse(table, empty, f"no name in the column {axis!r}", remedy="fill it")
    return tuple(words)


def _refuse(table: TableFile, rows: NDArray[np.bool_], found: str, **more: str) -> None:
    """Refuse a table for some of its rows, if there are any."""
    if np.any(rows):
        raise InputError(f"{table.path}, {table.rows(rows)}: {found}", **more)


def _complete(table: TableFile, rules: TableRules, steps: dict[str, Array]) -> tuple[str, ...]:
    """Apply a model's rules to the columns and their steps, in place; returns the notes."""
    try:
        found = rules.complete(table.columns, table.steps)
    except TableFault as fault:
        where = f"{table.path}" if fault.rows is None else f"{table.path}, {table.rows(fault.rows)}"
        raise InputError(f"{where}: {fault.found}", expected=fault.expected, remedy=fault.remedy) from None
    table.columns.update(found.columns)
    steps.update(found.steps)
    return found.notes


def _check_columns(
    table: TableFile,
    known: Mapping[str, Condition],
    measurable: Mapping[str, Observable],
    rules: TableRules | None,
) -> None:
    missing = []
    for column, condition in known.items():
        sources = rules.derivable.get(column) if rules else None
        derivable = sources is not None and sources <= set(table.columns)
        if column not in table.columns and condition.default is None and not derivable:
            missing.append(column)
    if missing:
        names = ", ".join(map(repr, missing))
        raise InputError(
            f"{table.path}: the column{'s' if len(missing) > 1 else ''} {names} "
            f"{'are' if len(missing) > 1 else 'is'} missing (found: {', '.join(table.columns)})",
            remedy=f'add it, or say which header it has: --column "{missing[0]}=HEADER"',
        )
    if not any(name in table.columns for name in measurable):
        raise InputError(
            f"{table.path} holds nothing that the model predicts",
            expected="a column " + " or ".join(measurable),
        )


def _add_constants(table: TableFile, constants: Mapping[str, float], known: Mapping[str, Condition]) -> None:
    for column, value in constants.items():
        if column not in known:
            raise InputError(f"{table.path}: unknown condition {column!r}", remedy=nearest(column, known))
        if column in table.columns:
            raise InputError(
                f"{table.path} holds the column {column!r}, and the study gives it as a constant too",
                remedy="leave one of them out",
            )
        table.columns[column] = np.full(table.lines.size, float(value))
        table.steps[column] = 0.0


def _measured(
    table: TableFile, measurable: Mapping[str, Observable], steps: Mapping[str, Array]
) -> tuple[NDArray[np.intp], NDArray[np.str_], Array, Array]:
    """Every measured value, those of a row together: its row, observable, value and printed step."""
    parts = []
    for column, observable in measurable.items():
        if column not in table.columns:
            continue
        unit = observable.column_unit or observable.unit
        found = np.asarray(convert(table.columns[column], unit, observable.unit), dtype=float)
        given = np.flatnonzero(np.isfinite(found))
        names = np.full(given.size, observable.name, dtype="U64")
        parts.append((given, names, found[given], steps[column][given] * scale_to(unit, observable.unit)))
    row, observables, values, printed = (np.concatenate(part) for part in zip(*parts, strict=True))
    lacking = ~np.isin(np.arange(table.lines.size), row)
    _refuse(table, lacking, "no measured value", expected="one of " + ", ".join(measurable))
    order = np.argsort(row, kind="stable")
    return row[order], observables[order], values[order], printed[order]


def _conditions(
    table: TableFile, known: Mapping[str, Condition], steps: Mapping[str, Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    found, its_steps = {}, {}
    for column, condition in known.items():
        if column not in table.columns:
            continue
        values = table.columns[column]
        if np.all(np.isnan(values)) and condition.default is not None:
            continue
        lacking = f"no value in the column {column!r}"
        _refuse(table, np.isnan(values), lacking, remedy="fill it or leave the rows out")
        found[condition.name] = np.asarray(convert(values, condition.column_unit, condition.unit))
        its_steps[condition.name] = steps.get(column, np.zeros(values.size)) * scale_to(
            condition.column_unit, condition.unit
        )
    return found, its_steps


def _mark(table: TableFile, name: str) -> Array:
    lacking = np.isnan(table.columns[name])
    _refuse(
        table, lacking, f"no value in the column {name!r}", remedy="number every row, or leave the column out"
    )
    return table.columns[name]


@dataclass(eq=False)
class ColumnNames:
    """Names and units of a table's columns for a model.

    Attributes
    ----------
    chosen : mapping
        ``{column of the model: header of the table}`` that a user gave; with one given, headers that are nothing
        known are passed over.
    lenient : bool
        Pass such headers over in any case.
    """

    path: Path
    model: Model
    chosen: Mapping[str, str] = field(default_factory=dict)
    lenient: bool = False
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    passed_over: list[str] = field(default_factory=list)

    def choose(self, headers: Iterable[str]) -> dict[str, str]:
        """Header to the model's column, for the headers that are used.

        Raises
        ------
        InputError
            Headers that are nothing known, all of them; a chosen header that the table does not have.
        """
        headers = list(headers)
        wanted = self._wanted(headers)
        found: dict[str, str] = {}
        unknown: list[str] = []
        for header in headers:
            column, unit = wanted.get(header) or self._recognised(header)
            if not column:
                unknown.append(header)
                continue
            if column in found.values():
                other = next(h for h, c in found.items() if c == column)
                raise InputError(
                    f"{self.path}: {other!r} and {header!r} are both the column {column!r}",
                    remedy=f'choose with --column "{column}={header}", or leave one of them out',
                )
            found[header] = column
            if unit:
                self.units[column] = unit
        if unknown and not self.chosen and not self.lenient:
            raise self._unknown(unknown, found)
        self.passed_over = unknown
        return found

    def convert(self, table: TableFile) -> None:
        """Turn columns with a unit of their own into the model's units, in place.

        Raises
        ------
        InputError
            A unit that does not fit.
        """
        for name, cell_unit in table.cell_units.items():
            self.units.setdefault(name, cell_unit)
        for name, header in self.chosen.items():
            column = self._column_called(name)
            if column not in self.units and column in self._targets and column not in self.model.groups:
                known = self._targets[column]
                unit = known.column_unit or known.unit
                self.notes.append(
                    f'{header!r} says no unit: taken to be in {unit} (else: --column "{name}={header} [UNIT]")'
                )
        if self.passed_over:
            self.notes.append(f"columns ignored: {', '.join(self.passed_over)}")
        for name, unit in self.units.items():
            if name in self.model.groups:
                continue
            target = self._targets.get(name)
            wanted = (target.column_unit or target.unit) if target is not None else unit
            if wanted == unit:
                continue
            if unit.lower() in _PER_SECOND and is_compatible("rpm", wanted):
                raise InputError(
                    f"{self.path}: the column {name!r} is in {unit!r}, which may be turns or radians a second",
                    remedy="write rps or rad/s",
                )
            try:
                table.columns[name] = np.asarray(convert(table.columns[name], unit, wanted), dtype=float)
                table.steps[name] *= scale_to(unit, wanted)
            except RequestError:
                raise InputError(
                    f"{self.path}: the column {name!r} is in {unit!r}",
                    expected=f"a unit of {name}, which the model has in {wanted}",
                    remedy="correct the unit in the table's header, or in the model",
                ) from None

    # --- how a header is recognised ---------------------------------------------------------------

    @property
    def _targets(self) -> dict[str, Condition | Observable]:
        conditions = {c.column: c for c in self.model.conditions.values() if c.column}
        return {**conditions, **{o.header: o for o in self.model.observables.values() if o.kind == "table"}}

    def _wanted(self, headers: list[str]) -> dict[str, tuple[str, str]]:
        """What a user chose: header to column and unit."""
        found = {}
        for name, header in self.chosen.items():
            column = self._column_called(name)
            said = _WITH_UNIT.match(header)
            if header not in headers and said is not None and said["name"] in headers:
                header = said["name"]  # the user says the unit that the table does not
            if header not in headers:
                raise InputError(
                    f"{self.path} has no column {header!r}, which is to be {name!r}",
                    remedy=nearest(header, headers),
                )
            found[header] = (column, _unit(said) if said else "")
        return found

    def _column_called(self, name: str) -> str:
        if name in self._targets or name in MARKS:
            return name
        for column, target in self._targets.items():
            if target.name == name:
                return column
        raise InputError(
            f"{self.model.name} has no column {name!r}", remedy=nearest(name, [*self._targets, *MARKS])
        )

    def _recognised(self, header: str) -> tuple[str, str]:
        """Column and unit of a header that names a column as it is, or a name with its unit behind."""
        if header in self._targets or header in MARKS:
            return header, ""
        other_letters = [c for c in (*self._targets, *MARKS) if _plain(c) == _plain(header)]
        if len(other_letters) == 1:
            return other_letters[0], ""
        said = _WITH_UNIT.match(header)
        if said is None:
            return "", ""
        name = _plain(said["name"])
        close = [c for c, t in self._targets.items() if name in _aliases(c, t)]
        return (close[0], _unit(said)) if len(close) == 1 else ("", "")

    def _unknown(self, unknown: list[str], known: Mapping[str, str]) -> InputError:
        allowed = [*self._targets, *MARKS]
        hints = []
        for header in unknown:
            said = _WITH_UNIT.match(header)
            stem = said["name"] if said else header
            same = [c for c in allowed if c.rsplit("_", 1)[0] == stem.rsplit("_", 1)[0]]
            hint = f"the unit belongs to the name: give {same[0]!r}" if same else nearest(stem, allowed)
            hints.append(hint.rstrip("?"))
        names = ", ".join(map(repr, unknown))
        said_hints = "; ".join(
            f"{header!r}: {hint}" for header, hint in zip(unknown, hints, strict=True)
        ) if len(set(hints)) > 1 else hints[0]  # fmt: skip
        example = next((c for c in self._targets if c not in known.values()), "")
        way = f'assign columns with --column "{example}={unknown[0]}"'
        if not example:
            header, column = next(iter(known.items()))
            way = f'no column is missing; to ignore the others, give --column "{column}={header}"'
        return InputError(
            f"{self.path}: unknown column{'s' if len(unknown) > 1 else ''} {names}",
            remedy=f"{said_hints}; {way}; a column whose name begins with 'note' is ignored",
        )


def _unit(said: re.Match[str]) -> str:
    return (said["a"] or said["b"] or (said["c"] or "").strip("()")).strip()


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name.strip()).lower()


def _aliases(column: str, target: Condition | Observable) -> set[str]:
    """Names under which a header may have a column, without its unit."""
    stem, _, suffix = column.rpartition("_")
    names = {column, target.name, *([stem] if stem and suffix else [])}
    if isinstance(target, Condition):
        names.add(target.words)
    return {_plain(name) for name in names}
