"""``specan rms`` as a user calls it."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan.errors import RequestError
from specan_cli.main import main

RATE = 8000


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """A clipped tone and a dead channel."""
    place = tmp_path_factory.mktemp("rms")
    tone = 0.2 * np.sqrt(2) * np.sin(2 * np.pi * 125 * np.arange(4 * RATE) / RATE)
    samples = np.stack([tone, np.clip(8 * tone, -1, 1), np.zeros(tone.size)], axis=1)
    wavfile.write(place / "a.wav", RATE, samples.astype(np.float32))
    (place / "channels.toml").write_text(
        '[[channel]]\nchannel = "*"\nrole = "microphone"\nunit = "Pa"\n', encoding="utf-8"
    )
    return place / "a.wav"


def run(*arguments):
    return CliRunner().invoke(
        main, ["rms", *map(str, arguments)], catch_exceptions=False, standalone_mode=False
    )


def test_json_holds_every_value(recording):
    printed = run(recording, "--json")
    found = json.loads(printed.stdout)
    first, clipped, dead = found["channels"]
    assert first["rms"] == pytest.approx(0.2, rel=1e-6)
    assert first["level_dB"] == pytest.approx(80.0, abs=1e-4)
    assert first["crest_factor"] == pytest.approx(np.sqrt(2), rel=1e-4)
    assert first["equivalent_dB"]["A"] == pytest.approx(80 - 16.19, abs=0.03)
    assert list(first["time_weighted_dB"]["exceeded"]) == ["5", "10", "50", "90", "95"]
    assert first["time_weighted_dB"]["exceeded"]["50"] == pytest.approx(80 - 16.19, abs=0.05)
    assert clipped["flags"][:2] == ["clipped", "edges"]  # it begins with a step, which is an event or a cut
    assert dead["flags"] == ["dead"]
    assert dead["level_dB"] is None
    assert dead["crest_factor"] is None
    assert "Warning: " in printed.stderr


def test_percentiles_and_weighting_that_were_asked_for(recording):
    found = json.loads(
        run(recording, "--percentile", 1, "--percentile", 99, "--weighting", "z", "--json").stdout
    )
    assert found["channels"][0]["time_weighted_dB"]["exceeded"] == pytest.approx(
        {"1": 80.0, "99": 80.0}, abs=0.05
    )
    with pytest.raises(RequestError, match=r"percentiles.*less than 100"):
        run(recording, "--percentile", 100)


def test_the_tables(recording):
    printed = run(recording, "--start", 1, "--stop", 3).stdout
    assert "1 s to 3 s, about the mean" in printed
    assert "20 uPa" in printed
    assert "80.00" in printed
    assert "L95" in printed


def test_numpy_says_nothing_of_numbers_that_are_none(tmp_path):
    samples = np.random.default_rng(1).standard_normal((RATE, 3)) * [1.0, 1e200, 1.0]
    samples[7, 2] = np.inf
    wavfile.write(tmp_path / "a.wav", RATE, samples)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for verb in ("rms", "octave", "fft"):
            done = CliRunner().invoke(main, [verb, str(tmp_path / "a.wav")], standalone_mode=False)
            assert done.exception is None
