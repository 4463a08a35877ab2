"""From table files to observations: what is fitted, what is held out, what only validates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, nearest
from specan.models import Condition, Model, SettingError
from specan.models.groups import grouped
from specan.models.trial import try_model
from specan.schema import regular
from specan.study.data.operating_table import SCATTER, Rows, check_varied, join
from specan.study.data.setpoints import grouping_of
from specan.study.data.table_covariance import uncertainty
from specan.study.data.table_file import Table
from specan.study.data.table_reader import read_measurement
from specan.study.observation import DataFile, MeasuredFiles, OpenedData
from specan.units import convert, is_compatible, printed_unit

TITLE = "a table (text with a header line, .xlsx, Parquet)"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUES = re.compile(rf"(?P<low>{_NUMBER})(?:\s*\.\.\s*(?P<high>{_NUMBER}))?\s*(?P<unit>[^\d\s.].*)?")
WORKBOOKS = (".xlsx", ".xlsm")  # an archive of another name is not a table


def reads(path: Path) -> bool:
    """Whether a file is text, a workbook or Parquet, whatever its name."""
    try:
        with regular(path).open("rb") as file:
            start = file.read(4096)
    except OSError:
        return False
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):  # UTF-16
        return True
    if start.startswith(b"PAR1") or (start.startswith(b"PK") and path.suffix.lower() in WORKBOOKS):
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
    fitted = [_read(f, model) for f in wanted.measurements]
    checked = [_read(f, model) for f in wanted.validations]
    rows = join([*fitted, *checked], model)
    if model.is_own:
        try_model(model, rows.conditions)
    aside = rows.recording >= len(fitted)
    for file, where in wanted.hold_out:
        aside |= matching(rows, model, where, file)
    if np.all(aside):
        raise RequestError(
            "all rows are held out", expected="some to fit", remedy="hold out fewer conditions"
        )
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
        discrepancy_percent=found.discrepancy_percent,
    )


def read_tables(
    model: Model,
    measurements: Sequence[Path],
    validations: Sequence[Path] = (),
    hold_out: Sequence[tuple[str | None, str]] = (),
) -> OpenedData:
    """Tables as observations, without a study directory.

    Parameters
    ----------
    model : Model
    measurements, validations : sequence of Path
        Tables to fit and tables to predict only.
    hold_out : sequence of (file name or None, condition)
        Rows of the measurements to put aside, ``(None, "load=60,90")``.
    """
    fitted, checked = ([DataFile(path.name, path) for path in paths] for paths in (measurements, validations))
    return open_data(model, MeasuredFiles(fitted, checked, hold_out))


def _read(file: DataFile, model: Model) -> Table:
    for column, value in file.conditions.items():
        if isinstance(value, str) and column not in model.groups:
            raise RequestError(f"{file.name}: the condition {column!r} is {value!r}", expected="a number")
    return read_measurement(file.path, model, file.conditions, file.name, file.columns, file.sheet)


def matching(rows: Rows, model: Model, where: str, file: str | None = None) -> NDArray[np.bool_]:
    """Rows that meet a condition such as ``load=60,90``, ``load_kN=60..90`` or ``mass=55 kg``.

    A value stands for the level nearest to it, as far as the scatter of setting allows; without a unit it is in that
    of the tables.

    Raises
    ------
    RequestError
        No such column or level; what there is, is named.
    """
    key, _, text = where.partition("=")
    name = _condition_named(key.strip(), rows, model)
    condition = model.conditions[name]
    if condition.group:
        return _named(rows, name, text, where) & _in_file(rows, file)
    unit = rows.units.get(name, condition.column_unit)
    found = np.zeros(rows.n, dtype=bool)
    for word in text.split(","):
        ends = values_of(word, where, condition, unit)
        if len(ends) == 2:
            here = (rows.levels[name] >= min(ends)) & (rows.levels[name] <= max(ends))
        else:
            here = _at_level(rows, name, ends[0], grouping_of(model, condition))
        if not np.any(here):
            levels = convert(np.unique(rows.levels[name]), condition.unit, unit)
            shown = f" {printed_unit(unit)}".rstrip()
            raise RequestError(
                f"no row has {condition.column} = {word.strip()}" + shown * word.strip()[-1].isdigit(),
                expected=f"one of {', '.join(f'{level:.4g}' for level in levels[:20])}{shown}",
            )
        found |= here
    return found & _in_file(rows, file)


def values_of(word: str, where: str, condition: Condition, unit: str) -> list[float]:
    """SI values of ``60``, ``60 kN`` or ``60..90 kN``."""
    said = _VALUES.fullmatch(word.strip())
    if said is None:
        raise RequestError(
            f"{word!r} in {where!r} is not a number",
            expected=f"{condition.column}=value,value or {condition.column}=low..high, with a unit if need be",
        )
    given = said["unit"] or unit
    if not is_compatible(given, condition.column_unit):
        raise RequestError(f"{given!r} in {where!r} is not a unit of {condition.column}", expected=unit)
    found = [float(said[end]) for end in ("low", "high") if said[end]]
    return [
        float(convert(convert(v, given, condition.column_unit), condition.column_unit, condition.unit))
        for v in found
    ]


def _in_file(rows: Rows, file: str | None) -> NDArray[np.bool_]:
    """Rows of a measurement; all where none is named."""
    if file is None:
        return np.ones(rows.n, dtype=bool)
    if file not in rows.recordings:
        raise RequestError(f"no measurement {file!r}", remedy=nearest(file, rows.recordings))
    return np.asarray(rows.recording == rows.recordings.index(file))


def _named(rows: Rows, axis: str, text: str, where: str) -> NDArray[np.bool_]:
    """Rows of some names of a group."""
    wanted = [word.strip() for word in text.split(",")]
    for name in wanted:
        if name not in rows.groups[axis]:
            raise RequestError(
                f"no row has {axis} = {name} ({where})",
                expected="one of " + ", ".join(rows.groups[axis][:20]),
            )
    return np.isin(rows.conditions[axis], [rows.groups[axis].index(name) for name in wanted])


def _at_level(rows: Rows, name: str, value: float, setting: SettingError) -> NDArray[np.bool_]:
    distance = np.abs(rows.levels[name] - value)
    read = 0.0 if rows.is_set[name] else SCATTER * float(setting.at(value))
    reach = max(read, 5e-4 * abs(value), 1e-12)  # levels are printed to four digits
    return (distance <= reach) & (distance == distance.min())


def _condition_named(key: str, rows: Rows, model: Model) -> str:
    """Condition that a column, or a part of its name, stands for."""
    columns = {model.conditions[name].column: name for name in rows.conditions}
    if key in columns:
        return columns[key]
    close = [name for column, name in columns.items() if key and key in column]
    if len(close) != 1:
        raise RequestError(
            f"{key!r} names no single column", expected="one of " + ", ".join(columns), remedy="write it out"
        )
    return close[0]
