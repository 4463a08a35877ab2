"""Lines of many channels in one pair of axes: a few each in its colour, many as a range with the outer ones on it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from specan.report.figure_style import line_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW = 8  # channels that are drawn each in its own colour
APART = 3  # of many: those that are drawn over the range
Styles: TypeAlias = dict[int, dict[str, Any]]  # colour and dash of each row that gets a line
_RANGE: dict[str, Any] = {"color": "0.82", "linewidth": 0}


def chosen(values: NDArray[np.float64]) -> list[int]:
    """Rows that get a line: all of a few; of many those that are furthest from the median, on average over x.

    Examples
    --------
    >>> levels = np.zeros((10, 4))
    >>> levels[[2, 7, 5]] = [[3.0], [-9.0], [6.0]]
    >>> chosen(levels)
    [7, 5, 2]
    """
    if len(values) <= FEW:
        return list(range(len(values)))
    finite = np.where(np.isfinite(values), values, np.nan)
    known = np.isfinite(finite).any(axis=0)
    if not known.any():
        return list(range(APART))
    off = np.abs(finite[:, known] - np.nanmedian(finite[:, known], axis=0))
    count = np.maximum(np.isfinite(off).sum(axis=1), 1)
    distance = np.nansum(off, axis=1) / count
    return np.argsort(-distance, kind="stable")[:APART].tolist()


def grouped(kinds: Iterable[str]) -> dict[str, list[int]]:
    """Rows of each unit or level reference.

    Examples
    --------
    >>> grouped(["Pa", "m/s", "Pa"])
    {'Pa': [0, 2], 'm/s': [1]}
    """
    found: dict[str, list[int]] = {}
    for row, kind in enumerate(kinds):
        found.setdefault(kind, []).append(row)
    return found


def outer_lines(
    axes: Axes, x: NDArray[np.float64], values: NDArray[np.float64], rows: Sequence[int], styles: Styles
) -> list[int]:
    """Those of the rows that get a line, their styles added to `styles`; the range of many is drawn."""
    many = len(rows) > FEW
    if many:
        draw_range(axes, x, values[list(rows)])
    outer = [rows[k] for k in chosen(values[list(rows)])]
    styles |= styles_of([*styles, *outer], many)
    return outer


def styles_of(rows: list[int], many: bool) -> Styles:
    """Colour and dash of each row that gets a line; of many channels each line is full."""
    return {
        row: ({**style, "linestyle": "-"} if many else style)
        for row, style in zip(rows, line_styles(), strict=False)
    }


def draw_range(axes: Axes, x: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """From the lowest to the highest of all channels, and their median.

    As steps where `x` holds edges, that is one value more than the rows.
    """
    finite = np.where(np.isfinite(values), values, np.nan)
    known = np.isfinite(finite).any(axis=0)
    low, middle, high = (np.full(finite.shape[1], np.nan) for _ in range(3))
    low[known], high[known] = np.nanmin(finite[:, known], axis=0), np.nanmax(finite[:, known], axis=0)
    middle[known] = np.nanmedian(finite[:, known], axis=0)
    label = f"range of {len(values)} channels"
    if x.size == finite.shape[1] + 1:
        axes.stairs(high, x, baseline=low, fill=True, label=label, **_RANGE)
        axes.stairs(middle, x, baseline=None, color="0.4", linewidth=1.3, label="median")
    else:
        axes.fill_between(x, low, high, label=label, **_RANGE)
        axes.plot(x, middle, color="0.4", linewidth=1.3, label="median")


def draw_thin(axes: Axes, x: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """All channels as thin grey lines: for phases, of which there is no range."""
    for row in values:
        axes.plot(x, row, color="0.72", linewidth=0.4, zorder=1.5)
