"""Rows are held out in the units of the table or in one that is given; likely mistakes of a unit are told."""

import warnings

import numpy as np
import pytest
from click.testing import CliRunner
from open_tables import read_tables

from specan.errors import InputError, RequestError
from specan.models import Model
from specan_cli.main import main

PLAN = [(flow, speed) for flow in (10, 20, 30, 40) for speed in (1200, 1800, 2400)]


def head(flow, speed, scale):
    return scale * flow * speed


def leak(flow, gap):
    return gap * flow


BENCH = Model.from_function(
    head, leak, conditions={"flow": ("m3/h", 5, 50), "speed": ("1/min", 1000, 3000)},
    observables={"head": ("m", 0.01), "leak": ("m3/h", 0.1)}, parameters={"scale": 1e-4, "gap": 0.1},
)  # fmt: skip


def table(place, rows, header="flow [l/s],speed,head,leak"):
    path = place / "t.csv"
    path.write_text(
        "\n".join([header, *(",".join(f"{v:.5g}" for v in row) for row in rows)]) + "\n", encoding="utf-8"
    )
    return path


@pytest.fixture
def litres(tmp_path):
    return table(tmp_path, [(q / 3.6, n, q * n / 1e4, 0) for q, n in PLAN])


@pytest.mark.parametrize(
    ("where", "flows"),
    [
        ("flow=5.5556", {20}),  # 20 m3/h
        ("flow=20 m3/h", {20}),
        ("flow=5..9", {20, 30}),
        ("flow=18..31 m3/h, 2.778", {10, 20, 30}),
        ("flow=18 m3/h..31 m3/h", {20, 30}),
        ("flow=300 l/min .. 31 m3/h", {20, 30}),
        ("flow=18 m3/h..31", {20, 30}),
        ("flo=333.33 l/min", {20}),
    ],
)
def test_a_value_is_in_the_units_of_the_table_or_its_own(litres, where, flows):
    found = read_tables(BENCH, [litres], hold_out=[(None, where)])
    assert set(np.round(found.held_out[0].conditions["flow"], 2)) == flows


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("flow=20", "one of 2.778, 5.556, 8.333, 11.11 l/s"),
        ("flow=20..30", "one of 2.778"),
        ("flow=5 bar", "'bar' in 'flow=5 bar' is not a unit of flow"),
        ("flow", "value,value or flow=low..high"),
    ],
)
def test_what_no_row_has_is_refused_with_what_there_is(litres, where, said):
    with pytest.raises(RequestError, match=said):
        read_tables(BENCH, [litres], hold_out=[(None, where)])


def test_turns_a_second_in_a_column_of_turns_a_minute_are_told(tmp_path):
    path = table(tmp_path, [(q / 3.6, n / 60, q * n / 1e4, 0) for q, n in PLAN])
    with pytest.raises(InputError, match=r"speed is 20 to 40 1/min.*likely in rev/s"):
        read_tables(BENCH, [path])


def test_one_row_outside_is_no_unit(tmp_path):
    path = table(
        tmp_path, [(q / 3.6 * (-1 if k == 0 else 1), n, q * n / 1e4, 0) for k, (q, n) in enumerate(PLAN)]
    )
    assert any(r"outside its limits" in text for text in read_tables(BENCH, [path]).statements)


def test_a_column_of_zeros_is_a_measurement(litres):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_tables(BENCH, [litres]).known


def test_a_model_without_limits_is_checked_as_far_as_it_goes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    text = "from specan.models import Model\ndef lift(flow, slope):\n    return slope * flow\n"
    text += 'model = Model.from_function(lift, conditions={"flow": "m3/h"}, observables={"lift": ("m", 0.1)},'
    (tmp_path / "m.py").write_text(text + ' parameters={"slope": 1.0})\n', encoding="utf-8")
    (tmp_path / "t.csv").write_text("flow,lift\n1,2\n2,4\n3,6\n", encoding="utf-8")
    checked = CliRunner().invoke(main, ["model", "check", "m.py"])
    assert (checked.exit_code, "no limits of flow" in checked.output) == (0, True)
    assert (
        CliRunner().invoke(main, ["study", "new", "s", "--model", "m.py", "--measurement", "t.csv"]).exit_code
        == 0
    )
