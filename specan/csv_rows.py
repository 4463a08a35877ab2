"""Small tables that people write: channel tables, limits."""

from __future__ import annotations

import csv
from pathlib import Path

from specan.errors import SpecanError
from specan.schema import read_text
from specan.units import number


def csv_rows(path: Path, fault: type[SpecanError]) -> tuple[list[str], list[tuple[int, dict[str, str]]]]:
    """Names of the columns, and the rows with their line numbers.

    Cells are separated by commas, semicolons or tabs; with the last two a decimal comma is read. Lines that begin with
    ``#`` are skipped, empty cells and rows left out.

    Raises
    ------
    SpecanError
        Of the kind `fault`: the file cannot be read, or a row has more cells than the header.
    """
    text = read_text(path, "a CSV file in UTF-8", fault)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if not lines:
        return [], []
    mark = max(";\t,", key=lines[0][1].count)
    cells = csv.reader([line for _, line in lines], delimiter=mark, skipinitialspace=True)
    (_, header), *below = [(n, [c.strip() for c in row]) for (n, _), row in zip(lines, cells, strict=False)]
    rows = []
    for place, row in below:
        if any(row[len(header) :]):
            raise fault(
                f"{path.name}, line {place}: more cells than the header has",
                remedy="put a cell with a separator into quotation marks",
            )
        found = {name: cell for name, cell in zip(header, row, strict=False) if name and cell}
        if mark != ",":
            found = {
                name: cell if number(cell) is None else cell.replace(",", ".") for name, cell in found.items()
            }
        if found:
            rows.append((place, found))
    return header, rows
