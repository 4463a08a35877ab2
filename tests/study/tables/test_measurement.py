"""Columns of a measured table: what is used, what is derived, what is refused."""

import numpy as np
import pytest
from open_tables import read_tables

from specan.errors import InputError, RequestError
from specan.study.data.held_out import chosen
from specan.study.data.open_tables import _column
from specan.study.data.operating_table import grouping_of, join
from specan.study.data.table_reader import read_measurement
from specan.study.observation import DataFile

RATIO = 7.5


@pytest.fixture(scope="module")
def gear(tables):
    return tables.model(input_torque_Nm=0.01)


@pytest.fixture
def whole(tables):
    """Exact columns of a small grid."""
    columns = tables.grid()
    columns["input_torque_Nm"] = tables.input_torque(columns)
    columns["efficiency"] = columns["output_torque_Nm"] / (RATIO * columns["input_torque_Nm"])
    return columns


@pytest.fixture
def read(tmp_path, tables, gear):
    def read_columns(columns, **more):
        return join([read_file(tables.write_table(tmp_path / "table.csv", columns), gear, **more)], gear)

    return read_columns


def read_file(path, model, **more):
    return read_measurement(DataFile(path.name, path, **more), model)


def without(columns, *names):
    return {n: v for n, v in columns.items() if n not in names}


def test_the_input_torque_is_fitted_and_an_efficiency_beside_it_only_checked(whole, read):
    found = read(whole)
    assert set(found.observable) == {"input_torque"}
    np.testing.assert_allclose(found.measured, whole["input_torque_Nm"])
    assert "used once" in found.notes[0]
    assert found.conditions["worm_speed"][0] == pytest.approx(800 * np.pi / 30)
    assert found.conditions["indicated_oil_temperature"][0] == pytest.approx(318.15)


def test_oil_as_cool_as_the_room_is_told(whole, read, tables, gear, tmp_path):
    assert not any("thermometer" in note for note in read(whole).notes)
    whole["oil_temperature_C"] = 22 + 0.3 * np.sin(np.arange(whole["speed_rpm"].size))
    (said,) = [note for note in read(whole).notes if "thermometer" in note]
    assert "oil_temperature_C is 21.7 to 22.3 in every row, as warm as the room" in said
    path = tables.write_table(tmp_path / "cool.csv", whole)
    assert read_tables(gear, [path]).doubts == (said.replace("table.csv", "cool.csv"),)


def test_efficiency_is_fitted_where_the_input_torque_is_missing(whole, read):
    found = read(without(whole, "input_torque_Nm"))
    assert set(found.observable) == {"efficiency"}
    mixed = {n: v.copy() for n, v in whole.items()}
    mixed["input_torque_Nm"][:3] = np.nan
    found = read(mixed)
    assert found.observable[:4].tolist() == ["efficiency"] * 3 + ["input_torque"]


def test_the_output_torque_follows_from_the_other_two(whole, read):
    found = read(without(whole, "output_torque_Nm"))
    np.testing.assert_allclose(
        found.conditions["indicated_output_torque"], whole["output_torque_Nm"], rtol=1e-6
    )


def test_an_idle_row_needs_its_input_torque(whole, read):
    columns = whole
    columns["output_torque_Nm"][0], columns["efficiency"][0] = 0.0, np.nan
    assert read(columns).measured[0] == pytest.approx(columns["input_torque_Nm"][0], rel=1e-6)
    columns["input_torque_Nm"][0], columns["efficiency"][0] = np.nan, 0.0
    with pytest.raises(InputError, match=r"line 2.*input_torque_Nm where the output torque is zero"):
        read(columns)


@pytest.mark.parametrize("reading", [-0.8, -0.02, 0.0, 0.8])
def test_an_idle_brake_that_reads_off_zero_agrees_with_an_efficiency_of_zero(whole, read, reading):
    whole["output_torque_Nm"][0], whole["efficiency"][0] = reading, 0.0
    found = read(whole)
    assert found.observable[0] == "input_torque"
    assert found.measured[0] == pytest.approx(whole["input_torque_Nm"][0], rel=1e-6)


@pytest.mark.parametrize(("torque", "efficiency"), [(20.0, 0.0), (-0.8, 0.2), (0.8, 0.4)])
def test_an_efficiency_that_no_idle_row_has_contradicts_the_torques(whole, read, torque, efficiency):
    whole["output_torque_Nm"][0], whole["efficiency"][0] = torque, efficiency
    whole["input_torque_Nm"][0] = max(whole["input_torque_Nm"][0], 1.2 * torque / RATIO)
    with pytest.raises(InputError, match=r"line 2.*contradict each other"):
        read(whole)


def fault(**changes):
    """The exact table with some columns replaced, renamed or taken out."""

    def make(whole):
        columns = dict(whole)
        for name, change in changes.items():
            if change is None:
                del columns[name]
            elif isinstance(change, str):
                columns = {change if n == name else n: v for n, v in columns.items()}
            else:
                columns[name] = change(columns[name].copy())
        return columns

    return make


def at(row, value):
    def change(column):
        column[row] = value
        return column

    return change


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (fault(speed_rpm=None), "column 'speed_rpm' is missing"),
        (fault(speed_rpm="speed_Hz"), "unknown column 'speed_Hz'.*give 'speed_rpm'"),
        (fault(output_torque_Nm="outputtorque_Nm"), "did you mean 'output_torque_Nm'"),
        (fault(input_torque_Nm=None, efficiency=None), "no column that the model predicts"),
        (fault(input_torque_Nm=at(2, np.nan), efficiency=at(2, np.nan)), "line 4: fewer than two"),
        (fault(efficiency=lambda c: 100 * c, input_torque_Nm=None), "in percent"),
        (fault(efficiency=at(0, 1.04), input_torque_Nm=None), "line 2: efficiency 1.04"),
        (fault(speed_rpm=at(1, 0.0)), "line 3: the speed is 0 rpm"),
        (fault(oil_temperature_C=lambda c: c + 273.15), "likely in K"),
        (fault(input_torque_Nm=at(3, -1.0), efficiency=None), "line 5: the input torque is -1"),
        (fault(output_torque_Nm=at(3, -40.0), efficiency=None), "counted positive"),
        (fault(input_torque_Nm=lambda c: 0.1 * c, efficiency=None), "exchanged, or in other units"),
        (fault(efficiency=lambda c: 0.9 * c), "contradict each other"),
        (fault(oil_temperature_C=at(0, np.nan)), "line 2: no value in the column 'oil_temperature_C'"),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(whole, read, make, told):
    with pytest.raises(InputError, match=told):
        read(make(whole))


def test_a_condition_of_the_whole_file(whole, read):
    found = read(without(whole, "oil_temperature_C"), conditions={"oil_temperature_C": 45.0})
    assert set(np.round(found.conditions["indicated_oil_temperature"], 2)) == {318.15}
    with pytest.raises(InputError, match="as a constant too"):
        read(whole, conditions={"oil_temperature_C": 45.0})
    with pytest.raises(InputError, match="did you mean 'oil_temperature_C'"):
        read(whole, conditions={"oil_temprature_C": 45.0})


def test_one_condition_is_no_measurement(tmp_path, tables, whole, gear):
    alike = {n: np.repeat(v[:1], 5) for n, v in whole.items()}
    path = tables.write_table(tmp_path / "t.csv", alike)
    with pytest.raises(InputError, match="5 rows, all at the same condition"):
        read_tables(gear, [path])
    path = tables.write_table(tmp_path / "t.csv", {n: v[:1] for n, v in whole.items()})
    with pytest.raises(InputError, match="one row"):
        read_tables(gear, [path])


def test_a_condition_that_one_table_lacks_takes_the_rigs_value(tmp_path, tables, whole, gear):
    one = read_file(tables.write_table(tmp_path / "a.csv", whole), gear)
    two = read_file(tables.write_table(tmp_path / "b.csv", without(whole, "oil_temperature_C")), gear)
    rows = join([one, two], gear)
    assert set(np.round(rows.conditions["indicated_oil_temperature"][len(one.frame) :], 2)) == {331.15}
    assert any("58" in note for note in rows.notes)
    timed = {**whole, "elapsed_time_s": 60.0 * np.arange(24)}
    rows = join([one, read_file(tables.write_table(tmp_path / "c.csv", timed), gear)], gear)
    assert "elapsed_time" not in rows.conditions


def matching(rows, model, where):
    return chosen({model.conditions[n].column: _column(rows, model, n) for n in rows.conditions}, where)


def test_rows_are_held_out_by_level(tmp_path, tables, gear):
    path = tables.write_table(tmp_path / "t.csv", tables.bench())
    rows = join([read_file(path, gear)], gear)
    near_50 = np.abs(rows.conditions["indicated_output_torque"] / 50 - 1) < 0.2
    np.testing.assert_array_equal(matching(rows, gear, "torque=50"), near_50)
    scatter = float(grouping_of(gear, gear.conditions["indicated_output_torque"]).at(50.0))
    level = rows.levels["indicated_output_torque"][near_50][0]
    for away, found in ((2.5, near_50), (-2.5, near_50)):  # of three standard deviations of setting
        np.testing.assert_array_equal(matching(rows, gear, f"torque={level + away * scatter}"), found)
    with pytest.raises(RequestError, match=r"no row has output_torque_Nm = .* N·m; expected one of .* N·m"):
        matching(rows, gear, f"torque={level + 4 * scatter}")
    np.testing.assert_array_equal(
        matching(rows, gear, "speed_rpm=800,1500"), rows.conditions["worm_speed"] < 200
    )
    both = matching(rows, gear, "speed=800") | matching(rows, gear, "oil_temperature_C=70")
    data = read_tables(gear, [path], hold_out=[(None, "speed=800"), (None, "oil_temperature_C=70")])
    assert data.held_out[0].n == both.sum()
    assert data.fitted[0].n == rows.n - both.sum()


@pytest.mark.parametrize(
    ("where", "told"),
    [("torque=63", "expected one of"), ("tork=60", "one of speed_rpm"), ("torque=fast", "is not a number"),
     ("e=5", "names no single column")],
)  # fmt: skip
def test_a_wrong_hold_out_says_what_there_is(tmp_path, tables, gear, where, told):
    path = tables.write_table(tmp_path / "t.csv", tables.bench())
    with pytest.raises(Exception, match=told):
        read_tables(gear, [path], hold_out=[(None, where)])
