"""``specan study add`` and ``study drop``: change the model, refit, see what the errors do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from specan_cli.options import opt, together
from specan_cli.output import Delivery, plot_option, show_apart, show_sheets, verb
from specan_cli.study import open_study, study_options, study_verb

if TYPE_CHECKING:
    from specan.study.edit import Change
    from specan.study.study import Study


change_options = together(
    click.argument("effect_name", metavar="EFFECT"),
    opt("--because", None, "Reason, kept in the history.", "TEXT", default=""),
    plot_option("measurement and changed model"),
)


@study_verb("add")
@change_options
def add(study: Study, effect_name: str, because: str, deliver: Delivery) -> None:
    """Add EFFECT to the model of DIR and refit: errors before and after, on fitted and on held-out data.

    EFFECT is a name (specan model show NAME lists them), with its place where it acts at one
    (wall-impedance@z1), or a Python file with an effect of your own.

    \b
    specan study add my_study seal-drag --because "idle runs show more drag"
    """
    from specan.study.edit import add_effect

    _show(add_effect(study, effect_name, because), deliver)


@verb("drop")
@study_options
@change_options
def drop(
    directory: Path, effect_name: str, effects: tuple[Path, ...], because: str, deliver: Delivery
) -> None:
    """Remove EFFECT from the model of DIR and refit. The history keeps the earlier steps.

    EFFECT may also be an effect file of the study (my_effect.py): it is then no longer a candidate.

    \b
    specan study drop my_study seal-drag
    """
    from specan.study.edit import drop_effect, drop_effect_file

    if not effect_name.endswith(".py"):
        _show(drop_effect(open_study(directory, effects), effect_name, because), deliver)
        return
    dropped = drop_effect_file(directory, effect_name)
    text = f"{dropped} is removed from the study; the file itself is kept."
    deliver.put_out({"dropped": dropped}, lambda: click.echo(text))


def _show(change: Change, deliver: Delivery) -> None:
    """What the step did, and a figure where one was asked for."""
    deliver.draw(change)
    deliver.put_out(change, lambda: _print(change))


def _print(change: Change) -> None:
    """Errors before and after, parameters, remarks."""
    from specan.report import study_sheets

    before, after = change.before, change.after
    for remark in change.remarks:  # before all that looks like success
        click.echo(f"Note: {remark}")
    show_sheets([study_sheets.change(before, after)])
    kinds = ("fitted data", "held-out data (prediction covariance included)")
    chi2 = ((step.reduced_chi2, step.held_out_reduced_chi2) for step in (before, after))
    told = [f"{old:.2f} -> {new:.2f} on {kind}" for old, new, kind in zip(*chi2, kinds) if new is not None]
    if told:
        click.echo(f"\nReduced chi-square {', '.join(told)}")
    for key, name in (("fit", "fitted"), ("held_out", "held-out")):
        levels = [[e.get("level_dB") for e in s.errors[key]] for s in (before, after)]
        if levels[1] and None not in (levels[0][0], levels[1][0]):
            what = after.errors[key][0].get("level_of", "levels")
            click.echo(f"RMS error of {what}: {levels[0][0]:.2g} -> {levels[1][0]:.2g} dB on {name} data")
    show_apart(study_sheets.parameters(after.parameters))
    click.echo("Model: " + (", ".join(after.model_effects) or change.study.model.words.ideal))
