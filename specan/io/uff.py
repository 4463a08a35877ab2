"""Universal files (UFF): data sets 58 of time responses and transfer functions, binary or ASCII."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.data.recording import ArraySource, Recording
from specan.errors import InputError, NoSignalError, library
from specan.io.sampling_rate import Rate, rate_of_axis
from specan.io.signals import Opening, Signal

SUFFIXES = (".uff", ".unv")
UNREADABLE = "\ufffd"  # what Python writes for bytes that are no text

# Function types of data set 58, record 6, field 1.
TIME_RESPONSE, TRANSFER_FUNCTION, COHERENCE = 1, 4, 6
FUNCTIONS = {
    2: "auto spectrum", 3: "cross spectrum", 4: "transfer function", 6: "coherence", 9: "power spectral density",
    12: "spectrum",
}  # fmt: skip
# Specific data types of record 9 and the SI unit of each; a file may use other units, which its labels then say.
QUANTITIES = {8: "m", 9: "N", 11: "m/s", 12: "m/s^2", 13: "N", 15: "Pa"}
_DIRECTIONS = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}


@dataclass(frozen=True)
class DataSet:
    """One data set 58.

    Attributes
    ----------
    kind : int
        Function type: 1 time response, 4 transfer function, 6 coherence.
    response, reference : str
        Entity name if the file gives one, else node and direction: ``2Z``, ``-1Y``.
    names : tuple of tuple of str
        Other names that response and reference may be called by.
    unit : str
        Of the ordinate, over that of the denominator; empty where the file does not say.
    x : array (n,)
        Abscissa: s or Hz.
    values : array (n,), real or complex
    """

    kind: int
    response: str
    reference: str
    names: tuple[tuple[str, ...], tuple[str, ...]]
    unit: str
    x: Real
    values: NDArray[Any]
    title: str = ""


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is a universal file: a line ``-1``, then the number of a data set.

    Examples
    --------
    >>> recognises(b"    -1\\n    58b     1     2\\n"), recognises(b"-1\\n-2\\n")
    (True, False)
    """
    lines = [line.split() for line in start.lstrip().splitlines()[:2]]
    if len(lines) < 2 or lines[0] != [b"-1"] or not lines[1]:
        return False
    return lines[1][0].removesuffix(b"b").isdigit()


def read_uff(path: Path, kinds: tuple[int, ...]) -> list[DataSet]:
    """The data sets 58 of some function types, in the order of the file.

    Raises
    ------
    InputError
        The file is damaged.
    RequestError
        pyuff is not installed.
    """
    pyuff = library("pyuff", "uff")
    try:
        file = pyuff.UFF(str(path))
        types = enumerate(np.atleast_1d(file.get_set_types()))
        sets = (file.read_sets(number) for number, kind in types if int(kind) == 58)
        found = [s for s in sets if int(s.get("func_type", -1)) in kinds]
    except Exception as fault:  # pyuff raises whatever a damaged number leads to
        raise InputError(
            f"{path.name} cannot be read as a universal file ({fault})", remedy="export it again"
        ) from None
    return [_data_set(path, s) for s in found]


def _data_set(path: Path, content: Mapping[str, Any]) -> DataSet:
    values, x = np.asarray(content["data"]), np.asarray(content["x"], dtype=float)
    if values.ndim != 1 or values.size != x.size or not values.size:
        raise InputError(f"{path.name}: a data set holds {values.size} values at {x.size} points of its axis")
    response, also = _end(content, "rsp")
    reference, other = _end(content, "ref")
    return DataSet(
        int(content["func_type"]), response, reference, (also, other), _unit(path, content), x, values,
        title=_word(content.get("id1")),
    )  # fmt: skip


def _end(content: Mapping[str, Any], which: str) -> tuple[str, tuple[str, ...]]:
    """Name of the response or reference, and all names that it goes by."""
    entity = _word(content.get(f"{which}_ent_name"))
    node, direction = int(content.get(f"{which}_node", 0)), int(content.get(f"{which}_dir", 0))
    along = _DIRECTIONS.get(abs(direction), "")
    sign = "-" if direction < 0 else ""
    place = f"{sign}{node}{along}"
    names = [entity, place, f"{node}{sign or '+'}{along}", f"{node}:{sign or '+'}{along}", str(node)]
    names = [name for name in dict.fromkeys(names) if name]
    return names[0], tuple(names)


def _unit(path: Path, content: Mapping[str, Any]) -> str:
    above, below = (_label(path, content, which) for which in ("ordinate", "orddenom"))
    if not above or not below:
        return above
    return f"({above})/({below})"


def _label(path: Path, content: Mapping[str, Any], which: str) -> str:
    """Unit of an axis; pyuff replaces what is not UTF-8, such as the ² and µ of Western Windows."""
    said = _word(content.get(f"{which}_axis_units_lab"))
    if UNREADABLE in said:
        written = b"[\x80-\xff]".join(re.escape(part.encode()) for part in said.split(UNREADABLE))
        found = re.search(written, path.read_bytes())
        said = said if found is None else found[0].decode("cp1252", "replace")
    return said or QUANTITIES.get(int(content.get(f"{which}_spec_data_type", 0)), "")


def _word(text: Any) -> str:
    plain = str(text or "").strip()
    return "" if plain.upper() in ("NONE", "NULL") else plain


def open_recording(path: Path, opening: Opening) -> Recording:
    """Read the time responses of a universal file; they are held in memory.

    A channel is called by the first line of its data set's description, or else by its node and direction.

    Raises
    ------
    InputError
        The file is damaged, or holds no time response.
    RequestError
        pyuff is not installed.
    """
    sets = read_uff(path, (TIME_RESPONSE,))
    if not sets:
        held = Counter(FUNCTIONS[one.kind] for one in read_uff(path, tuple(FUNCTIONS)))
        holds = ", ".join(f"{kind} ({n})" for kind, n in held.items())
        raise NoSignalError(
            f"{opening.label} is a universal file without a time response"
            + (f"; it holds: {holds}" if holds else ""),
            remedy="read it in Python with specan.read_functions; a study takes transfer functions"
            if holds
            else "",
        )
    names = [one.title or one.response for one in sets]
    names = [
        n if names.count(n) == 1 else f"{n} {one.response}".strip()
        for n, one in zip(names, sets, strict=True)
    ]
    names = [n if names.count(n) == 1 else f"{n} ({k})" for k, n in enumerate(names, 1)]
    signals = [
        Signal(name, one.values.size, one.unit, _rate(one)) for name, one in zip(names, sets, strict=True)
    ]
    samples = [np.asarray(one.values.real, dtype=np.float64) for one in sets]
    return opening.recording(signals, ArraySource(samples))


def _rate(one: DataSet) -> Rate | None:
    """Rate by the data set's axis; a step has six digits in the file, and is taken as the rate that rounds to it."""
    found = rate_of_axis("time", "DoubleFloat", {"unit_string": "s"}, one.x.size, lambda a, b: one.x[a:b])
    if not isinstance(found, Rate):
        return None
    # Steps have six digits.
    roundings = (float(f"{found.hz:.{digits}g}") for digits in range(2, 8))
    hz = next((hz for hz in roundings if f"{1 / hz:.5e}" == f"{1 / found.hz:.5e}"), found.hz)
    return Rate(hz, "the step of the data set's axis")
