"""``specan study`` as a user calls it: the chain on a table with a hidden effect."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan_cli.main import main, run
from truth.worm_gear import simulate, write

CHAIN = {"windage": 12.0}
SAMPLE = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "study" / "bench"  # windage is missing
FEW = Path(__file__).parents[1] / "study" / "few.py"


@pytest.fixture(autouse=True)
def own_machine(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A simulated table with a hidden effect, and its rig."""
    return write(simulate(5, CHAIN, "small"), tmp_path_factory.mktemp("bench"))


def specan(*arguments):
    result = CliRunner().invoke(main, ["study", *map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def answer(*arguments):
    return json.loads(specan(*arguments, "--json").stdout)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A study of the sample bench and what its first verbs say; its diagnosis, which takes long, is kept in it."""
    table, rig = SAMPLE / "measurement.csv", SAMPLE / "rig.toml"
    place = tmp_path_factory.mktemp("told")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPECAN_CONFIG_DIR", str(place / "config"))
        patch.chdir(place)
        new = ("new", "s", "--model", FEW, "--rig", rig, "--measurement", table)
        begun = answer(*new, "--hold-out", "torque=50")
        return place / "s", begun, answer("compare", "s"), answer("diagnose", "s")


@pytest.fixture
def begun(told, tmp_path):
    """A copy of it."""
    shutil.copytree(told[0], tmp_path / "s")
    shutil.copytree(told[0].parent / "config", tmp_path / "config")  # the model's file was named there
    return told[1:]


def exit_code(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["specan", "study", *map(str, arguments)])
    with pytest.raises(SystemExit) as done:
        run()
    return done.value.code


def test_a_new_user_is_led_from_the_table_to_an_error_that_falls(begun):
    new, compared, found = begun
    specan("report", "s", "-o", "report.html")
    assert new["uncertainty_known"]
    assert new["fitted_values"] + new["held_out_values"] == 180
    assert compared["p_value"] < 1e-3
    assert compared["sentences"][0].startswith("fails")
    assert found["verdict"] in ("effect", "group")
    assert "windage" in found["effects"]
    added = answer("add", "s", "windage", "--because", "the diagnosis")
    assert added["after"]["fit_error"]["value"] < 0.5 * added["before"]["fit_error"]["value"]
    assert added["after"]["held_out_error"]["value"] < 0.5 * added["before"]["held_out_error"]["value"]
    assert answer("compare", "s")["p_value"] > 1e-3
    steps = answer("history", "s")
    assert [s["action"] for s in steps] == ["new", "add"]
    assert steps[1]["model_effects"][-1] == "windage"
    assert set(steps[1]["fit_error"]) == {"value", "unit", "metric"}
    assert {"reduced_chi2", "parameters", "held_out_error"} <= set(steps[1])


def test_what_a_person_reads(begun):
    text = specan("compare", "s", "--plot", "c.png").stdout
    assert "The model does not fit" in text
    assert "fails" in text
    assert "specan study diagnose s" in text
    text = specan("diagnose", "s", "--plot", "d.pdf").stdout
    assert Path("d.pdf").read_bytes().startswith(b"%PDF")
    assert "windage" in text.splitlines()[0]
    assert "Smallest detectable effects" in text
    assert specan("next", "s").stdout
    text = specan("add", "s", "windage").stdout
    assert "held-out" in text
    assert "windage.power" in text
    text = specan("history", "s", "--plot", "h.svg").stdout
    assert "add windage" in text
    assert "windage" in specan("drop", "s", "windage").stdout


def test_new_says_what_it_assumed(bench):
    table, rig = bench
    text = specan("new", "t", "--model", "worm-gear", "--rig", rig, "--measurement", table).stdout
    for words in (
        "set anew",
        "values as read",
        "model discrepancy",
        "Defaults, not stated in the rig file",
        "held at its default",
    ):
        assert words in text


def test_json_is_alone_on_standard_output(begun):
    result = specan("compare", "s", "--json")
    json.loads(result.stdout)
    found = answer("diagnose", "s")
    contract = {
        "verdict", "alternatives", "effects", "at", "unknown_possible", "ranking", "lack_of_fit",
        "model_discrepancy_percent", "fails_at", "residual_law", "smallest_visible", "not_testable",
        "next_measurement",
    }  # fmt: skip
    assert contract <= set(found)
    assert found["model_discrepancy_percent"] == 0.5
    assert {"where", "z", "text"} <= set(found["fails_at"][0])


def test_exit_codes(begun, bench, monkeypatch, capsys, tmp_path):
    _, rig = bench
    new = ["new", "u", "--model", "worm-gear", "--rig", rig, "--measurement"]
    assert exit_code(monkeypatch, "compare", "nowhere") == 2
    assert exit_code(monkeypatch, *new, "absent.csv") == 2
    (tmp_path / "bad.csv").write_text("speed_rpm,output_torque_Nm\n1,2\n3,4\n")
    assert exit_code(monkeypatch, *new, "bad.csv") == 3
    assert exit_code(monkeypatch, "add", "s", "seal-drg") == 2
    assert "did you mean 'seal-drag'" in capsys.readouterr().err
    assert exit_code(monkeypatch, "compare", "s", "--plot", "c.bmp") == 2
    assert exit_code(monkeypatch, "report", "s", "-o", "no/where.html") == 2
    assert exit_code(monkeypatch, "history", "s") == 0


def test_help_is_quick_and_names_every_step_without_loading_them():
    script = (
        "import sys; from specan_cli.main import main\n"
        "try: main(['study', '--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted(m for m in sys.modules if m in ('numpy', 'scipy', 'pandas', 'pint', 'matplotlib')))"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    for step in ("new", "compare", "diagnose", "add", "drop", "history", "next", "report"):
        assert step in out
    assert out.splitlines()[-1] == "[]"


def test_the_next_measurements_stand_in_one_table_as_wide_as_the_screen(monkeypatch):
    """Warmth rose with the pull: a spring that opens and steel that softens explain the same readings."""
    monkeypatch.setenv("COLUMNS", "50")
    rng, lines = np.random.default_rng(1), ["pull_N,room_C,stretch_mm"]
    for pull in 2 * [10, 20, 30, 40, 50, 60]:
        stretch = 2 * pull + np.sqrt(pull / 30) + 6 * (pull / 60) ** 3
        lines.append(f"{pull},{15 + pull / 4},{stretch + 0.2 * rng.standard_normal()}")
    Path("t.csv").write_text("\n".join(lines) + "\n")
    Path("rig.toml").write_text(
        "[uncertainty]\nstretch_mm = 0.2\n[limits]\npull_N = [5.0, 60.0]\nroom_C = [10.0, 40.0]\n"
    )
    model = Path(__file__).parents[1] / "own_model" / "spring.py"
    specan("new", "s", "--model", model, "--rig", "rig.toml", "--measurement", "t.csv")
    text, proposed = specan("next", "s").stdout, answer("next", "s")["next_measurement"]
    assert max(map(len, text.splitlines())) <= 50
    assert text.strip() in specan("diagnose", "s").stdout
    rows = [line.split("  ") for line in text.splitlines()]
    pulls = next(row for row in rows if row[0] == "pull_N")
    assert [float(cell) for cell in pulls[1:] if cell.strip()] == [
        row["conditions"]["pull_N"] for row in proposed
    ]
    for name, value in proposed[0]["predictions"].items():
        (row,) = (row for row in rows if row[0] == f"{name}, m")
        assert float(next(cell for cell in row[1:] if cell.strip())) == pytest.approx(value, rel=1e-3)


def test_without_uncertainty_diagnose_refuses_and_says_what_it_needs(bench, tmp_path):
    _, rig = bench
    lines = rig.read_text().splitlines()
    bare = tmp_path / "bare.toml"
    bare.write_text("\n".join(line for line in lines if line != "input_torque_Nm = 0.005") + "\n")
    case = simulate(5, CHAIN, "small")
    table, _ = write(case, tmp_path / "free", noise_free=True)
    rows = [line for k, line in enumerate(table.read_text().splitlines()) if k == 0 or k <= 24]
    table.write_text("\n".join(rows) + "\n")
    result = specan("new", "v", "--model", "worm-gear", "--rig", bare, "--measurement", table)
    assert "The uncertainty of the measurement is unknown" in result.stdout
    with pytest.raises(Exception, match=r"input_torque_Nm = 0\.005"):
        specan("diagnose", "v")
    with pytest.raises(Exception, match="next needs"):
        specan("next", "v")
    assert "RMS error" in specan("compare", "v").stdout


def test_a_figure_without_anything_to_draw_costs_no_verdict():
    Path("spring.py").write_text(
        "from specan.models import Model\n"
        "model = Model.from_function(lambda stretch, rate=3.0: rate * stretch, conditions={'stretch': ('mm', 0, 10)},\n"
        "    observables={'force': ('N', 0.1)}, parameters={'rate': (3.0, 1, 5, 'N/mm')})\n"
    )
    readings = [(1, 3.05), (2, 5.9), (3, 9.1), (4, 12.0), (5, 14.95), (6, 18.1)]
    Path("t.csv").write_text("stretch,force\n" + "".join(f"{x},{y}\n" for x, y in readings))
    specan("new", "s", "--model", "spring.py", "--measurement", "t.csv")
    found = specan("diagnose", "s", "--plot", "d.png")
    assert found.exit_code == 0
    assert "No figure: no candidate was refitted" in found.stderr
    assert found.stdout.startswith("Nothing")
    assert not Path("d.png").exists()
    ran = specan("next", "s", "--plot", "n.svg")
    assert "No figure: no condition is proposed" in ran.output
    assert "Written to" not in ran.output
    assert not Path("n.svg").exists()
