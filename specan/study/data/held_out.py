"""Rows that are held out: ``load=60,90``, ``mass=2..3 kg``, ``time=6..7``, ``channel=A 6``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError, require_known
from specan.models import Condition
from specan.study.observation import MeasuredFiles
from specan.units import convert, is_compatible, printed_unit

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UNIT = r"[^\d\s.].*"
_VALUES = re.compile(
    rf"(?P<low>{_NUMBER})(?:\s*(?P<of_low>{_UNIT}?)?\s*\.\.\s*(?P<high>{_NUMBER}))?\s*(?P<unit>{_UNIT})?"
)


@dataclass(frozen=True, eq=False)
class Column:
    """What rows can be chosen by.

    Attributes
    ----------
    values : array
        Names, or numbers: those of a condition in its unit.
    condition : Condition, optional
    unit : str
        Of a number that is given without one; by default that of the condition's column.
    reach : callable
        How far a value may be from the number that is given.
    """

    values: NDArray[Any]
    condition: Condition | None = None
    unit: str = ""
    reach: Callable[[float], float] = lambda value: 0.02 * abs(value)

    @property
    def levels(self) -> list[str]:
        """What can be chosen, as a user writes it."""
        distinct = np.unique(self.values)
        if distinct.dtype.kind != "f":
            return [str(name) for name in distinct]
        shown = convert(distinct, self.condition.unit, self._given) if self.condition else distinct
        return [f"{level:.4g}" for level in shown]

    @property
    def _given(self) -> str:
        return self.unit or (self.condition.column_unit if self.condition else "")

    @property
    def printed_unit(self) -> str:
        """With a space before it."""
        return f" {printed_unit(self._given)}".rstrip() if self._given else ""

    def holds(self, word: str, where: str) -> NDArray[np.bool_]:
        """Rows of a name, or of a number, with a unit if need be, or of numbers from one to another."""
        if self.values.dtype.kind != "f":
            names = self.values.astype(str)
            return np.asarray((names == word) | np.char.startswith(names, f"{word} in "))
        low, *high = self._numbers(word, where)
        if high:
            return np.asarray((self.values >= min(low, *high)) & (self.values <= max(low, *high)))
        distance = np.abs(self.values - low)
        return np.asarray((distance <= self.reach(low)) & (distance == distance.min()))

    def _numbers(self, word: str, where: str) -> list[float]:
        said, key = _VALUES.fullmatch(word), where.partition("=")[0].strip()
        if said is None:
            raise RequestError(
                f"{word!r} in {where!r} is not a number",
                expected=f"{key}=value,value or {key}=low..high, with a unit if need be",
            )
        unit = said["unit"] or said["of_low"]
        ends = [(float(said["low"]), said["of_low"] or unit)]
        ends += [(float(said["high"]), unit)] if said["high"] else []
        return [self._in_its_unit(value, unit, where, key) for value, unit in ends]

    def _in_its_unit(self, value: float, unit: str | None, where: str, key: str) -> float:
        given, known = unit or self._given, self.condition
        if known is None or not is_compatible(given, known.column_unit):
            if unit:
                raise RequestError(f"{given!r} in {where!r} is not a unit of {key}", expected=self._given)
            return value
        return float(convert(convert(value, given, known.column_unit), known.column_unit, known.unit))


def chosen(columns: Mapping[str, Column], where: str) -> NDArray[np.bool_]:
    """Rows that ``key=value,value`` means; a key may be a part of a column's name.

    Parameters
    ----------
    columns : mapping
    where : str

    Raises
    ------
    RequestError
        No such column or value; what there is, is named.
    """
    key, _, text = where.partition("=")
    close = [name for name in columns if key.strip() and key.strip() in name]
    names = [key.strip()] if key.strip() in columns else close
    if len(names) != 1:
        raise RequestError(
            f"{key.strip()!r} names no single column",
            expected="one of " + ", ".join(columns),
            remedy="write it out",
        )
    column = columns[names[0]]
    found = np.zeros(column.values.size, dtype=bool)
    for word in map(str.strip, text.split(",")):
        here = column.holds(word, where)
        if not here.any():
            unit = column.printed_unit if word[-1:].isdigit() else ""
            raise RequestError(
                f"no row has {names[0]} = {word}{unit}",
                expected=f"one of {', '.join(column.levels[:20])}{column.printed_unit}",
            )
        found |= here
    return found


def put_aside(
    columns: Mapping[str, Column],
    wanted: MeasuredFiles,
    files: Sequence[str],
    recording: NDArray[np.intp],
    unseen: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Rows that are held out, each condition of one measurement or of all; a value stands for the nearest level.

    Parameters
    ----------
    columns : mapping
        What rows can be chosen by.
    wanted : MeasuredFiles
    files : sequence of str
        Names of the measurements.
    recording : array of int
        Number of each row's measurement.
    unseen : array of bool, optional
        Rows of validations.

    Raises
    ------
    RequestError
        A measurement, column or level that is not there; or nothing is left to fit.
    """
    aside = np.zeros(recording.size, dtype=bool) if unseen is None else unseen
    for file, where in wanted.hold_out:
        require_known(file or files[0], files, f"no measurement {file!r}")
        aside = aside | chosen(columns, where) & ((file is None) | (np.array(files)[recording] == file))
    if np.all(aside):
        raise RequestError("everything that was measured is held out", remedy="hold out less")
    return aside
