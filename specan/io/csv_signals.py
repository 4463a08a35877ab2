"""Time series as text: a column of times, and one column for each signal."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from specan.arrays import Real
from specan.csv_rows import cells_of
from specan.data.recording import ArraySource, Recording
from specan.errors import InputError
from specan.io.sampling_rate import Rate, is_time, rate_of_axis
from specan.io.signals import Opening, Signal
from specan.schema import decoded
from specan.units import number

SUFFIXES = (".csv",)

LEAST = 5  # lines with text on them, below which a file is a note and no time series
MOST_ABOVE = 30  # lines above the header
BEGINNING = 4096  # characters that tell whether a file is text

_WITH_UNIT = re.compile(r"^'?(?P<name>.*?)\s*[\[(](?P<unit>[^])]*)[\])]\s*$")
_UNIT = re.compile(r"^[\[(]?[^\d\s][^\s]*[\])]?$|^$|^-$")


def recognises(start: bytes) -> bool:
    """Whether text that begins so is a table of time series: its first column is a time, and numbers follow.

    Examples
    --------
    >>> rows = b"0,0;1,5\\n0,1;2\\n0,2;2,5\\n0,3;3\\n"
    >>> recognises(b"time [s];a [N]\\n" + rows), recognises(b"speed [rpm];torque [N m]\\n" + rows)
    (True, False)
    """
    lines = lines_of(start)
    if len(lines) < LEAST or not _is_header(lines[0]):
        return False
    return all(number(line.split(_delimiter(lines[0]))[0]) is not None for line in lines[2:LEAST])


def open_recording(path: Path, opening: Opening) -> Recording:
    """Read a text file of time series; all samples are held in memory.

    The first column is the time (``time [s]``, ``t``, ``Zeit [ms]``), equally spaced; each other column is a signal
    with its unit in brackets, ``force [N]``, or in a second header row. Separated by tabs, semicolons or commas, with
    a decimal point or, where columns are not separated by commas, a decimal comma. ``#`` begins a comment line.

    Raises
    ------
    InputError
        A cell that is not a number, rows of different lengths, times that are not equally spaced.
    """
    lines = lines_of(path.read_bytes())
    delimiter = _delimiter(lines[0])
    titles, below = cells_of("\n".join(lines[:2]), path.name)[0].values()
    units = [""] * len(titles)
    first = 1
    if number(below[0]) is None and all(_UNIT.match(cell) for cell in below):
        units = [cell.strip("[]() ") for cell in below] + [""] * (len(titles) - len(below))
        first = 2
    samples = _numbers(path, lines[first:], delimiter, len(titles))
    named = [_named(title, unit) for title, unit in zip(titles, units, strict=False)]
    time = samples[0]
    properties = {"unit_string": units[0]} if units[0] else {}
    found = rate_of_axis(titles[0], "DoubleFloat", properties, time.size, lambda a, b: time[a:b])
    rate = found if isinstance(found, Rate) else None
    if rate is None and opening.sampling_rate is None:
        raise InputError(
            f"{opening.label}: {found}", expected="equally spaced times", remedy="give --sampling-rate HZ"
        )
    signals = [Signal(name, time.size, unit, rate) for name, unit in named[1:]]
    return opening.recording(signals, ArraySource(list(samples[1:])))


def _named(title: str, unit: str) -> tuple[str, str]:
    said = _WITH_UNIT.match(title)
    if said is not None:
        return said["name"], unit or said["unit"].strip()
    return title.removeprefix("'"), "" if unit == "-" else unit


def _numbers(path: Path, lines: list[str], delimiter: str, columns: int) -> Real:
    text = "\n".join(lines)
    if delimiter != ",":
        text = text.replace(",", ".")
    try:
        found = np.loadtxt(io.StringIO(text), delimiter=delimiter, ndmin=2, dtype=np.float64, comments=None)
    except ValueError as fault:
        raise InputError(
            f"{path.name} holds a cell that is not a number ({fault})",
            expected=f"{columns} numbers per row below the header",
            remedy="a decimal comma in a comma-separated file does this: separate by semicolons",
        ) from None
    if found.shape[1] != columns:
        raise InputError(
            f"{path.name}: {found.shape[1]} cells per row", expected=f"{columns} as in the header"
        )
    return np.ascontiguousarray(found.T)


def lines_of(raw: bytes) -> list[str]:
    """Lines with text on them that are no comment, of a file or its beginning; none of what is no text.

    What stands above the header, such as the name of a measurement, is left out.
    """
    try:
        text = decoded(raw)
    except UnicodeDecodeError:
        return []
    if not all(c.isprintable() or c in "\r\n\t" for c in text[:BEGINNING]):
        return []
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    header = next((k for k, line in enumerate(lines[:MOST_ABOVE]) if _is_header(line)), 0)
    return lines[header:]


def _is_header(line: str) -> bool:
    titles = [cell.strip().strip('"') for cell in line.split(_delimiter(line))]
    return len(titles) > 1 and is_time(titles[0], "", {})


def _delimiter(header: str) -> str:
    return max("\t;,", key=header.count)
