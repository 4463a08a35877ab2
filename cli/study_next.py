"""``specan study next``: which measurement would decide."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb, draw, emit_json, plot_option
from specan_cli.study import open_study, study_options, told
from specan_cli.study_diagnose import show_next


@click.command("next", cls=Verb)
@study_options
@plot_option("what the rivals expect of each reading")
def command(directory: Path, effects: tuple[Path, ...], as_json: bool, plot: Path | None) -> None:
    """Propose the measurements, within the rig's limits, that best separate what could be missing.

    Of a room these are places for microphones: inside the box, off its walls, off those that are there.

    \b
    specan study next my_study
    """
    study = open_study(directory, effects)
    study.require_uncertainty("next")
    found = study.diagnose(progress=told()).next()
    if as_json:
        emit_json(found.to_json())
    elif found.rows:
        show_next(found.rows)
    else:
        click.echo("Nothing is left to decide: no two explanations compete for these data.")
        if study.model.words.what_else:
            click.echo(study.model.words.what_else.format(study=directory))
    draw(found, plot)
