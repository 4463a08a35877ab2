"""``specan study diagnose``: which physical effect is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from specan_cli.output import Delivery, plot_option, show_apart
from specan_cli.study import probability, show_next, study_verb, told

if TYPE_CHECKING:
    from specan.study.study import Study
    from specan.study.verdict import Diagnosis

SHOWN = 10  # rows of the table of candidates
DETAILED = 3  # of them with their parameters
EXPLANATIONS = 5  # whose probability is told in a sentence
LEAST_PROBABLE = 0.01
PLACES = 4  # where the model fails
BY_PROBABILITY = (
    "(error after: RMS once it is added. probable: among all explanations, nothing missing and something else "
    "included.\nevidence: natural logarithm of the Bayes factor over the current model.)"
)


@study_verb("diagnose")
@plot_option("the candidates in their order")
def command(study: Study, deliver: Delivery) -> None:
    """Find the effect that the model of DIR lacks. Held-out data are not used.

    \b
    specan study diagnose my_study --plot ranking.png
    """
    found = study.diagnose(progress=told())
    deliver.draw_beside(found).put_out(found, lambda: _print(found, study))


def _print(found: Diagnosis, study: Study) -> None:
    from specan.report import study_sheets
    from specan.study.verdict import headline

    click.echo(headline(found))
    if found.reason:
        click.echo(f"{found.reason[:1].upper()}{found.reason[1:]}.")
    if found.error is not None:
        click.echo("\n".join(found.error.sentences))
    _print_probabilities(found)
    for remark in found.remarks:
        click.echo(f"But: {remark}.")
    if found.residual_law is not None:
        click.echo(f"A law of this form would fit better: {found.residual_law['text']}.")
    show_apart(study_sheets.pulls(found.pulls))
    if found.next_measurement:
        click.echo("")
        show_next(found.next_measurement)
    if found.verdict in ("effect", "group") and found.ranking:
        click.echo("")
        for use in found.ranking[0].names:
            shown = f'"{use}"' if " " in use else use
            click.echo(f"Try it: specan study add {study.directory} {shown}")
    if found.verdict == "unknown-effect" and found.residual_law is not None:
        click.echo(f"\nSearch the residuals for a law: specan study propose {study.directory}")
    _print_where(found)
    _print_statistics(found)
    _print_power(found)
    for effect, why in found.not_testable.items():
        click.echo(f"Not testable: {effect} {why}")


def _print_probabilities(found: Diagnosis) -> None:
    """The likeliest explanations; all others together."""
    from specan.study.verdict import percent

    likely = [one for one in found.probabilities[:EXPLANATIONS] if one.probability >= LEAST_PROBABLE]
    if not likely:
        return
    told = [f"{one.spoken} {percent(one.probability)}" for one in likely]
    rest = 1 - sum(one.probability for one in likely)
    told += [f"all others together {percent(rest)}"] if rest >= LEAST_PROBABLE else []
    click.echo(f"How probable, each by itself: {', '.join(told)}.")


def _print_where(found: Diagnosis) -> None:
    """Where the model as it is is off: by how much, and of transfer functions which mode is near."""
    places = [place for place in found.fails_at if place.get("most_at") or found.probabilities][:PLACES]
    if places:
        click.echo("\nWhere the current model fails, most significant first:")
    for place in places:
        near = f", {place['most_at']}" if place.get("most_at") else ""
        click.echo(f"  {place['place']}: {place['text']}{near}")


def _print_statistics(found: Diagnosis) -> None:
    from specan.report import study_sheets

    show_apart(study_sheets.candidates(found.to_dict(), SHOWN, "Effects tested, most likely first"))
    if found.ranking:
        click.echo(BY_PROBABILITY)
        for ranked in found.ranking[:DETAILED]:
            effects = " + ".join(ranked.names)
            click.echo(f"{effects}:")
            for name, p in ranked.parameters.items():
                click.echo(f"  {name.removeprefix(f'{effects}.')} = {study_sheets.value_text(p)}")
    if found.lack_of_fit is not None:
        fit, percent = found.lack_of_fit, found.model_discrepancy_percent
        allowed = f"; model discrepancy {percent:g} % allowed for" if percent else ""
        click.echo(
            f"Current model: reduced chi-square {fit.reduced_chi2:.2f} (1 is expected of a complete model), "
            f"{probability(fit.p_value)} (of a worse fit by chance), {fit.n_effective:.0f} independent values"
            f"{allowed}."
        )


def _print_power(found: Diagnosis) -> None:
    from specan.report import study_sheets

    sheet, hidden = study_sheets.visible(found)
    show_apart(sheet)
    if hidden:
        click.echo("Not detectable at any size in their range: " + ", ".join(hidden))
