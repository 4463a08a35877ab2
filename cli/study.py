"""``specan study``: compare a model with measurements, learn what is missing, add it, watch the error fall.

Here is what its steps share, and those that are a few lines.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.main import LazyGroup
from specan_cli.options import json_option, opt, together
from specan_cli.output import Delivery, OutputFile, asked, plot_option, say, show_sheets, verb

if TYPE_CHECKING:
    from specan.study.progress import Progress
    from specan.study.study import Study

STEPS = {
    "new": ("study_new", "Create a study from a model, a rig file and measurements."),
    "compare": ("study_compare", "Fit the model and show where it fails."),
    "diagnose": ("study_diagnose", "Find the missing physical effect."),
    "propose": ("study_propose", "Search the residuals for a law."),
    "add": ("study_change:add", "Add an effect and refit."),
    "drop": ("study_change:drop", "Remove an effect and refit."),
    "history": ("study:history", "The error of every step, on fitted and on held-out data."),
    "next": ("study:next_measurement", "Propose the next measurement."),
    "report": ("study:report", "Write a report: one HTML page with figures."),
}


ENTRY_POINTS = "specan.study_verbs"  # of installed packages: name = click command


class StudyGroup(LazyGroup):
    """The steps of a study, in the order in which a user takes them, and those that models bring."""

    @property
    def verbs(self) -> Mapping[str, tuple[str, str]]:
        """Verb to where it is and what it does."""
        own = entry_points(group=ENTRY_POINTS)
        return STEPS | {point.name: (point.value, point.load().get_short_help_str(90)) for point in own}


@click.group("study", cls=StudyGroup)
def command() -> None:
    """Compare a model with measurements, step by step.

    \b
    specan study new my_study --model worm-gear --rig sample_data/worm_gear/rig.toml \\
      --measurement sample_data/worm_gear/table_8_loaded.csv --hold-out torque=60
    specan study compare my_study
    specan study diagnose my_study
    specan study add my_study seal-drag --because "needed at idle"
    specan study history my_study
    """
    # Many small matrices: threads of the linear algebra would spin for nothing. Numpy is loaded after this.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")


study_options = together(
    click.argument("directory", type=click.Path(path_type=Path), metavar="DIR"),
    opt(
        "--effect effects", Path, "Add and trust a Python file with your own effects; repeatable.", "FILE",
        multiple=True,
    ),
    json_option,
)  # fmt: skip


def open_study(directory: Path, effects: Sequence[Path] = (), accept_changes: bool = False) -> Study:
    """Open a study and say what was taken in."""
    from specan.study.study import Study

    study = Study(directory, accept_changes, effects)
    for line in study.history.ignored:
        say(f"Warning: {line}.")
    for name in study.accepted:
        say(f"{name}: the changed data are accepted.")
    if not study.data.known:
        say(
            "The uncertainty of the measurement is unknown: errors are shown, but no conclusion can be drawn. "
            "Repeat conditions, or give [uncertainty] in the rig file."
        )
    return study


def study_verb(name: str) -> Callable[[Any], click.Command]:
    """Decorator above the own options of a verb for a study, which is handed to it opened."""

    def make(function: Callable[..., None]) -> click.Command:
        @wraps(function)
        def opened(
            directory: Path, effects: tuple[Path, ...], accept_changes: bool = False, **options: Any
        ) -> None:
            function(open_study(directory, effects, accept_changes), **options)

        return verb(name)(study_options(opened))

    return make


LOGGED_S = 10.0  # between lines of progress in a log


LEAST_SHARE = 0.05  # of the whole, below which no time is estimated


def told() -> Progress:
    """What tells of progress on standard error: all of it on a terminal; in a log a line every ten seconds.

    With the share that is over stands the time that is left if the rest goes on as quickly.
    """
    began = last = time.monotonic()
    most = 0.0
    on_terminal, quiet = sys.stderr.isatty(), asked("quiet")

    def tell(text: str, share: float | None = None) -> None:
        nonlocal last, most
        now = time.monotonic()
        most = max(most, share or 0.0)
        if not quiet and (on_terminal or now - last >= LOGGED_S):
            last = now
            left = ""
            if most > LEAST_SHARE:
                seconds = (now - began) * (1 - most) / most
                left = f" ({100 * most:.0f} %, about {float(f'{seconds:.1g}'):g} s left)"
            say(f"{now - began:5.0f} s: {text}{left}")

    return tell


def probability(p: float) -> str:
    """A probability in words."""
    return "p < 1e-12" if p < 1e-12 else f"p = {p:.2g}"


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
