"""Which calibration a result has is said with it, and a `calibration.toml` beside a recording is applied."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from nptdms import ChannelObject, TdmsWriter

import specan
from specan.errors import RequestError
from specan_cli.main import main

NOISE = Path(__file__).parents[2] / "sample_data/recordings/noise/noise_24_microphones.tdms"
RATE, SECONDS = 8000, 2.0
# A sine of 50 mV RMS: 1 Pa, 93.979 dB re 20 uPa at the nominal 50 mV/Pa; 40 mV/Pa make it 1.25 Pa.
NOMINAL_DB, CALIBRATED_DB = 20 * math.log10(1.0 / 20e-6), 20 * math.log10(1.25 / 20e-6)
VERBS = ["rms", "octave", "fft"]


@pytest.fixture
def recording(tmp_path):
    volts = 0.05 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(int(RATE * SECONDS)) / RATE)
    properties = {"unit_string": "V", "QuantityUnit": "Pa", "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"}
    path = tmp_path / "tone.tdms"
    with TdmsWriter(path) as file:
        about = {"wf_increment": 1 / RATE, "wf_start_offset": 0.0, "NI_ChannelName": "Mic 1", **properties}
        file.write_segment([ChannelObject("Measurement", "Mic 1", volts, about)])
    return path


def calibrate(recording, name="calibration.toml", **more):
    content = {"channel": "Mic 1", "sensitivity": 40.0, "unit": "mV/Pa", **more}
    rows = "\n".join(f"{key} = {json.dumps(value)}" for key, value in content.items())
    path = recording.parent / name
    path.write_text(f"schema = 1\n[[channel]]\n{rows}\n")
    return path


def run(*arguments):
    done = CliRunner().invoke(main, list(map(str, arguments)), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def level(*arguments):
    return json.loads(run("rms", *arguments, "--json"))["channels"][0]["level_dB"]


def test_the_calibration_beside_a_recording_is_applied_unless_another_is_named(recording):
    assert level(recording) == pytest.approx(NOMINAL_DB, abs=0.01)
    calibrate(recording)
    other = calibrate(recording, "other.toml", sensitivity=50.0)
    assert level(recording) == pytest.approx(CALIBRATED_DB, abs=0.01)
    assert level(recording, "--calibration", "none") == pytest.approx(NOMINAL_DB, abs=0.01)
    assert level(recording, "--calibration", other) == pytest.approx(NOMINAL_DB, abs=0.01)


@pytest.mark.parametrize("verb", VERBS)
def test_every_output_says_it(recording, verb):
    assert "Calibration: nominal sensitivities." in run(verb, recording)
    calibrate(recording)
    assert "Calibration: calibration.toml." in run(verb, recording)
    assert json.loads(run(verb, recording, "--json"))["settings"]["calibration"] == "calibration.toml"
    assert "\n# calibration: calibration.toml\n" in run(verb, recording, "-o", "-")
    figure = getattr(specan, verb)(recording).plot()
    assert "Calibration: calibration.toml" in {text.get_text() for text in figure.texts}


def test_info_shows_it(recording):
    assert "Calibration: nominal sensitivities" in run("info", recording)
    calibrate(recording)
    assert "Calibration: calibration.toml" in run("info", recording)


def test_one_that_failed_is_not_applied_and_said(recording):
    calibrate(recording, verdict="failed", reasons=["the level drifts"])
    assert level(recording) == pytest.approx(NOMINAL_DB, abs=0.01)
    assert "Calibration: nominal sensitivities, calibration.toml failed." in run("rms", recording)


def test_a_channel_without_one_is_named():
    voltage = specan.Recording.from_arrays({"Mic 1": np.ones(8)}, RATE)
    assert voltage.calibration_of(["Mic 1"]) == "none"


def test_a_line_outside_the_band_is_refused():
    done = CliRunner().invoke(main, ["frf", str(NOISE), "--at", "99999"])
    assert isinstance(done.exception, RequestError)
    assert "outside the lines" in str(done.exception)
