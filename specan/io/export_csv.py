"""Samples as CSV, for spreadsheets of any country."""

from __future__ import annotations

import csv
from pathlib import Path

from specan.errors import RequestError
from specan.io.export_file import Excerpt
from specan.io.output_file import whole_file
from specan.io.text_cell import harmless


def write_csv(excerpt: Excerpt, path: Path, decimal: str = ".") -> None:
    """Write time and samples, one column a channel, nine significant digits.

    Parameters
    ----------
    decimal : {".", ","}
        With a comma, as Polish and German spreadsheets expect it, columns are separated by semicolons and
        the file begins with a byte order mark, by which these programs know UTF-8.

    Notes
    -----
    A name that a spreadsheet would take for a formula has an apostrophe before it; see `specan.io.text_cell`.

    Raises
    ------
    RequestError
        The decimal sign is another one, or the file cannot be written.
    """
    if decimal not in (".", ","):
        raise RequestError(f"the decimal sign is {decimal!r}", expected="a point or a comma")
    separator = "," if decimal == "." else ";"
    header = [
        "time_s",
        *(harmless(f"{n} [{c.unit}]") for n, c in zip(excerpt.names(), excerpt.channels, strict=True)),
    ]
    row = separator.join(["%.9g"] * len(header)) + "\n"
    encoding = "utf-8" if decimal == "." else "utf-8-sig"
    with whole_file(path) as half, half.open("w", encoding=encoding, newline="") as file:
        csv.writer(file, delimiter=separator, lineterminator="\n").writerow(header)
        for time, samples in excerpt.blocks():
            columns = [time.tolist(), *samples.tolist()]
            text = "".join(row % values for values in zip(*columns, strict=True))
            file.write(text if decimal == "." else text.replace(".", ","))
