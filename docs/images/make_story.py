"""Draws `story.svg`, the picture of the README: a gear bench, what its model lacks, and the error once that is added.

Run ``python docs/images/make_story.py`` where specan is installed. The numbers that are drawn are
written beside the picture (`story.json`); a test computes them anew and compares.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from specan.report.figure_style import COLOURS
from specan.study.create import begin
from specan.study.edit import add_effect
from specan.study.study import Study

HERE = Path(__file__).parent
BENCH = HERE.parents[1] / "sample_data" / "worm_gear" / "study" / "bench"
HELD_OUT = "torque=50"
STEPS = (
    "tooth-friction",
    "bearing-friction",
    "churning",
)  # the model's own effects; then what the diagnosis names


def steps(directory: Path) -> Iterator[tuple[str, Study]]:
    """The study after each step: an ideal gear, the model's own effects, the effect that the diagnosis names."""
    study = begin(
        directory,
        "worm-gear",
        BENCH / "rig.toml",
        [BENCH / "measurement.csv"],
        hold_out=[HELD_OUT],
        effects=(),
    ).study
    yield "ideal gear", study
    for name in STEPS:
        study = add_effect(study, name).study
        yield f"+ {name}", study
    diagnosis = study.diagnose()
    (named,) = diagnosis.ranking[0].effects
    assert diagnosis.verdict == "effect", diagnosis.verdict
    yield f"+ {named}", add_effect(study, str(named)).study


def numbers() -> dict[str, Any]:
    """Everything that is drawn: torques in N m, residuals (measured - model) in mN m, speeds in rpm.

    Examples
    --------
    >>> sorted(json.loads((HERE / "story.json").read_text()))
    ['held_out_N_m', 'measured_N_m', 'missing', 'predicted_N_m', 'residual_mN_m', 'speed_rpm', 'steps', 'temperature_C']
    """
    with tempfile.TemporaryDirectory() as directory:
        all_steps = list(steps(Path(directory) / "gear"))
        names = [name for name, _ in all_steps]
        before, after = (study for _, study in all_steps[-2:])
        observation = before.problem.observations[0]
        predicted = [s.problem.predictions(s.shown.theta)[0] for s in (before, after)]
        held_out = [study.held_out.errors[0].rms for _, study in all_steps]
    return {
        "steps": names,
        "missing": names[-1].removeprefix("+ "),
        "held_out_N_m": held_out,
        "speed_rpm": observation.labels["speed_rpm"].tolist(),
        "temperature_C": observation.labels["oil_temperature_C"].tolist(),
        "measured_N_m": observation.measured.tolist(),
        "predicted_N_m": predicted[0].tolist(),
        "residual_mN_m": [(1e3 * (observation.measured - p)).tolist() for p in predicted],
    }


def draw(drawn: dict[str, Any], path: Path) -> None:
    """The four panels."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams["svg.hashsalt"] = "specan"  # the same file from the same numbers
    mpl.rcParams["svg.fonttype"] = "path"
    figure = Figure(figsize=(12, 3.4), layout="constrained")
    data, first, second, stairs = figure.subplots(1, 4, width_ratios=[1, 1.05, 1.05, 1.15])
    measured, predicted = np.array(drawn["measured_N_m"]), np.array(drawn["predicted_N_m"])
    data.plot([0, measured.max() * 1.05], [0, measured.max() * 1.05], color="0.6", lw=1)
    data.plot(measured, predicted, "o", ms=3.5, color=COLOURS[0], alpha=0.6)
    data.set(xlabel="measured input torque / N m", ylabel="model / N m", title="1  Model and measurement")
    speed, temperature = np.array(drawn["speed_rpm"]), np.array(drawn["temperature_C"])
    levels = np.unique(temperature)
    span = 1.1 * np.abs(drawn["residual_mN_m"]).max()
    titles = ("2  Residual: a pattern", f"3  With {drawn['missing']} added")
    for axes, residual, title in zip((first, second), drawn["residual_mN_m"], titles, strict=True):
        axes.axhline(0, color="0.5", lw=1)
        for k, (level, colour) in enumerate(zip(levels, COLOURS, strict=False)):
            mine = temperature == level
            shift = (k - (levels.size - 1) / 2) * 60  # side by side, to be told apart
            axes.plot(
                speed[mine] + shift, np.array(residual)[mine], "o", ms=3, color=colour, label=f"{level:g}"
            )
        axes.set(xlabel="speed / rpm\n(temperatures side by side)", ylim=(-span, span), title=title)
    first.set_ylabel("measured - model / mN m")
    second.legend(
        title="oil temperature / °C",
        fontsize="small",
        title_fontsize="small",
        ncols=3,
        loc="upper center",
        frameon=False,
        columnspacing=0.8,
        handletextpad=0.1,
    )
    errors = np.array(drawn["held_out_N_m"]) * 1e3
    at = np.arange(errors.size)
    colours = ["0.65"] * (errors.size - 1) + [COLOURS[1]]
    stairs.bar(at, errors, color=colours, width=0.7)
    for k, error in enumerate(errors):
        stairs.annotate(f"{error:.3g}", (k, error), ha="center", va="bottom", fontsize="small")
    stairs.set_yscale("log")
    stairs.set_ylim(errors.min() / 2, errors.max() * 2.5)
    stairs.set_xticks(at, drawn["steps"], rotation=25, ha="right", fontsize="small")
    stairs.set(ylabel="RMS error / mN m", title="4  Error on data never fitted")
    for axes in (data, first, second, stairs):
        axes.spines[["top", "right"]].set_visible(False)
        axes.title.set_fontsize("medium")
        axes.title.set_fontweight("bold")
    figure.savefig(path, metadata={"Date": None}, dpi=100)


if __name__ == "__main__":
    found = numbers()
    draw(found, HERE / "story.svg")
    rounded = {
        key: np.round(value, 4).tolist() if isinstance(value[0], float | list) else value
        for key, value in found.items()
    }
    (HERE / "story.json").write_text(json.dumps(rounded) + "\n", encoding="utf-8")
