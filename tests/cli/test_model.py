"""``specan model`` as a user calls it."""

import json

import pytest
from click.testing import CliRunner

from specan.errors import RequestError
from specan_cli.main import main


def run(*arguments):
    result = CliRunner().invoke(main, ["model", *map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def test_list_names_the_models():
    listed = json.loads(run("list", "--json"))
    gear = next(row for row in listed if row["name"] == "worm-gear")
    assert {"seal-drag", "thermal-lag", "churning"} <= set(gear["effects"])
    assert "worm-gear" in run("list")


def test_show_model_holds_everything_as_json():
    model = json.loads(run("show", "worm-gear", "--json"))
    assert model["base_effects"] == ["bearing-friction", "churning", "tooth-friction"]
    assert model["observables"]["input_torque"]["quantity"] == "indicated_input_torque"
    assert model["conditions"]["worm_speed"]["column"] == "speed_rpm"
    assert model["conditions"]["elapsed_time"]["default"] is None
    torque = model["effects"]["seal-drag"]["parameters"]["torque"]
    assert (torque["unit"], torque["plausible"], torque["neutral"]) == ("N*m", [0.02, 0.5], 0.0)
    assert "inlet-shear-heating" in model["quantities"]["bearing_rolling_moment"]["changed_by"]


def test_show_model_prints_names_whole():
    text = run("show", "worm-gear")
    for name in ("viscosity-dependent-friction", "indicated_input_torque", "oil_temperature_C"):
        assert name in text


def test_show_effect_teaches():
    text = run("show", "worm-gear", "seal-drag")
    for words in ("radial shaft seal", "0.02 to 0.5", "torque-zero-error", "Distinguished by", "Reference"):
        assert words in text


def test_show_quantity():
    text = run("show", "worm-gear", "kinematic_viscosity")
    assert "shear-thinning" in text
    assert "contact_temperature" in text


def test_show_with_a_rig(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text("[gear]\nz_worm = 2\n")
    with pytest.raises(RequestError, match=r"gear\.z_wheel"):
        run("show", "worm-gear", "--rig", rig)


def test_nearest_names_are_offered():
    with pytest.raises(RequestError, match="did you mean 'seal-drag'"):
        run("show", "worm-gear", "seal-drug")
    with pytest.raises(RequestError, match="did you mean 'worm-gear'"):
        run("show", "wormgear")
