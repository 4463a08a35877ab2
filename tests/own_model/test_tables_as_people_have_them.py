"""One table in many forms gives one measurement; headers that are nothing known are told all at once."""

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from specan.errors import InputError, RequestError
from specan.models import Model
from specan.models.catalogue import example_model
from specan.study.data.operating_table import join
from specan.study.data.table_file import read_table
from specan.study.data.table_reader import read_measurement
from specan.study.observation import DataFile, kind_of
from specan.study.study_file import read_study_file
from specan_cli.main import main


def rows_of(path, model, **more):
    return join([read_measurement(DataFile(path.name, path, **more), model)], model)


def lift(flow, speed, share, scale):
    return scale * flow * speed * (1 - share)


@pytest.fixture
def pump():
    return Model.from_function(
        lift, conditions={"flow": "m3/h", "speed": "1/min", "share": "1"}, observables={"head": "m"},
        parameters={"scale": 1.0},
    )  # fmt: skip


FORMS = {
    "units in brackets": "flow [l/s];speed (rps);share [%];head [cm]\n1,5;50;20;250\n3;25;5;1,5e2\n",
    "units in a second row": "flow\tspeed\tshare\thead\n[l/s]\t[rps]\t[%]\t[cm]\n1.5\t50\t20\t250\n3\t25\t5\t150\n",
    "units without brackets below": "flow;speed;share;head\nl/s;rps;%;cm\n1,5;50;20;250\n3;25;5;150\n",
    "units behind a stroke": "flow / (l/s),speed / (rps),share,head / cm\n1.5,50,20 %,250\n3,25,5 %,150\n",
    "the model's own": "flow,speed,share,head\n5.4,3000,0.2,2.5\n10.8,1500,0.05,1.5\n",
    "capitals": "Flow [l/s],Speed [rps],Share [1],Head [m]\n1.5,50,0.2,2.5\n3,25,0.05,1.5\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_the_same_measurement(tmp_path, pump, form):
    path = tmp_path / "t.csv"
    path.write_text(FORMS[form], encoding="utf-8")
    same(rows_of(path, pump))


def same(found):
    # 1.5 and 3 l/s, 50 and 25 turns a second, 20 and 5 percent, 250 and 150 cm
    assert found.conditions["flow"] == pytest.approx([5.4, 10.8])
    assert found.conditions["speed"] == pytest.approx([3000, 1500])
    assert found.conditions["share"] == pytest.approx([0.2, 0.05])
    assert found.measured == pytest.approx([2.5, 1.5])


def test_the_printed_step_goes_with_the_unit(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text(FORMS["units in brackets"], encoding="utf-8")
    assert rows_of(path, pump).steps["flow"] == pytest.approx(0.1 * 3.6)


@pytest.mark.parametrize("ending", ["xlsx", "parquet"])
def test_workbooks_and_parquet(tmp_path, pump, ending):
    pytest.importorskip({"xlsx": "openpyxl", "parquet": "pyarrow"}[ending])
    frame = pd.DataFrame(
        {
            "flow [l/s]": [1.5, 3.0],
            "speed [rps]": [50.0, 25.0],
            "share [%]": [20.0, 5.0],
            "head [cm]": [250.0, 150.0],
        }
    )
    path = tmp_path / f"t.{ending}"
    frame.to_excel(path, index=False) if ending == "xlsx" else frame.to_parquet(path)
    same(rows_of(path, pump))


def test_a_workbook_without_its_reader_names_the_extra(tmp_path, pump, monkeypatch):
    (tmp_path / "t.xlsx").write_bytes(b"PK\x03\x04")

    def missing(*given, **more):
        raise ImportError

    monkeypatch.setattr(pd, "ExcelFile", missing)
    with pytest.raises(InputError, match=r'pip install "specan\[xlsx\]"'):
        rows_of(tmp_path / "t.xlsx", pump)


def test_chosen_columns_and_those_passed_over(tmp_path):
    gear = example_model("worm-gear")
    path = tmp_path / "t.csv"
    path.write_text("n [1/min];M2 [N m];M1 [N m];who\n1500;40;7,5;Anna\n2000;20;3,9;Ben\n", encoding="utf-8")
    columns = {"speed_rpm": "n [1/min]", "output_torque_Nm": "M2 [N m]", "input_torque_Nm": "M1 [N m]"}
    found = rows_of(path, gear, columns=columns)
    assert found.conditions["worm_speed"] == pytest.approx(2 * np.pi * np.array([25.0, 100 / 3]))
    assert found.measured == pytest.approx([7.5, 3.9])
    assert "t.csv: columns ignored: who" in found.notes
    short = {
        "speed_rpm": "n",
        "output_torque_Nm": "M2",
        "input_torque_Nm": "M1",
    }  # the header states the unit
    assert (
        rows_of(path, gear, columns=short).conditions["worm_speed"].tolist()
        == found.conditions["worm_speed"].tolist()
    )
    path.write_text("n;M2_Nm;M1\n1500;40000;7,5\n2000;20000;3,9\n", encoding="utf-8")
    named = {"speed_rpm": "n [1/min]", "output_torque_Nm": "M2_Nm [mN*m]", "input_torque_Nm": "M1"}
    again = rows_of(path, gear, columns=named)  # the unit is the user's word
    assert again.conditions["worm_speed"] == pytest.approx(found.conditions["worm_speed"])
    assert any("'M1' states no unit: assumed to be in N*m" in note for note in again.notes)
    with pytest.raises(InputError, match=r"has no column 'M2 \[N m\]'.*did you mean 'M2_Nm'"):
        rows_of(path, gear, columns=columns)


def test_all_unknown_columns_in_one_message(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("n [1/min];M2 [Nm];eta [%]\n1500;40;90\n", encoding="utf-8")
    with pytest.raises(InputError) as fault:
        rows_of(path, example_model("worm-gear"))
    said = str(fault.value)
    assert all(name in said for name in ("'n [1/min]'", "'M2 [Nm]'", "'eta [%]'", "--column"))


def test_a_unit_that_does_not_fit(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("flow [bar],speed,share,head\n1,2,3,4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"'flow' is in 'bar'; expected a unit of flow.*m3/h"):
        rows_of(path, pump)


def test_a_speed_per_second_is_ambiguous(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("flow,speed [1/s],share,head\n1,2,0.3,4\n", encoding="utf-8")
    with pytest.raises(InputError, match="may be turns or radians a second; write rps or rad/s"):
        rows_of(path, pump)


def test_units_say_which_header_is_which_column(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_bytes("Förderstrom [l/s];Drehzahl [1/min];eta [%];Höhe [m]\n1,5;1500;20;2\n".encode("cp1252"))
    with pytest.raises(InputError) as fault:
        rows_of(path, pump)
    pairs = ("flow=Förderstrom [l/s]", "speed=Drehzahl [1/min]", "share=eta [%]", "head=Höhe [m]")
    assert " ".join(f'--column "{pair}"' for pair in pairs) in str(fault.value)


def test_time_and_temperature_differ_by_a_capital_letter(tmp_path):
    model = Model.from_function(
        lambda t, rate: 20 - rate * t,
        conditions={"t": "s"},
        observables={"T": "degC"},
        parameters={"rate": 1.0},
    )
    path = tmp_path / "t.csv"
    path.write_text("t [min],T [K]\n1,283.15\n2,273.15\n", encoding="utf-8")
    found = rows_of(path, model)
    assert found.conditions["t"] == pytest.approx([60, 120])
    assert found.measured == pytest.approx([10, 0])


def test_two_headers_for_one_column(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("flow,flow [l/s],speed,share,head\n1,2,3,4,5\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"'flow' and 'flow \[l/s\]' are both"):
        rows_of(path, pump)


def test_missing_columns_all_at_once(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("flow,head\n1,2\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"the columns 'speed', 'share' are missing \(found: flow, head\)"):
        rows_of(path, pump)


def test_the_study_keeps_the_choice_of_columns(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    run = CliRunner().invoke
    assert run(main, ["model", "new", "pump.py"]).exit_code == 0
    text = (tmp_path / "pump.csv").read_text("utf-8").replace("flow [m3/h]", "Q [m3/h]")
    (tmp_path / "pump.csv").write_text(text, encoding="utf-8")
    new = ["study", "new", "s", "--model", "pump.py", "--measurement", "pump.csv"]
    assert run(main, new).exit_code != 0
    begun = run(main, [*new, "--column", "flow=Q [m3/h]"], catch_exceptions=False)
    assert begun.exit_code == 0
    assert read_study_file(tmp_path / "s").columns == {"flow": "Q [m3/h]"}
    found = run(main, ["study", "diagnose", "s"], catch_exceptions=False)
    assert "Missing: cavitation" in found.output


@pytest.mark.parametrize(
    "unit", ["rpm", "1/min", "min^-1", "min-1", "min⁻¹", "U/min", "r/min", "obr/min", "tr/min"]
)
def test_turns_a_minute_in_every_spelling(tmp_path, pump, unit):
    path = tmp_path / "t.csv"
    path.write_text(f"flow,speed [{unit}],share,head\n1,2900,0.1,4\n2,1450,0.1,4\n", encoding="utf-8")
    assert rows_of(path, pump).conditions["speed"] == pytest.approx([2900, 1450])


def test_other_letters_are_the_same_column(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("Flow,SPEED,Share,head\n1,2900,0.1,4\n2,1450,0.1,4\n", encoding="utf-8")
    assert rows_of(path, pump).conditions["flow"] == pytest.approx([1, 2])


def test_unknown_columns_beside_all_that_are_needed(tmp_path, pump):
    path = tmp_path / "t.csv"
    path.write_text("flow,speed,share,head,operator\n1,2900,0.1,4,5\n2,1450,0.1,4,5\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"no column is missing; to ignore the others, give --column \"flow=flow\""
    ):
        rows_of(path, pump)
    assert rows_of(path, pump, columns={"flow": "flow"}).n == 2


def test_an_empty_file_is_called_empty(tmp_path, pump):
    (tmp_path / "t.csv").touch()
    with pytest.raises(InputError, match=r"t\.csv is empty"):
        kind_of(tmp_path / "t.csv", pump)


def test_messages_name_the_file_as_the_user_did(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    run = CliRunner().invoke
    assert run(main, ["model", "new", "pump.py"]).exit_code == 0
    (tmp_path / "t.csv").write_text("flow,speed,head\n1,2900,x\n2,1450,4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"^t\.csv, line 2: 'x' in the column 'head' is not a number"):
        run(
            main,
            ["study", "new", "s", "--model", "pump.py", "--measurement", "t.csv"],
            catch_exceptions=False,
        )


def test_a_sheet_of_a_workbook_with_lines_above_the_header(tmp_path, monkeypatch):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["a cover page"])
    sheet = book.create_sheet("Runs")
    for row in (["Bench 3"], ["Operator", "K."], [], ["flow [l/s]", "speed", "head", "note 1", "note 2"]):
        sheet.append(row)
    sheet.append([5, 2900, 32.6, "x", "y"])
    sheet.append([10, 2900, 28.4, "x", "y"])
    book.save(tmp_path / "runs.xlsx")
    table = read_table(tmp_path / "runs.xlsx", sheet="Runs")
    assert list(table.frame) == ["flow [l/s]", "speed", "head"]
    assert table.frame["head"].tolist() == [32.6, 28.4]
    assert table.notes == ["lines above the header ignored: Bench 3; Operator K."]
    first = read_table(tmp_path / "runs.xlsx")
    assert first.frame.equals(table.frame)
    assert first.notes[0] == "the sheet 'Runs' is read"
    for sheet in ("Sheet", "Run"):
        with pytest.raises(InputError, match=r"no table on a sheet .*--sheet: Sheet, Runs"):
            read_table(tmp_path / "runs.xlsx", sheet=sheet)
    del book["Runs"]
    book.save(tmp_path / "cover.xlsx")
    with pytest.raises(InputError, match=r"cover\.xlsx has no table; give a sheet a header and numbers"):
        read_table(tmp_path / "cover.xlsx")


def test_a_title_that_is_nearly_as_wide_as_the_table(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text(
        "Pump bench;12 May;\nflow;speed;head\n[m3/h];[1/min];[m]\n5,0;2900;32,6\n10,0;2900;28,4\n"
    )
    table = read_table(path)
    assert list(table.frame) == ["flow [m3/h]", "speed [1/min]", "head [m]"]
    assert table.notes == ["lines above the header ignored: Pump bench 12 May"]


def test_a_sheet_of_what_has_no_sheets_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    begin = ["study", "new", "s", "--model", "pump.py", "--measurement", "pump.csv", "--sheet", "Runs"]
    CliRunner().invoke(main, ["model", "new", "pump.py"])
    with pytest.raises(RequestError, match=r"none of the tables has a sheet 'Runs'; expected a workbook"):
        CliRunner().invoke(main, begin, catch_exceptions=False, standalone_mode=False)
