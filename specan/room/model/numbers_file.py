"""Tables of numbers that a rig file names, with a header line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.csv_rows import csv_rows
from specan.errors import InputError


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
