"""A model of a user's own goes through every verb, in its own words and units, without a line of specan changed."""

import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import RequestError
from specan.models import Condition, Model, Observable, constant
from specan.models.catalogue import load_model, model_names
from specan.study.observation import kind_of
from specan_cli.main import main

SPRING = Path(__file__).parent / "spring.py"
# Words and units of the built-in models.
FOREIGN = re.compile(
    r"\b(?:Nm|N\*m|losses|machine|gear|torque|speed|temperature|wall|microphone|ideal room)\b", re.IGNORECASE
)
STIFFNESS, GIVE, CUBIC = 500.0, 2e-3, 8e-3  # of the planted truth: N/m, m at 30 N, m at 60 N


def run(*words: object) -> str:
    found = CliRunner().invoke(main, [str(w) for w in words])
    assert found.exit_code == 0, (found.output, found.exception)
    return found.output


def refused(*words: object) -> str:
    with pytest.raises(RequestError) as fault:
        CliRunner().invoke(main, [str(w) for w in words], catch_exceptions=False)
    return str(fault.value)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A rig file and a table of 3 readings each at 12 pulls and 2 warmths; the cubic effect is in it."""
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    (tmp_path / "rig.toml").write_text(
        "[limits]\npull_N = [5, 60]\nroom_C = [10, 40]\n[uncertainty]\nstretch_mm = 0.2\n", encoding="utf-8"
    )
    random, lines = np.random.default_rng(3), ["pull_N,room_C,stretch_mm,repeat"]
    for repeat in (1, 2, 3):
        for pull in np.linspace(5, 60, 12):
            for room in (15.0, 35.0):
                x = pull / STIFFNESS + GIVE * np.sqrt(pull / 30) + CUBIC * (pull / 60) ** 3
                lines.append(f"{pull:g},{room:g},{1e3 * x + 0.2 * random.standard_normal():.4f},{repeat}")
    (tmp_path / "spring.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def study(place):
    said = run("study", "new", place / "s", "--model", SPRING, "--rig", place / "rig.toml",
               "--measurement", place / "spring.csv")  # fmt: skip
    assert "no model discrepancy is declared" in said
    assert re.search(r"stretch_mm: scatter 0\.000(18|19|2|20|21|22) m from repeats", said)
    assert not FOREIGN.search(said)
    return place / "s"


def test_the_missing_effect_is_found_and_added(study):
    compared = run("study", "compare", study)
    assert "N (pull)" in compared
    assert not FOREIGN.search(compared)
    verdict = json.loads(run("study", "diagnose", study, "--json"))
    assert verdict["verdict"] == "effect"
    assert verdict["effects"] == ["opening"]
    cubic = verdict["ranking"][0]["parameters"]["opening.cubic"]
    assert cubic["low"] < CUBIC < cubic["high"]
    assert not FOREIGN.search(run("study", "diagnose", study))
    added = run("study", "add", study, "opening", "--because", "asked for")
    assert "The data ask" not in added
    assert not FOREIGN.search(added)
    steps = json.loads(run("study", "history", study, "--json"))
    assert [s["action"] for s in steps] == ["new", "add"]
    assert steps[0]["fit_error"]["unit"] == "m"
    assert steps[1]["fit_error"]["value"] < 2.4e-4 < steps[0]["fit_error"]["value"]
    assert not FOREIGN.search(run("study", "history", study))
    assert not FOREIGN.search(run("study", "next", study))
    run("study", "report", study, "-o", study / "report.html")
    page = re.sub(r"<svg.*?</svg>|data:[^\"']*", "", (study / "report.html").read_text("utf-8"), flags=re.S)
    assert not FOREIGN.search(page)
    assert "the stiff stand" in run("study", "new", study.parent / "bare", "--model", SPRING, "--rig",
                                    study.parent / "rig.toml", "--effects", "none",
                                    "--measurement", study.parent / "spring.csv")  # fmt: skip


def test_what_is_simulated_is_what_is_measured(place):
    run("simulate", SPRING, place / "rig.toml", "--grid", "pull_N=30,60", "--grid", "room_C=20",
        "-e", "stand.compliance=0.002", "-o", place / "made.csv")  # fmt: skip
    rows = np.genfromtxt(place / "made.csv", delimiter=",", names=True)
    assert rows["stretch_mm"] == pytest.approx([62.0, 122.828427], abs=1e-5)  # 60 + 2, 120 + 2 root 2


def test_the_model_is_shown_and_checked(place):
    shown = run("model", "show", SPRING, "--rig", place / "rig.toml")
    assert "warm-steel" in shown
    assert not FOREIGN.search(shown)
    assert "opening passes" in run("model", "check", SPRING, "--rig", place / "rig.toml")


def test_the_template_keeps_the_rules_and_is_not_overwritten(place):
    run("model", "new", place / "pump.py")
    assert "cavitation passes" in run("model", "check", place / "pump.py")
    assert written_lines(place / "pump.py") <= 40
    assert written_lines(Path(__file__).parents[2] / "sample_data/worm_drive/worm_drive.py") <= 40
    assert run("model", "show", place / "pump.py").startswith("pump: ")
    assert "exists already" in refused("model", "new", place / "pump.py")


def written_lines(path: Path) -> int:
    lines = [line.strip() for line in path.read_text("utf-8").splitlines()]
    return sum(bool(line) and not line.startswith("#") for line in lines)


def test_a_recording_is_no_table_whatever_its_name(place):
    (place / "sound.csv").write_bytes(b"RIFF\x24\0\0\0WAVEfmt ")
    said = refused("study", "new", place / "s", "--model", SPRING, "--rig", place / "rig.toml",
               "--measurement", place / "sound.csv")  # fmt: skip
    assert "is not a kind of file that a study of the model spring reads" in said
    assert not (place / "s").exists()


def test_a_model_of_somebody_elses_study_is_not_run_unasked(study, monkeypatch, tmp_path):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "another machine"))
    assert "has not been run on this machine" in refused("study", "compare", study)
    run("model", "check", study / "model" / "spring.py", "--rig", study.parent / "rig.toml")
    run("study", "compare", study)


def test_a_changed_model_file_is_noticed(study):
    path = study / "model" / "spring.py"
    path.write_text(path.read_text("utf-8") + "\n", encoding="utf-8")
    assert "was changed since it was added" in refused("study", "compare", study)


def test_an_installed_package_brings_a_model(monkeypatch):
    spec = importlib.util.spec_from_file_location("spring", SPRING)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    class Point:
        name = "spring"

        def load(self):
            return module

    def points(group, name="spring"):
        return [Point()] if group == "specan.models" and name == "spring" else []

    monkeypatch.setattr("specan.models.catalogue.entry_points", points)
    assert model_names() == ["spring"]
    assert load_model("spring", module.EXAMPLE_RIG).title == "A spring on a stand"


def test_an_installed_package_brings_a_kind_of_measurement(monkeypatch, place):
    class Orders:
        TITLE = "an order spectrum"

        @staticmethod
        def reads(path):
            return path.read_bytes().startswith(b"ORDERS")

    class Point:
        name = "strain"

        def load(self):
            return Orders

    def points(group, name=Point.name):
        return [Point()] if name == Point.name else []

    monkeypatch.setattr("specan.study.observation.entry_points", points)
    model = load_model(SPRING, {})
    both = replace(
        model,
        observables={**model.observables, "line": Observable("line", "stretch", "m", "Line.", kind="strain")},
    )
    (place / "a.csv").write_bytes(b"ORDERS\0\1")
    assert both.kinds == ("table", "strain")
    assert kind_of(place / "a.csv", both) == "strain"
    assert kind_of(place / "spring.csv", both) == "table"
    with pytest.raises(RequestError, match="is not a kind of file"):
        kind_of(place / "a.csv", model)


def test_an_observable_in_another_unit_than_its_quantity_is_refused():
    with pytest.raises(RequestError, match="is in degC, its quantity"):
        Model(
            "m", "M", {"x": Condition("x", "m", "X.", "x_m", "m")}, {"t": constant("t", 1.0, "K", "T.")}, {},
            {"t": Observable("t", "t", "degC", "T.")},
        )  # fmt: skip


def test_a_file_without_a_model_says_so(tmp_path):
    (tmp_path / "empty.py").write_text("x = 1\n", encoding="utf-8")
    with pytest.raises(RequestError, match="holds no model"):
        load_model(tmp_path / "empty.py", {})
