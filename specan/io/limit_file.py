"""A file of limits: a frequency and an upper or lower limit in dB on each line."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from specan.data.limits import LimitCurve
from specan.errors import InputError, nearest
from specan.schema import regular

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
    try:
        text = regular(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"the file of limits {path} does not exist", remedy="check the path") from None
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"{path} cannot be read ({fault})", expected="a table of limits as text") from None
    lines = [
        (n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")
    ]
    if not lines:
        raise InputError(f"{path} is empty", expected=f"a header such as band_hz,{UPPER}")
    separator = next((mark for mark in "\t;" if mark in lines[0][1]), ",")
    rows = list(csv.reader([line for _, line in lines], delimiter=separator))
    names = [cell.strip() for cell in rows[0]]
    known = (*FREQUENCY, LOWER, UPPER)
    for name in names:
        if name not in known:
            raise InputError(f"{path}: unknown column '{name}'", remedy=nearest(name, known))
    if not set(FREQUENCY) & set(names) or not {LOWER, UPPER} & set(names):
        raise InputError(
            f"{path} has the columns {', '.join(names)}", expected=f"band_hz, and {UPPER} or {LOWER}"
        )
    return _curve(path, names, [number for number, _ in lines[1:]], rows[1:], separator)


def _curve(
    path: Path, names: Sequence[str], numbers: Sequence[int], rows: Sequence[Sequence[str]], separator: str
) -> LimitCurve:
    points: list[tuple[float, float, float]] = []
    totals: dict[str, tuple[float, float]] = {}
    for number, row in zip(numbers, rows):
        cells = dict(zip(names, (cell.strip() for cell in row)))
        lower, upper = (_number(cells.get(name, ""), path, number, separator) for name in (LOWER, UPPER))
        where = next(cells[name] for name in FREQUENCY if name in cells)
        if where.startswith(_TOTAL):
            totals[where.removeprefix(_TOTAL)] = (lower, upper)
            continue
        frequency = _number(where, path, number, separator)
        if not frequency > 0:
            raise InputError(
                f"{path}, line {number}: the frequency is {where!r}", expected="a number above 0"
            )
        points.append((frequency, lower, upper))
    if not points and not totals:
        raise InputError(f"{path} has a header and no limits", expected="a line for each band")
    points.sort()
    frequencies, lowers, uppers = np.array(points, dtype=float).reshape(-1, 3).T
    return LimitCurve(path.name, frequencies, lowers, uppers, totals)


def _number(cell: str, path: Path, line: int, separator: str) -> float:
    try:
        return float(cell.replace(",", ".") if separator != "," else cell) if cell else float("nan")
    except ValueError:
        raise InputError(f"{path}, line {line}: {cell!r} is not a number", remedy="correct it") from None
