"""``specan study drop``: take an effect out again."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb, emit_json
from specan_cli.study_change_output import change_options


@click.command("drop", cls=Verb)
@change_options
def command(
    directory: Path,
    effect_name: str,
    effects: tuple[Path, ...],
    as_json: bool,
    because: str,
    plot: Path | None,
) -> None:
    """Take EFFECT out of the model of DIR and refit. The steps before stay in the history.

    EFFECT may also be an effect file of your own that the study took in (my_effect.py): it is then no candidate
    any more, whether it still works or not.

    \b
    specan study drop my_study seal-drag
    """
    from specan.study.edit import drop_effect, drop_effect_file, is_effect_file
    from specan_cli.study import open_study
    from specan_cli.study_change_output import show_change

    if is_effect_file(directory, effect_name):
        dropped = drop_effect_file(directory, effect_name)
        if as_json:
            emit_json({"dropped": dropped})
        else:
            click.echo(f"{dropped} is no part of the study any more; the file itself stays.")
        return
    show_change(drop_effect(open_study(directory, effects), effect_name, because), as_json, plot)
