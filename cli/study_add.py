"""``specan study add``: add an effect, refit, see what the errors do."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb
from specan_cli.study_change_output import change_options


@click.command("add", cls=Verb)
@change_options
def command(
    directory: Path,
    effect_name: str,
    effects: tuple[Path, ...],
    as_json: bool,
    because: str,
    plot: Path | None,
) -> None:
    """Add EFFECT to the model of DIR and refit: errors before and after, on fitted and on held-out data.

    EFFECT is a name (specan model show NAME lists them), with its place where it acts at one
    (wall-impedance@z1), or a Python file with an effect of your own.

    \b
    specan study add my_study seal-drag --because "idle runs ask for it"
    """
    from specan.study.edit import add_effect
    from specan_cli.study import open_study
    from specan_cli.study_change_output import show_change

    show_change(add_effect(open_study(directory, effects), effect_name, because), as_json, plot)
