"""Tables as laboratories write them: CSV, TSV or semicolons, decimal point or comma, workbooks, Parquet."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.csv_rows import cells_of
from specan.errors import InputError, RequestError
from specan.result import first_of
from specan.schema import decoded, regular
from specan.units import base_unit

MOST_NAMED = 5  # lines in one message
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
Cells = dict[int, list[str]]  # of each line


@dataclass(eq=False)
class Table:
    """Rows of a file, with what its header and its digits say.

    Attributes
    ----------
    frame : DataFrame
        Numbers, and texts in columns of names; its index is the line of each row in the file.
    steps : dict
        Step in which the values of a column are printed (0.01 for 0.72, 0.7, 0.81), or one for each row.
    units : dict
        Units that are behind the numbers themselves, ``percent`` for ``85 %``, or that the header says.
    notes : list of str
        What was assumed or left out.
    doubts : list of str
        Those of them that are said beside every verdict.
    """

    path: Path
    frame: pd.DataFrame
    steps: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    name: str = ""

    def rows(self, mask: NDArray[np.bool_]) -> str:
        """The lines of some rows in words: ``line 4, 7 and 12 more``."""
        found = [str(n) for n in self.frame.index[mask]]
        return f"line{'s' if len(found) > 1 else ''} {first_of(found, MOST_NAMED)}"

    def refuse(self, mask: Any, found: str, **more: str) -> None:
        """Refuse the table for some of its rows, if there are any."""
        if np.any(mask):
            raise InputError(f"{self.path}, {self.rows(np.asarray(mask))}: {found}", **more)


def beginning(path: Path) -> bytes:
    """The first bytes of a file, by which its kind is told; none where it cannot be read."""
    try:
        with regular(path).open("rb") as file:
            return file.read(4096)
    except OSError:
        return b""


def _bytes(path: Path) -> bytes:
    try:
        return regular(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"the table {path} does not exist", remedy="check the path") from None
    except OSError as fault:
        raise InputError(f"the table {path} cannot be read ({fault})") from None


def read_table(
    path: Path,
    choose: Callable[[Iterable[str]], dict[str, str]] | None = None,
    texts: Collection[str] = (),
    sheet: str = "",
) -> Table:
    """Read a table with one header line; ``#`` begins a comment line.

    A second line that holds units only, ``[m3/h];[m]``, belongs to the header; lines of a title above it, which have
    few cells, are ignored. Workbooks (.xlsx) and Parquet files are read through pandas.

    Parameters
    ----------
    path : Path
    choose : callable, optional
        Given the headers, returns ``{header: name}`` of the columns to read; all under their own names by default.
    texts : collection of str
        Names of columns whose cells are names, not numbers.
    sheet : str
        Of a workbook; the first with a table by default.

    Raises
    ------
    InputError
        No such file, no text, no rows, a row of another length, a cell that is not a number.
    """
    raw = _bytes(path)
    cells, comma, notes = (
        _frame_cells(path, raw, sheet) if raw[:4] in (b"PK\x03\x04", b"PAR1") else _text_cells(path, raw)
    )
    if len(cells) < 2:
        raise InputError(f"the table {path} holds no rows", expected="a header line and rows of numbers")
    titles = _without_titles(cells)
    header = _header(cells)
    _check(path, header, cells)
    kept = [name for name in header if name and not name.startswith("note")]
    names = {name: name for name in kept} if choose is None else choose(kept)
    found = Table(path, pd.DataFrame(index=list(cells)), notes=[*notes, *titles])
    for k, title in enumerate(header):
        name = names.get(title)
        if name is None:
            continue
        words = [row[k] if k < len(row) else "" for row in cells.values()]
        if name in texts:
            found.frame[name] = words
            continue
        if any(word.endswith("%") for word in words):
            words, found.units[name] = [word.removesuffix("%").strip() for word in words], "percent"
        read = zip(words, cells, strict=True)
        found.frame[name] = [_number(word, path, title, line, comma) for word, line in read]
        found.steps[name] = printed_step(words)
    return found


def _text_cells(path: Path, raw: bytes) -> tuple[Cells, bool, list[str]]:
    """Cells of each line that is neither empty nor a comment; whether a comma may be a decimal one; notes."""
    try:
        text = decoded(raw)
    except UnicodeDecodeError as fault:
        raise InputError(
            f"the table {path} cannot be read ({fault})",
            expected="a text file in UTF-8",
            remedy="save it as UTF-8 (spreadsheets call it CSV UTF-8)",
        ) from None
    return *cells_of(text, path.name), []


def _frame_cells(path: Path, raw: bytes, sheet: str) -> tuple[Cells, bool, list[str]]:
    """The same of a Parquet file, or of a sheet of a workbook: the first that has a row with two numbers."""
    workbook = raw[:2] == b"PK"
    try:
        if not workbook:
            return _cells(pd.read_parquet(io.BytesIO(raw)).astype(object).T.reset_index().T), False, []
        book = pd.ExcelFile(io.BytesIO(raw), engine="openpyxl")
        names = list(map(str, book.sheet_names))
        for name in [n for n in names if sheet in ("", n)]:
            cells = _cells(pd.read_excel(book, name, header=None, dtype=object))
            if any(sum(map(_is_number, row)) > 1 for row in cells.values()):
                return cells, False, [] if name in (sheet, names[0]) else [f"the sheet {name!r} is read"]
    except ImportError:
        needed = "xlsx" if workbook else "parquet"
        raise InputError(
            f"the table {path} needs another package to be read",
            remedy=f'pip install "specan[{needed}]", or save the table as CSV',
        ) from None
    except Exception as fault:  # whatever the reader of such a file finds wrong with it
        raise InputError(f"the table {path} cannot be read ({fault})", remedy="save it as CSV") from None
    where = f" on a sheet {sheet!r}" if sheet else ""
    remedy = f"choose one with --sheet: {', '.join(names)}" if sheet else "give a sheet a header and numbers"
    raise InputError(f"{path} has no table{where}", remedy=remedy)


def _cells(frame: pd.DataFrame) -> Cells:
    rows = [["" if pd.isna(cell) else str(cell).strip() for cell in row] for row in frame.to_numpy()]
    return {n: row for n, row in enumerate(rows, 1) if any(row) and not row[0].startswith("#")}


def _without_titles(cells: Cells) -> list[str]:
    """Take out the lines above the header, which has more cells than they; a note.

    The header is above the first line that holds mostly numbers and is not much shorter than the others.
    """
    sizes = {line: sum(map(bool, row)) for line, row in cells.items()}
    usual = float(np.median(list(sizes.values())))

    def holds_values(line: int) -> bool:
        return 2 * sum(map(_is_number, cells[line])) >= sizes[line] > usual / 2

    heads = list(takewhile(lambda line: not holds_values(line), cells))
    above = list(takewhile(lambda line: sizes[line] < max(map(sizes.__getitem__, heads)), heads))
    if not above or len(above) > len(sizes) - 2:
        return []
    said = "; ".join(" ".join(filter(None, cells.pop(line))) for line in above)
    return [f"lines above the header ignored: {said}"]


def _header(cells: Cells) -> list[str]:
    """Titles with their units; what they stand in is taken out of the cells."""
    first, second = list(cells)[:2]
    titles, below = cells.pop(first), [cell.strip("[]()- ") for cell in cells[second]]
    if not any(cells[second]) or any(map(_is_number, below)) or not all(map(_is_unit, filter(None, below))):
        return titles
    del cells[second]
    below += [""] * (len(titles) - len(below))
    return [f"{t} [{u}]" if u else t for t, u in zip(titles, below, strict=False)]


def _check(path: Path, header: list[str], cells: Cells) -> None:
    doubled = sorted({name for name in header if name and header.count(name) > 1})
    if doubled:
        raise InputError(f"{path}: the column {doubled[0]!r} occurs twice", remedy="rename one")
    for line, row in cells.items():
        if any(row[len(header) :]):
            raise InputError(
                f"{path}, line {line}: {len(row)} cells",
                expected=f"{len(header)} as in the header",
                remedy="a decimal comma in a comma-separated file does this: separate by semicolons",
            )


def _is_number(word: str) -> bool:
    return re.fullmatch(r"[-+]?\d*[.,]?\d+([eE][-+]?\d+)?\s*%?", word) is not None


def _is_unit(word: str) -> bool:
    try:
        base_unit(word)
    except RequestError:
        return False
    return True


def _number(word: str, path: Path, column: str, line: int, comma: bool) -> float:
    if word.lower() in _MISSING:
        return math.nan
    try:
        value = float(word.replace(",", ".") if comma else word)
    except ValueError:
        value = math.nan
    # 1e100: of a value; the square of a larger one may have no floating point number
    if not abs(value) < 1e100:
        what = "is too large" if math.isfinite(value) else "is not a number"
        raise InputError(
            f"{path}, line {line}: {word!r} in the column {column!r} {what}",
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
