"""What every verb prints: a readable table, or JSON and nothing else on standard output."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

_COLLECTED = "specan_cli.collected"


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
    from rich.console import Console
    from rich.table import Table

    class Sheet(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich would end the process itself

    sheet = Table(title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold")
    rows = [["" if cell is None else cell for cell in row] for row in rows]
    for index, name in enumerate(header):
        numeric = bool(rows) and all(isinstance(row[index], (int, float)) or row[index] == "" for row in rows)
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


def say(text: str) -> None:
    """A line of progress or warning, on standard error."""
    click.echo(text, err=True)
