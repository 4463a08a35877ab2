"""A batch on one page that a colleague can read: settings, figures, what was skipped and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from specan import __version__
from specan.analysis.batch.run import BatchReport
from specan.analysis.batch.settings import BatchSettings
from specan.io.text_cell import cells, plain
from specan.report.figure_style import line_styles, octave_axis
from specan.report.html_page import bullets, page, picture, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_FIGURES = 24  # of files of noise; the tables hold the others
MOST_ROWS = 200  # of a table on the page
SINES = ("file", "channel", "frequency_hz", "rms", "unit", "level_dB", "phase_deg", "flags")
OTHERS = ("file", "channel", "band_hz", "rms", "unit", "level_dB", "flags")
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
    counts = {kind: len(report.of_kind(kind)) for kind in ("done", "aside", "failed")}
    parts = [
        "<h1>Batch</h1>",
        f'<p class="verdict">{counts["done"]} analysed, {counts["aside"]} put aside, '
        f"{counts['failed']} failed.</p>",
        *(_listing(tables["sine.txt"], "Sines", SINES) if "sine.txt" in tables else []),
        *(_noise(tables["noise.txt"]) if "noise.txt" in tables else []),
        *(_bands(tables["bands.txt"]) if "bands.txt" in tables else []),
        *(_listing(tables["other.txt"], "Neither sine nor noise", OTHERS) if "other.txt" in tables else []),
        *_skipped(report),
        "<h2>To have these numbers again</h2>",
        f"<p>specan {escape(__version__)}, settings {escape(settings.fingerprint)}:</p>",
        table(["setting", "value"], _flat(settings.model_dump(mode="json"))),
        "<p>The full tables:</p>",
        bullets(path.name for path in report.tables),
    ]
    return page("Batch", parts)


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
    parts = [f"<h2>{title}</h2>", table([c.replace("_", " ") for c in columns], shown[:MOST_ROWS])]
    return [*parts, f"<p>More rows stand in {path.name}.</p>"] if len(shown) > MOST_ROWS else parts


def _noise(path: Path) -> list[str]:
    parts: list[str] = []
    for name, channels in islice(
        _by_file(path, ("frequency_hz", "magnitude", "phase_deg", "coherence")), MOST_FIGURES
    ):
        parts += [
            f"<h3>{escape(name)}</h3>",
            picture(_transfer_figure(channels), f"transfer functions of {name}"),
        ]
    return ["<h2>Transfer functions</h2>", *parts] if parts else []


def _bands(path: Path) -> list[str]:
    parts: list[str] = []
    for name, channels in islice(_by_file(path, ("band_hz", "level_dB")), MOST_FIGURES):
        parts += [f"<h3>{escape(name)}</h3>", picture(_band_figure(channels), f"band levels of {name}")]
    return ["<h2>Band levels</h2>", *parts] if parts else []


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
        return float(text)
    except ValueError:
        return float("nan")


def _transfer_figure(channels: Mapping[str, np.ndarray]) -> Figure:
    figure, axes = _sheet(3, [3, 2, 1])
    for values, style in zip(channels.values(), line_styles()):
        with np.errstate(divide="ignore", invalid="ignore"):
            level = 20 * np.log10(values[1])
        jumps = np.abs(np.diff(values[2], prepend=values[2][0])) > 180
        for one, shown in zip(axes, (level, np.where(jumps, np.nan, values[2]), values[3])):
            one.plot(values[0], shown, linewidth=0.9, **style)
    axes[0].set_ylabel("Magnitude / dB")
    axes[1].set(ylabel="Phase / degrees", ylim=(-190, 190), yticks=range(-180, 181, 90))
    axes[2].set(ylabel="Coherence", ylim=(0, 1.05))
    return _finished(figure, axes, channels)


def _band_figure(channels: Mapping[str, np.ndarray]) -> Figure:
    figure, axes = _sheet(1, [1])
    for values, style in zip(channels.values(), line_styles()):
        axes[0].plot(
            values[0], np.where(np.isfinite(values[1]), values[1], np.nan), drawstyle="steps-mid", **style
        )
    axes[0].set_ylabel("Level / dB")
    return _finished(figure, axes, channels)


def _sheet(count: int, heights: Sequence[float]) -> tuple[Figure, list[Any]]:
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    figure = Figure(figsize=(8.5, 2.2 + 1.6 * count), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False, height_ratios=list(heights))[:, 0]
    return figure, list(axes)


def _finished(figure: Figure, axes: Sequence[Any], channels: Mapping[str, np.ndarray]) -> Figure:
    frequencies = np.concatenate([values[0] for values in channels.values()])
    positive = frequencies[frequencies > 0]
    octave_axis(axes[-1], float(positive.min()), max(float(positive.max()), 1.01 * float(positive.min())))
    axes[-1].set_xlabel("Frequency / Hz")
    for one in axes:
        one.grid(True, color="0.9")
    names = [name.replace("$", r"\$") for name in channels]
    figure.legend(
        axes[0].get_lines(), names, loc="outside right upper", fontsize="x-small", ncols=1 + len(names) // 40
    )
    return figure


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
