"""Result tables as text: tab-separated, the same bytes on every machine, never half written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan import __version__
from specan.errors import RequestError, nearest
from specan.io.output_file import text_file, write_encoded
from specan.io.text_cell import cells, escaped, plain, word

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["cells", "plain", "word"]

COLUMNS = {
    "sine.txt": (
        "file", "channel", "role", "unit", "frequency_hz", "rms", "level_dB", "tone_rms", "phase_deg",
        "u_phase_deg", "magnitude_re_reference", "reference", "reference_rms", "flags",
    ),
    "noise.txt": (
        "file", "channel", "frequency_hz", "magnitude", "phase_deg", "coherence", "u_magnitude_percent",
        "u_phase_deg", "flags",
    ),
    "bands.txt": ("file", "channel", "band_hz", "level_dB", "u_dB", "flags"),
    "other.txt": ("file", "channel", "role", "unit", "band_hz", "rms", "level_dB", "u_dB", "flags"),
    "orders.txt": (
        "file", "channel", "unit", "order", "amplitude", "level_dB", "phase_deg", "u", "u_blocks", "flags",
    ),
    "skipped.txt": ("file", "channel", "kind", "reason"),
}  # fmt: skip
# Written only where a recording has what they are made of, or the settings ask for them.
OPTIONAL = frozenset({"orders.txt"})


def read_table(path: Path) -> pd.DataFrame:
    """A table that a batch wrote, as a data frame.

    Raises
    ------
    RequestError
        No batch writes a table of that name, or it is not there.
    """
    import pandas as pd

    if path.name not in COLUMNS or not path.is_file():
        raise RequestError(f"there is no table {path}", remedy=nearest(path.name, COLUMNS))
    with path.open(encoding="utf-8") as file:
        header = next((n for n, line in enumerate(file) if not line.startswith("#")), 0)
    return pd.read_csv(path, sep="\t", skiprows=header, encoding="utf-8")


def fixed(values: ArrayLike, decimals: int) -> list[str]:
    """Numbers with a fixed number of decimals; empty where not finite, no negative zero.

    Examples
    --------
    >>> fixed([1.23456, -0.0001, float("nan")], 3)
    ['1.235', '0.000', '']
    """
    rounded = np.round(np.atleast_1d(np.asarray(values, dtype=float)), decimals) + 0.0
    return _printed(rounded, f"%.{decimals}f")


def _printed(values: NDArray[np.float64], form: str) -> list[str]:
    """Each number in one form, all at once; empty where not finite."""
    if not values.size:
        return []
    finite = np.isfinite(values)
    texts = ("\t".join([form] * len(values)) % tuple(values.tolist())).split("\t")
    return texts if finite.all() else [t if ok else "" for t, ok in zip(texts, finite.tolist())]


def levels(values: ArrayLike) -> list[str]:
    """Levels and their uncertainties in decibels, to 0.001 dB."""
    return fixed(values, 3)


def phases(values: ArrayLike) -> list[str]:
    """Angles in degrees, to 0.01 degree, in (-180, 180] after rounding.

    Examples
    --------
    >>> phases([-180.0, 179.999, 180.004, 359.999, -0.001, float("nan")])
    ['180.00', '180.00', '180.00', '0.00', '0.00', '']
    """
    return fixed(in_one_turn(values), 2)


def in_one_turn(degrees: ArrayLike) -> NDArray[np.float64]:
    """Angles to 0.01 degree, in (-180, 180]; NaN where not finite."""
    given = np.atleast_1d(np.asarray(degrees, dtype=float))
    usable = np.isfinite(given)
    hundredths = np.rint(np.where(usable, given, 0.0) * 100.0) % 36000.0
    hundredths = np.where(hundredths > 18000.0, hundredths - 36000.0, hundredths)
    return np.where(usable, hundredths / 100.0, np.nan)


def significant(values: ArrayLike, digits: int = 6) -> list[str]:
    """Numbers to some significant digits; empty where not finite.

    Examples
    --------
    >>> significant([0.123456789, 1e-9, 0.0, -0.0, float("inf")])
    ['0.123457', '1e-09', '0', '0', '']
    """
    return _printed(np.atleast_1d(np.asarray(values, dtype=float)) + 0.0, f"%.{digits}g")


def frequencies(values: ArrayLike) -> list[str]:
    """Frequencies to 0.1 mHz, without trailing zeros.

    Examples
    --------
    >>> frequencies([1000.0, 0.9765625, 203.70001])
    ['1000', '0.9766', '203.7']
    """
    return list(_frequencies(np.atleast_1d(np.asarray(values, dtype=float)).tobytes()))


@lru_cache(maxsize=4)
def _frequencies(values: bytes) -> tuple[str, ...]:
    """Many files of a batch have the same lines."""
    texts = fixed(np.frombuffer(values), 4)
    return tuple(text.rstrip("0").rstrip(".") if "." in text else text for text in texts)


def rows(columns: Sequence[Sequence[str]]) -> str:
    """Columns of equal length as lines of a table, each ended by a line feed."""
    lines = "\n".join(map("\t".join, zip(*columns, strict=True)))
    return f"{lines}\n" if lines else ""


def rows_of_channels(
    names: Sequence[str], columns: Callable[[int], Sequence[Sequence[str]]]
) -> Iterator[str]:
    """Lines of one channel after the other: its name before the columns that its number gives."""
    for number, name in enumerate(names):
        own = columns(number)
        yield rows([[word(name)] * len(own[0]), *own])


def write_table(
    path: Path, header: Iterable[str], columns: Sequence[str], blocks: Iterable[str | bytes]
) -> None:
    """Write one result table; a reader sees the old file or the whole new one.

    Parameters
    ----------
    path : Path
        Target.
    header : iterable of str
        Lines that are written with a leading ``# ``.
    columns : sequence of str
        Names of the columns.
    blocks : iterable of str or bytes
        Lines of the table as `rows` makes them, in order, or encoded; may come from a generator.
    """
    with text_file(path) as file:
        for line in header:
            file.write(f"# {escaped(' '.join(line.split()))}\n")
        file.write("\t".join(columns) + "\n")
        for block in blocks:
            if isinstance(block, bytes):
                write_encoded(file, [block])
            else:
                file.write(block)


def write_result(
    path: Path, verb: str, found: Any, about: Iterable[str], columns: Sequence[str], blocks: Iterable[str]
) -> None:
    """Write the table of one result; its header says which verb made it, and ends with its settings and notes."""
    header = [f"specan {__version__} {verb}", *about, f"settings: {found.settings}", *found.notes]
    write_table(path, header, columns, blocks)
