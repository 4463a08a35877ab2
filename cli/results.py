"""What the verbs with a result share: the options for where it goes, and delivering it there."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from specan_cli.output import emit_json
from specan_cli.output_file import OutputFile, say_written, to_standard_output
from specan_cli.recording_input import opening_options


def result_options(what: str = "everything") -> Callable[[Any], Any]:
    """The options ``-o`` and ``--json``, and those of opening a recording, which come as one dict `opening`."""

    def add(command: Callable[..., int]) -> Any:
        @wraps(command)
        def gathered(
            channel_table: Path | None, calibration: Path | None, sampling_rate: float | None, **options: Any
        ) -> int:
            opening = {
                "channel_table": channel_table,
                "calibration": calibration,
                "sampling_rate": sampling_rate,
            }
            return command(opening=opening, **options)

        made = opening_options(gathered)
        made = click.option("--json", "as_json", is_flag=True, help=f"Print {what} as JSON.")(made)
        return click.option("-o", "--output", type=OutputFile(), help=f"Write {what} as text.")(made)

    return add


def deliver(
    plot: Path | None,
    output: Path | None,
    as_json: bool,
    *,
    draw: Callable[[Path], None],
    write: Callable[[Path], None],
    content: Callable[[], Any],
    show: Callable[[], None],
) -> None:
    """Draw and write a result where that was asked for, then print it: as JSON, or to read.

    Nothing is printed to read where the text itself goes to standard output.
    """
    if plot is not None:
        draw(plot)
    if output is not None:
        write(output)
    if as_json:
        emit_json(content())
    elif not to_standard_output(output):
        show()
        say_written(plot, output)
