"""Many numbers as text at once: the characters that ``%`` gives, a tenth of its time.

Cells are rows of bytes of one width; a zero byte stands for nothing and is left out when lines are put together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.uint8]
Real = NDArray[np.float64]

_ZERO, _POINT, _MINUS = b"0.-"
# Numbers from 0 to 9999 as four digits, each in one word.
_GROUP = np.frombuffer("".join(f"{n:04d}" for n in range(10_000)).encode(), dtype=np.uint32)
# Powers of ten up to 10^22 are exact: one product or quotient with them has one rounding.
_POWERS = np.array([10.0**k for k in range(23)])
# Nearer than this to the middle between two printed numbers, that rounding might decide; `%` sees the number itself.
_UNSURE = 1e-6
_MOST_DIGITS, _MOST_EXPONENT = 7, 15
_LARGE = 1e9


def text_cells(texts: Sequence[str]) -> Cells:
    """Texts as they are; none may hold a zero byte."""
    words = np.array([text.encode() for text in texts], dtype=np.bytes_)
    return words.view(np.uint8).reshape(len(texts), -1) if words.size else np.zeros((0, 1), np.uint8)


def fixed_cells(values: Real, decimals: int) -> Cells:
    """Numbers with a fixed number of decimals, at least one; empty where not finite, no negative zero.

    Examples
    --------
    >>> lines([fixed_cells(np.array([1.23456, -0.0001, np.nan]), 3)]).splitlines()
    ['1.235', '0.000', '']
    """
    finite = np.isfinite(values)
    if not finite.all():
        values = np.where(finite, values, 0.0)
    large = np.abs(values) >= _LARGE
    if large.any():
        rounded = np.where(large, values, np.round(np.where(large, 0.0, values), decimals)) + 0.0
        return text_cells([f"{v:.{decimals}f}" if ok else "" for v, ok in zip(rounded, finite, strict=True)])
    scaled = np.rint(values * 10.0**decimals).astype(np.int64)
    size = np.abs(scaled)
    count = max(len(str(int(size.max(initial=0)))), decimals + 1)
    digits = _digits(size, count)
    for column in range(count - decimals - 1):  # zeros ahead
        digits[:, column] *= size >= 10 ** (count - 1 - column)
    cells = np.empty((len(values), count + 2), np.uint8)
    cells[:, 0] = (scaled < 0) * np.uint8(_MINUS)
    cells[:, 1 : count - decimals + 1] = digits[:, : count - decimals]
    cells[:, count - decimals + 1] = _POINT
    cells[:, count - decimals + 2 :] = digits[:, count - decimals :]
    if not finite.all():
        cells[~finite] = 0
    return cells


def significant_cells(values: Real, digits: int) -> Cells:
    """Numbers to up to seven significant digits, as ``%g`` prints them; empty where not finite.

    Examples
    --------
    >>> lines([significant_cells(np.array([0.123456789, 1e-9, -0.0, 2.5e6, np.inf]), 6)]).splitlines()
    ['0.123457', '1e-09', '0', '2.5e+06', '']
    """
    assert 1 <= digits <= _MOST_DIGITS
    width = digits + 7  # sign, point, and an exponent of three digits
    with np.errstate(all="ignore"):
        exponent = np.floor(np.log10(values))
        usable = np.abs(exponent) <= _MOST_EXPONENT  # and neither zero, negative, nor not finite
        exponent = np.where(usable, exponent, 0.0).astype(np.int64)
        shift = digits - 1 - exponent
        scaled = np.where(
            shift >= 0, values * _POWERS[np.maximum(shift, 0)], values / _POWERS[np.maximum(-shift, 0)]
        )
        rounded = np.rint(scaled)
        usable &= np.abs(scaled - rounded) < 0.5 - _UNSURE
    number = np.where(usable, rounded, 0.0).astype(np.int64)
    carried = number == 10**digits
    number[carried] = 10 ** (digits - 1)
    exponent[carried] += 1
    shown = _digits(number, digits)
    # Zeros at the end are left out where they stand behind the point.
    ends = np.zeros((len(values), digits), np.uint8)
    seen = np.zeros(len(values), np.bool_)
    for column in range(digits - 1, -1, -1):
        seen |= shown[:, column] != _ZERO
        np.multiply(shown[:, column], seen, out=ends[:, column])
    cells = np.zeros((len(values), width), np.uint8)
    exponent[~usable] = _MOST_EXPONENT + 2  # none of its own
    for power in np.flatnonzero(np.bincount(exponent + _MOST_EXPONENT)) - _MOST_EXPONENT:
        if power <= _MOST_EXPONENT + 1:
            rows = np.flatnonzero(exponent == power)
            _place(cells, rows, shown[rows], ends[rows], int(power), digits)
    others = np.flatnonzero(~usable & np.isfinite(values))
    if others.size:
        texts = [f"{value + 0.0:.{digits}g}".encode() for value in values[others].tolist()]
        cells[others] = np.array(texts, dtype=f"S{width}").view(np.uint8).reshape(-1, width)
    return cells


def _place(cells: Cells, rows: NDArray[np.int64], shown: Cells, ends: Cells, power: int, digits: int) -> None:
    """Write numbers of one power of ten: `shown` are their digits, `ends` those without zeros at the end."""
    if -4 <= power < 0:
        ahead = np.broadcast_to(np.frombuffer(b"0." + b"0" * (-power - 1), np.uint8), (len(rows), 1 - power))
        parts = [ahead, ends]
    else:
        whole, behind = (power + 1, b"") if 0 <= power < digits else (1, b"e%+03d" % power)
        parts = [shown[:, :whole]]
        if whole < digits:
            parts += [(ends[:, whole : whole + 1] > 0) * np.uint8(_POINT), ends[:, whole:]]
        parts.append(np.broadcast_to(np.frombuffer(behind, np.uint8), (len(rows), len(behind))))
    found = np.concatenate(parts, axis=1)
    cells[rows, : found.shape[1]] = found


def _digits(numbers: NDArray[np.int64], count: int) -> Cells:
    """The last `count` decimal digits of numbers of 0 and above, shape (numbers, count)."""
    groups = -(-count // 4)
    found = np.empty((len(numbers), groups), np.uint32)
    for group in range(groups - 1, -1, -1):
        rest = numbers // 10_000
        found[:, group] = _GROUP[numbers - 10_000 * rest]
        numbers = rest
    return found.view(np.uint8)[:, 4 * groups - count :]


def lines(cells: Sequence[Cells], before: str = "") -> str:
    """Lines of cells with tabs between them, each with `before` at its beginning and a line feed at its end.

    Examples
    --------
    >>> lines([fixed_cells(np.array([1.0, 20.0]), 1), text_cells(["", "x"])], "a b ")
    'a b 1.0\\t\\na b 20.0\\tx\\n'
    """
    count = len(cells[0])
    if not count:
        return ""
    tab = np.full((count, 1), ord("\t"), np.uint8)
    parts = [part for cell in cells for part in (tab, cell)][1:]
    body = np.concatenate([*parts, np.full((count, 1), ord("\n"), np.uint8)], axis=1)
    text = body.tobytes().translate(None, b"\0").decode()
    return before + text[:-1].replace("\n", f"\n{before}") + "\n"
