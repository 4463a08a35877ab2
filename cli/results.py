"""What the verbs with a result share: the options for where it goes, and delivering it there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import emit_json
from specan_cli.output_file import OutputFile, say_written, to_standard_output
from specan_cli.recording_input import opening_options

if TYPE_CHECKING:
    from specan.result import Result


def result_options(what: str = "everything") -> Callable[[Any], Any]:
    """The options ``-o`` and ``--json``, and those of opening a recording, which come as one dict `opening`."""

    def add(command: Callable[..., int]) -> Any:
        made = opening_options(command)
        made = click.option("--json", "as_json", is_flag=True, help=f"Print {what} as JSON.")(made)
        return click.option("-o", "--output", type=OutputFile(), help=f"Write {what} as text.")(made)

    return add


def draw(found: Result, plot: Path | None, **options: Any) -> None:
    """The figure of a result, where one was asked for; see `specan.plot` for the options."""
    if plot is not None:
        import specan

        specan.plot(found, plot, **options)


def deliver(
    found: Result,
    plot: Path | None,
    output: Path | None,
    as_json: bool,
    *,
    write: Callable[[Any, Path], None],
    show: Callable[[], None],
    content: Callable[[], Any] | None = None,
    **drawn: Any,
) -> None:
    """Draw and write a result where that was asked for, then print it: as JSON, or to read.

    Nothing is printed to read where the text itself goes to standard output.
    """
    draw(found, plot, **drawn)
    if output is not None:
        write(found, output)
    if as_json:
        emit_json(found.to_json() if content is None else content())
    elif not to_standard_output(output):
        show()
        say_written(plot, output)


def _checked(context: click.Context, option: click.Parameter, path: Path | None) -> Path | None:
    """A name that cannot be written is told before the work is done."""
    if path is not None:
        from specan.report.figure_style import figure_format

        figure_format(path)
    return path


def plot_option(what: str = "") -> Callable[[Any], Any]:
    """The option ``--plot FILE``."""
    text = f"Draw {what} to a .png, .svg or .pdf." if what else "Draw to a .png, .svg or .pdf."
    return click.option("--plot", type=OutputFile(), callback=_checked, metavar="FILE", help=text)
