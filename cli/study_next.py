"""``specan study next``: which measurement would decide."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb, draw_beside, emit_json, plot_option
from specan_cli.study import open_study, study_options, told
from specan_cli.study_diagnose import show_next


@click.command("next", cls=Verb)
@study_options
@plot_option("what each explanation predicts")
def command(directory: Path, effects: tuple[Path, ...], as_json: bool, plot: Path | None) -> None:
    """Propose the measurements, within the rig's limits, that best distinguish the possible explanations.

    For a room: microphone positions inside it, away from its walls and from the microphones in use.

    \b
    specan study next my_study
    """
    study = open_study(directory, effects)
    study.require_uncertainty("next")
    found = study.diagnose(progress=told()).next()
    if as_json:
        emit_json(found.to_dict())
    elif found.rows:
        show_next(found.rows)
    else:
        click.echo(f"{found.summary()[:1].upper()}{found.summary()[1:]}.")
        if study.model.words.what_else:
            click.echo(study.model.words.what_else.format(study=directory))
    draw_beside(found, plot)
