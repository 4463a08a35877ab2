"""Result tables as text: tab-separated, the same bytes on every machine, never half written."""

from __future__ import annotations

import csv
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from specan.arrays import Real
from specan.errors import RequestError, library, nearest
from specan.io.output_file import text_file, whole_file

if TYPE_CHECKING:
    import pandas as pd

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


_COMMA = "# decimal sign: comma\n"


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
        header = list(takewhile(lambda line: line.startswith("#"), file))
    decimal = "," if _COMMA in header else "."
    return pd.read_csv(path, sep="\t", skiprows=len(header), encoding="utf-8", decimal=decimal)


@dataclass(frozen=True)
class Numbers:
    """A column of a table: values, and the form in which each is printed."""

    form: str
    values: Sequence[Any]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def texts(self) -> list[str]:
        """The cells."""
        return [self.form % value for value in self.values]


def fixed(values: ArrayLike, decimals: int) -> Numbers:
    """Numbers with a fixed number of decimals; empty where not finite, no negative zero.

    Examples
    --------
    >>> fixed([1.23456, -0.0001, float("nan")], 3).texts
    ['1.235', '0.000', '']
    """
    return _numbers(np.round(np.atleast_1d(np.asarray(values, dtype=float)), decimals), f"%.{decimals}f")


def _numbers(values: Real, form: str) -> Numbers:
    finite, numbers = np.isfinite(values), (values + 0.0).tolist()
    if finite.all():
        return Numbers(form, numbers)
    return Numbers("%s", [form % v if ok else "" for v, ok in zip(numbers, finite.tolist(), strict=True)])


def phases(values: ArrayLike) -> Numbers:
    """Angles in degrees, to 0.01 degree, in (-180, 180] after rounding.

    Examples
    --------
    >>> phases([-180.0, 179.999, 180.004, 359.999, -0.001, float("nan")]).texts
    ['180.00', '180.00', '180.00', '0.00', '0.00', '']
    """
    given = np.atleast_1d(np.asarray(values, dtype=float))
    usable = np.isfinite(given)
    hundredths = np.rint(np.where(usable, given, 0.0) * 100.0) % 36000.0
    hundredths = np.where(hundredths > 18000.0, hundredths - 36000.0, hundredths)
    return fixed(np.where(usable, hundredths / 100.0, np.nan), 2)


def significant(values: ArrayLike, digits: int = 6) -> Numbers:
    """Numbers to some significant digits; empty where not finite.

    Examples
    --------
    >>> significant([0.123456789, 1e-9, 0.0, -0.0, float("inf")]).texts
    ['0.123457', '1e-09', '0', '0', '']
    """
    return _numbers(np.atleast_1d(np.asarray(values, dtype=float)), f"%.{digits}g")


def frequencies(values: ArrayLike) -> Numbers:
    """Frequencies to 0.1 mHz, without trailing zeros.

    Examples
    --------
    >>> frequencies([1000.0, 0.9765625, 203.70001]).texts
    ['1000', '0.9766', '203.7']
    """
    return Numbers("%s", _frequencies(np.atleast_1d(np.asarray(values, dtype=float)).tobytes()))


@lru_cache(maxsize=4)
def _frequencies(values: bytes) -> tuple[str, ...]:
    """Many files of a batch have the same lines."""
    texts = fixed(np.frombuffer(values), 4).texts
    return tuple(text.rstrip("0").rstrip(".") if "." in text else text for text in texts)


def table_lines(columns: Mapping[str, Any], names: Sequence[str] = ()) -> str:
    """Named columns as lines of a table, numbers in the form that belongs to the name of their column.

    Parameters
    ----------
    columns : mapping
        Name to numbers, to cells (a sequence of str), to words that stand in one cell (a sequence of sequences of str),
        or to what is the same in every row: a name or a number.
    names : sequence of str, optional
        Those of the table, in order; a column that is not given is empty.

    Examples
    --------
    >>> table_lines({"channel": "Mic 1", "frequency_hz": [1.0, 2.5], "phase_deg": [-180.0, 3.14159]})
    'Mic 1\\t1\\t180.00\\nMic 1\\t2.5\\t3.14\\n'
    """
    count = next(len(v) for v in columns.values() if not np.isscalar(v))
    forms, filled = [], []
    for name in names or columns:
        values = columns.get(name, "")
        if np.isscalar(values):
            same = _cells(name, [word(values) if isinstance(values, str) else values])
            forms.append(same.texts[0].replace("%", "%%"))
        else:
            own = _cells(name, values)
            forms.append(own.form)
            filled.append(own.values)
    return ("\t".join(forms) + "\n") * count % tuple(chain.from_iterable(zip(*filled, strict=True)))


def _cells(name: str, values: Any) -> Numbers:
    if isinstance(values, Numbers):
        return values
    first = values[0] if len(values) else ""
    if isinstance(first, str):
        return Numbers("%s", values)
    if isinstance(first, (tuple, list)):
        return Numbers("%s", [" ".join(words) for words in values])
    if name in ("frequency_hz", "order"):
        return frequencies(values)
    if name == "phase_deg":
        return phases(values)
    if name in ("coherence", "speed_hz", "time_s"):
        return fixed(values, 4)
    if name.endswith("_dB"):
        return fixed(values, 3)
    return significant(values, 3 if name.split("_")[0] == "u" else 6)


def write_table(
    path: Path,
    header: Iterable[str],
    columns: Sequence[str],
    blocks: Iterable[str],
    decimal: str = ".",
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
    blocks : iterable of str
        Lines of the table as `rows` makes them, in order; may come from a generator.
    decimal : {".", ","}
        Decimal sign of text. With a comma, a .csv has semicolons between columns and a byte order mark.
    """
    form = path.suffix.lower()
    if form in (".xlsx", ".parquet"):
        _write_frame(path, form, list(header), columns, blocks)
        return
    if decimal != ".":
        header = [*header, _COMMA[2:-1]]
        blocks = map(with_comma, blocks)
    with text_file(path) as file:
        if decimal != "." and form == ".csv":
            file.write("\ufeff")
        for line in header:
            file.write(f"# {escaped(' '.join(line.split()))}\n")
        if form == ".csv":
            sheet = csv.writer(file, lineterminator="\n", delimiter="," if decimal == "." else ";")
            sheet.writerow(columns)
            for lines in blocks:
                sheet.writerows(cells(line) for line in lines.split("\n")[:-1])
            return
        file.write("\t".join(columns) + "\n")
        file.writelines(blocks)


# A number with a point: a cell, or in a flag such as ``left-out=12.40/55.31``.
_NUMBER = re.compile(r"(?<![^\t\n=/])([-+]?\d+)\.(\d+(?:e[-+]?\d+)?)(?![^\t\n /])")


def with_comma(cells: str) -> str:
    """Cells of a table with the decimal comma.

    Examples
    --------
    >>> with_comma("0.94 %\\tedges left-out=12.40/55.31\\tsine_0125.3Hz.tdms")
    '0,94 %\\tedges left-out=12,40/55,31\\tsine_0125.3Hz.tdms'
    """
    return _NUMBER.sub(r"\1,\2", cells)


_SHEET_ROWS = 1_048_576  # of a workbook


def _write_frame(
    path: Path, form: str, header: Sequence[str], columns: Sequence[str], blocks: Iterable[str]
) -> None:
    """The same table as a workbook, with the header on a second sheet, or as Parquet, with it among the metadata."""
    import io

    import pandas as pd

    library(*(("openpyxl", "xlsx") if form == ".xlsx" else ("pyarrow", "parquet")))
    text = "".join(["\t".join(columns), "\n", *blocks])
    frame = pd.read_csv(
        io.StringIO(text), sep="\t", keep_default_na=False, na_values=[""], dtype={"channel": str}
    )
    if form == ".xlsx" and len(frame) >= _SHEET_ROWS:
        raise RequestError(
            f"{len(frame)} rows do not fit a workbook",
            expected=f"less than {_SHEET_ROWS}",
            remedy="write .csv",
        )
    about = list(map(escaped, header))
    with whole_file(path) as half, half.open("wb") as file:
        if form == ".parquet":
            frame.attrs = {"header": about}
            frame.to_parquet(file, index=False, engine="pyarrow")
            return
        with pd.ExcelWriter(file, engine="openpyxl") as book:
            frame.to_excel(book, sheet_name="specan", index=False)
            pd.DataFrame({"about": list(map(harmless, header))}).to_excel(
                book, sheet_name="about", index=False
            )


# A name as a cell of a table: read back as it was by pandas, R and spreadsheets, whatever it holds.
#
# The rule, in the order in which it is applied:
#
# 1. A backslash is doubled; characters that end a cell or a line and those that UTF-8 does not have become
#    ``\t``, ``\n``, ``\r``, ``\x1b``, ``\u2028``, ``\udcff`` (a byte of a file name that is not UTF-8).
# 2. Before ``=``, ``+``, ``-``, ``@`` or an apostrophe at the beginning of a longer text stands an apostrophe, so
#    that no spreadsheet takes it for a formula.
# 3. A text with ``#`` or ``"``, or with a blank at its beginning or end, stands between ``"``; ``"`` within it is
#    doubled.
#
# Ordinary names are not touched. Different names give different cells, from which the name can be found again.

# Controls, surrogates, separators of lines and of paragraphs.
_UNSEEN = {"Cc", "Cs", "Zl", "Zp"}
_FORMULA = ("=", "+", "-", "@", "'")


def escaped(text: str) -> str:
    r"""Rule 1: one line of UTF-8, whatever the text holds.

    Examples
    --------
    >>> escaped("Mic\t1"), escaped("a\\b"), escaped("bad\udcff")
    ('Mic\\t1', 'a\\\\b', 'bad\\udcff')
    """
    if text.isascii() and text.isprintable() and "\\" not in text:
        return text
    return "".join(_escape(c) for c in text)


def harmless(text: object) -> str:
    """Rules 1 and 2, for writers that quote by themselves.

    Examples
    --------
    >>> harmless("=1+1"), harmless("-"), harmless("Mic 1")
    ("'=1+1", '-', 'Mic 1')
    """
    found = escaped(str(text))
    return f"'{found}" if len(found) > 1 and found.startswith(_FORMULA) else found


def word(text: object) -> str:
    r"""A cell of a tab-separated table.

    Examples
    --------
    >>> word("Mic 1"), word("Mic #1"), word('5" pipe'), word("a\tb")
    ('Mic 1', '"Mic #1"', '"5"" pipe"', 'a\\tb')
    """
    found = harmless(text)
    if "#" in found or '"' in found or found != found.strip():
        return '"' + found.replace('"', '""') + '"'
    return found


def cells(line: str) -> list[str]:
    """The cells of one line of a table, without quotation marks.

    Examples
    --------
    >>> cells('a.tdms\\t"Mic #1"\\t94.000')
    ['a.tdms', 'Mic #1', '94.000']
    """
    line = line.rstrip("\n")
    return line.split("\t") if '"' not in line else next(csv.reader([line], delimiter="\t"))


def _escape(character: str) -> str:
    if character != "\\" and unicodedata.category(character) not in _UNSEEN:
        return character
    return character.encode("unicode_escape").decode("ascii")
