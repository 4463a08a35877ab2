"""The steps of ``specan study`` after its beginning: compare, diagnose, propose, add, drop, history, next, report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import opt, together
from specan_cli.output import say, show_apart, show_sheets, table
from specan_cli.study import open_study, study_options, study_verb, told
from specan_cli.verb import TABLES, Delivery, OutputFile, decimal_option, plot_option, verb

if TYPE_CHECKING:
    from specan.study.comparison import Comparison
    from specan.study.edit import Change
    from specan.study.estimation.fit import Fit
    from specan.study.localisation.localise import Localisation
    from specan.study.propose import ProposedLaws
    from specan.study.study import Study
    from specan.study.verdict import Diagnosis


def show_next(rows: Sequence[Mapping[str, Any]]) -> None:
    """What to measure next: a table, one column for each reading; sentences where something else is to be done."""
    from specan.report.study_sheets import readings

    found = [row for row in rows if row["conditions"] and row["predictions"]]
    tabled = [row for row in found if row.get("observable") == found[0].get("observable")]
    if tabled:
        show_sheets([readings(tabled)])
    elif rows:
        click.echo("What to measure next")
    for number, row in enumerate(rows, 1):
        if row not in tabled or not row["separation_sigma"]:
            click.echo(f"{number}. {row['text']}")


FITS = 1e-3  # probability of a worse fit of a true model
BLOCKS = 8  # of conditions where it fails


@study_verb("compare")
@plot_option("measured and model")
@opt("-o --output", OutputFile(*TABLES, ".json"), "Write every value: measured, model, residual.")
@decimal_option()
@opt("--channel", None, "Recordings: the channel whose curves --plot shows.", "NAME")
@opt("--accept-changes", bool, "Continue although measured files have changed.")
def compare(study: Study, deliver: Delivery, channel: str | None) -> None:
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

        _print_comparison(study, found)
        show_apart(*(study_sheets.bands(one, one.plural) for one in found.recorded))

    deliver.put_out(found, show)


def _print_comparison(study: Study, found: Comparison) -> None:
    from specan.report import study_sheets
    from specan.study.diagnose import untestable
    from specan.study.selection.refits import Refit

    click.echo("Model: " + (", ".join(study.model_effects) or study.model.words.ideal))
    gains = [study_sheets.gains(one, found.errors[0].unit) for one in found.path_gains]
    errors = study_sheets.errors(found.errors, "Error on the fitted data")
    show_apart(errors, *gains, study_sheets.parameters(found.parameters))
    where = found.localisation
    if where is None:
        return
    _print_fit(study, found.fit)
    untold = untestable(Refit(frozenset(), study.problem, found.fit))
    click.echo(
        f"These data cannot tell whether the model fits: {untold}." if untold else _verdict(found, where)
    )
    if study.mistaken_set_up.text:
        click.echo(f"Check the set-up: {study.mistaken_set_up.sentence}.")
    if study.shown is not study.best:
        click.echo(
            f"The best fit (reduced chi-square {study.best.reduced_chi2:.2f}) needs instrument errors far beyond their "
            "certificates. The fit that is shown has smaller ones."
        )
    for text in () if untold else where.sentences():
        click.echo(f"  {text}")
    show_apart(study_sheets.blocks(() if untold else where.fails_at[:BLOCKS]))
    if found.fit.p_value <= FITS:
        click.echo(f"\nNext: specan study diagnose {study.directory}")


def _print_fit(study: Study, best: Fit) -> None:
    from specan.report.study_sheets import allowed_for, chance

    spent = " excluding those of the repeats" if study.problem.pure_error_dof else ""
    chi2 = (
        f"Reduced chi-square {best.reduced_chi2:.2f} ({best.n_effective:.0f} independent values, "
        f"{best.dof - study.problem.pure_error_dof:.0f} degrees of freedom{spent}), {chance(best.p_value)}"
    )
    click.echo("\n" + "; ".join(filter(None, (chi2, allowed_for(study)))))


def _verdict(found: Comparison, where: Localisation) -> str:
    """Whether the model fits, in a sentence."""
    if found.fit.p_value <= FITS:
        return "The model does not fit."
    outside = [name for name, p in found.parameters.items() if not p["plausible"]]
    if outside:
        return f"The model fits, but only with values outside their known range: {', and '.join(outside)}."
    if where.fails_at or any(t.significant for t in where.trends):
        return "The model fits overall, but:"
    return "The model fits."


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
def diagnose(study: Study, deliver: Delivery) -> None:
    """Find the effect that the model of DIR lacks. Held-out data are not used.

    \b
    specan study diagnose my_study --plot ranking.png
    """
    found = study.diagnose(progress=told())
    deliver.draw_beside(found).put_out(found, lambda: _print_diagnosis(found, study))


def _print_diagnosis(found: Diagnosis, study: Study) -> None:
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
            f"{study_sheets.chance(fit.p_value)} (of a worse fit by chance), {fit.n_effective:.0f} independent values"
            f"{allowed}."
        )


def _print_power(found: Diagnosis) -> None:
    from specan.report import study_sheets

    sheet, hidden = study_sheets.visible(found)
    show_apart(sheet)
    if hidden:
        click.echo("Not detectable at any size in their range: " + ", ".join(hidden))


@study_verb("propose")
def propose(study: Study, deliver: Delivery) -> None:
    """Search the residuals of DIR for laws, and write them as effect files.

    For an effect outside the catalogue: powers, exponentials and saturation of one operating variable, and
    their products with a power of another. Held-out data are not used.

    \b
    specan study propose my_study
    """
    from specan.study.propose import propose_laws

    found = propose_laws(study)
    deliver.put_out(found, lambda: _print_laws(found, study))


def _print_laws(found: ProposedLaws, study: Study) -> None:
    """The laws, what they do to the error, and what would distinguish them."""
    from specan.report import study_sheets
    from specan.study.verdict import percent
    from specan.units import printed_unit

    if not found.laws:
        click.echo(f"{found.summary()}.")
        return
    count = len(found.laws)
    click.echo(
        f"Found in these data: {count} {'law' if count == 1 else 'laws that they cannot distinguish'}; "
        f"{found.tried} were tried."
    )
    if found.more:
        click.echo(
            f"These data fit {found.more} further families of laws as well: measure more before you choose."
        )
    before = "" if found.left_out_before is None else f", {found.left_out_before:.4g} in cross-validation"
    click.echo(f"Error now: {found.error_before:.4g} {printed_unit(found.unit)}{before}.")
    table(
        "",
        ["law", "error after", "cross-validated", "probability"],
        [
            [
                law.name, f"{law.error_after:.4g}",
                "" if law.left_out_after is None else f"{law.left_out_after:.4g}", percent(law.probability),
            ]
            for law in found.laws
        ],
    )  # fmt: skip
    for law in found.laws:
        click.echo(f"{law.name}: {law.text}")
        for name, p in law.parameters.items():
            click.echo(f"  {name.rpartition('.')[2]} = {study_sheets.value_text(p)}")
    click.echo(
        "(error after: RMS once it is added. cross-validated: each condition is predicted by a fit without it.)"
    )
    if found.next_measurement:
        click.echo("")
        show_next(found.next_measurement)
    click.echo(f"\nTry it: specan study add {study.directory} {found.laws[0].file}")


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
    deliver.put_out(change, lambda: _print_change(change))


def _print_change(change: Change) -> None:
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


@verb("history")
@click.argument("directory", type=click.Path(path_type=Path), metavar="DIR")
@plot_option("the error of each step")
@opt("--json as_json", bool, "Print the steps as JSON.")
def history(directory: Path, deliver: Delivery) -> None:
    """Show every step of DIR with its error on fitted and on held-out data.

    \b
    specan study history my_study --plot steps.png
    """
    from specan.report import study_sheets
    from specan.study.history import History
    from specan.study.study_file import read_study_file

    read_study_file(directory)
    found = History(directory)
    for line in found.ignored:
        say(f"Warning: {line}.")
    steps = found.steps

    def show() -> None:
        names = steps[-1].of_each("fit") if steps else ()
        title = f"{directory}: RMS" + (f" of {', '.join(names)}" if names else "")
        show_sheets([study_sheets.history(steps, title)])
        if steps:
            click.echo("\nModel: " + (", ".join(steps[-1].model_effects) or "no effects"))

    deliver.draw(found)
    deliver.put_out(steps, show)


@study_verb("next")
@plot_option("what each explanation predicts")
def next_measurement(study: Study, deliver: Delivery) -> None:
    """Propose the measurements, within the rig's limits, that best distinguish the possible explanations.

    For a room: microphone positions inside it, away from its walls and from the microphones in use.

    \b
    specan study next my_study
    """
    study.require_uncertainty("next")
    found = study.diagnose(progress=told()).next()

    def show() -> None:
        if found.rows:
            show_next(found.rows)
            return
        click.echo(f"{found.summary()[:1].upper()}{found.summary()[1:]}.")
        if study.model.words.what_else:
            click.echo(study.model.words.what_else.format(study=study.directory))

    deliver.draw_beside(found).put_out(found, show)


@study_verb("report")
@opt("-o --output", OutputFile(".html", ".htm"), "HTML file to write.", required=True)
def report(study: Study, deliver: Delivery) -> None:
    """Write a report of DIR on one page: figures, verdict, history, assumptions.

    The page needs no network and no other file.

    \b
    specan study report my_study -o report.html
    """
    from specan.report.study_report import write_study_report

    output = deliver.output
    assert output is not None  # it is required
    write_study_report(study, output)
    deliver.put_out({"report": str(output)}, lambda: None)
