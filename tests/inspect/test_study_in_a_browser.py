"""The page of a study as a person uses it, in a real browser."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from specan_cli.study_history import command as study_history
from specan_cli.study_new import command as study_new

pytest.importorskip("bokeh")

GEAR = Path(__file__).parents[2] / "sample_data" / "worm_gear"


def test_an_effect_is_tried_accepted_and_in_the_history(browser, open_page, serve, tmp_path):
    study = tmp_path / "gear"
    arguments = [
        "--model",
        "worm-gear",
        "--rig",
        str(GEAR / "rig.toml"),
        "--measurement",
        str(GEAR / "table_8_loaded.csv"),
    ]
    assert CliRunner().invoke(study_new, [str(study), *arguments]).exit_code == 0
    before = (study / "history.jsonl").read_text()
    page = open_page(serve(str(study)))
    page.wait(lambda: "efficiency" in page.text("trial"))
    shown = page.text("trial")
    page.press("try-seal-drag")
    page.wait(lambda: "tried, not accepted" in page.text("status"))
    assert page.text("trial") != shown
    assert (study / "history.jsonl").read_text() == before  # nothing is written by trying
    page.type("because", "it leaks")
    page.press("accept")
    page.wait(lambda: "it leaks" in page.text("history"))
    steps = json.loads(CliRunner().invoke(study_history, [str(study), "--json"]).stdout)
    assert (steps[-1]["action"], steps[-1]["effect"], steps[-1]["because"]) == (
        "add",
        "seal-drag",
        "it leaks",
    )
    assert f"{steps[-1]['fit_error']['value']:.4g}" in page.text("history")
    assert page.complaints == []
