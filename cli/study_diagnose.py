"""``specan study diagnose``: which physical effect is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import opt
from specan_cli.output import Verb, draw_beside, emit_json, plot_option, show_sheets, table
from specan_cli.study import open_study, probability, study_options, told

if TYPE_CHECKING:
    from specan.study.verdict import Diagnosis, Ranked

SHOWN = 10  # rows of the table of candidates
DETAILED = 3  # of them with their parameters
EXPLANATIONS = 5  # whose probability is told in a sentence
LEAST_PROBABLE = 0.01
PLACES = 4  # where the model fails
BY_PROBABILITY = (
    "(error after: RMS once it is added. probable: among all explanations, nothing missing and something else "
    "included.\nevidence: natural logarithm of how much more probable it makes the data than the model as it is does.)"
)
SEPARATES = 2.0  # sigma by which a reading has to separate explanations to tell them apart


@click.command("diagnose", cls=Verb)
@study_options
@plot_option("the candidates in their order")
@opt(
    "--jobs", click.IntRange(1),
    "Number of processes for transfer functions, on Linux; the result is the same.", default=1,
    show_default=True,
)  # fmt: skip
def command(
    directory: Path,
    effects: tuple[Path, ...],
    as_json: bool,
    plot: Path | None,
    jobs: int,
) -> None:
    """Find the effect that the model of DIR lacks. Held-out data are not used.

    \b
    specan study diagnose my_study --plot ranking.png
    """
    study = open_study(directory, effects)
    found = study.diagnose(progress=told(), jobs=jobs)
    if as_json:
        emit_json(found.to_dict())
    else:
        _print(found, directory)
    draw_beside(found, plot)


def _print(found: Diagnosis, directory: Path) -> None:
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
        click.echo(f"With this law it would fit better: {found.residual_law.text_with_values}.")
    _print_pulls(found)
    if found.next_measurement:
        click.echo("")
        show_next(found.next_measurement)
    if found.verdict in ("effect", "group") and found.ranking:
        click.echo("")
        for use in found.ranking[0].names:
            shown = f'"{use}"' if " " in use else use
            click.echo(f"Try it: specan study add {directory} {shown}")
    if found.verdict == "unknown-effect" and found.residual_law is not None:
        click.echo(f"\nSearch the residuals for a law: specan study propose {directory}")
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
    told = [f"{one.explanation} {percent(one.probability)}" for one in likely]
    rest = 1 - sum(one.probability for one in likely)
    told += [f"all others together {percent(rest)}"] if rest >= LEAST_PROBABLE else []
    click.echo(f"How probable: {', '.join(told)}.")


def _print_pulls(found: Diagnosis) -> None:
    if found.pulls:
        click.echo("")
        table(
            "Values outside the known range, in standard uncertainties",
            ["parameter", "value", "known", "unit", "off by", ""],
            [
                [
                    p.parameter, *p.shown(), f"{p.pull:+.1f}", "at its bound" if p.at_bound else "",
                ]
                for p in found.pulls
            ],
        )  # fmt: skip


def _print_where(found: Diagnosis) -> None:
    """Where the model as it is is off: by how much, and of transfer functions which mode is near."""
    places = [place for place in found.fails_at if place.get("most_at") or found.probabilities][:PLACES]
    if places:
        click.echo("\nWhere the current model fails, most significant first:")
    for place in places:
        near = f", {place['most_at']}" if place.get("most_at") else ""
        where = place.get("place") or ", ".join(f"{n} = {v:g}" if isinstance(v, float) else f"{n} = {v}"
                                                for n, v in place["where"].items())  # fmt: skip
        click.echo(f"  {where}: {place['text']}{near}")


def show_next(rows: Sequence[Mapping[str, Any]]) -> None:
    """What to measure next: a table, one column for each reading; sentences where something else is to be done."""
    readings = [row for row in rows if row["conditions"] and row["predictions"]]
    tabled = [row for row in readings if row.get("observable") == readings[0].get("observable")]
    if tabled:
        unit = _in_unit(tabled[0]["unit"])
        lines: list[tuple[str, list[str]]] = [
            (
                name,
                [v if isinstance(v, str) else f"{v:g}" for v in (row["conditions"][name] for row in tabled)],
            )
            for name in tabled[0]["conditions"]
        ]
        lines += [
            (f"{name}{unit}", [f"{row['predictions'][name]:.4g}" for row in tabled])
            for name in tabled[0]["predictions"]
        ]
        lines.append((f"sigma{unit}", [f"{row['sigma']:.2g}" if row.get("sigma") else "" for row in tabled]))
        for label, key in (
            ("closest two, sigma apart", "least_sigma"),
            ("furthest two, sigma apart", "separation_sigma"),
        ):
            lines.append((label, [f"{row[key]:.1f}" if row.get(key) else "" for row in tabled]))
        lines.append(("separates", [_apart(row) for row in tabled]))
        table(
            "What to measure next",
            ["", *map(str, range(1, len(tabled) + 1))],
            [[label, *cells] for label, cells in lines if any(cells)],
        )
    if rows and not tabled:
        click.echo("What to measure next")
    for number, row in enumerate(rows, 1):
        if row not in tabled or not row["separation_sigma"]:
            click.echo(f"{number}. {row['text']}")


def _apart(row: Mapping[str, Any]) -> str:
    """Whether a reading tells all explanations apart."""
    if not row["separation_sigma"]:
        return ""
    return "all" if (row.get("least_sigma") or 0.0) >= SEPARATES else "some"


def _print_statistics(found: Diagnosis) -> None:
    from specan.report import study_sheets

    if found.ranking:
        now = None if found.error is None else found.error.before.level_dB
        unit = "" if found.error is None else _in_unit(found.error.before.unit)
        others = {e.before.observable: e.before.unit for e in found.error.others} if found.error else {}
        levels = now is not None and all(r.level_after_dB is not None for r in found.ranking[:SHOWN])
        click.echo("")
        table(
            "Effects tested, most likely first",
            [
                "effects",
                f"error after{unit}",
                *(f"{name}{_in_unit(unit)}" for name, unit in others.items()),
                *(["levels, dB"] if levels else []),
                "probable",
                "evidence",
                "",
            ],
            [_row(r, now, levels) for r in found.ranking[:SHOWN]],
        )
        click.echo(BY_PROBABILITY)
        for ranked in found.ranking[:DETAILED]:
            click.echo(f"{' + '.join(ranked.names)}:")
            for name, p in ranked.parameters.items():
                click.echo(f"  {name} = {study_sheets.value_text(p)}")
    if found.lack_of_fit is not None:
        fit = found.lack_of_fit
        click.echo(
            f"The model as it is: reduced chi-square {fit.reduced_chi2:.2f} (one for a true model), "
            f"{probability(fit.p_value)} (of a worse fit of a true model), {fit.n_effective:.0f} independent values; "
            f"model discrepancy {found.model_discrepancy_percent:g} % allowed for."
        )


def _in_unit(unit: str) -> str:
    return "" if unit == "1" else f", {unit}"


def _row(ranked: Ranked, now_dB: float | None, levels: bool) -> list[Any]:
    percent = 100 * ranked.probability
    told = f"{percent:.2g} %" if percent >= 0.01 else "< 0.01 %"
    remark = "" if ranked.plausible else "outside"
    if ranked.at_bound:
        remark = f"{remark}, at its bound".lstrip(", ")
    fall = [f"{now_dB:.2g} to {ranked.level_after_dB:.2g}"] if levels else []
    return [
        " + ".join(ranked.names), f"{ranked.error_after:.3g}",
        *(f"{rms:.3g}" for rms in ranked.others_after.values()), *fall, told,
        f"{ranked.ln_evidence:+.1f}", remark,
    ]  # fmt: skip


def _print_power(found: Diagnosis) -> None:
    from specan.report import study_sheets

    hidden = [n for n, v in found.smallest_visible.items() if v is None]
    if (sheet := study_sheets.visible(found.smallest_visible)).rows:
        click.echo("")
        show_sheets([sheet])
    if hidden:
        click.echo("Not detectable at any size in their range: " + ", ".join(hidden))
