"""What a rig says that a study needs: limits of the conditions, uncertainties of instruments and settings.

A rig file may name other files, which lie beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.quantity import Condition, Observable, SettingError
from specan.schema import read_toml
from specan.units import convert, scale_to

_FILES = (("room", "mesh"), ("background", "recording"))  # keys whose values are paths


@dataclass(frozen=True)
class RigStatement:
    """Limits and uncertainties of a rig, in SI, by the model's names of conditions and observables.

    Instrument errors that are common to all readings (a zero, a gain) are not here: they are effects that
    the model holds by a certificate, see `specan.models.model.Nuisance`.

    Attributes
    ----------
    limits : mapping
        ``{condition: (low, high)}`` that the rig can run.
    setting : mapping
        ``{condition: SettingError}`` of setting a condition anew.
    reading : mapping
        ``{observable or condition: standard uncertainty}`` of one reading.
    reading_percent : mapping
        The same in percent of the reading; added to `reading` in squares.
    discrepancy_percent : float
        Declared standard discrepancy of the model, in percent of what its effects do to the reading.
    defaults_used : mapping
        ``{"table.key": value}`` that the rig file did not give and the model assumed.
    """

    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    setting: Mapping[str, SettingError] = field(default_factory=dict)
    reading: Mapping[str, float] = field(default_factory=dict)
    discrepancy_percent: float = 0.0
    reading_percent: Mapping[str, float] = field(default_factory=dict)
    defaults_used: Mapping[str, Any] = field(default_factory=dict)


def rig_statement(
    rig: Mapping[str, Any], conditions: Iterable[Condition], observables: Iterable[Observable]
) -> RigStatement:
    """Read ``[limits]`` and ``[uncertainty]`` of a rig file by the columns of a model's conditions and observables.

    Parameters
    ----------
    rig : mapping
        The parsed rig file. ``[limits]`` holds ``COLUMN = [low, high]``. ``[uncertainty]`` holds
        ``COLUMN = sd`` of a reading, ``COLUMN_percent = sd`` of a reading in percent of it,
        ``COLUMN_setting_percent = sd`` or ``COLUMN_setting = sd`` of setting a
        condition, and ``model_discrepancy_percent``; values are in the column's unit.
    conditions, observables : iterable
        Those of the model.

    Raises
    ------
    RequestError
        A key that names no column.

    Examples
    --------
    >>> from specan.models import Condition, Observable
    >>> load = Condition("load", "N", "Load.", "load_kN", "kN")
    >>> stretch = Observable("stretch", "stretch", "m", "Stretch.", column="stretch_mm", column_unit="mm")
    >>> said = rig_statement(
    ...     {"limits": {"load_kN": [0, 2]}, "uncertainty": {"stretch_mm": 0.5, "load_kN_setting_percent": 1.0}},
    ...     [load], [stretch],
    ... )
    >>> said.limits, said.reading, said.setting
    ({'load': (0.0, 2000.0)}, {'stretch': 0.0005}, {'load': SettingError(relative=0.01, absolute=0.0)})
    """
    by_column = {c.column: c for c in conditions}
    reads = {o.header: o for o in observables}
    limits: dict[str, tuple[float, float]] = {}
    for key, (low, high) in dict(rig.get("limits", {})).items():
        known = by_column.get(key)
        if known is None:
            raise RequestError(
                f"[limits] names {key!r}, which is not a condition", remedy=nearest(key, by_column)
            )
        ends = [float(convert(float(end), known.column_unit, known.unit)) for end in (low, high)]
        limits[known.name] = (ends[0], ends[1])
    setting: dict[str, SettingError] = {}
    reading: dict[str, float] = {}
    reading_percent: dict[str, float] = {}
    percent = 0.0
    for key, value in dict(rig.get("uncertainty", {})).items():
        if key == "model_discrepancy_percent":
            percent = float(value)
        elif key in reads:
            node = reads[key]
            reading[node.name] = float(value) * scale_to(node.column_unit or node.unit, node.unit)
        elif key in by_column:
            known = by_column[key]
            reading[known.name] = float(value) * scale_to(known.column_unit, known.unit)
        elif (column := key.removesuffix("_percent")) in reads or column in by_column:
            reading_percent[(reads[column] if column in reads else by_column[column]).name] = float(value)
        elif (column := key.removesuffix("_setting_percent")) in by_column:
            setting[by_column[column].name] = SettingError(relative=float(value) / 100)
        elif (column := key.removesuffix("_setting")) in by_column:
            known = by_column[column]
            setting[known.name] = SettingError(
                absolute=float(value) * scale_to(known.column_unit, known.unit)
            )
        else:
            usual = [
                *reads,
                *by_column,
                *(f"{c}_setting_percent" for c in by_column),
                "model_discrepancy_percent",
            ]
            raise RequestError(
                f"[uncertainty] has the key {key!r}, which names nothing", remedy=nearest(key, usual)
            )
    return RigStatement(limits, setting, reading, percent, reading_percent)


def read_rig_file(path: Path) -> dict[str, Any]:
    """Read a rig file; paths in it are relative to where it lies, and are made absolute.

    Raises
    ------
    RequestError
        It does not exist or is not valid TOML.
    """
    content = read_toml(path)
    for table, key in _FILES:
        given = content.get(table)
        if isinstance(given, dict) and isinstance(given.get(key), str):
            given[key] = str((path.parent / given[key]).resolve())
    return content


def rig_files(path: Path) -> tuple[Path, ...]:
    """The rig file and the files that it names: everything that decides what the rig is."""
    content = read_rig_file(path)
    tables = [(content.get(table), key) for table, key in _FILES]
    named = [table.get(key) for table, key in tables if isinstance(table, dict)]
    return (path, *(Path(name) for name in named if isinstance(name, str)))
