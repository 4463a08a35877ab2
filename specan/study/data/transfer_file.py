"""Transfer functions that other programs have written: universal files, and text with a column of frequencies."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from specan.csv_rows import cells_of
from specan.errors import InputError, RequestError
from specan.io.uff import COHERENCE, TRANSFER_FUNCTION, read_uff, recognises
from specan.schema import regular
from specan.study.data.table_file import beginning, read_table
from specan.study.data.table_reader import name_and_unit
from specan.study.observation import Array
from specan.units import convert

# What a column of numbers is of a transfer function, by the last word of its header.
_PARTS = {
    "re": "re", "real": "re", "im": "im", "imag": "im", "imaginary": "im", "mag": "magnitude", "abs": "magnitude",
    "magnitude": "magnitude", "amplitude": "magnitude", "phase": "phase", "arg": "phase", "angle": "phase",
    "coherence": "coherence", "coh": "coherence", "u": "u", "sigma": "u", "averages": "averages",
}  # fmt: skip
_PART = re.compile(
    rf"^(?:(?P<name>.*)[ _])?(?P<part>{'|'.join(_PARTS)})(?:[ _](?:deg|rad|percent))?$", re.IGNORECASE
)
# Those of a table that `specan frf -o` has written.
_OWN = {
    "u_magnitude_percent": "u", "u_common_percent": "common", "u_phase_deg": "", "u_leakage_percent": "",
    "u_common_phase_deg": "",
}  # fmt: skip
_FREQUENCY = re.compile(r"^(f|freq|freq\.|frequency|frequencies)([ _]k?hz)?$", re.IGNORECASE)
_CHANNEL = "channel"


@dataclass(frozen=True, eq=False)
class MeasuredFrf:
    """One transfer function of a file.

    Attributes
    ----------
    response, reference : str
        Empty where the file has a single one without a name.
    also : tuple of tuple of str
        Other names of both.
    unit : str
        Empty where the file does not say.
    frequency_hz : array (n,)
    values : complex array (n,)
    sigma : array (n,) or None
        Standard uncertainty of the real and of the imaginary part; None where nothing tells it.
    common : float
        Standard uncertainty of the calibration, relative.
    coherence : array (n,) or None
    windowed : bool
        Whether a Hann window has made neighbouring lines alike, as `specan frf` says of its own tables.
    """

    response: str
    reference: str
    also: tuple[tuple[str, ...], tuple[str, ...]]
    unit: str
    frequency_hz: Array
    values: NDArray[np.complex128]
    sigma: Array | None = None
    common: float = 0.0
    coherence: Array | None = None
    windowed: bool = False

    @property
    def said(self) -> str:
        """Its name in a message."""
        return f"{self.response or 'a response'} over {self.reference or 'its reference'}"


def is_transfer_file(path: Path) -> bool:
    """Whether a file holds transfer functions, by its content: a universal file, or a header with a frequency."""
    start = beginning(path)
    if recognises(start):
        return True
    if b"\0" in start or start.startswith((b"RIFF", b"TDSm", b"PK")):
        return False
    cells, _ = cells_of(start.decode("utf-8", "replace"), path.name)
    titles = [name_and_unit(cell)[0] for cell in next(iter(cells.values()), [])]
    return any(_FREQUENCY.match(title) for title in titles) and any(_part(t)[1] for t in titles)


def read_transfer_file(path: Path) -> list[MeasuredFrf]:
    """All transfer functions of a universal file or a table.

    A table has a column of frequencies (``frequency [Hz]``) and, for each transfer function, ``re`` and ``im`` or
    ``magnitude`` and ``phase`` (degrees unless the header says ``[rad]``), and perhaps ``coherence`` and ``u`` (a
    standard uncertainty, in percent of the magnitude or in the unit). Before each of these words may stand the name
    of the response (``x2 re [um/N]``), or a column ``channel`` names it in every row, as in a table of ``specan frf``.

    Raises
    ------
    InputError
        No transfer function, one part without the other, numbers that are none.
    """
    found = _from_uff(path) if recognises(beginning(path)) else _from_table(path)
    if not found:
        raise InputError(
            f"{path.name} holds no transfer function",
            expected="data sets 58 of function type 4, or columns frequency, re and im",
        )
    return [_usable(path, one) for one in found]


def _usable(path: Path, one: MeasuredFrf) -> MeasuredFrf:
    """Without lines at 0 Hz and lines without a value; frequencies rise."""
    kept = (one.frequency_hz > 0) & np.isfinite(one.values)
    order = np.argsort(one.frequency_hz[kept], kind="stable")

    def take(values: Any) -> Any:
        return None if values is None else values[kept][order]

    frequency = take(one.frequency_hz)
    if frequency.size < 3 or np.any(np.diff(frequency) <= 0):
        raise InputError(
            f"{path.name}: {one.said} has {frequency.size} lines, some at the same frequency"
            if frequency.size >= 3
            else f"{path.name}: {one.said} has {frequency.size} lines above 0 Hz with a value",
            expected="lines at different frequencies",
        )
    return replace(
        one, frequency_hz=frequency, values=take(one.values), sigma=take(one.sigma), coherence=take(one.coherence)
    )  # fmt: skip


# --- universal files ---------------------------------------------------------------------------------


def _from_uff(path: Path) -> list[MeasuredFrf]:
    sets = read_uff(path, (TRANSFER_FUNCTION, COHERENCE))
    coherences = [s for s in sets if s.kind == COHERENCE]
    found = []
    for one in sets:
        if one.kind != TRANSFER_FUNCTION:
            continue
        ends = (one.response, one.reference)
        beside = next((c for c in coherences if (c.response, c.reference) == ends), None)
        coherence = None if beside is None else np.interp(one.x, beside.x, np.real(beside.values))
        values = one.values.astype(complex)
        found.append(MeasuredFrf(*ends, one.names, one.unit, one.x, values, coherence=coherence))
    return found


# --- tables ------------------------------------------------------------------------------------------


@dataclass
class _Header:
    """What the columns of a table of transfer functions are."""

    frequency: str = ""
    channel: str = ""
    parts: dict[tuple[str, str], str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    def choose(self, headers: Iterable[str]) -> dict[str, str]:
        """Columns that are read: the frequency, and the parts of each response."""
        for header in headers:
            title, unit = name_and_unit(header)
            self.units[header] = unit
            scale, (name, part) = _FREQUENCY.match(title), _part(title)
            if title.lower() in (_CHANNEL, "response"):
                self.channel = header
            elif scale and not self.frequency:
                self.frequency, self.units[header] = header, unit or (scale[2] or "Hz").strip(" _")
            elif part:
                self.parts[name, part] = header
        numbers = [h for h in (self.frequency, *self.parts.values()) if h]
        return {**{h: h for h in numbers}, **({self.channel: _CHANNEL} if self.channel else {})}


def _from_table(path: Path) -> list[MeasuredFrf]:
    header = _Header()
    frame = read_table(path, choose=header.choose, texts=(_CHANNEL,)).frame
    if not header.frequency:
        raise InputError(f"{path.name} has no column of frequencies", expected="a column frequency [Hz]")
    names = dict.fromkeys(name for name, _ in header.parts)
    if _CHANNEL not in frame:
        return [_one(path, frame, header, name, name) for name in names]
    each = frame.groupby(_CHANNEL, sort=False)
    return _as_specan_says(path, [_one(path, rows, header, n, str(c)) for n in names for c, rows in each])


def _as_specan_says(path: Path, found: list[MeasuredFrf]) -> list[MeasuredFrf]:
    """Units, reference and window out of the comments of a table that `specan frf` has written."""
    with regular(path).open(encoding="utf-8", errors="replace") as file:
        comments = [line[1:].strip() for line in takewhile(lambda line: line.startswith("#"), file)]
    if not comments or not re.fullmatch(r"specan \S+ frf", comments[0]):
        return found
    said = next(
        (text.removeprefix("magnitude in ") for text in comments if text.startswith("magnitude in ")), ""
    )
    units = {name: unit for unit, name in re.findall(r"(\S+) \((.*?)\)(?:, |$)", said)}
    over = next((m[1] for text in comments if (m := re.search(r": \S+ over (.*) \(.*\)$", text))), "")
    window = any(re.search("[\"']window[\"']: [\"']hann[\"']", text) for text in comments)
    return [
        replace(one, unit=units.get(one.response, ""), reference=over, windowed=window) for one in found
    ]  # fmt: skip


def _one(path: Path, frame: pd.DataFrame, header: _Header, name: str, response: str) -> MeasuredFrf:
    titles = {part: title for (of, part), title in header.parts.items() if of == name}
    units = {part: header.units[title] for part, title in titles.items()}
    column = {part: frame[title].to_numpy() for part, title in titles.items()}
    if {"re", "im"} <= column.keys():
        values, unit = column["re"] + 1j * column["im"], units["re"]
    elif {"magnitude", "phase"} <= column.keys():
        said, phase = units["phase"] or titles["phase"], column["phase"]
        turn = phase if said.lower().endswith(("rad", "radian", "radians")) else np.radians(phase)
        values, unit = column["magnitude"] * np.exp(1j * turn), units["magnitude"]
    else:
        raise InputError(
            f"{path.name}: the transfer function {name or response!r} lacks a part",
            expected="columns re and im, or magnitude and phase",
        )
    f_unit = header.units[header.frequency]
    try:
        known = {"khz": "kHz", "hz": "Hz"}.get(f_unit.lower(), f_unit)
        hertz = np.asarray(convert(frame[header.frequency].to_numpy(), known, "Hz"))
    except RequestError:
        raise InputError(f"{path.name}: the frequency is in {f_unit!r}", expected="Hz or kHz") from None
    coherence, sigma, common = column.get("coherence"), column.get("u"), column.get("common")
    if sigma is not None:
        title = titles["u"]
        if title in _OWN or units["u"] in ("%", "percent") or "percent" in title:
            sigma = sigma / 100 * np.abs(values)
    elif coherence is not None and "averages" in column:
        sigma = sigma_of(np.abs(values), coherence, column["averages"])
    return MeasuredFrf(
        response, "", ((response,), ()), unit, hertz, values, sigma,
        common=0.0 if common is None else float(np.nanmedian(common)) / 100, coherence=coherence,
    )  # fmt: skip


def sigma_of(magnitude: Array, coherence: Array, averages: Any) -> Array:
    """Standard uncertainty of each part of an H1 line: ``|H| sqrt((1 - g2) / (2 n g2))``.

    Bendat & Piersol, Random Data, 4th ed. (2010), eq. 9.90.

    Examples
    --------
    >>> sigma_of(np.array([2.0]), np.array([0.8]), 50).round(3).tolist()
    [0.1]
    """
    known = np.clip(coherence, 1e-6, 1 - 1e-9)
    return np.asarray(magnitude * np.sqrt((1 - known) / (2 * np.asarray(averages) * known)))


def _part(title: str) -> tuple[str, str]:
    """Response and part of a column: ``x2 re`` is the real part of x2."""
    if title in _OWN:
        return "", _OWN[title]
    said = _PART.match(title)
    return ((said["name"] or "").strip(), _PARTS[said["part"].lower()]) if said else ("", "")


def find(found: Sequence[MeasuredFrf], response: str, reference: str) -> MeasuredFrf | None:
    """The transfer function of two ends, by any of their names; the only one there is where it has no names."""
    if len(found) == 1 and not found[0].response:
        return found[0]
    for one in found:
        matches = response in (one.response, *one.also[0])
        if matches and (not reference or not one.reference or reference in (one.reference, *one.also[1])):
            return one
    return None
