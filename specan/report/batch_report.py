"""A batch on one page that a colleague can read: settings, figures, what was skipped and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from specan import __version__
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.run import BatchReport
from specan.analysis.batch.settings import BatchSettings
from specan.io.results_text import cells, plain
from specan.report.figure_style import level_limits, micro, with_gaps
from specan.report.html_page import bullets, page, picture, table
from specan.report.panels import Curve, Drawing, Panel, figure_of_panels, grouped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_FIGURES = 24  # of files of noise; the tables hold the others
MOST_ROWS = 200  # of a table on the page
SINES = ("file", "channel", "frequency_hz", "rms", "unit", "level_dB", "phase_deg", "flags")
OTHERS = ("file", "channel", "band_hz", "rms", "unit", "level_dB", "flags")
HEADERS = {
    "frequency_hz": "frequency / Hz", "level_dB": "level / dB", "phase_deg": "phase / degrees", "band_hz": "band / Hz",
}  # fmt: skip
Row = Mapping[str, str]


def batch_report(report: BatchReport, settings: BatchSettings) -> str:
    """The page as HTML, from the tables that a batch has written.

    Parameters
    ----------
    report : BatchReport
        As `run_batch` gives it.
    settings : BatchSettings
        Those of the batch.
    """
    tables = {path.name: path for path in report.tables}
    where = tables["bands.txt"].absolute().parent.name
    counts = {kind: len(report.of_kind(kind)) for kind in ("done", "aside", "failed")}
    parts = [
        f"<h1>Batch: {escape(where)}</h1>",
        f'<p class="verdict">{counts["done"]} analysed, {counts["aside"]} skipped, '
        f"{counts['failed']} failed.</p>",
        *(f"<p>Calibration: {escape(line)}.</p>" for line in report.calibration),
        *(_noise(tables["noise.txt"], report) if "noise.txt" in tables else []),
        *(_bands(tables["bands.txt"], report) if "bands.txt" in tables else []),
        *(_listing(tables["sine.txt"], "Sines", SINES) if "sine.txt" in tables else []),
        *(_listing(tables["other.txt"], "Neither sine nor noise", OTHERS) if "other.txt" in tables else []),
        *_skipped(report),
        "<h2>To reproduce these numbers</h2>",
        f"<p>specan {escape(__version__)}, settings {escape(settings.fingerprint)}:</p>",
        table(["setting", "value"], _flat(settings.model_dump(mode="json"))),
        "<p>The full tables:</p>",
        bullets(path.name for path in report.tables),
    ]
    return page(f"Batch: {where}", parts)


def _rows(path: Path) -> Iterator[Row]:
    """Lines of a result table, read one after the other: a table may be long."""
    with path.open(encoding="utf-8", newline="\n") as file:
        lines = ([plain(cell) for cell in cells(line)] for line in file if not line.startswith("#"))
        header = next(lines, [])
        for row in lines:
            yield dict(zip(header, row))


def _listing(path: Path, title: str, columns: Sequence[str]) -> list[str]:
    shown = [[row[c] for c in columns] for row in islice(_rows(path), MOST_ROWS + 1)]
    if not shown:
        return []
    more = f"<p>More rows are in {path.name}.</p>" if len(shown) > MOST_ROWS else ""
    rows = table([HEADERS.get(c, c) for c in columns], shown[:MOST_ROWS])
    return [f"<h2>{title}</h2>", f"<details><summary>Table</summary>{rows}{more}</details>"]


def _noise(path: Path, report: BatchReport) -> list[str]:
    parts: list[str] = []
    columns = ("frequency_hz", "magnitude", "phase_deg", "coherence")
    for name, channels in islice(_by_file(path, columns), MOST_FIGURES):
        result = next((r for r in report.results if r.label == name), None)
        figure = transfer_figure(name, channels, *_units_and_facts(result, path.name))
        parts.append(picture(figure, f"transfer functions of {name}"))
    return ["<h2>Transfer functions</h2>", *parts] if parts else []


def _bands(path: Path, report: BatchReport) -> list[str]:
    parts: list[str] = []
    for name, channels in islice(_by_file(path, ("band_hz", "level_dB")), MOST_FIGURES):
        result = next((r for r in report.results if r.label == name), None)
        figure = band_figure(name, channels, *_units_and_facts(result, path.name))
        parts.append(picture(figure, f"band levels of {name}"))
    return ["<h2>Band levels</h2>", *parts] if parts else []


def _units_and_facts(result: FileResult | None, table: str) -> tuple[Mapping[str, str], Sequence[str]]:
    """Units of the channels, and what the headings of the tables say of the file: its excitation and description."""
    if result is None:
        return {}, ()
    told = ("Description: ", "excitation ") if table == "bands.txt" else ("Description: ",)
    facts = [line.removeprefix("Description: ") for line in result.about if line.startswith(told)]
    if table == "noise.txt":
        facts += [line for line in result.about if " over " in line and " blocks, " in line]
    return result.units.get(table, {}), facts


def _by_file(path: Path, columns: Sequence[str]) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Channels of one file after the other, each an array (columns, rows); the tables are sorted by file."""
    name, channels = None, dict[str, list[list[float]]]()
    for row in _rows(path):
        if row["file"] != name:
            if name is not None and channels:
                yield name, {c: np.array(v).T for c, v in channels.items()}
            name, channels = row["file"], {}
        values = [_number(row[c]) for c in columns]
        if values[0] == values[0]:  # rows of totals have no frequency
            channels.setdefault(row["channel"], []).append(values)
    if name is not None and channels:
        yield name, {c: np.array(v).T for c, v in channels.items()}


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return float("nan")


def transfer_figure(
    name: str, channels: Mapping[str, np.ndarray], units: Mapping[str, str], facts: Sequence[str]
) -> Figure:
    """Magnitudes with one pair of axes a unit, phases, and the coherence; from rows of ``noise.txt``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        level = [20 * np.log10(values[1]) for values in channels.values()]
    panels = _level_panels(
        channels, [values[0] for values in channels.values()], level, units, "Magnitude / dB re 1 {}", 100.0
    )
    phases = tuple(Curve(n, values[0], with_gaps(values[2])) for n, values in channels.items())
    coherences = tuple(Curve(n, values[0], values[3]) for n, values in channels.items())
    panels.append(Panel("Phase / degrees", phases, share=2, leads=False, phase=True, kind="thin"))
    panels.append(Panel("Coherence", coherences, (0.0, 1.05), share=1, leads=False))
    return figure_of_panels(Drawing(name, tuple(facts), "Frequency / Hz", tuple(panels), hertz=True))


def band_figure(
    name: str, channels: Mapping[str, np.ndarray], units: Mapping[str, str], facts: Sequence[str]
) -> Figure:
    """Band levels with one pair of axes a level reference; from rows of ``bands.txt``."""
    edges, level = [_edges(values[0]) for values in channels.values()], [v[1] for v in channels.values()]
    panels = _level_panels(channels, edges, level, units, "Level / dB re {}", 90.0)
    return figure_of_panels(Drawing(name, tuple(facts), "Frequency / Hz", tuple(panels), hertz=True))


def _level_panels(
    names: Iterable[str],
    xs: Sequence[np.ndarray],
    levels: Sequence[np.ndarray],
    units: Mapping[str, str],
    label: str,
    dynamics_dB: float,
) -> list[Panel]:
    """A panel for each unit, or reference of levels."""
    curves = [Curve(name, x, y) for name, x, y in zip(names, xs, levels, strict=True)]
    return [
        Panel(
            label.format(micro(unit)) if unit else label.partition(" re ")[0],
            tuple(curves[k] for k in rows),
            level_limits(np.concatenate([curves[k].y for k in rows]), dynamics_dB, above=4.0),
        )
        for unit, rows in grouped(units.get(curve.name, "") for curve in curves).items()
    ]


def _edges(mid_hz: np.ndarray) -> np.ndarray:
    """Where steps change: between neighbouring bands on a logarithmic axis."""
    inner = np.sqrt(mid_hz[1:] * mid_hz[:-1])
    if not inner.size:
        return np.array([mid_hz[0] / 1.2, mid_hz[0] * 1.2])
    return np.concatenate([[mid_hz[0] ** 2 / inner[0]], inner, [mid_hz[-1] ** 2 / inner[-1]]])


def _skipped(report: BatchReport) -> list[str]:
    rows = [[r.label, "", r.kind, r.reason] for r in report.results if r.kind != "done"]
    rows += [
        [r.label, channel, "aside", why] for r in report.results for channel, why in r.set_aside if channel
    ]
    if not rows:
        return []
    return ["<h2>Skipped</h2>", table(["file", "channel", "kind", "reason"], rows)]


def _flat(content: Mapping[str, Any], before: str = "") -> list[list[Any]]:
    rows: list[list[Any]] = []
    for name, value in content.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{before}{name}.")
        elif value not in (None, [], ""):
            rows.append([f"{before}{name}", value])
    return rows
