"""Where the model of a study fails, as an HTML table with colours."""

from __future__ import annotations

from html import escape

import numpy as np

from specan.report.residual_map import ResidualMap, axis_text

_LINE = 'style="white-space:nowrap"'
# Violet to orange, by C. Brewer (PuOr): distinguished by every kind of colour vision.
_DIVERGING = (
    "#2d004b", "#542788", "#8073ac", "#b2abd2", "#d8daeb", "#f7f7f7", "#fee0b6", "#fdb863", "#e08214", "#b35806",
    "#7f3b08",
)  # fmt: skip


def failing_map(found: ResidualMap | None, known: bool) -> str:
    """Left-out z of every pair of levels as coloured cells; framed where it is significant."""
    if found is None:
        return "<p>No operating variable varies: there is no map.</p>"
    title = f"violet: low, orange: high, full colour at {found.end:g}; "
    title += "framed: significant" if known else "relative to 1 %"
    if known and not found.significant.any():
        title = "no significant deviation of the model"
    across, up = (axis_text(name, found.variables) for name in (found.across, found.up))
    lines = []
    for i in reversed(range(len(found.rows))):
        cells = "".join(_cell(found, i, j, across, up) for j in range(len(found.columns)))
        lines.append(f"<tr><th {_LINE}>{escape(found.rows[i])}</th>{cells}</tr>")
    style = "writing-mode:vertical-rl;vertical-align:top;padding:2px 0"
    foot = "".join(
        f'<td style="border:0"><span style="{style}">{escape(text)}</span></td>' for text in found.columns
    )
    return (
        f"<p><b>Where the model fails</b> ({escape(title)})</p>"
        f'<table style="width:100%;border-spacing:2px;border-collapse:separate;table-layout:fixed">{"".join(lines)}'
        f"<tr><td style='border:0'></td>{foot}</tr></table>{escape(across)}{escape(f'; up: {up}' if up else '')}"
    )


def _cell(found: ResidualMap, i: int, j: int, across: str, up: str) -> str:
    cell = found.blocks[i][j]
    if not cell:
        return '<td style="border:0"></td>'
    worst = max(cell, key=lambda block: abs(block.z))
    colour = _DIVERGING[int(np.clip(round(5 + 5 * worst.z / found.end), 0, 10))]
    frame = "2px solid var(--ink)" if found.significant[i, j] else "1px solid var(--line)"
    place = f"{across} {found.columns[j]}" + (f", {up} {found.rows[i]}" if up else "")
    text = f"{place}: left-out z {worst.z:+.1f}, {worst.text} ({worst.n} values)"
    style = f"background:{colour};border:0;height:18px;print-color-adjust:exact;outline:{frame}"
    return f'<td title="{escape(text)}" style="{style}"></td>'
