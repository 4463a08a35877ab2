"""What the figures and the report of a study say about a change: before and after, and why it was made."""

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from specan.report.figures_steps import figure_change, figure_diagnosis, figure_history
from specan.report.figures_study import _curve, _panels
from specan.report.study_report import study_report
from specan.study.create import begin
from specan.study.edit import add_effect
from specan.study.history import History
from specan.study.verdict import headline

BENCH = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "study" / "bench"
FEW = Path(__file__).parents[1] / "study" / "few.py"


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    place = tmp_path_factory.mktemp("story") / "gear"
    study = begin(place, FEW, BENCH / "rig.toml", [BENCH / "measurement.csv"], hold_out=["torque=50"]).study
    found = study.diagnose()
    return study, found, add_effect(study, "windage")


@pytest.mark.long
def test_bars_of_a_diagnosis_are_the_errors_that_are_left(story):
    _, found, _ = story
    axes = figure_diagnosis(found).axes[0]
    widths = [patch.get_width() for patch in axes.patches]
    assert widths == [found.error.before.rms, *(row.error_after for row in found.ranking)]
    assert axes.get_xscale() == "linear"
    assert axes.get_xlabel() == "Remaining RMS error of input torque / N·m"
    assert headline(found).startswith("Missing: windage (")


def test_a_change_is_drawn_before_and_after(story, heading_text):
    study, _, change = story
    table = list(csv.DictReader((BENCH / "measurement.csv").read_text().splitlines()))
    figure = figure_change(change)
    bars, before, after = figure.axes
    heights = [patch.get_height() for patch in bars.patches]
    steps = (change.before, change.after)
    assert heights == [
        e["value"] for kind in ("fit_error", "held_out_error") for e in (getattr(s, kind) for s in steps)
    ]
    for axes, one in ((before, study), (after, change.study)):
        points = [line for line in axes.lines if line.get_marker() == "."]  # not the lines across
        drawn = np.concatenate([line.get_ydata() for line in points])
        residual = one.problem.observations[0].measured - one.problem.predictions(one.shown.theta)[0]
        np.testing.assert_allclose(np.sort(drawn), np.sort(residual))
        at = np.concatenate([line.get_xdata() for line in points])
        # where they were read, not at the mean of a level
        assert set(np.round(at, 6)) <= {float(row["speed_rpm"]) for row in table}
        assert len(set(np.round(at, 6))) > 20
    assert before.get_ylim() == after.get_ylim()
    assert "(-78 %)" in heading_text(figure)


def test_the_staircase_carries_every_error(story):
    *_, change = story
    steps = change.study.history.steps
    heights = {patch.get_height() for patch in figure_history(change.study.history).axes[0].patches}
    assert {s.fit_error["value"] for s in steps} <= heights
    assert {s.held_out_error["value"] for s in steps} <= heights


def test_a_step_keeps_the_diagnosis_that_led_to_it(story):
    study, found, _change = story
    before, after = History(study.directory).steps
    assert before.diagnosis is None
    assert after.diagnosis["reason"] == found.reason


def test_the_report_begins_with_the_story_and_ends_with_what_was_rejected(story):
    *_, change = story
    page = study_report(change.study)
    places = [
        page.index(text)
        for text in (
            "Windage was missing. With it the error on fitted data went from 0.0288 to 0.00638 N·m (-78 %)",
            "How each step came about", "<b>Missing: windage (", "<h2>Measured and model",
            "<h2>What is missing now", "<h2>Parameters", "<h2>Candidates tested",
        )
    ]  # fmt: skip
    assert places == sorted(places)


def test_a_label_that_is_no_condition_of_the_model_is_drawn_at_the_rows(story):
    # Rows of a measurement kind of one's own may carry other labels than the model's conditions.
    study, *_ = story
    observation = study.problem.observations[0]
    sensor = np.linspace(1.0, 2.0, observation.n)
    marked = replace(observation, labels={"sensor": sensor})
    seen = SimpleNamespace(
        problem=replace(study.problem, observations=(marked,)), shown=study.shown, model=study.model
    )
    panel = _panels(marked)[0]
    x, model = _curve(seen, marked, panel, panel.rows)
    np.testing.assert_array_equal(x, sensor)
    np.testing.assert_allclose(model, study.problem.plain(study.shown.theta)[0])
