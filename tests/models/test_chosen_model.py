"""Effects and values as a user writes them; predictions over rows."""

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models import conditions_over_limits
from specan.models.catalogue import example_model
from specan.models.chosen_model import choose_model, grid, outside_validity, predict, to_conditions

MODEL = example_model("worm-gear")


def test_values_come_as_si_by_full_name():
    request = choose_model(
        MODEL, ["bearing-preload=5", "bearing-preload.free_temperature=20", "running-in.time=2 hour"]
    )
    assert request.values["bearing-preload.growth"] == pytest.approx(0.005)
    assert request.values["bearing-preload.free_temperature"] == pytest.approx(293.15)
    assert request.values["running-in.time"] == pytest.approx(7200)
    assert {str(use) for use in request.assembly.uses} == {
        *MODEL.base_effects, "bearing-preload", "running-in",
    }  # fmt: skip


def test_a_second_copy_has_its_own_value():
    request = choose_model(MODEL, ["seal-drag=0.1", "seal-drag@2=0.3"])
    assert request.values == {"seal-drag.torque": 0.1, "seal-drag@2.torque": 0.3}


def test_conditions_are_converted_and_others_passed_over():
    columns = {"speed_rpm": np.array([60.0]), "oil_temperature_C": np.array([0.0]), "note": np.array([1.0])}
    found = to_conditions(MODEL, columns)
    assert set(found) == {"worm_speed", "indicated_oil_temperature"}
    assert found["worm_speed"] == pytest.approx(2 * np.pi)
    assert found["indicated_oil_temperature"] == pytest.approx(273.15)


def test_prediction_is_the_models_evaluation():
    request = choose_model(MODEL, ["seal-drag=0.2"])
    rows = grid(MODEL, {"speed_rpm": [1000, 2000], "output_torque_Nm": [0, 50]})
    got = predict(request, rows)
    again = request.assembly.evaluate(to_conditions(MODEL, rows), request.values)
    np.testing.assert_array_equal(got["input_torque"], again["indicated_input_torque"])
    assert got["power_loss"].shape == (4,)


def test_an_unknown_column_is_refused():
    with pytest.raises(RequestError, match="did you mean 'speed_rpm'"):
        grid(MODEL, {"speed_rmp": [1]})


def test_rows_outside_are_counted():
    request = choose_model(MODEL, ["speed-dependent-friction"])
    rows = grid(MODEL, {"speed_rpm": [0.01, 0.02, 1500.0], "output_torque_Nm": [10.0]})
    [said] = outside_validity(request, rows)
    assert said.startswith("2 rows have sliding_speed outside 0.0005 to ")
    assert outside_validity(choose_model(MODEL), rows) == []


def test_own_effects_are_checked_all_over_what_the_rig_can_run():
    rows = conditions_over_limits(MODEL)
    for name, (low, high) in MODEL.rig.limits.items():
        assert [rows[name].min(), rows[name].max()] == pytest.approx([low, high])
    each = [len(set(rows[name])) for name in MODEL.rig.limits]
    combined = {tuple(row) for row in zip(*(rows[n] for n in MODEL.rig.limits), strict=True)}
    assert len(combined) == np.prod(each) > 27
    assert np.all(np.diff(rows["elapsed_time"]) > 0)
    assert not np.all(np.diff(rows["worm_speed"]) >= 0)  # the order is random
