"""``specan tones``: the tone of a recording whose amplitudes and phases are known."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from specan import Recording
from specan.io.export_file import Excerpt, write_excerpt
from specan_cli.main import main

RATE = 8000


@pytest.fixture
def sine(tmp_path):
    t = np.arange(2 * RATE) / RATE
    samples = {
        "Vibrometer": 0.01 * np.cos(2 * np.pi * 123.4 * t),
        "Mic 1": 0.5 * np.cos(2 * np.pi * 123.4 * (t - 2e-3)) + 0.005 * np.cos(2 * np.pi * 246.8 * t),
    }
    made = Recording.from_arrays(
        samples, RATE, units={"Vibrometer": "m/s", "Mic 1": "Pa"}, roles={"Vibrometer": "vibrometer"}
    )
    write_excerpt(Excerpt(made, made.channels, 0, 2 * RATE), tmp_path / "sine.tdms")
    return tmp_path / "sine.tdms"


def test_amplitude_phase_and_distortion(sine, tmp_path):
    found = CliRunner().invoke(main, ["tones", str(sine), "--json", "-o", str(tmp_path / "t.csv")])
    content = json.loads(found.stdout)
    (microphone,) = (c for c in content["channels"] if c["channel"] == "Mic 1")
    assert content["frequency_hz"] == pytest.approx(123.4, abs=1e-4)
    assert microphone["tone_rms"] == pytest.approx(0.5 / np.sqrt(2), rel=1e-4)
    assert microphone["phase_deg"] == pytest.approx(-360 * 123.4 * 2e-3, abs=0.01)
    assert microphone["thd_percent"] == pytest.approx(1.0, abs=1e-3)
    assert microphone["harmonics_rms"][1] == pytest.approx(0.005 / np.sqrt(2), rel=1e-3)
    assert "Mic 1," in (tmp_path / "t.csv").read_text(encoding="utf-8")


def test_a_word_of_the_help_leads_to_its_verb():
    assert "see fft" in CliRunner().invoke(main, ["spectrogram"]).stderr
