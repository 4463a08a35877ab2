"""``specan study diagnose``: which physical effect is missing."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.figure_output import plot_option
from specan_cli.output import emit_json, say, table
from specan_cli.output_file import Verb
from specan_cli.study_output import open_study, probability, study_options

if TYPE_CHECKING:
    from specan.study.verdict import Diagnosis, Ranked

SHOWN = 10  # rows of the table of candidates
DETAILED = 3  # of them with their parameters

VERDICTS = {
    "effect": "Missing: {names}.",
    "group": "Missing: {names}; these data cannot tell which.",
    "nothing-missing": "Nothing is missing, as far as these data can tell.",
    "unknown-effect": "Something is missing that is not on the list of effects.",
    "cannot-tell": "These data cannot tell.",
}


@click.command("diagnose", cls=Verb)
@study_options
@plot_option("the candidates in their order")
@click.option("--bootstrap", is_flag=True, help="Family-wise probabilities by simulation (slower).")
def command(
    directory: Path, effects: tuple[Path, ...], as_json: bool, plot: Path | None, bootstrap: bool
) -> None:
    """Find out which effect the model of DIR is missing. Held-out data are not looked at.

    \b
    specan study diagnose my_study --plot ranking.png
    """
    study = open_study(directory, effects)
    progress = say if sys.stderr.isatty() else None
    found = study.diagnose(bootstrap=bootstrap, progress=progress)
    if as_json:
        emit_json(found.to_json())
    else:
        _print(found, directory)
    if plot is not None:
        from specan.report.figure_style import save_figure
        from specan.report.figures_diagnosis import figure_diagnosis

        save_figure(figure_diagnosis(found), plot)


def _print(found: Diagnosis, directory: Path) -> None:
    names = " or ".join(" with ".join(members) for members in found.alternatives)
    click.echo(VERDICTS[found.verdict].format(names=names))
    click.echo(f"{found.reason[:1].upper()}{found.reason[1:]}.")
    if found.unknown_possible and found.alternatives:
        click.echo("One unknown effect would explain the data as well.")
    if found.residual_law is not None:
        click.echo(f"What is left goes like {found.residual_law.text.lstrip('~ ')}.")
    if found.lack_of_fit is not None:
        fit = found.lack_of_fit
        click.echo(
            f"The model as it is: reduced chi-square {fit.reduced_chi2:.2f}, {probability(fit.p_value)}, "
            f"{fit.n_effective:.0f} independent values; "
            f"model discrepancy {found.model_discrepancy_percent:g} % allowed for."
        )
    if found.ranking:
        click.echo("")
        table(
            "What was tried, the likeliest first",
            ["effects", "delta BIC", "p", "CV gain", "error after", ""],
            [_row(r) for r in found.ranking[:SHOWN]],
        )
        click.echo("")
        for ranked in found.ranking[:DETAILED]:
            click.echo(f"{' + '.join(ranked.effects)}:")
            for name, p in ranked.parameters.items():
                click.echo(f"  {name} = {_value(p)}")
    _print_power(found)
    for effect, why in found.not_testable.items():
        click.echo(f"Not testable: {effect} {why}")
    if found.next_measurement:
        click.echo("\nWhat would decide:")
        for row in found.next_measurement:
            click.echo(f"  {row['text']}")
    if found.verdict in ("effect", "group"):
        for use in _uses(found.ranking[0]):
            shown = f'"{use}"' if " " in use else use
            click.echo(f"\nTry it: specan study add {directory} {shown}")


def _uses(ranked: Ranked) -> list[str]:
    """Effects with their places, as ``study add`` takes them."""
    placed = [f"{name}@{place}" for name in ranked.effects for place in ranked.at.get(name, ())]
    return [*placed, *(name for name in ranked.effects if name not in ranked.at)]


def _row(ranked: Ranked) -> list[Any]:
    remark = "" if ranked.plausible else "implausible"
    if ranked.at_bound:
        remark = f"{remark}, at bound".lstrip(", ")
    return [
        " + ".join(ranked.effects), f"{ranked.delta_bic:.1f}", f"{ranked.p_value:.1g}",
        f"{ranked.held_out_gain:.1f}", f"{ranked.error_after:.3g}", remark,
    ]  # fmt: skip


def _value(p: Mapping[str, Any]) -> str:
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    return f"{p['value']:.3g} ({p['low']:.3g} to {p['high']:.3g}){unit}"


def _print_power(found: Diagnosis) -> None:
    seen = {n: v for n, v in found.smallest_visible.items() if v is not None}
    hidden = [n for n, v in found.smallest_visible.items() if v is None]
    if seen:
        sizes = [
            f"{n} {v['value']:.2g}{'' if v['unit'] == '1' else ' ' + v['unit']}" for n, v in seen.items()
        ]
        click.echo("\nSmallest that these data would show: " + ", ".join(sizes))
    if hidden:
        click.echo("Invisible at any plausible size: " + ", ".join(hidden))
