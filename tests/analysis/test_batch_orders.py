"""Orders in a batch: a table of its own, where a recording has a tacho or the settings ask for it."""

import numpy as np
import pytest
from scipy.io import wavfile

import specan
from specan.analysis.batch.one_file import _analyse
from specan.analysis.batch.settings import BatchSettings, read_settings
from specan.analysis.batch.tables import with_orders
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError

RATE, N = 12800.0, 12800 * 6
TIME = np.arange(N) / RATE
TURNS = 10 * TIME + 0.3 * TIME**2  # a run-up from 10 Hz to 13.6 Hz
VIBRATION = 3 * np.cos(2 * np.pi * 24 * TURNS + 0.5)
TACHO = np.clip(20 * np.sin(2 * np.pi * TURNS), -2.5, 2.5)  # rises through its middle at whole turns
LEVEL = 20 * np.log10(3 / np.sqrt(2) / 1e-6)  # re 1 um/s^2, ISO 1683


def recording(*, tacho: bool = True) -> Recording:
    rest = {"sampling_rate": RATE, "n_samples": N}
    channels = [Channel("Acc", unit="m/s^2", role="accelerometer", **rest)]
    if tacho:
        channels.append(Channel("Tacho", role="tacho", properties={"PulsesPerRevolution": 1}, **rest))
    return Recording("run.tdms", tuple(channels), ArraySource([VIBRATION, TACHO][: len(channels)]))


def result(one: Recording, **settings):
    asked = BatchSettings(**settings)
    found = with_orders(_analyse(one, asked), one, asked)
    return found, [line.split("\t") for line in found.blocks.get("orders.txt", "").splitlines()]


def test_orders_that_are_asked_for_have_phase_and_uncertainty():
    found, rows = result(recording(), orders={"orders": (24.0, 12.0), "max_order": 40.0})
    assert [(r[0], r[1], r[2], r[3]) for r in rows] == [
        ("run.tdms", "Acc", "m/s^2", "12"), ("run.tdms", "Acc", "m/s^2", "24"),
    ]  # fmt: skip
    order_24 = rows[1]
    assert float(order_24[4]) == pytest.approx(3.0, rel=0.002)
    assert float(order_24[5]) == pytest.approx(LEVEL, abs=0.02)
    assert float(order_24[6]) == pytest.approx(np.degrees(0.5), abs=0.5)
    assert float(order_24[7]) < 0.02
    assert float(rows[0][4]) < 0.01
    assert any("by Tacho" in line for line in found.about)
    assert "other.txt" in found.blocks


def test_a_tacho_alone_gives_the_spectrum():
    _, rows = result(recording())
    highest = max(rows, key=lambda row: float(row[4]))
    assert highest[3] == "24"
    assert float(highest[5]) == pytest.approx(LEVEL, abs=0.05)
    assert highest[6:9] == ["", "", ""]
    assert rows[0][3] == "0.125"


def test_without_a_tacho_there_is_no_table_and_with_a_request_a_reason():
    found, _ = result(recording(tacho=False))
    assert "orders.txt" not in found.blocks
    found, rows = result(recording(tacho=False), orders={"mesh": 24})
    assert (rows, found.blocks["orders.txt"], found.kind) == ([], "", "done")
    assert any(why.startswith("no orders: ") and "no tacho" in why for _, why in found.set_aside)
    _, rows = result(recording(tacho=False), orders={"orders": (24.0,), "speed_hz": 11.8})
    assert len(rows) == 1


def test_settings_are_as_before_where_no_orders_are_asked_for(tmp_path):
    assert '"orders"' not in BatchSettings().as_json()
    path = tmp_path / "settings.toml"
    path.write_text("[orders]\nmesh = 66\nsidebands = 3\n", encoding="utf-8")
    asked = read_settings(path, {})
    assert asked.orders.wanted[:2] == (63.0, 64.0)
    assert asked.fingerprint != BatchSettings().fingerprint


def test_the_table_comes_and_goes_with_the_tacho(tmp_path):
    place, out = tmp_path / "in", tmp_path / "out"
    place.mkdir()
    samples = np.stack([VIBRATION, TACHO], axis=1).astype(np.float32)
    wavfile.write(place / "run.wav", int(RATE), samples)
    table = place / "channels.csv"
    table.write_text(
        "channel,role,unit\nChannel 1,accelerometer,m/s^2\nChannel 2,tacho,V\n", encoding="utf-8"
    )
    asked = {"orders": (24.0,), "pulses_per_turn": 1.0, "max_order": 40.0}
    report = specan.batch(place, out, jobs=1, orders=asked)
    frame = report.table("orders")
    assert frame[["order", "amplitude"]].round(2).values.tolist() == [[24.0, 3.0]]
    again = specan.batch(place, out, jobs=1, orders=asked)
    assert again.resumed == 1
    assert len(again.table("orders")) == 1

    table.write_text(
        "channel,role,unit\nChannel 1,accelerometer,m/s^2\nChannel 2,generator,V\n", encoding="utf-8"
    )
    report = specan.batch(place, out, jobs=1)
    assert not (out / "orders.txt").exists()
    assert "orders.txt" not in [path.name for path in report.tables]


def test_a_text_of_the_command_orders_stays_and_a_batch_that_is_asked_for_orders_is_refused(tmp_path):
    from click.testing import CliRunner

    from specan_cli.main import main

    place, out = tmp_path / "in", tmp_path / "out"
    place.mkdir()
    out.mkdir()
    wavfile.write(place / "run.wav", int(RATE), VIBRATION.astype(np.float32))
    asked = ["orders", str(place / "run.wav"), "--speed", "10", "-o", str(out / "orders.txt")]
    assert CliRunner().invoke(main, asked, catch_exceptions=False).exit_code == 0
    before = (out / "orders.txt").read_bytes()
    specan.batch(place, out, jobs=1)
    assert (out / "orders.txt").read_bytes() == before
    with pytest.raises(RequestError, match=r"orders.txt is not a table of a batch: another command wrote it"):
        specan.batch(place, out, jobs=1, orders={"speed_hz": 10.0})
    assert (out / "orders.txt").read_bytes() == before
    (out / "orders.txt").unlink()
    for _ in range(2):  # a table of an earlier batch is replaced
        specan.batch(place, out, jobs=1, orders={"speed_hz": 10.0})
