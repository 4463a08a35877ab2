"""The rig file: what it must say, what it may leave out, what cannot be."""

import copy
import tomllib
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models import SettingError, TableFault
from specan.models.catalogue import load_model
from specan.worm_gear.model import EXAMPLE_RIG, build
from specan.worm_gear.model.build import complete
from specan.worm_gear.model.rig import SERIES, SIZES, read_rig

SAMPLE = Path(__file__).parents[2] / "sample_data/worm_gear/rig.toml"


def changed(*keys, value=None, drop=False):
    """The example rig with one value changed or dropped."""
    rig = copy.deepcopy(EXAMPLE_RIG)
    place = rig
    for key in keys[:-1]:
        place = place[key]
    if drop:
        del place[keys[-1]]
    else:
        place[keys[-1]] = value
    return rig


def test_sample_rig_and_example_say_the_same():
    sample = tomllib.loads(SAMPLE.read_text(encoding="utf-8"))
    assert read_rig(sample) == read_rig(EXAMPLE_RIG)


@pytest.mark.parametrize(
    ("rig", "message"),
    [
        (changed("gear", "wheel_width_mm", value=-25.0), "gear.wheel_width_mm"),
        (changed("gear", "z_worm", drop=True), "gear.z_worm' is missing"),
        (changed("gear", "lead_angle_deg", value=45.0), "lead angle near 18.92"),
        (changed("gear", "worm_bearing_positions_mm", value=[31.0, -31.0]), "each side of the mesh"),
        (changed("gear", "worm_widht_mm", value=1.0), "did you mean 'worm_width_mm'"),
        (changed("oil", "viscosity_100C_mm2_s", value=300.0), "are they exchanged"),
        (changed("oil", "viscosity_40C_mm2_s", value="thick"), "oil.viscosity_40C_mm2_s"),
        (changed("operation", "oil_level_percent", value=0.0), "operation.oil_level_percent"),
        (changed("limits", "speed_rpm", value=[3000.0, 300.0]), "speed_rpm from low to high"),
        (changed("uncertainty", "input_torque_Nm", value=-0.01), "uncertainty.input_torque_Nm"),
        (changed("bearing", 0, "designation", value="6213"), "did you mean '62"),
        (changed("bearing", 0, "designation", value="6211-2RSH"), "seal_torque_Nm"),
        (changed("bearing", 0, "count", value=1), "the wheel shaft has 1 bearings"),
        (changed("bearing", 0, "shaft", value="axle"), "'bearing' entry 1 'shaft'"),
        (changed("bearings", value=[]), "did you mean 'bearing'"),
    ],
)
def test_impossible_rigs_are_refused_with_the_key(rig, message):
    with pytest.raises(RequestError, match=message.replace("[", r"\[")):
        build(rig)


def test_nobody_locates_a_shaft():
    rig = copy.deepcopy(EXAMPLE_RIG)
    for entry in rig["bearing"]:
        entry["locating"] = False
    with pytest.raises(RequestError, match="takes the axial load"):
        build(rig)


def test_the_bearing_that_is_named_takes_the_axial_load():
    def locating(which):
        rig = copy.deepcopy(EXAMPLE_RIG)
        rig["bearing"][which]["locating"] = True
        model = build(rig)
        found = model.assemble().evaluate({"worm_speed": 100.0, "indicated_output_torque": 50.0})
        return list(found["bearing_axial_load"] > 0)

    assert locating(1) == [True, False, True, False]
    assert locating(2) == [False, True, True, False]


def test_defaults_that_were_used_are_told():
    rig = changed("operation", drop=True)
    used = load_model("worm-gear", rig).rig.defaults_used
    assert used["operation.oil_temperature_C"] == 60.0
    assert "gear.lead_angle_deg" not in used
    assert not any(key.startswith("uncertainty.input_torque") for key in used)  # nothing is assumed there


def test_only_certificates_that_are_given_become_nuisances():
    assert build(EXAMPLE_RIG).nuisances == ()
    rig = changed("uncertainty", value={"input_torque_zero_Nm": 0.01, "oil_temperature_K": 0.5})
    found = {(n.effect, n.parameter): n.prior_sd for n in build(rig).nuisances}
    assert found == {("torque-zero-error", "input"): 0.01, ("temperature-bias", "bias"): 0.5}


def test_studies_get_si_by_name_of_condition():
    rig = build(EXAMPLE_RIG).rig
    assert rig.limits["worm_speed"] == pytest.approx((125.66, 293.22), abs=0.01)
    assert rig.limits["indicated_oil_temperature"] == pytest.approx((298.15, 353.15))
    assert rig.setting == {"indicated_output_torque": SettingError(relative=0.05)}
    assert rig.discrepancy_percent == 0.5


def test_the_bearing_table_is_whole():
    for size, (bore, outside, rating) in SIZES.items():
        assert size[:2] in SERIES
        code = int(size[2:])
        assert bore == {0: 10, 1: 12, 2: 15, 3: 17}.get(code, 5 * code)  # ISO 15: bore code
        assert bore < outside < 5 * bore
        assert 0.5 < rating * 1e3 / (outside - bore) ** 2 < 25.0


def test_load_ratings_grow_with_size_within_a_series():
    for series in SERIES:
        ratings = [rating for size, (_, _, rating) in sorted(SIZES.items()) if size[:2] == series]
        assert ratings == sorted(ratings)


@pytest.mark.parametrize(
    ("torques", "refused"),
    [
        ((0.53, 0.49, 20.0, 60.0), False),
        ((-0.6, -0.55, 20.0, 60.0), False),
        ((4.8, 5.1, 20.0, 60.0), True),  # one load, read on both sides of a twentieth of 100 N m
        ((0.5, 4.8, 20.0, 60.0), True),
    ],
)
def test_small_loads_are_not_taken_for_idle_runs_in_silence(torques, refused):
    output = np.array(torques)
    columns = {
        "speed_rpm": np.full(4, 1200.0),
        "output_torque_Nm": output,
        "input_torque_Nm": 1.0 + output / 5,
    }
    said = (
        pytest.raises(TableFault, match=r"4\.8 Nm is below 5 Nm, a twentieth") if refused else nullcontext()
    )
    with said:
        complete(columns, {}, ratio=7.5, ambient=22.0, idle_below=5.0)
