"""What a diagnosis says of rows before it blames physics, and of parts that have another published form."""

import re

import numpy as np
import pytest
from open_tables import read_tables

from specan.models import Model, Parameter, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.evidence.faults import faults
from specan.study.evidence.marginal import Tangent
from specan.study.selection.candidates import base_problem
from specan.study.verdict import headline
from tests.study.few import beside


def verdict(tables, tmp_path, columns, *more, **uncertainty):
    """The verdict beside few effects, and those that are named: a fault of the rows is none of the gear."""
    gear = tables.model(**uncertainty)
    few = beside(gear, "seal-drag", "windage", "load-dependent-friction", *more)
    data = read_tables(few, [tables.write_table(tmp_path / "table.csv", columns)])
    return diagnose(base_problem(few, data.fitted))


GRID = {"speeds": (600, 1000, 1500, 2000, 2800), "torques": (5, 15, 30, 50, 90)}


@pytest.mark.parametrize("drift", [0.0, 0.1])
def test_a_drift_over_the_rows_is_told_with_its_size(tables, tmp_path, drift):
    columns = tables.bench(3, repeats=2, points=tables.grid(**GRID))
    number = columns["input_torque_Nm"].size
    columns["input_torque_Nm"] = columns["input_torque_Nm"] + drift * np.arange(number) / (number - 1)
    found = verdict(tables, tmp_path, columns)
    said = [text for text in (found.reason, *found.remarks) if "drifts with the order" in text]
    assert len(said) == (1 if drift else 0)
    if drift:
        assert float(said[0].partition("by up to ")[2].split()[0]) == pytest.approx(drift, rel=0.2)


def test_a_drift_that_repeats_hold_too_is_named_with_its_size(tables, tmp_path):
    """A second round that reads 6 % more: the repeats tell a large scatter, and it is no noise that follows itself."""
    columns = tables.bench(3, repeats=2, points=tables.grid(**GRID))
    number = columns["input_torque_Nm"].size
    change = 0.12 * columns["input_torque_Nm"] * (np.arange(number) / (number - 1) - 0.5)
    columns["input_torque_Nm"] = columns["input_torque_Nm"] + change
    found = verdict(tables, tmp_path, columns)
    assert found.verdict == "faulty-data"
    said = found.reason.partition(
        "the gain of the readings drifts with the order of the rows, input_torque by up to "
    )
    assert float(said[2].split()[0]) == pytest.approx(np.ptp(change), rel=0.15)


def test_oil_that_was_changed_is_not_taken_for_another_level_alone(tables, tmp_path):
    """What the oil drags in proportion to a power of the speed is 30 % less from a row on."""
    plan = tables.grid(**GRID)
    order = np.random.default_rng(4).permutation(plan["speed_rpm"].size)
    columns = tables.bench(4, repeats=2, points={name: values[order] for name, values in plan.items()})
    columns["oil_level_percent"] = np.full(2 * order.size, 100.0)
    usual = tables.input_torque(columns)
    without = tables.input_torque(columns, {"churning.power": 0.0})
    later = np.arange(usual.size) >= 60
    columns["input_torque_Nm"] = columns["input_torque_Nm"] - 0.3 * (usual - without) * later
    found = verdict(tables, tmp_path, columns)
    assert found.verdict == "faulty-data"
    assert re.search(r"the machine behaves differently from line 6[0-4] of table.csv on", found.reason)


@pytest.mark.long
def test_a_thermometer_that_shows_the_room_costs_no_effect_a_name(tables, tmp_path):
    columns = tables.bench(5, repeats=2, points=tables.grid(**GRID))
    rows = columns["speed_rpm"].size
    columns["oil_temperature_C"] = 22 + np.round(np.random.default_rng(5).normal(0, 0.3, rows), 1)
    found = verdict(tables, tmp_path, columns, "shear-thinning", "viscosity-dependent-friction")
    assert found.verdict == "faulty-data"
    assert "its sensor may be in another place" in found.reason
    assert "it would be" not in found.reason
    assert found.alternatives == ((),)


def test_an_effect_that_explains_more_than_a_condition_is_named_beside_it(tmp_path):
    """A spring with a preload, and a thermometer that shows a tenth more of the difference to 25 degC."""

    def force(x, stiffness, warm):
        return stiffness * x * warm

    def warm(temperature):
        return np.exp(1800 / (temperature + 273.15) - 1800 / 298.15)

    known = Parameter(3, "N", min=0.1, max=30, lower=0)

    @effect("preload", adds_to="force", neutral={"size": 0.0})
    def preload(*, size=known):
        return size

    model = Model.from_function(
        force, warm, effects=[preload], units={"warm": "1"},
        conditions={"x": ("mm", 0, 10), "temperature": ("degC", -10, 50)},
        observables={"force": ("N", 0.02)}, parameters={"stiffness": (3, 1, 9, "N/mm")},
    )  # fmt: skip
    rng = np.random.default_rng(2)
    x, warmth = (a.ravel() for a in np.meshgrid(np.arange(1.0, 9.0), [-5.0, 10.0, 25.0, 33.0, 42.0]))
    acts = 25 + (warmth - 25) / 1.1
    read = 3 * x * warm(acts) + 4.0 + rng.normal(0, 0.02, x.size)
    rows = [f"{x[k]},{warmth[k]},{read[k]:.4f}" for k in rng.permutation(x.size)]
    (tmp_path / "t.csv").write_text("\n".join(["x,temperature,force", *rows]) + "\n", encoding="utf-8")
    found = diagnose(base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted))
    assert "temperature of another place" in headline(found)
    assert headline(found).endswith("Missing beside it: preload (above 99 %).")


def test_readings_that_share_a_set_up_are_no_drift(tmp_path):
    def force(x, a):
        return a * x

    model = Model.from_function(
        force,
        conditions={"x": ("mm", 0, 10)},
        observables={"force": ("N", 0.02)},
        parameters={"a": (2, 1, 5)},
    )
    random, told = np.random.default_rng(1), 0
    for _ in range(4):  # each set-up of four places, in three rounds, is read ten times
        place = np.repeat(np.tile([2.0, 4.0, 6.0, 8.0], 3), 10)
        number = np.repeat(np.arange(12), 10)
        read = 2 * place + random.normal(0, 0.1, 12)[number] + random.normal(0, 0.02, 120)
        rows = [f"{x},{y:.4f},{k}" for x, y, k in zip(place, read, number, strict=True)]
        (tmp_path / "t.csv").write_text("\n".join(["x,force,setup", *rows]) + "\n", encoding="utf-8")
        problem = base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted)
        found = diagnose(problem)
        told += found.verdict != "nothing-missing" or any("drift" in text for text in found.remarks)
    assert told == 0


@pytest.mark.parametrize("order", ["of x", "random"])
def test_a_law_over_sorted_rows_is_no_sure_drift(tables, tmp_path, order):
    """A spring that hardens, read from small to large: 0.05 x^2 is what a gain that drifts would make."""

    def force(x, a, b):
        return a * x + b

    model = Model.from_function(
        force,
        conditions={"x": ("mm", 0, 10)},
        observables={"force": ("N", 0.02)},
        parameters={"a": (2, 1, 5), "b": (0, -1, 1)},
    )
    random, x = np.random.default_rng(1), np.linspace(0.5, 9, 12)
    read = 2.1 * x + 0.1 + 0.05 * x**2 + random.normal(0, 0.02, x.size)
    rows = np.arange(x.size) if order == "of x" else random.permutation(x.size)
    path = tables.write_table(tmp_path / "t.csv", {"x": x[rows].round(3), "force": read[rows].round(4)})
    found = diagnose(base_problem(model, read_tables(model, [path]).fitted))
    assert found.verdict == "unknown-effect"
    assert any("drifts" in text for text in found.remarks) == (order == "of x")


def test_a_repeat_that_lies_off_is_named_by_its_line_and_size(tables, tmp_path):
    columns = tables.bench(4, repeats=2, points=tables.grid(**GRID))
    columns["input_torque_Nm"][20] += 25 * tables.NOISE
    found = verdict(tables, tmp_path, columns)
    assert found.verdict == "faulty-data"
    said = found.reason.partition("the reading of line 22 of table.csv is off, input_torque by up to ")[2]
    assert float(said.split()[0]) == pytest.approx(25 * tables.NOISE, rel=0.15)


def copies_told(tables, tmp_path, columns):
    found = verdict(tables, tmp_path, columns)
    return [text for text in (found.reason, *found.remarks) if "are copies" in text]


@pytest.mark.long
def test_copied_rows_are_named_by_their_lines(tables, tmp_path):
    columns = tables.bench(8, repeats=2, points=tables.grid(**GRID))
    assert not copies_told(tables, tmp_path, columns)
    rows = columns["speed_rpm"].size
    twice = {name: np.tile(values, 2) for name, values in columns.items()}
    (said,) = copies_told(tables, tmp_path, twice)
    assert f"line {rows + 2} of table.csv and line 2 of table.csv" in said
    assert f"and {rows - 3} more pairs" in said
    one = {name: np.append(values, values[:1]) for name, values in columns.items()}
    assert not copies_told(tables, tmp_path, one)


@pytest.mark.long
def test_a_few_copied_rows_are_seen_by_conditions_that_are_read(tables, tmp_path):
    columns = tables.bench(8, repeats=2, setting="read", points=tables.grid(**GRID))
    assert not copies_told(tables, tmp_path, columns)
    for values in columns.values():
        values[-6:] = values[:6]
    (said,) = copies_told(tables, tmp_path, columns)
    rows = columns["speed_rpm"].size
    assert f"line {rows - 4} of table.csv and line 2 of table.csv" in said


def test_two_readings_of_conditions_that_were_read_once_are_no_copies(tables, tmp_path):
    columns = tables.bench(8, repeats=2, readings=2, noise=0.002, points=tables.grid(**GRID))
    del columns["setup"]
    twice = np.column_stack([v for n, v in columns.items() if n != "repeat"]).reshape(-1, 2, 4)
    assert np.sum(np.all(twice[:, 0] == twice[:, 1], axis=1)) > 5
    assert not copies_told(tables, tmp_path, columns)


def test_coarse_readings_at_set_conditions_agree_by_chance(tables, tmp_path):
    columns = tables.bench(9, repeats=4, setting="set", points=tables.grid(**GRID))
    columns["input_torque_Nm"] = np.round(columns["input_torque_Nm"] / 0.05) * 0.05
    table = np.column_stack([v for n, v in columns.items() if n not in ("repeat", "setup")])
    assert np.unique(table, axis=0).shape[0] < 0.9 * table.shape[0]
    assert not copies_told(tables, tmp_path, columns)


@pytest.mark.long
def test_a_condition_that_is_wrong_in_all_repeats_is_named(tables, tmp_path):
    columns = tables.bench(5, repeats=2, points=tables.grid(**GRID))
    columns["input_torque_Nm"][[20, 70]] *= 1.06
    found = verdict(tables, tmp_path, columns)
    assert "one condition are off (line 22 of table.csv, line 72 of table.csv)" in found.reason
    assert headline(found).startswith("The data have a fault: one condition")
    assert not found.next_measurement
    assert found.residual_law is None


@pytest.mark.long
def test_another_published_form_of_the_bearings_is_no_missing_effect(tables, tmp_path):
    """A gear whose bearings follow Palmgren, made with the effect itself; and none where the SKF model holds."""
    plan = tables.grid(**GRID)
    made = tables.bench(6, repeats=3, points=plan)
    assert verdict(tables, tmp_path, made, "palmgren-bearings", "iso-bearings").other_form == ""
    skf = tables.input_torque(made)
    others = {"bearing-friction.scale": 0.0, "palmgren-bearings.scale": 1.0}
    made["input_torque_Nm"] = made["input_torque_Nm"] + tables.input_torque(made, others) - skf
    found = verdict(tables, tmp_path, made, "palmgren-bearings", "iso-bearings")
    assert found.verdict == "nothing-missing"
    assert found.other_form == "palmgren-bearings in place of bearing-friction"
    assert not found.unknown_possible  # the data decide between the forms


@pytest.mark.long
def test_a_zero_error_without_certificate_is_found_beside_one_with_it(tables, tmp_path):
    """The output sensor's zero is off by 0.8 N*m either way, the input's has a certificate; idle runs uncoupled."""
    for offset in (0.8, -0.8):
        columns = tables.bench(7, repeats=3, points=tables.grid(GRID["speeds"], (0, *GRID["torques"])))
        columns["coupled"] = (columns["output_torque_Nm"] > 1).astype(float)
        columns["output_torque_Nm"] = columns["output_torque_Nm"] + offset * columns["coupled"]
        found = verdict(tables, tmp_path, columns, "torque-zero-error", input_torque_zero_Nm=0.01)
        assert ("torque-zero-error",) in found.alternatives
        row = next(r for r in found.ranking if r.effects == ("torque-zero-error",))
        value = row.parameters["torque-zero-error.output"]
        assert value["low"] < offset < value["high"]


def test_a_gain_changes_readings_by_a_share_of_themselves(tables, tmp_path):
    """Not by a share of the losses, of which the model is uncertain."""
    gear = tables.model(model_discrepancy_percent=0.5)
    data = read_tables(gear, [tables.write_table(tmp_path / "table.csv", tables.bench())])
    problem = base_problem(gear, data.fitted)
    best = fit(problem)
    predicted = np.concatenate(problem.predictions(best.theta))
    found = faults(Tangent.at(problem, best.theta, best.residual, best.jacobian), predicted)
    (drift,) = (fault.columns[:, 0] for fault in found if fault.name == "drift of the gain")
    np.testing.assert_allclose(drift, predicted * np.linspace(-0.5, 0.5, predicted.size), rtol=1e-9)
