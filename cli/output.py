"""What every verb puts out: tables or JSON on standard output, notes on standard error, files and figures.

With the options for it: ``-q`` and ``-v``, which every verb has, ``--plot``, and files that are not replaced.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from typing import TYPE_CHECKING, Any
from unicodedata import combining, east_asian_width

import click

if TYPE_CHECKING:
    from specan.result import Sheet

_COLLECTED = "specan_cli.collected"
_WIDTH = 80  # of a file or a pipe
_MANY = 12  # columns of a table that may be split


@contextmanager
def collecting(ctx: click.Context) -> Iterator[list[Any]]:
    """What `emit_json` is given meanwhile is kept here and not printed."""
    found: list[Any] = []
    ctx.meta[_COLLECTED] = found
    try:
        yield found
    finally:
        del ctx.meta[_COLLECTED]


def emit_json(content: Any) -> None:
    """Print `content` as JSON on standard output."""
    ctx = click.get_current_context(silent=True)
    if ctx is not None and _COLLECTED in ctx.meta:
        ctx.meta[_COLLECTED].append(content)
        return
    from specan.result import finite

    click.echo(json.dumps(finite(content), indent=2, ensure_ascii=False))


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Print a table that fits the terminal as far as no word is broken: nothing is cut off at the edge.

    Numbers stand to the right; the header is bold on a terminal. Columns that hold nothing are left out; those of a
    wide table that do not fit stand below the others, behind the first column once more.
    """
    rows = list(rows)
    if title:
        click.echo(title)
    lines = [list(header), *([str("" if cell is None else cell) for cell in row] for row in rows)]
    context = click.get_current_context(silent=True)
    if context is not None and context.params.get("decimal") == ",":
        from specan.io.results_text import with_comma

        lines = [[with_comma(cell) for cell in line] for line in lines]
    width = shutil.get_terminal_size((_WIDTH, 24)).columns
    shown = [k for k in range(len(header)) if len(lines) == 1 or any(line[k] for line in lines[1:])]
    while shown:
        fitting = len(shown)
        while fitting > 2 and len(header) > _MANY and _natural(lines, shown[:fitting]) > width:
            fitting -= 1
        _print_columns(lines, rows, shown[:fitting], width)
        shown = shown[fitting:] and [shown[0], *shown[fitting:]]


def _natural(lines: Sequence[Sequence[str]], columns: Sequence[int]) -> int:
    """Width of some columns with no line folded."""
    widths = column_widths([[line[k] for k in columns] for line in lines], 10**6)
    return sum(widths) + 2 * len(widths) - 2


def _print_columns(
    whole: Sequence[Sequence[str]], given: Sequence[Sequence[Any]], columns: Sequence[int], width: int
) -> None:
    lines = [[line[k] for k in columns] for line in whole]
    rows = [[row[k] for k in columns] for row in given]
    lines = [lines[0], *(line for line in lines[1:] if any(line))]
    right = [
        bool(rows) and all(isinstance(row[k], (int, float)) or row[k] in ("", None) for row in rows)
        for k in range(len(columns))
    ]
    widths = column_widths(lines, width)
    bold = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    for number, line in enumerate(lines):
        folded = [_folded(cell, width) for cell, width in zip(line, widths, strict=True)]
        for parts in zip_longest(*folded, fillvalue=""):
            padded = [
                " " * (width - _length(part)) + part if to_the_right else part + " " * (width - _length(part))
                for part, width, to_the_right in zip(parts, widths, right, strict=True)
            ]
            text = "  ".join(padded).rstrip()
            click.echo(click.style(text, bold=True) if bold and number == 0 else text)


def show_sheets(sheets: Iterable[Sheet]) -> None:
    """Print tables with what is above and below them."""
    for sheet in sheets:
        table(sheet.title, sheet.header, sheet.rows)
        if sheet.below:
            click.echo(sheet.below)


def show_apart(*sheets: Sheet) -> None:
    """Print those tables that have rows, each after a blank line."""
    for sheet in sheets:
        if sheet.rows:
            click.echo()
            show_sheets([sheet])


def column_widths(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Widths of columns two letters apart that fit in, as far as no word is broken: the widest give way first.

    Names of effects and parameters are copied into commands.
    """
    columns = [[line for cell in column for line in cell.split("\n")] for column in zip(*rows, strict=True)]
    widths = [max(map(_length, column)) for column in columns]
    least = [max((_length(w) for cell in c for w in cell.split()), default=0) for c in columns]
    while sum(widths) + 2 * (len(widths) - 1) > width:
        shrinkable = [k for k, size in enumerate(widths) if size > least[k]]
        if not shrinkable:
            break
        widths[max(shrinkable, key=lambda k: widths[k])] -= 1
    return widths


def _folded(cell: str, width: int) -> list[str]:
    lines = cell.split("\n")
    return [
        part
        for line in lines
        for part in (textwrap.wrap(line, width, break_on_hyphens=False) if _length(line) > width else [line])
    ]


def _length(text: str) -> int:
    """Columns of a terminal that a text takes."""
    if text.isascii():
        return len(text)
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


def say(text: str) -> None:
    """A line of progress or warning, on standard error."""
    click.echo(text, err=True)


def note(text: str) -> None:
    """A line that ``-q`` leaves out."""
    if not asked("quiet"):
        say(text)


# --- how much a verb says on standard error -------------------------------------------------------------


def add_options(command: click.Command) -> None:
    """Give a verb ``-q`` and ``-v``, once."""
    if isinstance(command, click.Group) or any(p.name == "quiet" for p in command.params):
        return
    for names, text in (
        (["-q", "--quiet"], "No notes and no progress; warnings and errors only."),
        (["-v", "--verbose"], "Print also what is read and how long it takes."),
    ):
        command.params.append(
            click.Option(names, is_flag=True, expose_value=False, callback=_keep, help=text)
        )


def asked(name: str) -> bool:
    """Whether ``--quiet`` or ``--verbose`` was given."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(f"specan_cli.{name}", False))


def _keep(context: click.Context, option: click.Parameter, value: bool) -> None:
    context.meta[f"specan_cli.{option.name}"] = value
    if value and option.name == "verbose":
        begun, processor = time.perf_counter(), time.process_time()

        def took() -> None:
            passed, used = time.perf_counter() - begun, time.process_time() - processor
            click.echo(f"{context.info_name}: {passed:.2f} s, {used:.2f} s of processor time", err=True)

        context.call_on_close(took)
