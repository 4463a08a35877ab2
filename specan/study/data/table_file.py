"""Tables as laboratories write them: CSV, TSV or semicolons, decimal point or comma."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from specan.errors import InputError
from specan.study.observation import Array

_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}


@dataclass(frozen=True)
class TableFile:
    """Columns of numbers and the line of the file that each row stands in.

    Attributes
    ----------
    columns : dict
        Header to values; nan where a cell is empty.
    steps : dict
        Header to the step in which the values are printed (0.01 for 0.72, 0.7, 0.81).
    lines : array of int
        Line number of each row, for messages.
    """

    path: Path
    columns: dict[str, Array]
    steps: dict[str, float]
    lines: np.ndarray

    def rows(self, mask: np.ndarray, most: int = 5) -> str:
        """The lines of some rows in words: ``line 4, 7 and 12 more``."""
        found = [str(n) for n in self.lines[mask]]
        text = ", ".join(found[:most]) + (f" and {len(found) - most} more" if len(found) > most else "")
        return f"line{'s' if len(found) > 1 else ''} {text}"


def read_table(path: Path, content: bytes | None = None) -> TableFile:
    """Read a table with one header line; ``#`` begins a comment line.

    Parameters
    ----------
    path : Path
    content : bytes, optional
        The file's content where it has been read (and hashed) already.

    Raises
    ------
    InputError
        No such file, no text, no rows, a row of another length, a cell that is no number.
    """
    try:
        raw = path.read_bytes() if content is None else content
        text = raw.decode("utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"the table {path} does not exist", remedy="check the path") from None
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(
            f"the table {path} cannot be read ({fault})", expected="a text file in UTF-8"
        ) from None
    numbered = [
        (n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")
    ]
    if len(numbered) < 2:
        raise InputError(f"the table {path} holds no rows", expected="a header line and rows of numbers")
    delimiter = _delimiter(numbered[0][1])
    cells = [next(csv.reader([line], delimiter=delimiter)) for _, line in numbered]
    header = [name.strip() for name in cells[0]]
    doubled = sorted({name for name in header if name and header.count(name) > 1})
    if doubled:
        raise InputError(f"{path}: the column {doubled[0]!r} stands there twice", remedy="rename one")
    _check_lengths(path, header, cells, [n for n, _ in numbered])
    kept = [k for k, name in enumerate(header) if name and not name.startswith("note")]
    columns, steps = {}, {}
    for k in kept:
        words = [row[k].strip() if k < len(row) else "" for row in cells[1:]]
        values = [
            _number(word, path, header[k], n, comma=delimiter != ",")
            for word, (n, _) in zip(words, numbered[1:], strict=True)
        ]
        columns[header[k]] = np.array(values)
        steps[header[k]] = printed_step(words)
    return TableFile(path, columns, steps, np.array([n for n, _ in numbered[1:]]))


def _delimiter(header: str) -> str:
    return max("\t;,", key=header.count)


def _check_lengths(path: Path, header: list[str], cells: list[list[str]], lines: list[int]) -> None:
    for row, line in zip(cells[1:], lines[1:], strict=True):
        if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
            raise InputError(
                f"{path}, line {line}: {len(row)} cells",
                expected=f"{len(header)} as in the header",
                remedy="a decimal comma in a comma-separated file does this: separate by semicolons",
            )


def _number(word: str, path: Path, column: str, line: int, comma: bool) -> float:
    if word.lower() in _MISSING:
        return math.nan
    try:
        value = float(word.replace(",", ".") if comma else word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{path}, line {line}: {word!r} in the column {column!r} is no number",
            remedy="correct it, leave the cell empty, or begin the column's name with 'note' to pass over it",
        )
    return value


def printed_step(words: list[str]) -> float:
    """Step in which numbers are printed, from their last digits; 0 where there is none.

    Examples
    --------
    >>> printed_step(["0.48", "0.7", "0.81"])
    0.01
    >>> printed_step(["5", "10", "15"])
    1.0
    """
    decimals = []
    for word in words:
        if word.lower() in _MISSING:
            continue
        mantissa, _, exponent = word.lower().replace(",", ".").partition("e")
        decimals.append(len(mantissa.partition(".")[2]) - int(exponent or 0))
    return 10.0 ** -max(decimals) if decimals else 0.0
