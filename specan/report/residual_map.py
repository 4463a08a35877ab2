"""Where a model fails, on a map: left-out blocks over two operating variables, third octave x microphone.

The map is shown as an HTML table, in the report and on the page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Flags, Real
from specan.result import gathered
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import Block, localise
from specan.study.observation import Variable, shared_labels, variable_named

_LEAST_END = 6.0  # of the colour scale: what is below is what chance may do
_MOST_SHARE = 0.95  # of the cells that the scale separates where the model fails everywhere
_FREQUENCY = "third_octave_hz"  # always lies across
_LINE = 'style="white-space:nowrap"'
_UPRIGHT = 12  # columns of which the names lie across
# Violet to orange, by C. Brewer (PuOr): distinguished by every kind of colour vision.
_DIVERGING = (
    "#2d004b", "#542788", "#8073ac", "#b2abd2", "#d8daeb", "#f7f7f7", "#fee0b6", "#fdb863", "#e08214", "#b35806",
    "#7f3b08",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """Left-out blocks of rows over two operating variables.

    Attributes
    ----------
    across, up : str
        Operating variables, as the labels of the rows name them; `up` is empty where one alone varies.
    columns, rows : tuple of str
        Their levels.
    blocks : tuple of tuple of tuple of Block
        Of each row and column: what the model, fitted to all other data, is off by. Of several observables each has a
        block; where nothing was measured there is none.
    variables : mapping
        Words and unit of the operating variables.
    """

    across: str
    up: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    blocks: tuple[tuple[tuple[Block, ...], ...], ...]
    variables: Mapping[str, Variable]

    @property
    def z(self) -> Real:
        """Mean errors (rows, columns) in standard uncertainties: of the block that is furthest off, or NaN."""
        return np.array(
            [[max((b.z for b in cell), key=abs, default=np.nan) for cell in row] for row in self.blocks]
        )

    @property
    def significant(self) -> Flags:
        """Passed at a false discovery rate of 5 % (rows, columns); of transfer functions by level or phase."""
        return np.array([[any(b.significant for b in cell) for cell in row] for row in self.blocks])

    @property
    def end(self) -> float:
        """End of the colour scale, to either side."""
        known = np.abs(self.z[np.isfinite(self.z)])
        wanted = float(np.quantile(known, _MOST_SHARE)) if known.size else 0.0
        return max(_LEAST_END, float(f"{wanted:.1g}"))


def residual_map(problem: Problem, best: Fit) -> ResidualMap | None:
    """The map of a fitted model; None where no operating variable varies, or nothing is to be shown.

    Blocks are those of `specan.study.localisation.localise`: nuisance parameters cannot hide a failure in them.
    """
    labels = shared_labels(problem.observations)
    names = map_axes(labels)
    if not names:
        return None
    across, up = names[0], names[1] if len(names) > 1 else ""
    rows = _levels(labels[up]) if up else [""]
    blocks = gathered((frozenset(block.where.items()), block) for block in localise(problem, best).blocks)
    columns = {
        level: [
            tuple(_blocks_of(blocks, labels, {across: level, **({up: row} if up else {})})) for row in rows
        ]
        for level in _levels(labels[across])
    }
    # Numbers are a scale; of names those with nothing to show are left out.
    columns = {level: cells for level, cells in columns.items() if any(cells) or not isinstance(level, str)}
    if not columns:
        return None
    variables = problem.observations[0].variables
    over, upwards = (
        tuple(variable_named(name, variables).short(level, unit=False) if name else "" for level in levels)
        for name, levels in ((across, columns), (up, rows))
    )
    return ResidualMap(across, up, over, upwards, tuple(zip(*columns.values())), dict(variables))


def map_axes(labels: Mapping[str, NDArray[Any]]) -> list[str]:
    """Varying operating variables, those for a map first: frequency, then the one with most levels.

    Examples
    --------
    >>> map_axes({"load": np.array([1.0, 1.0, 2.0]), "width": np.array([1.0, 2.0, 3.0]), "age": np.ones(3)})
    ['width', 'load']
    """
    counts = {n: np.unique(v).size for n, v in labels.items() if n != "measurement"}
    return sorted((n for n in counts if counts[n] > 1), key=lambda n: (n != _FREQUENCY, -counts[n], n))


def plot_axes(labels: Mapping[str, NDArray[Any]]) -> list[str]:
    """Varying operating variables, those for an abscissa first: no axis over names if there is another."""
    return sorted(map_axes(labels), key=lambda name: labels[name].dtype.kind not in "fiu")


def axis_text(column: str, variables: Mapping[str, Variable]) -> str:
    """Label of an axis over a variable: ``Output force / kN``."""
    text = variable_named(column, variables).axis if column else ""
    return text[:1].upper() + text[1:]


def _levels(values: NDArray[Any]) -> list[Any]:
    """Numbers in their order, names as they come."""
    if values.dtype.kind in "fiu":
        return list(np.unique(values).tolist())
    return list(dict.fromkeys(values.tolist()))


def _blocks_of(
    blocks: Mapping[frozenset[tuple[str, Any]], Sequence[Block]],
    labels: Mapping[str, NDArray[Any]],
    where: Mapping[str, Any],
) -> Sequence[Block]:
    """Those of a cell; rows that two places share are kept under the first, so a cell may go by one variable."""
    found = blocks.get(frozenset(where.items()), ())
    mine = np.logical_and.reduce([labels[name] == level for name, level in where.items()])
    alone = (
        blocks[frozenset([one])]
        for one in where.items()
        if np.array_equal(labels[one[0]] == one[1], mine) and frozenset([one]) in blocks
    )
    return found or next(alone, ())


def failing_map(found: ResidualMap | None, known: bool) -> str:
    """Left-out z of every pair of levels as coloured cells; framed where it is significant."""
    if found is None:
        return "<p>No map: it needs an operating variable that varies and a place where the model fails.</p>"
    title = f"violet: low, orange: high, full colour at {found.end:g}; "
    title += "framed: significant" if known else "relative to 1 %"
    if known and not found.significant.any():
        title = "no significant deviation of the model"
    across, up = (axis_text(name, found.variables) for name in (found.across, found.up))
    lines = []
    for i in reversed(range(len(found.rows))):
        cells = "".join(_cell(found, i, j, across, up) for j in range(len(found.columns)))
        lines.append(f"<tr><th {_LINE}>{escape(found.rows[i])}</th>{cells}</tr>")
    turned = "writing-mode:vertical-rl;white-space:nowrap" if len(found.columns) > _UPRIGHT else ""
    style = "border:0;padding:2px 0;text-align:center;vertical-align:top"
    foot = "".join(
        f'<td style="{style}"><span style="{turned}">{escape(text)}</span></td>' for text in found.columns
    )
    names = 1 + max(map(len, found.rows))
    return (
        f"<p><b>Where the model fails</b> ({escape(title)})</p>"
        '<table style="width:100%;table-layout:fixed;border-spacing:2px;border-collapse:separate">'
        f'<col style="width:{names}ch">{"".join(lines)}'
        f"<tr><td style='border:0'></td>{foot}</tr></table>{escape(across)}{escape(f'; up: {up}' if up else '')}"
    )


def _cell(found: ResidualMap, i: int, j: int, across: str, up: str) -> str:
    cell = found.blocks[i][j]
    if not cell:
        return '<td style="border:0"></td>'
    worst = max(cell, key=lambda block: abs(block.z))
    colour = _DIVERGING[int(np.clip(round(5 + 5 * worst.z / found.end), 0, 10))]
    frame = "2px solid var(--accent)" if found.significant[i, j] else "1px solid var(--line)"
    place = f"{across} {found.columns[j]}" + (f", {up} {found.rows[i]}" if up else "")
    text = f"{place}: left-out z {worst.z:+.1f}, {worst.text} ({worst.n} values)"
    style = f"background:{colour};border:0;height:18px;print-color-adjust:exact;outline:{frame}"
    return f'<td title="{escape(text)}" style="{style}"></td>'
