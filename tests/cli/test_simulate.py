"""``specan simulate`` as a user calls it."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import InputError, RequestError
from specan_cli.main import main

SAMPLE = Path(__file__).parents[2] / "sample_data/worm_gear"
RIG = SAMPLE / "rig.toml"


def run(*arguments, model="worm-gear", rig=RIG):
    result = CliRunner().invoke(main, ["simulate", model, str(rig), *map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def columns(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_a_table_over_the_limits_of_the_rig(tmp_path):
    run("-o", tmp_path / "a.csv")
    got = columns(tmp_path / "a.csv")
    assert (got["speed_rpm"].min(), got["speed_rpm"].max()) == (1200, 2800)
    assert got["output_torque_Nm"].max() == 90
    loaded = got["output_torque_Nm"] > 0
    np.testing.assert_allclose(
        got["efficiency"][loaded], (got["output_torque_Nm"] / 7.5 / got["input_torque_Nm"])[loaded], rtol=1e-6
    )
    np.testing.assert_allclose(
        got["power_loss_W"],
        (got["input_torque_Nm"] - got["output_torque_Nm"] / 7.5) * got["speed_rpm"] * np.pi / 30,
        atol=1e-4,
    )


POINT = (
    "--grid",
    "speed_rpm=1500",
    "--grid",
    "output_torque_Nm=50",
    "--grid",
    "oil_temperature_C=58",
    "--json",
)


def torque(*arguments):
    return json.loads(run(*POINT, *arguments).stdout)["rows"][0]["input_torque_Nm"]


def test_effects_are_switched_on_with_values_and_units():
    base = torque()
    assert torque("--effects", "seal-drag=0.2") == pytest.approx(base + 0.2)
    assert torque("-e", "seal-drag.torque=200 mN*m") == pytest.approx(base + 0.2)
    assert torque("-e", "seal-drag", "-e", "windage") == pytest.approx(base + 0.1 + 4 / (50 * np.pi))
    assert torque("--without", "churning") < base
    assert torque("-e", "tooth-friction=0.03") < base


def test_values_of_the_rig_can_be_taken_otherwise():
    assert torque("--set", "oil.viscosity_40C_mm2_s=460") > torque()
    assert torque("--set", "model.mesh=article") != torque()
    with pytest.raises(RequestError, match="did you mean 'oil'"):
        torque("--set", "oils.density_kg_m3=1")
    with pytest.raises(RequestError, match="cannot be set"):
        torque("--set", "oil.density_kg_m3")


def test_without_any_base_effect_the_gear_is_ideal():
    ideal = ("--without", "churning", "--without", "tooth-friction", "--without", "bearing-friction")
    assert torque(*ideal) == pytest.approx(50 / 7.5)


def test_noise_has_its_deviation_and_its_seed(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run("-o", tmp_path / f"{name}.csv", "--noise", 0.02, "--repeats", 4, "--seed", seed)
    run("-o", tmp_path / "clean.csv", "--repeats", 4)
    a, b, c, clean = (columns(tmp_path / f"{n}.csv")["input_torque_Nm"] for n in ("a", "b", "c", "clean"))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
    assert np.std(a - clean) == pytest.approx(0.02, rel=0.1)
    assert set(columns(tmp_path / "a.csv")["repeat"]) == {1, 2, 3, 4}


def test_look_up_table_is_a_full_grid(tmp_path):
    run("--table", tmp_path / "map.csv")
    got = columns(tmp_path / "map.csv")
    assert list(got) == ["speed_rpm", "output_torque_Nm", "oil_temperature_C", "efficiency", "power_loss_W"]
    sizes = [np.unique(got[name]).size for name in list(got)[:3]]
    assert np.prod(sizes) == got["efficiency"].size
    assert np.all(np.diff(got["oil_temperature_C"][: sizes[2]]) > 0)  # the last axis runs fastest
    assert np.all(np.isfinite(got["efficiency"]))


def test_conditions_are_taken_from_a_measured_table(tmp_path):
    run("-o", tmp_path / "a.csv", "--conditions", SAMPLE / "table_8_loaded.csv")
    got = columns(tmp_path / "a.csv")
    assert got["speed_rpm"].size == 24
    assert got["output_torque_Nm"][:3] == pytest.approx([5, 10, 15])


def test_plot_is_the_map(tmp_path):
    run("--plot", tmp_path / "map.png", "--table", tmp_path / "map.csv")
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "map.csv").exists()


def test_rows_outside_the_validity_are_told(tmp_path):
    result = run("-o", tmp_path / "a.csv", "-e", "speed-dependent-friction", "--grid", "speed_rpm=0.1,1500")
    assert "sliding_speed outside" in result.stderr
    assert "33 rows" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-e", "seal-drug=1"), "did you mean 'seal-drag'"),
        (("-e", "seal-drag.torqe=1"), "did you mean 'seal-drag.torque'"),
        (("-e", "seal-drag=much"), "is not a number"),
        (("-e", "seal-drag=-3"), "outside its domain"),
        (("-e", "seal-drag=2 degC"), "cannot be read"),
        (("-e", "seal-drag.torque"), "without a value"),
        (("--without", "seal-drag"), "not an effect of the base"),
        (("--grid", "speed=1"), "did you mean 'speed_rpm'"),
        (("--grid", "speed_rpm=fast"), "cannot be read"),
        (("-o", "no/such/place.csv"), "does not exist"),
        (("--noise", "-1"), "from 0 to 1e30"),
    ],
)
def test_requests_that_cannot_be_carried_out(arguments, message):
    with pytest.raises(RequestError, match=message):
        run(*arguments)


def test_unknown_model_and_missing_files():
    with pytest.raises(RequestError, match="did you mean 'worm-gear'"):
        run(model="worm-gaer")
    with pytest.raises(RequestError, match="does not exist"):
        run(rig="nowhere.toml")
    with pytest.raises(InputError, match="does not exist"):
        run("--conditions", "nowhere.csv")


SPRINGS = """
from specan.models import Model, Parameter, effect


@effect("preload", adds_to="force", neutral={"size": 0.0})
def preload(*, size=Parameter(0.5, "N", min=-3, max=3, per="specimen")):
    \"\"\"Each spring begins with a force of its own.\"\"\"
    return size


def force(stretch, rate):
    return rate * stretch


model = Model.from_function(
    force, conditions={"stretch": ("mm", 0, 10)}, observables={"force": ("N", 0.1)},
    parameters={"rate": (3.0, 1, 5, "N/mm")}, effects=[preload], groups="specimen",
)
"""


@pytest.mark.parametrize("how", ["grid", "table"])
def test_columns_of_names_say_which_parameter_holds(tmp_path, how):
    (tmp_path / "springs.py").write_text(SPRINGS, encoding="utf-8")
    (tmp_path / "rows.csv").write_text("stretch,specimen\n2,lower\n2,upper\n4,lower\n", encoding="utf-8")
    if how == "grid":
        rows = ("--grid", "stretch=2,4", "--grid", "specimen=lower,upper")
    else:
        rows = ("--conditions", tmp_path / "rows.csv")
    effects = ("-e", "preload.size_lower=1", "-e", "preload.size_upper=2")
    arguments = ["simulate", str(tmp_path / "springs.py"), *map(str, rows), *effects]
    result = CliRunner().invoke(main, [*arguments, "--json"])
    found = [(r["stretch"], r["specimen"], r["force"]) for r in json.loads(result.stdout)["rows"]]
    expected = [(2, "lower", 7), (2, "upper", 8), (4, "lower", 13), (4, "upper", 14)]  # 3 N/mm, and 1 or 2 N
    assert sorted(found) == expected[: len(found)]
    assert len(found) == (4 if how == "grid" else 3)
    CliRunner().invoke(main, [*arguments, "-o", str(tmp_path / "out.csv")])
    assert ",upper," in (tmp_path / "out.csv").read_text(encoding="utf-8")


def test_a_table_with_decimal_commas_is_that_with_points(tmp_path):
    import pandas as pd

    run("--grid", "speed_rpm=1200,1500", "-o", tmp_path / "points.csv")
    run("--grid", "speed_rpm=1200,1500", "-o", tmp_path / "commas.csv", "--decimal", ",")
    points = pd.read_csv(tmp_path / "points.csv", comment="#")
    commas = pd.read_csv(tmp_path / "commas.csv", comment="#", sep=";", decimal=",")
    pd.testing.assert_frame_equal(points, commas, check_dtype=False, rtol=1e-5)
