"""A file of limits: a frequency and an upper or lower limit in dB on each line."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from specan.csv_rows import csv_rows
from specan.data.limits import LimitCurve
from specan.errors import InputError, require_known

FREQUENCY, LOWER, UPPER = ("band_hz", "frequency_hz"), "lower_dB", "upper_dB"
_TOTAL = "total-"


def read_limits(path: Path) -> LimitCurve:
    """Read limits: CSV with a header ``band_hz,upper_dB`` and perhaps ``lower_dB``.

    Cells are separated by commas, semicolons or tabs; with the last two, decimal commas are allowed. Lines that begin
    with ``#`` are skipped. A band called ``total-A`` stands for the overall level with that weighting.

    Raises
    ------
    InputError
        The file cannot be read or holds no limits; the message names the line.
    """
    names, rows = csv_rows(path, InputError)
    if not names:
        raise InputError(f"{path} is empty", expected=f"a header such as band_hz,{UPPER}")
    known = (*FREQUENCY, LOWER, UPPER)
    for name in names:
        require_known(name, known, f"{path}: unknown column '{name}'", kind=InputError)
    if not set(FREQUENCY) & set(names) or not {LOWER, UPPER} & set(names):
        raise InputError(
            f"{path} has the columns {', '.join(names)}", expected=f"band_hz, and {UPPER} or {LOWER}"
        )
    points: list[tuple[float, float, float]] = []
    totals: dict[str, tuple[float, float]] = {}
    for line, cells in rows:
        lower, upper = (_number(cells.get(name, "nan"), path, line) for name in (LOWER, UPPER))
        where = next((cells[name] for name in FREQUENCY if name in cells), "")
        if where.startswith(_TOTAL):
            totals[where.removeprefix(_TOTAL)] = (lower, upper)
            continue
        frequency = _number(where, path, line)
        if not frequency > 0:
            raise InputError(f"{path}, line {line}: the frequency is {where!r}", expected="a number above 0")
        points.append((frequency, lower, upper))
    if not points and not totals:
        raise InputError(f"{path} has a header and no limits", expected="a line for each band")
    points.sort()
    frequencies, lowers, uppers = np.array(points, dtype=float).reshape(-1, 3).T
    return LimitCurve(path.name, frequencies, lowers, uppers, totals)


def _number(cell: str, path: Path, line: int) -> float:
    try:
        return float(cell)
    except ValueError:
        raise InputError(f"{path}, line {line}: {cell!r} is not a number", remedy="correct it") from None
