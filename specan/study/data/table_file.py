"""Tables as laboratories write them: CSV, TSV or semicolons, decimal point or comma, workbooks, Parquet."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from specan.errors import InputError, RequestError
from specan.schema import regular
from specan.study.observation import Array

MOST_NAMED = 5  # lines in one message
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}


@dataclass(frozen=True)
class TableFile:
    """Columns of numbers and the line of the file that each row is in.

    Attributes
    ----------
    columns : dict
        Header to values; nan where a cell is empty.
    steps : dict
        Header to the step in which the values are printed (0.01 for 0.72, 0.7, 0.81).
    lines : array of int
        Line number of each row, for messages.
    cell_units : dict
        Header to the unit that is behind the numbers themselves: ``percent`` for ``85 %``.
    words : dict
        Header to the cells of the columns that are read as text.
    """

    path: Path
    columns: dict[str, Array]
    steps: dict[str, float]
    lines: np.ndarray
    cell_units: dict[str, str] = field(default_factory=dict)
    words: dict[str, list[str]] = field(default_factory=dict)

    def rows(self, mask: np.ndarray) -> str:
        """The lines of some rows in words: ``line 4, 7 and 12 more``."""
        found = [str(n) for n in self.lines[mask]]
        text = ", ".join(found[:MOST_NAMED]) + (
            f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        )
        return f"line{'s' if len(found) > 1 else ''} {text}"


@dataclass(frozen=True)
class _Sheet:
    """Cells of a table as text; the first row is the header."""

    cells: list[list[str]]
    lines: list[int]
    decimal_comma: bool = False


def read_table(
    path: Path,
    choose: Callable[[Iterable[str]], dict[str, str]] | None = None,
    texts: Collection[str] = (),
) -> TableFile:
    """Read a table with one header line; ``#`` begins a comment line.

    A second line that holds units only, ``[m3/h];[m]``, belongs to the header. Workbooks (.xlsx, the first sheet)
    and Parquet files are read through pandas.

    Parameters
    ----------
    path : Path
    choose : callable, optional
        Given the headers, returns ``{header: name}`` of the columns to read; all under their own names by default.
    texts : collection of str
        Names of columns whose cells are names, not numbers.

    Raises
    ------
    InputError
        No such file, no text, no rows, a row of another length, a cell that is not a number.
    """
    try:
        raw = regular(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"the table {path} does not exist", remedy="check the path") from None
    except OSError as fault:
        raise InputError(f"the table {path} cannot be read ({fault})") from None
    sheet = _frame_sheet(path, raw) if raw[:4] in (b"PK\x03\x04", b"PAR1") else _text_sheet(path, raw)
    if len(sheet.cells) < 2:
        raise InputError(f"the table {path} holds no rows", expected="a header line and rows of numbers")
    header, cells, lines = _header(sheet)
    doubled = sorted({name for name in header if name and header.count(name) > 1})
    if doubled:
        raise InputError(f"{path}: the column {doubled[0]!r} is there twice", remedy="rename one")
    _check_lengths(path, header, cells, lines)
    kept = [name for name in header if name and not name.startswith("note")]
    names = {name: name for name in kept} if choose is None else choose(kept)
    columns, steps, units, named = {}, {}, {}, {}
    for k, title in enumerate(header):
        name = names.get(title)
        if name is None:
            continue
        words = [row[k].strip() if k < len(row) else "" for row in cells]
        if name in texts:
            named[name] = words
            continue
        if any(word.endswith("%") for word in words):
            words, units[name] = [word.removesuffix("%").strip() for word in words], "percent"
        columns[name] = np.array(
            [
                _number(word, path, title, line, sheet.decimal_comma)
                for word, line in zip(words, lines, strict=True)
            ]
        )
        steps[name] = printed_step(words)
    return TableFile(path, columns, steps, np.array(lines), units, named)


def _text_sheet(path: Path, raw: bytes) -> _Sheet:
    try:
        text = raw.decode("utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(
            f"the table {path} cannot be read ({fault})",
            expected="a text file in UTF-8",
            remedy="save it as UTF-8 (spreadsheets call it CSV UTF-8)",
        ) from None
    numbered = [
        (n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")
    ]
    if not numbered:
        return _Sheet([], [])
    delimiter = max("\t;,", key=numbered[0][1].count)
    cells = [next(csv.reader([line], delimiter=delimiter)) for _, line in numbered]
    return _Sheet(cells, [n for n, _ in numbered], decimal_comma=delimiter != ",")


def _frame_sheet(path: Path, raw: bytes) -> _Sheet:
    """The first sheet of a workbook, or a Parquet file, through pandas."""
    import io

    import pandas as pd

    workbook = raw[:2] == b"PK"
    try:
        if workbook:
            frame = pd.read_excel(io.BytesIO(raw), header=None, dtype=object)
        else:
            frame = pd.read_parquet(io.BytesIO(raw))
    except ImportError:
        needed = "xlsx" if workbook else "parquet"
        raise InputError(
            f"the table {path} needs another package to be read",
            remedy=f'pip install "specan[{needed}]", or save the table as CSV',
        ) from None
    except Exception as fault:  # whatever the reader of such a file finds wrong with it
        raise InputError(f"the table {path} cannot be read ({fault})", remedy="save it as CSV") from None
    rows = [["" if pd.isna(cell) else str(cell) for cell in row] for row in frame.itertuples(index=False)]
    if not workbook:
        rows.insert(0, [str(name) for name in frame.columns])
    kept = [(n, row) for n, row in enumerate(rows, 1) if any(row) and not row[0].startswith("#")]
    return _Sheet([row for _, row in kept], [n for n, _ in kept])


def _header(sheet: _Sheet) -> tuple[list[str], list[list[str]], list[int]]:
    """Titles with their units, and the rows below them."""
    titles = [name.strip() for name in sheet.cells[0]]
    below = [cell.strip() for cell in sheet.cells[1]]
    if not any(below) or any(_is_number(cell) for cell in below if cell) or not _are_units(below):
        return titles, sheet.cells[1:], sheet.lines[1:]
    below += [""] * (len(titles) - len(below))
    marked = [
        f"{t} [{u.strip('[]() ')}]" if u.strip("[]() -") else t for t, u in zip(titles, below, strict=False)
    ]
    return marked, sheet.cells[2:], sheet.lines[2:]


def _is_number(word: str) -> bool:
    return re.fullmatch(r"[-+]?\d*[.,]?\d+([eE][-+]?\d+)?\s*%?", word) is not None


def _are_units(words: list[str]) -> bool:
    from specan.units import base_unit

    for word in words:
        plain = word.strip("[]() ")
        if not plain or plain == "-":
            continue
        try:
            base_unit(plain)
        except RequestError:
            return False
    return True


def _check_lengths(path: Path, header: list[str], cells: list[list[str]], lines: list[int]) -> None:
    for row, line in zip(cells, lines, strict=True):
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
            f"{path}, line {line}: {word!r} in the column {column!r} is not a number",
            remedy="correct it, leave the cell empty, or begin the column's name with 'note' to ignore it",
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
