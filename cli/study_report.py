"""``specan study report``: one self-contained page."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.options import opt
from specan_cli.output import OutputFile, Verb, say_written, to_standard_output
from specan_cli.study import open_study, study_options


@click.command("report", cls=Verb)
@study_options
@opt("-o --output", OutputFile(".html", ".htm"), "HTML file to write.", required=True)
def command(directory: Path, effects: tuple[Path, ...], as_json: bool, output: Path) -> None:
    """Write a report of DIR on one page: figures, verdict, history, assumptions.

    The page needs no network and no other file.

    \b
    specan study report my_study -o report.html
    """
    from specan.io.output_file import check_directory, text_file
    from specan.report.study_report import study_report
    from specan_cli.output import emit_json

    check_directory(output)
    page = study_report(open_study(directory, effects))
    with text_file(output) as file:
        file.write(page)
    if as_json:
        emit_json({"report": str(output)})
    elif not to_standard_output(output):
        say_written(output)
