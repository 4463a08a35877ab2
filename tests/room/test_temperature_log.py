"""The log of a thermometer beside a rig file."""

import numpy as np
import pytest

from specan.errors import InputError
from specan.models.catalogue import load_model, read_rig_file
from specan.room.model import EXAMPLE_RIG


def logged(tmp_path, text):
    log = tmp_path / "air.csv"
    log.write_text(text, encoding="utf-8")
    return {**EXAMPLE_RIG, "air": {"temperature_log": str(log)}}


def test_mean_and_span_are_those_of_the_log(tmp_path):
    model = load_model("room", logged(tmp_path, "time_s,temperature_C\n0,22.0\n60,22.6\n120,23.2\n"))
    assert float(np.asarray(model.quantities["nominal_air_temperature"]())) == pytest.approx(22.6 + 273.15)
    (sd,) = [n.prior_sd for n in model.nuisances if n.effect == "temperature"]
    given = EXAMPLE_RIG.get("uncertainty", {}).get("temperature_K", 0.5)
    assert sd == pytest.approx(np.sqrt(given**2 + 1.2**2 / 12))  # rectangular over 1.2 K
    assert any(note.startswith("air.csv: air of 22.60 degrees") for note in model.notes)


def test_the_log_lies_beside_the_rig_file(tmp_path):
    (tmp_path / "air.csv").touch()
    (tmp_path / "rig.toml").write_text('[air]\ntemperature_log = "air.csv"\n')
    assert read_rig_file(tmp_path / "rig.toml")["air"]["temperature_log"] == str(tmp_path / "air.csv")


def test_a_log_of_a_spreadsheet_with_decimal_commas_is_read(tmp_path):
    model = load_model("room", logged(tmp_path, "time_s;temperature_C\n0;22,0\n60;22,6\n120;23,2\n"))
    assert float(np.asarray(model.quantities["nominal_air_temperature"]())) == pytest.approx(22.6 + 273.15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,degrees\n0,22\n", "columns time_s, degrees"),
        ("time_s,temperature_C\n0,warm\n", "that is no number"),
        ("time_s,temperature_C\n0,295.1\n", "goes from 295.1 to 295.1"),
        ("", "columns none"),
    ],
)
def test_other_logs_are_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        load_model("room", logged(tmp_path, text))


def test_a_log_that_is_not_there_is_refused(tmp_path):
    rig = {**EXAMPLE_RIG, "air": {"temperature_log": str(tmp_path / "none.csv")}}
    with pytest.raises(InputError, match=r"none\.csv does not exist"):
        load_model("room", rig)
