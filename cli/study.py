"""``specan study``: hold a model against measurements, learn what is missing, add it, watch the error fall."""

from __future__ import annotations

import os

import click

from specan_cli.main import LazyGroup

STEPS = {
    "new": ("study_new", "Begin a study: a model, a rig, measurements."),
    "compare": ("study_compare", "Fit the model and see where it fails."),
    "diagnose": ("study_diagnose", "Which physical effect is missing."),
    "propose": ("study_propose", "Laws for what no effect of the catalogue explains."),
    "add": ("study_add", "Add an effect, refit, see what the errors do."),
    "drop": ("study_drop", "Take an effect out again."),
    "history": ("study_history", "The error of every step, on fitted and on held-out data."),
    "next": ("study_next", "Which measurement would decide."),
    "impedance": ("study_impedance", "Room: surface impedance and absorption per wall and third octave."),
    "report": ("study_report", "One self-contained page with figures."),
}


class StudyGroup(LazyGroup):
    """The steps of a study, in the order in which a user takes them."""

    verbs = STEPS


@click.group("study", cls=StudyGroup)
def command() -> None:
    """Hold a model against measurements, step by step.

    \b
    specan study new my_study --model worm-gear --rig sample_data/worm_gear/rig.toml \\
      --measurement sample_data/worm_gear/table_8_loaded.csv --hold-out torque=60
    specan study compare my_study
    specan study diagnose my_study
    specan study add my_study seal-drag --because "the idle runs ask for it"
    specan study history my_study
    """
    # Many small matrices: threads of the linear algebra would spin for nothing. Numpy is loaded after this.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
