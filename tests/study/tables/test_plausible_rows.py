"""Tables compared with the rig and against themselves, before a fit."""

from dataclasses import replace

import numpy as np
import pytest
from open_tables import read_tables

from specan.errors import InputError
from specan.models import SettingError
from specan.study.data.setpoints import levels
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import base_problem

# The limits of the sample rig: 1200 to 2800 rpm, 0 to 90 N m, 25 to 80 degC.
PLAN = {"speeds": (1200, 2000, 2800), "torques": (5, 20, 50, 90), "temperatures": (30, 70)}


def observed(tables, folder, columns):
    model = tables.model(input_torque_Nm=0.01)
    return read_tables(model, [tables.write_table(folder / "t.csv", columns)])


@pytest.mark.parametrize(
    ("column", "wrong", "unit"),
    [
        ("speed_rpm", lambda v: v / 60, "rev/s"),
        ("speed_rpm", lambda v: v * np.pi / 30, "rad/s"),
        ("speed_rpm", lambda v: v / 1000, "thousands separator"),
        ("oil_temperature_C", lambda v: v * 9 / 5 + 32, "degF"),
    ],
)
def test_values_in_another_unit_stop_with_the_likely_one(tables, tmp_path, column, wrong, unit):
    columns = tables.bench(points=tables.grid(**PLAN))
    observed(tables, tmp_path, columns)
    columns[column] = wrong(columns[column])
    with pytest.raises(InputError, match=column) as fault:
        observed(tables, tmp_path, columns)
    assert unit in fault.value.remedy
    assert "t.csv, line " in fault.value.found


def test_a_speed_a_little_outside_is_only_remarked_on(tables, tmp_path):
    columns = tables.bench(points=tables.grid(speeds=(800, 1500, 2800)))
    told = observed(tables, tmp_path, columns).statements
    assert any("outside its limits" in text and "800" in text for text in told)


@pytest.mark.parametrize("seed", range(20))
def test_steps_that_the_readings_tell_apart_are_not_merged(seed):
    # 70, 80 and 90 N m with a setting of 5 %, held to 0.3 % in truth: 4 N m about 80 would take its neighbours in.
    plan = np.repeat([0, 5, 15, 25, 30, 40, 50, 60, 70, 80, 90.0], 15)
    read = plan * (1 + 0.003 * np.random.default_rng(seed).standard_normal(plan.size))
    level, is_set = levels(read, SettingError(0.05))
    assert not is_set
    np.testing.assert_allclose(level, plan, rtol=0.005)


def test_a_setting_that_scatters_as_declared_stays_one_level():
    whole = 0
    for seed in range(200):
        read = 50 * (1 + 0.05 * np.random.default_rng(seed).standard_normal(40))
        whole += np.unique(levels(read, SettingError(0.05))[0]).size == 1
    assert whole >= 170


@pytest.mark.long
@pytest.mark.parametrize(("kind", "lines"), [("reading", "line 7"), ("condition", "line 31")])
def test_a_reading_or_a_condition_that_is_off_is_named_by_its_lines(tables, tmp_path, kind, lines):
    columns = tables.bench(seed=3, points=tables.grid(**PLAN), setting="read")
    data = observed(tables, tmp_path, columns)
    [o] = data.fitted
    rows = np.flatnonzero(o.replicate_group == o.replicate_group[5]) if kind == "condition" else np.array([5])
    measured = o.measured.copy()
    measured[rows] += 10 * o.sigma[5]
    model = tables.model(input_torque_Nm=0.01)
    found = diagnose(base_problem(model, [replace(o, measured=measured)]))
    told = [text for text in (found.reason, *found.remarks) if lines in text]
    assert found.probabilities[0].explanation.startswith(f"one {kind}")
    assert told
    clean = diagnose(base_problem(model, data.fitted))
    assert not any("is off" in text or "are off" in text for text in (clean.reason, *clean.remarks))
