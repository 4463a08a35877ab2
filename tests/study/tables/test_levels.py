"""Set or read, and which values were meant to be equal."""

import numpy as np
import pytest
from open_tables import read_tables

from specan.errors import InputError
from specan.models import Model, SettingError
from specan.study.data.setpoints import MOST_LEVELS, cells, grouped, levels, round_step

TORQUES = np.array([5, 15, 30, 50, 80.0])


def test_printed_set_values_are_set_though_closer_than_their_scatter():
    values = np.repeat([60.0, 70.0, 80.0, 90.0], 3)
    level, is_set = levels(values, SettingError(0.05))
    assert is_set
    np.testing.assert_array_equal(level, values)


@pytest.mark.parametrize("seed", range(5))
def test_a_brake_that_misses_its_set_value_is_read(seed):
    meant = np.repeat(TORQUES, 18)
    values = np.round(meant * (1 + 0.05 * np.random.default_rng(seed).standard_normal(meant.size)), 2)
    level, is_set = levels(values, SettingError(0.05))
    assert not is_set
    assert np.mean(np.abs(level / meant - 1) < 0.06) > 0.97


def test_a_speed_in_whole_rpm_is_read_though_values_come_twice():
    meant = np.repeat([600.0, 1000, 1800, 2800], 30)
    values = np.round(meant * (1 + 0.005 * np.random.default_rng(1).standard_normal(meant.size)))
    level, is_set = levels(values, SettingError(0.02))
    assert not is_set
    assert np.unique(level).size == 4


def test_odd_values_that_come_again_and_again_are_set():
    values = np.tile([4.9, 14.9, 29.91, 49.92], 6)
    level, is_set = levels(values, SettingError(0.05))
    assert is_set
    np.testing.assert_array_equal(level, values)


def test_a_random_plan_is_read():
    values = np.random.default_rng(3).uniform(5, 90, 15).round(2)
    assert not levels(values, SettingError(0.01))[1]


def test_one_value_is_set():
    assert levels(np.full(4, 100.0), SettingError(0.05))[1]


def test_round_steps():
    assert round_step(np.array([1200.0, 1500, 2000, 2400, 2800])) == 100
    assert round_step(np.array([0.0, 2.5, 5.0])) == 2.5
    assert round_step(np.array([4.83, 9.67])) == pytest.approx(0.01)


def test_many_levels_are_grouped_with_their_neighbours():
    values = np.arange(60.0)
    found = np.unique(grouped(values))
    assert found.size <= MOST_LEVELS
    assert np.all(np.abs(grouped(values) - values) < 8)
    np.testing.assert_array_equal(grouped(np.array([3.0, 1.0])), [3.0, 1.0])


def test_cells_number_combinations():
    assert cells(np.array([1.0, 2, 1, 2]), np.array([5.0, 5, 5, 6])).tolist() == [0, 1, 0, 2]


def test_temperatures_in_kelvin_are_as_far_apart_as_in_degrees(tmp_path):
    """A heat flow of 2 W/K from 25, 30, 40, 55 and 70 degC: five conditions, of which one is put aside."""

    def heat(T, k):
        return k * (T - 290.0)

    (tmp_path / "t.csv").write_text(
        "T [degC],heat [W]\n" + "".join(f"{t},{2 * t:.3f}\n" for t in (25, 30, 40, 55, 70))
    )
    for unit, low, high in (("K", 273, 400), ("degC", 0, 127)):
        model = Model.from_function(
            heat, conditions={"T": (unit, low, high)}, observables={"heat": ("W", 0.1)},
            parameters={"k": (2.0, 0.1, 10, "W/K")},
        )  # fmt: skip
        data = read_tables(model, [tmp_path / "t.csv"])
        assert "5 levels" in " ".join(data.statements)
        np.testing.assert_allclose(data.fitted[0].sigma, 0.1, rtol=1e-5)


def test_rows_nearer_than_they_can_be_set_are_refused_with_the_reason(tmp_path):
    def force(travel, rate):
        return rate * travel

    model = Model.from_function(
        force, conditions={"travel": ("m", 0, 1)}, observables={"force": ("N", 0.1)},
        parameters={"rate": (2.0, 0.1, 10, "N/m")},
    )  # fmt: skip
    (tmp_path / "t.csv").write_text("travel,force\n0.5,1\n0.502,1\n0.5037,1\n")
    with pytest.raises(
        InputError, match=r"differ in travel by no more than .* smaller travel_setting_percent"
    ):
        read_tables(model, [tmp_path / "t.csv"])
