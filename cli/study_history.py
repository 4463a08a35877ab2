"""``specan study history``: the error of every step."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.options import opt
from specan_cli.output import Verb, draw, plot_option


@click.command("history", cls=Verb)
@click.argument("directory", type=click.Path(path_type=Path), metavar="DIR")
@plot_option("the staircase of errors")
@opt("--json as_json", bool, "Print the steps as JSON.")
def command(directory: Path, plot: Path | None, as_json: bool) -> None:
    """Show every step of DIR with its error on fitted and on held-out data.

    \b
    specan study history my_study --plot staircase.png
    """
    from specan.report import study_sheets
    from specan.study.history import History
    from specan.study.study_file import read_study_file
    from specan_cli.output import emit_json, say, show_sheets

    read_study_file(directory)
    history = History(directory)
    for line in history.ignored:
        say(f"Warning: {line}.")
    steps = history.steps
    if as_json:
        emit_json([step.as_dict() for step in steps])
    else:
        names = steps[-1].of_each("fit") if steps else ()
        show_sheets(
            [study_sheets.history(steps, f"{directory}: RMS" + (f" of {', '.join(names)}" if names else ""))]
        )
        if steps:
            click.echo("\nModel: " + (", ".join(steps[-1].model_effects) or "no effects"))
    draw(history, plot)
