"""Tables that a rig file names: columns of numbers, and the log of a thermometer in the room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.csv_rows import csv_rows
from specan.errors import InputError

COLUMN = "temperature_C"
TIME = "time_utc"
STEPS = 101  # of a recording, at which its temperature is looked up
LONGEST_GAP_S = 3600.0  # between a recording and the nearest reading


@dataclass(frozen=True)
class TemperatureLog:
    """Readings of a thermometer.

    Attributes
    ----------
    celsius : array (n,)
    time_utc : array (n,) of datetime64, optional
        Increasing; None where the log has no such column.
    """

    celsius: NDArray[np.float64]
    time_utc: NDArray[np.datetime64] | None = None

    def during(self, start: np.datetime64, duration_s: float) -> NDArray[np.float64]:
        """Temperatures at even steps of a recording, straight between the readings, degrees Celsius.

        Raises
        ------
        InputError
            No reading lies within an hour of it.
        """
        assert self.time_utc is not None
        at = (self.time_utc - start) / np.timedelta64(1, "s")
        if max(at[0] - duration_s, -at[-1]) > LONGEST_GAP_S:
            raise InputError(
                f"the temperature log goes from {self.time_utc[0]} to {self.time_utc[-1]}, the recording begins at "
                f"{start} (UTC)",
                expected=f"a log of the time of the recording, {TIME} in UTC",
                remedy=f"give the right log, or remove its column {TIME}",
            )
        return np.interp(np.linspace(0.0, duration_s, STEPS), at, self.celsius)


def read_temperature_log(path: Path) -> TemperatureLog:
    """Read a table whose column ``temperature_C`` holds the readings.

    Raises
    ------
    InputError
        The file cannot be read, has no such column or no reading, or one that no room has.
    """
    names, rows = read_rows(path, COLUMN, f"a column {COLUMN}, beside one of the time")
    readings = numbers(path, rows, COLUMN)
    if not np.all((readings > -50) & (readings < 80)):  # as [air] nominal_temperature_C allows
        raise InputError(
            f"the temperature log {path.name} goes from {readings.min():g} to {readings.max():g} degrees",
            expected="degrees Celsius between -50 and 80",
        )
    return TemperatureLog(readings, _times(path, rows) if TIME in names else None)


def _times(path: Path, rows: list[dict[str, str]]) -> NDArray[np.datetime64]:
    try:
        found = np.array([np.datetime64(row.get(TIME, "").removesuffix("Z"), "us") for row in rows])
    except ValueError:
        raise InputError(
            f"the temperature log {path.name} has a {TIME} that is not a time",
            expected="times such as 2026-05-12T14:03:20",
        ) from None
    if np.any(np.diff(found) <= np.timedelta64(0)):
        raise InputError(
            f"the times of the temperature log {path.name} do not increase", remedy="sort its lines"
        )
    return found


def read_rows(path: Path, needed: str, expected: str) -> tuple[list[str], list[dict[str, str]]]:
    """Columns, and rows as texts; `needed` is a column that must be there, of which `expected` says more."""
    names, rows = csv_rows(path, InputError)
    if needed not in names or not rows:
        raise InputError(
            f"the table {path.name} has the columns {', '.join(names if rows else []) or 'none'}",
            expected=expected,
        )
    return names, [cells for _, cells in rows]


def numbers(path: Path, rows: Sequence[dict[str, str]], column: str) -> NDArray[np.float64]:
    """A column of `read_rows` as numbers."""
    try:
        return np.array([float(row[column]) for row in rows])
    except (KeyError, ValueError):
        raise InputError(f"the table {path.name} has a {column} that is no number") from None
