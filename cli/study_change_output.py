"""What ``study add`` and ``study drop`` print."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import draw, emit_json, plot_option, table
from specan_cli.study import parameter_table, study_options

if TYPE_CHECKING:
    from specan.study.edit import Change


def change_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Study, effect, reason and figure of a step that changes the model."""
    for decorate in (
        plot_option("measured and model as it is then"),
        click.option("--because", default="", metavar="TEXT", help="Why, for the history."),
        click.argument("effect_name", metavar="EFFECT"),
        study_options,
    ):
        command = decorate(command)
    return command


def show_change(change: Change, as_json: bool, plot: Path | None) -> None:
    """Errors before and after, parameters, remarks; a figure where one was asked for."""
    draw(change, plot)
    before, after = change.before, change.after
    if as_json:
        emit_json(change.to_json())
        return
    rows = [*_rows("fit", "fitted", before, after), *_rows("held_out", "held-out", before, after)]
    table(
        f"Step {after.step}: {after.action} {after.effect}",
        ["data", "observable", "RMS before", "after", "unit", "change"],
        rows,
    )
    chi2 = [(s.reduced_chi2, s.held_out_reduced_chi2) for s in (before, after)]
    if chi2[1][0] is not None:
        text = f"\nReduced chi-square {chi2[0][0]:.2f} -> {chi2[1][0]:.2f} on fitted data"
        if chi2[1][1] is not None:
            text += (
                f", {chi2[0][1]:.2f} -> {chi2[1][1]:.2f} on held-out data (prediction covariance included)"
            )
        click.echo(text)
    click.echo("")
    parameter_table(change.parameters)
    for remark in change.remarks:
        click.echo(f"Note: {remark}")
    click.echo("Model: " + (", ".join(after.model_effects) or change.study.model.words.ideal))


def _rows(key: str, name: str, before: Any, after: Any) -> list[list[Any]]:
    old = {e["observable"]: e for e in before.errors[key]}
    rows = []
    for new in after.errors[key]:
        was = old[new["observable"]]["rms"]
        percent = 100 * (new["rms"] / was - 1) if was > 0 else 0.0
        unit = "" if new["unit"] == "1" else new["unit"]
        rows.append([name, new["observable"], f"{was:.4g}", f"{new['rms']:.4g}", unit, f"{percent:+.0f} %"])
    return rows
