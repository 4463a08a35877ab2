"""The page of a study as a person uses it, in a real browser."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from specan_cli.study_new import command as study_new
from specan_cli.study_steps import diagnose as study_diagnose
from specan_cli.study_steps import history as study_history

pytest.importorskip("bokeh")

BENCH = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "study" / "bench"
FEW = Path(__file__).parents[1] / "study" / "few.py"


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Path:
    """Begun and diagnosed: else the page begins to search beside what is tried here."""
    place = tmp_path_factory.mktemp("begun") / "gear"
    arguments = ["--model", str(FEW), "--rig", str(BENCH / "rig.toml"), "--hold-out", "torque=50"]
    arguments += ["--measurement", str(BENCH / "measurement.csv")]
    assert CliRunner().invoke(study_new, [str(place), *arguments]).exit_code == 0
    assert CliRunner().invoke(study_diagnose, [str(place)]).exit_code == 0
    return place


@pytest.fixture
def study(begun, tmp_path) -> Path:
    """A copy in a directory as deep, from which the table is found."""
    return Path(shutil.copytree(begun, tmp_path / "gear"))


@pytest.mark.long
def test_candidates_are_ranked_as_the_command_ranks_them(open_page, serve, study):
    found = json.loads(CliRunner().invoke(study_diagnose, [str(study), "--json"]).stdout)
    page = open_page(serve(str(study)))
    page.wait(lambda: page.text("verdict").strip())
    page.wait(lambda: page.script("return document.documentElement.scrollHeight <= innerHeight"))
    assert found["verdict"] in ("effect", "group")
    assert "Missing:" in page.text("verdict")
    assert all(name in page.text("verdict") for name in found["effects"])
    best = found["ranking"][0]
    name = best["effects"][0]
    assert f"{best['error_after']:.3g}" in page.text(f"rank-{name}")
    # Of those that are less likely, the most probable one comes first.
    others = [
        r for r in found["ranking"][len(found["alternatives"]) :] if r["plausible"] and len(r["effects"]) == 1
    ]
    tops = [page.element(f"try-{r['effects'][0]}", "button").location["y"] for r in (best, *others[:3])]
    assert tops == sorted(tops)
    page.press(f"about-{name}")
    page.wait(lambda: "Source:" in page.text("explanation"))
    for parameter, row in best["parameters"].items():
        assert f"{parameter.rpartition('.')[2]} {row['value']:.4g}" in page.text("explanation")
    assert page.complaints == []


@pytest.mark.long
def test_a_tried_effect_can_be_sent_on(browser, open_page, serve, study):
    url = serve(str(study))
    page = open_page(url + "?tried=seal-drag&tried=windage")
    page.wait(lambda: "Trial: seal-drag with windage" in page.text("status"))
    page.press("try-seal-drag")
    page.wait(lambda: browser.current_url == url + "?tried=seal-drag")
    page = open_page(url + "?tried=nonsense")
    page.wait(lambda: "nonsense cannot be tried" in page.text("status"))
    page.wait(lambda: page.text("verdict").strip())  # the diagnosis is made nonetheless
    page = open_page(url + "?path=/etc/passwd")
    page.wait(lambda: "path" in page.text("status"))


@pytest.mark.long
def test_a_tried_effect_is_put_back(open_page, serve, study):
    page = open_page(serve(str(study)))
    page.wait(lambda: "torque" in page.text("trial"))
    shown = page.text("trial")
    page.press("try-seal-drag")
    page.wait(lambda: "(not accepted)" in page.text("status"))
    page.press("as-it-is")
    page.wait(lambda: page.text("trial") == shown)
    assert page.script("return Bokeh.documents[0].get_model_by_name('accept').disabled")


@pytest.mark.long
def test_an_effect_is_tried_accepted_and_in_the_history(open_page, serve, study):
    before = (study / "history.jsonl").read_text()
    page = open_page(serve(str(study)))
    page.wait(lambda: "torque" in page.text("trial"))
    shown = page.text("trial")
    page.press("try-seal-drag")
    page.wait(lambda: "(not accepted)" in page.text("status"))
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
