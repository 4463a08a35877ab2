"""``specan orders`` from a file: table, JSON, text, pictures, errors."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import specan
from specan.errors import RequestError
from specan.io.write_tdms import write_tdms
from specan.report.figures_spectra import figure_order_map
from specan_cli.main import main


@pytest.fixture(scope="module")
def run_up(tmp_path_factory):
    t = np.arange(51200) / 12800
    turns = 10 * t + 0.5 * t**2
    acceleration = 3 * np.cos(2 * np.pi * 24 * turns)
    path = tmp_path_factory.mktemp("orders") / "run.tdms"
    channels = [
        ("Acc 1", acceleration, {"unit_string": "m/s^2"}),
        ("Tacho", 5.0 * (turns % 1 < 0.1), {"unit_string": "V", "PulsesPerRevolution": 1}),
    ]
    names, samples, properties = zip(*channels, strict=True)
    write_tdms(path, names, np.stack(samples), 12800.0, channels=properties, group={}, samples="float32")
    return str(path)


def call(*arguments):
    return CliRunner().invoke(main, ["orders", *arguments], catch_exceptions=False)


def test_its_own_table_is_replaced_and_nothing_else(run_up, tmp_path):
    assert call(run_up, "-o", str(tmp_path / "orders.txt")).exit_code == 0
    assert call(run_up, "-o", str(tmp_path / "orders.txt")).exit_code == 0
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RequestError, match="does not say that specan wrote it"):
        CliRunner().invoke(
            main,
            ["orders", run_up, "-o", str(tmp_path / "notes.txt")],
            standalone_mode=False,
            catch_exceptions=False,
        )


def test_json_holds_lines_and_map(run_up):
    found = call(run_up, "--order", "24", "--max-order", "40", "--map", "--json", "--kurtosis")
    content = json.loads(found.stdout)
    line = content["channels"][0]["lines"][0]
    assert line["amplitude"] == pytest.approx(3.0, rel=2e-3)
    assert np.shape(content["channels"][0]["map"]) == (
        len(content["columns"]["speed_hz"]),
        len(content["order"]),
    )
    bands, values = content["kurtosis"]["bands_hz"], content["kurtosis"]["channels"]["Acc 1"]
    assert len(values) == len(bands)
    # The tone sweeps from 240 to 336 Hz: it is in the octave below 320 Hz for most of the time, a sine there.
    assert values[bands.index([160.0, 320.0])] == pytest.approx(1.5 * 4 / 3.33, rel=0.1)


def test_pictures_and_text(run_up, tmp_path):
    for name, extra in (("map.png", ["--map"]), ("spectrum.svg", ["--order", "24"])):
        result = call(run_up, "--max-order", "40", "--plot", str(tmp_path / name), *extra)
        assert result.exit_code == 0, result.output
        assert (tmp_path / name).stat().st_size > 1000
    call(run_up, "--max-order", "40", "-o", str(tmp_path / "orders.txt"))
    rows = [line.split("\t") for line in (tmp_path / "orders.txt").read_text().splitlines() if line[0] != "#"]
    assert rows[0][:3] == ["channel", "order", "amplitude"]
    strongest = max(rows[1:], key=lambda row: float(row[2]))
    assert strongest[1] == "24"


def test_a_map_is_over_speed_and_at_a_steady_speed_over_time(run_up):
    by_tacho, stated = specan.orders(run_up), specan.orders(run_up, speed_hz=25.0)
    assert [figure_order_map(one).pictures[0].y_label for one in (by_tacho, stated)] == [
        "Speed / Hz",
        "Time / s",
    ]


def test_an_envelope_band_that_cannot_be_read(run_up):
    with pytest.raises(RequestError, match="cannot be read"):
        call(run_up, "--envelope", "high")
