"""From a table file to operating points and measured values in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError, nearest
from specan.models import Condition, Model, Observable, TableFault, TableRules
from specan.study.data.table_columns import ColumnNames
from specan.study.data.table_file import TableFile, read_table
from specan.study.observation import Array
from specan.units import convert, scale_to


@dataclass(frozen=True, eq=False)
class Measurement:
    """Rows of one table, checked, in SI.

    Attributes
    ----------
    observable : array of str
        Which observable each row holds: the first of the model's that it has.
    conditions : dict
        Operating conditions that the table holds, by the model's names.
    steps : dict
        Step in which each row's condition or observable was printed, SI, by condition or observable.
    repeat, setup : array or None
        Number of the set-up of a condition; mark that readings of one set-up share.
    notes : tuple of str
        What was assumed or left out.
    groups : dict
        Names in the columns of groups, one a row.
    """

    name: str
    path: Path
    lines: NDArray[np.int_]
    observable: NDArray[np.str_]
    measured: Array
    conditions: dict[str, Array]
    steps: dict[str, Array]
    repeat: Array | None
    setup: Array | None
    notes: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.measured.size)


def read_measurement(
    path: Path,
    model: Model,
    constants: Mapping[str, Any] | None = None,
    content: bytes | None = None,
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
    content : bytes, optional
        The file's content where it has been read already.
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
    table = read_table(path, content, names.choose, texts=model.groups)
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
    chosen, measured, step = _choose(table, measurable, steps)
    conditions, its_steps = _conditions(table, known, steps)
    return Measurement(
        name=name or path.name,
        path=path,
        lines=table.lines,
        observable=chosen,
        measured=measured,
        conditions=conditions,
        steps={**its_steps, "": step},
        repeat=_mark(table, "repeat"),
        setup=_mark(table, "setup"),
        notes=tuple(notes),
        groups=groups,
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
    if np.any(empty):
        raise InputError(
            f"{table.path}, {table.rows(empty)}: no name in the column {axis!r}", remedy="fill it"
        )
    return tuple(words)


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


def _choose(
    table: TableFile, measurable: Mapping[str, Observable], steps: Mapping[str, Array]
) -> tuple[NDArray[np.str_], Array, Array]:
    """For each row the first of the model's observables that it holds."""
    size = table.lines.size
    chosen, measured, step = np.full(size, "", dtype="U64"), np.full(size, np.nan), np.zeros(size)
    for column, observable in measurable.items():
        if column not in table.columns:
            continue
        values = table.columns[column]
        rows = np.isnan(measured) & np.isfinite(values)
        chosen[rows] = observable.name
        measured[rows] = values[rows]
        step[rows] = steps[column][rows]
        if observable.column_unit not in ("", observable.unit):
            measured[rows] = convert(values[rows], observable.column_unit, observable.unit)
            step[rows] *= scale_to(observable.column_unit, observable.unit)
    if np.any(np.isnan(measured)):
        raise InputError(
            f"{table.path}, {table.rows(np.isnan(measured))}: no measured value",
            expected="one of " + ", ".join(measurable),
        )
    return chosen, measured, step


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
        if np.any(np.isnan(values)):
            raise InputError(
                f"{table.path}, {table.rows(np.isnan(values))}: no value in the column {column!r}",
                remedy="fill it or leave the rows out",
            )
        found[condition.name] = np.asarray(convert(values, condition.column_unit, condition.unit))
        its_steps[condition.name] = steps.get(column, np.zeros(values.size)) * scale_to(
            condition.column_unit, condition.unit
        )
    return found, its_steps


def _mark(table: TableFile, name: str) -> Array | None:
    values = table.columns.get(name)
    if values is None:
        return None
    if np.any(np.isnan(values)):
        raise InputError(
            f"{table.path}, {table.rows(np.isnan(values))}: no value in the column {name!r}",
            remedy="number every row, or leave the column out",
        )
    return values
