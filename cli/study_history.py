"""``specan study history``: the error of every step."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.output import Verb, draw, plot_option


@click.command("history", cls=Verb)
@click.argument("directory", type=click.Path(path_type=Path), metavar="DIR")
@plot_option("the staircase of errors")
@click.option("--json", "as_json", is_flag=True, help="Print the steps as JSON.")
def command(directory: Path, plot: Path | None, as_json: bool) -> None:
    """Show every step of DIR with its error on fitted and on held-out data.

    \b
    specan study history my_study --plot staircase.png
    """
    from specan.study.history import History
    from specan.study.study_file import read_study_file
    from specan_cli.output import emit_json, table
    from specan_cli.study import amount

    read_study_file(directory)
    history = History(directory)
    steps = history.steps
    if as_json:
        emit_json([step.as_dict() for step in steps])
    else:
        rows = []
        for s in steps:
            held = "" if s.held_out_reduced_chi2 is None else f"{s.held_out_reduced_chi2:.2f}"
            chi2 = "" if s.reduced_chi2 is None else f"{s.reduced_chi2:.2f}"
            what = f"{s.action} {s.effect}".strip() + (f" ({s.because})" if s.because else "")
            rows.append([s.step, what, amount(s.fit_error), chi2, amount(s.held_out_error), held])
        metric = steps[-1].fit_error["metric"] if steps else "RMS"
        table(
            f"{directory}: {metric}",
            ["step", "what", "fitted", "chi2/n", "held out", "chi2/n"],
            rows,
        )
        if steps:
            click.echo("\nModel: " + (", ".join(steps[-1].model_effects) or "no effects"))
    draw(history, plot)
