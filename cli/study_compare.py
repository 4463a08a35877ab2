"""``specan study compare``: fit the model and see where it fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import Verb, plot_option
from specan_cli.study import study_options

if TYPE_CHECKING:
    from specan.study.localisation.frf_errors import FrfErrors
    from specan.study.study import Comparison, Study


@click.command("compare", cls=Verb)
@study_options
@plot_option("measured and model")
@click.option("--channel", metavar="NAME", help="Recordings: the channel whose curves --plot shows.")
@click.option("--accept-changes", is_flag=True, help="Continue although measured files have changed.")
def command(
    directory: Path,
    effects: tuple[Path, ...],
    as_json: bool,
    plot: Path | None,
    channel: str | None,
    accept_changes: bool,
) -> None:
    """Fit the parameters that the model of DIR has and show where it fails.

    Held-out data are not looked at.

    \b
    specan study compare my_study --plot compare.png
    specan study compare my_room --plot mic_7.png --channel "Mic 7"
    """
    from specan_cli.output import emit_json, say
    from specan_cli.study import open_study

    study = open_study(directory, effects, accept_changes)
    found = study.compare()
    kept = study.record_changes()
    if kept is not None:
        say(f"The study was changed since its last step: kept as step {kept.step}.")
    recorded = study.frf_errors()
    if plot is not None:
        from specan.report.figure_style import save_figure
        from specan.report.figures_study import figure_comparison

        save_figure(figure_comparison(study, channel), plot)
    if as_json:
        recordings = {"recordings": [one.as_dict() for one in recorded]} if recorded else {}
        emit_json(_content(study, found) | recordings)
    else:
        _print(study, found)
        _print_recordings(study, recorded)


def _content(study: Study, found: Comparison) -> dict[str, Any]:
    known, best, where = study.data.known, found.fit, found.localisation
    return {
        "model_effects": list(study.model_effects),
        "errors": [e.as_dict() for e in found.errors],
        "reduced_chi2": best.reduced_chi2 if known else None,
        "p_value": best.p_value if known else None,
        "n_effective": best.n_effective,
        "dof": best.dof,
        "model_discrepancy_percent": study.data.discrepancy_percent,
        "parameters": found.parameters,
        "at_bound": list(best.at_bound),
        "fails_at": [b.as_dict() for b in where.fails_at] if where else [],
        "trends": [
            {"variable": t.variable, "p_value": t.p_value, "significant": t.significant, "text": t.sentence}
            for t in (where.trends if where else ())
        ],
        "sentences": where.sentences() if where else [],
        "assumptions": list(study.data.statements),
        "mistaken_set_up": study.mistaken_set_up.text,
    }


def _print(study: Study, found: Comparison) -> None:
    from specan.study.diagnose import untestable
    from specan.study.selection.refits import Refit
    from specan_cli.output import table
    from specan_cli.study import error_table, parameter_table, probability

    best, where = found.fit, found.localisation
    click.echo("Model: " + (", ".join(study.model_effects) or study.model.words.ideal))
    error_table("\nError on the fitted data", found.errors)
    click.echo("")
    parameter_table(found.parameters)
    if where is None:
        return
    spent = " beside those of the repeats" if study.problem.pure_error_dof else ""
    click.echo(
        f"\nReduced chi-square {best.reduced_chi2:.2f} ({best.n_effective:.0f} independent values, "
        f"{best.dof - study.problem.pure_error_dof:.0f} degrees of freedom{spent}), {probability(best.p_value)}; "
        f"model discrepancy of {study.data.discrepancy_percent:g} % of the {_of_what(study)} allowed for"
    )
    verdict = "The model fits." if best.p_value > 1e-3 else "The model does not fit."
    outside = [name for name, p in found.parameters.items() if not p["plausible"]]
    why = untestable(Refit(frozenset(), study.problem, best))
    if why:
        verdict = f"These data cannot tell whether the model fits: {why}."
    elif best.p_value > 1e-3 and outside:
        verdict = f"The model fits, but only with values outside what is known: {', '.join(outside)}."
    elif best.p_value > 1e-3 and (where.fails_at or any(t.significant for t in where.trends)):
        verdict = "The model fits as a whole, and yet:"
    click.echo(verdict)
    if study.mistaken_set_up.text:
        click.echo(f"Check the set-up: {study.mistaken_set_up.sentence}.")
    if study.shown is not study.best:
        click.echo(
            f"It fits best, reduced chi-square {study.best.reduced_chi2:.2f}, with instruments far beyond their "
            "certificates; it is shown with instruments nearer to these."
        )
    for text in where.sentences():
        click.echo(f"  {text}")
    blocks = where.fails_at[:8]
    if blocks:
        click.echo("")
        table(
            "Where, the clearest first",
            ["conditions", "values", "z", "p", ""],
            [
                [
                    b.short_place,
                    b.n,
                    f"{b.z:+.1f}",
                    f"{b.p_value:.1g}",
                    ", ".join(filter(None, (b.text, b.most_at))),
                ]
                for b in blocks
            ],
        )
    if best.p_value <= 1e-3:
        click.echo(f"\nAsk what is missing: specan study diagnose {study.directory}")


def _of_what(study: Study) -> str:
    return str(study.model.words.discrepancy_of)


def _print_recordings(study: Study, recorded: Sequence[FrfErrors]) -> None:
    from specan.study.localisation.frf_errors import summary
    from specan_cli.output import table

    receivers = study.model.receivers
    names = receivers.plural if receivers else "channels"
    for one in recorded:
        click.echo("")
        table(
            f"{one.recording}: model over measured, all {names}",
            ["Hz", "dB, mean", "dB, range", "|deg|, mean", "CSAC", "the clearest, dB (95 %)"],
            summary([one]),
        )
        frac = ", ".join(f"{c} {f:.4f}" for c, f in zip(one.channels, one.frac, strict=True) if f == f)
        click.echo(f"FRAC: {frac}")
    if recorded:
        click.echo("(FRAC and CSAC see less than chi-square: they are shown, and decide nothing.)")
