"""Tables that people write: channel tables, limits, measurements."""

from __future__ import annotations

import csv
from pathlib import Path

from specan.errors import InputError, SpecanError
from specan.schema import read_text
from specan.units import number


def cells_of(text: str, name: str) -> tuple[dict[int, list[str]], bool]:
    """Cells of each line of a file that is neither empty nor a comment, and whether a comma may be a decimal one.

    Cells are separated by commas, semicolons or tabs, of which the first line has most; ``#`` begins a comment.

    Raises
    ------
    InputError
        A cell that is longer than any number or name.
    """
    lines = {n: line for n, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"}
    mark = max("\t;,", key=next(iter(lines.values()), "").count)
    rows = csv.reader(lines.values(), delimiter=mark, skipinitialspace=True)
    try:
        return {n: [cell.strip() for cell in row] for n, row in zip(lines, rows, strict=False)}, mark != ","
    except csv.Error as fault:
        raise InputError(f"{name} holds an unreadable cell ({fault})", expected="numbers, names") from None


def csv_rows(path: Path, fault: type[SpecanError]) -> tuple[list[str], list[tuple[int, dict[str, str]]]]:
    """Names of the columns, and the rows with their line numbers; empty cells and rows are left out.

    Raises
    ------
    SpecanError
        Of the kind `fault`: the file cannot be read, or a row has more cells than the header.
    """
    lines, comma = cells_of(read_text(path, "a CSV file in UTF-8", fault), path.name)
    header = lines.pop(next(iter(lines), 0), [])
    rows = []
    for place, row in lines.items():
        if any(row[len(header) :]):
            raise fault(
                f"{path.name}, line {place}: more cells than the header has",
                remedy="put a cell with a separator into quotation marks",
            )
        found = {name: cell for name, cell in zip(header, row, strict=False) if name and cell}
        if comma:
            found = {
                name: cell if number(cell) is None else cell.replace(",", ".") for name, cell in found.items()
            }
        if found:
            rows.append((place, found))
    return header, rows
