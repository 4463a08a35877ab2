"""What every verb prints: a readable table, or JSON and nothing else on standard output."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

_COLLECTED = "specan_cli.collected"
# What makes rich treat standard output as a terminal, or of another width.
_OF_A_TERMINAL = (
    "FORCE_COLOR",
    "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
    "JUPYTER_COLUMNS",
    "JUPYTER_LINES",
)
_WIDTH = "80"  # of a file or a pipe


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
    """Print a table that fits the terminal; numbers to the right, NO_COLOR respected."""
    rows = [["" if cell is None else cell for cell in row] for row in rows]
    if (lines := plain_lines(title, header, rows)) is not None:
        click.echo("\n".join(lines))
        return
    from rich.console import Console
    from rich.table import Table

    class Sheet(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich would end the process itself

    sheet = Table(title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(header):
        numeric = _numeric(rows, index)
        # Names of effects and parameters are copied into commands: they are never broken over two lines.
        words = [word for row in rows for word in str(row[index]).split()] if index == 0 else []
        least = max(map(len, words), default=1)
        sheet.add_column(
            name, justify="right" if numeric else "left", overflow="fold", min_width=min(least, 48)
        )
    from rich.text import Text

    for row in rows:
        # Text, not markup: a channel may be called "[bold]".
        sheet.add_row(*(Text(str(cell)) for cell in row))
    Sheet(soft_wrap=False).print(sheet)


def plain_lines(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str] | None:
    """The lines that rich prints into a file or a pipe, without loading it; None where it is more than that.

    It is more for a terminal, for a table that does not fit in, and for letters that are not one column wide.
    """
    if sys.stdout.isatty() or any(name in os.environ for name in _OF_A_TERMINAL):
        return None
    if any(mark in name for name in (title, *header) for mark in "[:\\"):  # rich takes it for markup
        return None
    cells = [list(header), *([str(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    width = sum(widths) + 2 * (len(widths) - 1)
    every = [title, *(cell for row in cells for cell in row)]
    columns = os.environ.get("COLUMNS", "")
    if width > int(columns if columns.isdecimal() else _WIDTH) or len(title) > width:
        return None
    if not all(cell.isascii() and cell.isprintable() and cell == cell.strip() for cell in every):
        return None
    right = [_numeric(rows, index) for index in range(len(header))]
    lines = [
        "  ".join(
            cell.rjust(w) if to_the_right else cell.ljust(w)
            for cell, w, to_the_right in zip(row, widths, right, strict=True)
        )
        for row in cells
    ]
    return [title.ljust(width), *lines] if title else lines


def _numeric(rows: Sequence[Sequence[Any]], index: int) -> bool:
    return bool(rows) and all(isinstance(row[index], (int, float)) or row[index] == "" for row in rows)


def say(text: str) -> None:
    """A line of progress or warning, on standard error."""
    click.echo(text, err=True)


_QUIET, _VERBOSE = "specan_cli.quiet", "specan_cli.verbose"


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


def is_quiet() -> bool:
    """Whether notes and progress are unwanted."""
    return bool(_asked(_QUIET))


def is_verbose() -> bool:
    """Whether more is to be said."""
    return bool(_asked(_VERBOSE))


def _asked(key: str) -> Any:
    context = click.get_current_context(silent=True)
    return context is not None and context.meta.get(key, False)


def _keep(context: click.Context, option: click.Parameter, value: bool) -> None:
    context.meta[_QUIET if option.name == "quiet" else _VERBOSE] = value
    if value and option.name == "verbose":
        begun, processor = time.perf_counter(), time.process_time()

        def took() -> None:
            passed, used = time.perf_counter() - begun, time.process_time() - processor
            click.echo(f"{context.info_name}: {passed:.2f} s, {used:.2f} s of processor time", err=True)

        context.call_on_close(took)
