"""``specan octave`` as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan.errors import InputError, RequestError
from specan_cli.main import main

RATE = 8000


@pytest.fixture(scope="module")
def directory(tmp_path_factory) -> Path:
    """A tone of 500 Hz in two microphones, the same with a background, and the background."""
    place = tmp_path_factory.mktemp("octave")
    t = np.arange(3 * RATE) / RATE
    tone = np.sqrt(2) * np.sin(2 * np.pi * 500 * t)
    hum = 0.5 * np.sqrt(2) * np.sin(2 * np.pi * 100 * t)
    for name, samples in {"tone": (0.2 * tone, 0.02 * tone), "hum": (0.2 * hum, 0.02 * hum)}.items():
        wavfile.write(place / f"{name}.wav", RATE, np.stack(samples, axis=1).astype(np.float32))
    (place / "channels.toml").write_text(
        '[[channel]]\nchannel = "*"\nrole = "microphone"\nunit = "Pa"\n', encoding="utf-8"
    )
    return place


def run(*arguments):
    return CliRunner().invoke(
        main, ["octave", *map(str, arguments)], catch_exceptions=False, standalone_mode=False
    )


def content(*arguments):
    return json.loads(run(*arguments, "--json").stdout)


def test_json_holds_bands_overall_levels_and_settings(directory):
    found = content(directory / "tone.wav", "--fraction", 1)
    assert found["nominal_hz"] == [16, 31.5, 63, 125, 250, 500, 1000, 2000]
    first, second = found["channels"]
    assert first["level_dB"][5] == pytest.approx(80.0, abs=0.01)
    assert second["level_dB"][5] == pytest.approx(60.0, abs=0.01)
    assert first["overall_dB"]["Z"] == pytest.approx(80.0, abs=0.001)
    assert first["overall_dB"]["A"] == pytest.approx(76.75, abs=0.03)
    assert first["level_reference"] == "20 uPa"
    assert found["settings"]["fraction"] == 1
    assert "at rest at the start" in found["settling"]
    assert (found["other_settling"], found["settings"]["settling"]) == ("left-out", "counted")
    assert len(first["other_settling_dB"]) == len(first["level_dB"])
    assert first["band_flags"][0][0] == "edges"  # the tone is cut
    assert first["band_flags"][5] == []
    assert found["u_dB"][0] > found["u_dB"][-1]


def test_percentiles_are_printed_written_and_in_the_json(directory, tmp_path):
    arguments = [directory / "tone.wav", "--fraction", 1, "--averaging", "fast"]
    arguments += ["--percentile", 10, "--percentile", 99.5, "--fmin", 500, "--fmax", 500]
    first = content(*arguments)["channels"][0]
    assert list(first["percentile_dB"]) == ["0", "10", "99.5", "100"]
    for levels in first["percentile_dB"].values():  # a steady tone
        assert levels == [pytest.approx(80.0, abs=0.05)]
    assert first["percentile_overall_dB"]["10"]["A"] == pytest.approx(76.75, abs=0.05)
    printed = run(*arguments, "-o", tmp_path / "levels.txt").stdout
    heading = next(line for line in printed.splitlines() if "L99.5" in line)
    assert heading.split() == ["Hz", "max", "L10", "L99.5", "min"]
    lines = (tmp_path / "levels.txt").read_text(encoding="utf-8").splitlines()
    table = [line.split("\t") for line in lines if not line.startswith("#")]
    assert table[0] == [
        "channel",
        "band_hz",
        "level_dB",
        "u_dB",
        "max_dB",
        "L10_dB",
        "L99.5_dB",
        "min_dB",
        "flags",
    ]
    assert [float(cell) for cell in table[1][4:8]] == pytest.approx([80.0] * 4, abs=0.05)
    assert {len(line) for line in table} == {9}


def test_one_band_weighted_in_time(directory):
    found = content(
        directory / "tone.wav", "--band", 500, "--averaging", "fast", "--hold", "max", "--interval", 0.5
    )
    assert (found["averaging"], found["hold"]) == ("fast", "max")
    assert found["history_interval_s"] == 0.5
    assert found["history_time_s"] == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert found["channels"][0]["level_dB"] == pytest.approx([80.0], abs=0.02)
    assert len(found["channels"][0]["history_dB"][0]) == 6
    slow = content(directory / "tone.wav", "--averaging", "0.5", "--band", 500)
    assert slow["averaging"] == "0.5 s"


def test_the_table_names_references_and_settling(directory):
    printed = run(directory / "tone.wav", "--fmin", 400, "--fmax", 600).stdout
    assert "1/3 octave levels, Z weighting, linear averaging, 0 s to 3 s" in printed
    assert "dB re 20 uPa" in printed
    assert "80.00" in printed
    assert "overall A" in printed
    assert "Settling" not in printed  # the default is in the header of files, and in the JSON
    left_out = run(directory / "tone.wav", "--fmin", 400, "--fmax", 600, "--settling", "left-out").stdout
    assert "Settling: " in left_out


def test_a_background_is_taken_off(directory):
    found = content(directory / "tone.wav", "--background", directory / "hum.wav", "--fraction", 1)
    first = found["channels"][0]
    # 6 dB above the background in all, though it is in another band
    assert first["overall_dB"]["Z"] == pytest.approx(80.0 - 1.25, abs=0.02)
    assert first["level_dB"][5] == pytest.approx(80.0, abs=0.01)
    assert "low-snr" in first["band_flags"][3]
    assert "ISO 3744" in found["notes"][-1]


def test_figures_and_text(directory, tmp_path):
    assert run(directory / "tone.wav", "--plot", tmp_path / "a.svg", "-o", tmp_path / "a.txt").exit_code == 0
    assert (tmp_path / "a.svg").read_text(encoding="utf-8").startswith("<?xml")
    lines = (tmp_path / "a.txt").read_text(encoding="utf-8").splitlines()
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    assert rows[0] == ["channel", "band_hz", "level_dB", "u_dB", "flags"]
    assert [row[2] for row in rows if row[1] == "500"] == [
        "79.997",
        "59.997",
    ]  # some of the cut tone is beside the band
    assert [row[1] for row in rows[-4:]] == ["total-Z", "total-A", "total-B", "total-C"]
    run(directory / "tone.wav", "--averaging", "fast", "--history", "--plot", tmp_path / "b.png")
    assert (tmp_path / "b.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (("--hold", "max"), RequestError, "hold, interval and percentiles need averaging fast"),
        (("--fmax", 4000), RequestError, "up to 3150 Hz"),
        (("--band", 500, "--fmin", 100), RequestError, "not both"),
        (("--averaging", "-1"), RequestError, "a time constant in s above 0"),
        (("--plot", "a.gif"), RequestError, "ends in"),
        (("--plot", "a.csv"), RequestError, "give --output a.csv"),
        (("--plot", "nowhere/a.png"), RequestError, "does not exist"),
        (("--history",), RequestError, "--averaging fast"),
        (("--background", "nowhere.wav"), InputError, "nowhere.wav"),
    ],
)
def test_what_cannot_be_done(directory, arguments, kind, message):
    with pytest.raises(kind, match=message):
        run(directory / "tone.wav", *arguments)


def test_a_level_without_the_ends_stands_beside_one_channel_alone(directory):
    """Of several channels the table says where; the values are in the JSON and in the file."""
    t = np.arange(RATE) / RATE
    burst = np.where(t > 0.9, np.sin(2 * np.pi * 250 * t), 0.0).astype(np.float32)
    wavfile.write(directory / "burst.wav", RATE, np.stack([burst, burst / 2], axis=1))
    one = run(directory / "burst.wav", "--channel", "Channel 1", "--fraction", 1).stdout
    both = run(directory / "burst.wav", "--fraction", 1).stdout
    assert "edges left-out=" in one
    assert " edges\n" in both
    assert "left-out" not in both
    assert "(--json, -o: the level without them)" in both
