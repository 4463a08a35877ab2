"""``specan study next``: which measurement would decide."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb, emit_json, plot_option
from specan_cli.study import open_study, study_options, told


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
    found = study.diagnose(progress=told())
    rows = found.to_json()["next_measurement"]
    if as_json:
        emit_json({"verdict": found.verdict, "next_measurement": rows})
    elif not rows:
        click.echo("Nothing is left to decide: no two explanations compete for these data.")
        if study.model.words.what_else:
            click.echo(study.model.words.what_else.format(study=directory))
    else:
        for number, row in enumerate(rows, 1):
            click.echo(f"{number}. {row['text']}")
    if plot is not None:
        from specan.report.figure_style import save_figure
        from specan.report.figures_diagnosis import figure_next

        save_figure(figure_next(rows), plot)
