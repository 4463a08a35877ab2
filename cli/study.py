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
from specan_cli.output import asked, say
from specan_cli.verb import verb

if TYPE_CHECKING:
    from specan.study.progress import Progress
    from specan.study.study import Study

STEPS = {
    "new": ("study_new", "Create a study from a model, a rig file and measurements."),
    "compare": ("study_steps:compare", "Fit the model and show where it fails."),
    "diagnose": ("study_steps:diagnose", "Find the missing physical effect."),
    "propose": ("study_steps:propose", "Search the residuals for a law."),
    "add": ("study_steps:add", "Add an effect and refit."),
    "drop": ("study_steps:drop", "Remove an effect and refit."),
    "history": ("study_steps:history", "The error of every step, on fitted and on held-out data."),
    "next": ("study_steps:next_measurement", "Propose the next measurement."),
    "report": ("study_steps:report", "Write a report: one HTML page with figures."),
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
