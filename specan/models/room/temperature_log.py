"""The temperature of the air while a recording was made, from the log of a thermometer."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from specan.errors import InputError

COLUMN = "temperature_C"


@dataclass(frozen=True)
class TemperatureLog:
    """Mean and span of a log, degrees Celsius and kelvin."""

    mean_C: float
    span_K: float

    def uncertainty_K(self, thermometer_K: float) -> float:
        """Standard uncertainty of a temperature that drifts over the span, read by a thermometer.

        The air passed through every value of the span: a rectangular law, span / sqrt(12) (JCGM 100:2008, 4.3.7).
        """
        return float(np.hypot(thermometer_K, self.span_K / np.sqrt(12)))


def read_temperature_log(path: Path) -> TemperatureLog:
    """Read a table whose column ``temperature_C`` holds the readings.

    Raises
    ------
    InputError
        The file cannot be read, has no such column or no reading, or one that no room has.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(
            f"the temperature log {path.name} cannot be read ({fault})",
            remedy="correct [air] temperature_log in the rig file",
        ) from None
    columns = list(rows[0]) if rows else []
    if COLUMN not in columns:
        raise InputError(
            f"the temperature log {path.name} has the columns {', '.join(map(str, columns)) or 'none'}",
            expected=f"a column {COLUMN}, beside one of the time",
        )
    try:
        readings = np.array([float(row[COLUMN]) for row in rows])
    except (TypeError, ValueError):
        raise InputError(
            f"the temperature log {path.name} has a {COLUMN} that is no number",
            remedy="use a decimal point, and commas between columns",
        ) from None
    if not np.all((readings > -50) & (readings < 80)):  # as [air] nominal_temperature_C allows
        raise InputError(
            f"the temperature log {path.name} goes from {readings.min():g} to {readings.max():g} degrees",
            expected="degrees Celsius between -50 and 80",
        )
    return TemperatureLog(float(readings.mean()), float(np.ptp(readings)))
