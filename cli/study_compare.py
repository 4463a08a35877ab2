"""``specan study compare``: fit the model and see where it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from specan_cli.options import opt
from specan_cli.output import (
    TABLES,
    Delivery,
    OutputFile,
    decimal_option,
    plot_option,
    say,
    show_apart,
)
from specan_cli.study import probability, study_verb

if TYPE_CHECKING:
    from specan.study.comparison import Comparison
    from specan.study.estimation.fit import Fit
    from specan.study.localisation.localise import Localisation
    from specan.study.study import Study


FITS = 1e-3  # probability of a worse fit of a true model
BLOCKS = 8  # of conditions where it fails


@study_verb("compare")
@plot_option("measured and model")
@opt("-o --output", OutputFile(*TABLES, ".json"), "Write every value: measured, model, residual.")
@decimal_option()
@opt("--channel", None, "Recordings: the channel whose curves --plot shows.", "NAME")
@opt("--accept-changes", bool, "Continue although measured files have changed.")
def command(study: Study, deliver: Delivery, channel: str | None) -> None:
    """Fit the parameters of DIR's model and show where it fails.

    Held-out data are not used.

    \b
    specan study compare my_study --plot compare.png -o rows.csv
    specan study compare my_room --plot mic_7.png --channel "Mic 7"
    """
    found = study.compare()
    kept = study.record_changes()
    if kept is not None:
        say(f"The study was changed since its last step: kept as step {kept.step}.")
    deliver.draw(found, channel=channel)
    if deliver.output is not None:
        from specan.io.export_file import write_frame

        write_frame(found.residuals, deliver.output, [f"compare {study.directory.name}"], deliver.decimal)

    def show() -> None:
        from specan.report import study_sheets

        _print(study, found)
        show_apart(*(study_sheets.bands(one, one.plural) for one in study.frf_errors()))

    deliver.put_out(found, show)


def _print(study: Study, found: Comparison) -> None:
    from specan.report import study_sheets

    click.echo("Model: " + (", ".join(study.model_effects) or study.model.words.ideal))
    gains = [study_sheets.gains(one, found.errors[0].unit) for one in found.path_gains]
    errors = study_sheets.errors(found.errors, "Error on the fitted data")
    show_apart(errors, *gains, study_sheets.parameters(found.parameters))
    where = found.localisation
    if where is None:
        return
    _print_fit(study, found.fit)
    click.echo(_verdict(study, found, where))
    if study.mistaken_set_up.text:
        click.echo(f"Check the set-up: {study.mistaken_set_up.sentence}.")
    if study.shown is not study.best:
        click.echo(
            f"The best fit (reduced chi-square {study.best.reduced_chi2:.2f}) needs instrument errors far beyond their "
            "certificates. Shown is a fit with smaller ones."
        )
    for text in where.sentences():
        click.echo(f"  {text}")
    show_apart(study_sheets.blocks(where.fails_at[:BLOCKS]))
    if found.fit.p_value <= FITS:
        click.echo(f"\nNext: specan study diagnose {study.directory}")


def _print_fit(study: Study, best: Fit) -> None:
    from specan.report.study_words import allowed_for

    spent = " excluding those of the repeats" if study.problem.pure_error_dof else ""
    chi2 = (
        f"Reduced chi-square {best.reduced_chi2:.2f} ({best.n_effective:.0f} independent values, "
        f"{best.dof - study.problem.pure_error_dof:.0f} degrees of freedom{spent}), {probability(best.p_value)}"
    )
    click.echo("\n" + "; ".join(filter(None, (chi2, allowed_for(study)))))


def _verdict(study: Study, found: Comparison, where: Localisation) -> str:
    """Whether the model fits, in a sentence."""
    from specan.study.diagnose import untestable
    from specan.study.selection.refits import Refit

    start = Refit(frozenset(), study.problem, found.fit)
    if why := untestable(start):
        return f"These data cannot tell whether the model fits: {why}."
    if found.fit.p_value <= FITS:
        return "The model does not fit."
    outside = [name for name, p in found.parameters.items() if not p["plausible"]]
    if outside:
        return f"The model fits, but only with values outside their known range: {', and '.join(outside)}."
    if where.fails_at or any(t.significant for t in where.trends):
        return "The model fits overall, but:"
    return "The model fits."
