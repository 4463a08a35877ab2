"""``specan fft`` as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan.errors import RequestError
from specan_cli.main import main

RATE = 8000


@pytest.fixture(scope="module")
def tone(tmp_path_factory) -> Path:
    """Two channels at 500 Hz, half and quarter of full scale, the second a quarter period late."""
    t = np.arange(2 * RATE) / RATE
    samples = np.stack([0.5 * np.cos(2 * np.pi * 500 * t), 0.25 * np.sin(2 * np.pi * 500 * t)], axis=1)
    path = tmp_path_factory.mktemp("fft") / "tone.wav"
    wavfile.write(path, RATE, samples.astype(np.float32))
    return path


def run(*arguments):
    return CliRunner().invoke(
        main, ["fft", *map(str, arguments)], catch_exceptions=False, standalone_mode=False
    )


def content(*arguments):
    found = run(*arguments, "--json")
    return json.loads(found.stdout)


def test_json_holds_every_line(tone):
    found = content(tone, "--lines", 400)
    peak = int(np.argmax(found["channels"][0]["values"]))
    assert found["frequency_hz"][peak] == 500.0
    assert found["channels"][0]["values"][peak] == pytest.approx(0.5, rel=1e-6)
    assert found["channels"][1]["values"][peak] == pytest.approx(0.25, rel=1e-6)
    assert found["window"]["enbw_hz"] == pytest.approx(1.5 * RATE / 1024)
    assert found["channels"][0]["phase_deg"] is None
    assert len(found["channels"][0]["level_dB"]) == len(found["frequency_hz"]) == 513


def test_phase_over_a_reference_and_of_one_block(tone):
    names = [c["channel"] for c in content(tone)["channels"]]
    over = content(tone, "--lines", 400, "--reference", names[0])
    peak = over["frequency_hz"].index(500.0)
    assert over["channels"][1]["phase_deg"][peak] == pytest.approx(-90, abs=1e-6)
    alone = content(tone, "--whole")
    peak = alone["frequency_hz"].index(500.0)
    assert alone["channels"][0]["phase_deg"][peak] == pytest.approx(0, abs=1e-4)
    assert alone["averaging"] == "none"


@pytest.mark.parametrize("scaling", ["rms", "psd"])
def test_scalings(tone, scaling):
    found = content(tone, "--lines", 400, "--scaling", scaling)
    power = 0.5**2 / 2
    expected = {"rms": np.sqrt(power), "psd": power / found["window"]["enbw_hz"]}[scaling]
    assert max(found["channels"][0]["values"]) == pytest.approx(expected, rel=1e-6)


def test_table_names_the_peaks(tone):
    found = run(tone, "--peaks", 2, "--start", 0.5, "--stop", 1.9)
    assert "500" in found.stdout
    assert "RMS" in found.stdout


def test_text_file(tone, tmp_path):
    out = tmp_path / "spectrum.txt"
    run(tone, "--lines", 100, "--fmin", 100, "--fmax", 1000, "-o", out)
    lines = out.read_bytes().decode().splitlines()
    head = [line for line in lines if line.startswith("#")]
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    assert any("noise bandwidth" in line for line in head)
    assert rows[0] == ["channel", "frequency_hz", "amplitude", "level_dB", "phase_deg"]
    frequencies = sorted({float(row[1]) for row in rows[1:]})
    assert 100 <= frequencies[0] < frequencies[-1] <= 1000
    assert str(tmp_path) not in out.read_text()


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_plots(tone, tmp_path, suffix):
    out = tmp_path / f"spectrum.{suffix}"
    run(tone, "--whole", "--plot", out)
    assert out.stat().st_size > 5000


def test_spectrogram(tone, tmp_path):
    out, figure = tmp_path / "spectrogram.txt", tmp_path / "spectrogram.png"
    found = content(tone, "--spectrogram", "--lines", 100, "--columns", 10, "-o", out, "--plot", figure)
    assert len(found["time_s"]) <= 10
    level = np.array(found["channels"][0]["level_dB"])
    assert level.shape == (len(found["time_s"]), len(found["frequency_hz"]))
    assert found["frequency_hz"][int(np.argmax(level[3]))] == 500.0
    assert "channel\ttime_s\tfrequency_hz\tamplitude\tlevel_dB" in out.read_text().splitlines()
    assert figure.stat().st_size > 5000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--window", "hamm"], "window"),
        (["--lines", "4"], "lines"),
        (["--plot", "x.jpg"], ".png"),
        (["--averaging", "max", "--reference", "1"], "no channel"),
        (["--spectrogram", "--averaging", "max"], "averaging"),
        (["--spectrogram", "--whole"], "whole"),
        (["--fmin", "9000"], "no line"),
        (["--channel", "Nothing"], "no channel"),
    ],
)
def test_requests_that_cannot_be_carried_out(tone, arguments, message):
    with pytest.raises(RequestError, match=message):
        run(tone, *arguments)
