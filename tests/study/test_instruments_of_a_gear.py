"""Errors of a gear's torque sensors over a campaign: found with their size, on both sides of zero."""

import copy

import numpy as np
import pytest
from open_tables import read_tables

from specan.models.chosen_model import ChosenModel, grid, predict
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.selection.candidates import base_problem
from specan.worm_gear.model.build import build
from specan.worm_gear.model.rig import EXAMPLE_RIG
from tests.study.few import beside

NOISE = 0.004  # N*m


def rig(**tables):
    found = copy.deepcopy(EXAMPLE_RIG)
    found["uncertainty"] = {"input_torque_Nm": NOISE, "model_discrepancy_percent": 0.0}
    for name, keys in tables.items():
        found[name] = {**found[name], **keys}
    return found


def campaign(seed, offset=0.0, drift=0.0, turn=600.0):
    """Columns of a table: the gear of the base model, run at its true torques, read by sensors that are off.

    Rows without load are run with the brake uncoupled; its sensor shows its offset there too.
    """
    model = build(rig())
    rng = np.random.default_rng(seed)
    rows = grid(model, {"speed_rpm": [1200, 2000, 2800], "oil_temperature_C": [35, 70],
                        "output_torque_Nm": [0, 10, 25, 45, 70, 90]})  # fmt: skip
    order = rng.permutation(rows["speed_rpm"].size)
    rows = {name: values[order] for name, values in rows.items()}
    assembly = model.assemble(model.base_effects)
    time = turn * np.arange(order.size)
    torque = predict(ChosenModel(assembly, assembly.defaults), rows)["input_torque"]
    torque = torque + drift * time / 3600 + NOISE * rng.standard_normal(torque.size)
    return {**rows, "output_torque_Nm": rows["output_torque_Nm"] + offset, "input_torque_Nm": torque,
            "coupled": (rows["output_torque_Nm"] > 0).astype(float), "elapsed_time_s": time}  # fmt: skip


def problem(folder, columns, content):
    path = folder / "table.csv"
    lines = [",".join(columns)] + [
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    model = beside(
        build(content), "seal-drag", "thermal-lag", "torque-zero-error", "zero-drift", "torque-gain-error"
    )
    return base_problem(model, read_tables(model, [path]).fitted)


def without(columns, *names):
    return {name: values for name, values in columns.items() if name not in names}


@pytest.mark.parametrize("offset", [-0.45, pytest.param(0.45, marks=pytest.mark.long)])
@pytest.mark.parametrize("told", ["column", pytest.param("rig", marks=pytest.mark.long)])
def test_an_offset_of_the_output_sensor_is_found_on_both_sides_of_zero(tmp_path, offset, told):
    columns = without(campaign(1, offset), "elapsed_time_s", *([] if told == "column" else ["coupled"]))
    content = rig(operation={} if told == "column" else {"idle_uncoupled": True})
    found = diagnose(problem(tmp_path, columns, content))
    assert ("torque-zero-error",) in found.alternatives
    row = next(r for r in found.ranking if r.effects == ("torque-zero-error",))
    value = row.parameters["torque-zero-error.output"]
    assert value["low"] < offset < value["high"]
    assert value["high"] - value["low"] < abs(offset)


@pytest.mark.long
def test_intervals_of_an_offset_hold_the_truth_as_often_as_they_say(tmp_path):
    # Binomial: with 95 % each, 16 or more of 20 hold the truth in all but 3 of 1000 tries.
    inside = 0
    for seed in range(20):
        offset = 0.4 if seed % 2 else -0.4
        with_effect = problem(
            tmp_path, without(campaign(100 + seed, offset), "elapsed_time_s"), rig()
        ).with_uses(["torque-zero-error"])
        best = fit(with_effect)
        inside += abs(best.values["torque-zero-error.output"] - offset) < 1.96 * best.standard_error(
            "torque-zero-error.output"
        )
    assert inside >= 16


@pytest.mark.long
def test_an_offset_is_right_where_nobody_says_that_the_brake_was_uncoupled(tmp_path):
    columns = without(campaign(1, -0.6), "elapsed_time_s", "coupled")
    found = diagnose(problem(tmp_path, columns, rig()))
    assert ("torque-zero-error",) in found.alternatives
    row = next(r for r in found.ranking if r.effects == ("torque-zero-error",))
    value = row.parameters["torque-zero-error.output"]
    assert value["low"] < -0.6 < value["high"]
    whole = diagnose(problem(tmp_path, without(campaign(1), "elapsed_time_s", "coupled"), rig()))
    assert whole.verdict == "nothing-missing"


@pytest.mark.parametrize("drift", [-0.004, pytest.param(0.004, marks=pytest.mark.long)])
def test_a_drifting_zero_is_named_with_its_rate(tmp_path, drift):
    found = diagnose(problem(tmp_path, campaign(2, drift=drift), rig()))
    assert found.alternatives[0] == ("zero-drift",)
    value = found.ranking[0].parameters["zero-drift.rate"]
    assert value["low"] < drift < value["high"]


def test_noise_in_percent_and_of_read_temperatures_is_counted(tmp_path):
    columns = without(campaign(3), "elapsed_time_s")
    columns["oil_temperature_C"] = columns["oil_temperature_C"] + np.random.default_rng(3).normal(
        0.0, 0.3, 36
    )
    plain = problem(tmp_path, columns, rig()).observations[0]
    more = problem(
        tmp_path, columns, rig(uncertainty={"input_torque_percent": 0.3, "oil_temperature_reading_K": 0.5})
    ).observations[0]
    added = np.diag(more.covariance) - np.diag(plain.covariance)
    percent = (0.003 * columns["input_torque_Nm"]) ** 2
    # slope over temperature by differences of the true model
    model = build(rig())
    assembly = model.assemble(model.base_effects)
    request = ChosenModel(assembly, assembly.defaults)
    ends = [
        predict(request, {**columns, "oil_temperature_C": columns["oil_temperature_C"] + d})["input_torque"]
        for d in (0.05, -0.05)
    ]
    slope = (ends[0] - ends[1]) / 0.1
    assert added == pytest.approx(percent + (0.5 * slope) ** 2, rel=0.1)


@pytest.mark.long
def test_a_thermometer_that_stayed_in_the_room_is_told(tmp_path):
    """The oil is set to 40, 55 and 70 degC, twice; the column says what the room has."""
    model = build(rig())
    rng = np.random.default_rng(31)
    at = {"speed_rpm": [500, 1200, 1900, 2600], "output_torque_Nm": [10, 30, 50, 70]}
    passes = [grid(model, at | {"oil_temperature_C": [warm]}) for warm in (40, 55, 70, 40, 55, 70)]
    rows = {name: np.concatenate([one[name] for one in passes]) for name in passes[0]}
    assembly = model.assemble(model.base_effects)
    torque = predict(ChosenModel(assembly, assembly.defaults), rows)["input_torque"]
    room = 22 + rng.normal(0, 0.3, torque.size)
    columns = rows | {"oil_temperature_C": np.round(room, 1), "repeat": np.repeat([1.0, 2.0], 48)}
    columns["input_torque_Nm"] = torque + NOISE * rng.standard_normal(torque.size)
    found = diagnose(problem(tmp_path, columns, rig()))
    assert found.verdict == "faulty-data"
    assert "oil temperature is not the effective one; its sensor may be in another place" in found.reason
