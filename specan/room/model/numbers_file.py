"""Tables of numbers that a rig file names: comma-separated, with a header line."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.schema import regular


def read_rows(path: Path, needed: str, expected: str) -> list[dict[str, str]]:
    """Rows as texts; `needed` is a column that must be there, of which `expected` says more."""
    try:
        with regular(path).open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(
            f"the table {path.name} cannot be read ({fault})", remedy="correct its place in the rig file"
        ) from None
    there = [str(name) for name in rows[0]] if rows else []
    if needed not in there:
        raise InputError(
            f"the table {path.name} has the columns {', '.join(there) or 'none'}", expected=expected
        )
    return rows


def numbers(path: Path, rows: Sequence[dict[str, str]], column: str) -> NDArray[np.float64]:
    """A column of `read_rows` as numbers."""
    try:
        return np.array([float(row[column]) for row in rows])
    except (TypeError, ValueError):
        raise InputError(
            f"the table {path.name} has a {column} that is no number",
            remedy="use a decimal point, and commas between columns",
        ) from None
