"""``specan simulate room`` as a user calls it."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.interpolate import LinearNDInterpolator

from specan.errors import RequestError
from specan.io.open import open_recording
from specan.models.catalogue import load_model
from specan.schema import read_toml
from specan_cli.main import main

RIG = """
[room]
dims_m = [0.9, 0.6, 0.7]
[piston]
wall = "x0"
centre_m = [0.0, 0.246, 0.3229]
radius_m = 0.05
[band]
f_min_hz = 40.0
f_max_hz = 250.0
[mics]
position_m = [[0.1548, 0.0931, 0.1376], [0.1709, 0.228, 0.5666], [0.62, 0.41, 0.29]]
nominal_sensitivity_mV_per_Pa = 20.0
cards = [[1, 3]]
"""


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return path


def run(rig, *arguments):
    result = CliRunner().invoke(main, ["simulate", "room", str(rig), *map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def spectra(path, lines):
    """Complex spectra of pressures and velocity at whole numbers of lines, channels in SI units."""
    recording = open_recording(path)
    return np.fft.rfft(recording.read(recording.channels))[:, lines], recording


def model_at(rig, frequency, effects=()):
    model = load_model("room", read_toml(rig))
    conditions = {"frequency": np.asarray(frequency, float), "velocity_psd": np.ones(len(frequency))}
    assembly = model.assemble(effects)
    return assembly.evaluate(conditions, assembly.defaults)["indicated_frf"]


def test_a_recording_holds_the_models_transfer_functions(rig, tmp_path):
    out = tmp_path / "rec.tdms"
    run(rig, "-o", out, "--duration", 4, "-e", "wall-impedance@z1")
    lines = np.arange(4 * 50, 4 * 240, 4)
    found, recording = spectra(out, lines)
    assert [c.role for c in recording.channels] == ["microphone"] * 3 + ["vibrometer", "generator"]
    assert recording.channels[0].sampling_rate >= 2.56 * 250
    assert recording.channels[0].n_samples == 4 * recording.channels[0].sampling_rate
    expected = model_at(rig, lines / 4, ["wall-impedance@z1"])
    np.testing.assert_allclose(found[:3] / found[3], expected, atol=2e-3 * np.abs(expected).max())
    assert not np.allclose(expected, model_at(rig, lines / 4), rtol=0.05)


def test_a_sine_is_exact_at_its_frequency(rig, tmp_path):
    run(rig, "-o", tmp_path / "sine.tdms", "--duration", 2, "--frequency", 101.5)
    found, _ = spectra(tmp_path / "sine.tdms", [203])
    np.testing.assert_allclose(found[:3, 0] / found[3, 0], model_at(rig, [101.5])[:, 0], rtol=1e-3)
    others = np.abs(spectra(tmp_path / "sine.tdms", slice(0, 200))[0][:3]).max()
    assert others < 1e-3 * np.abs(found[:3]).min()
    said = CliRunner().invoke(main, ["info", str(tmp_path / "sine.tdms")]).stdout
    assert "sine" in said
    assert "101.5" in said
    assert "20 mV/Pa" in said  # the rig file's, not a usual one


def test_noise_has_its_deviation_and_its_seed(rig, tmp_path):
    signals = {}
    for name, seed, noise in (("a", 1, 0.0), ("b", 1, 2e-3), ("c", 2, 0.0)):
        run(rig, "-o", tmp_path / f"{name}.tdms", "--duration", 2, "--seed", seed, "--noise", noise)
        recording = open_recording(tmp_path / f"{name}.tdms")
        signals[name] = recording.read(recording.channels)
    added = signals["b"] - signals["a"]
    assert np.std(added[:3]) == pytest.approx(2e-3, rel=0.05)
    assert np.abs(added[3:]).max() < 1e-5
    assert np.abs(signals["c"] - signals["a"]).max() > 0.01


def test_an_instruments_error_is_in_the_recording(rig, tmp_path):
    run(rig, "-o", tmp_path / "a.tdms", "--duration", 1)
    run(rig, "-o", tmp_path / "b.tdms", "--duration", 1, "-e", "microphone-gain@Mic 2=0.1")
    a, b = (open_recording(tmp_path / f"{n}.tdms") for n in "ab")
    ratio = np.std(b.read(b.channels), axis=1) / np.std(a.read(a.channels), axis=1)
    np.testing.assert_allclose(ratio, [1.0, 1.1, 1.0, 1.0, 1.0], rtol=1e-4)


def test_json_names_channels_and_effects(rig, tmp_path):
    said = json.loads(run(rig, "-o", tmp_path / "a.tdms", "--duration", 1, "-e", "leak@y1", "--json").stdout)
    assert said["effects"] == ["leak@y1"]
    assert [c["channel"] for c in said["channels"]] == ["Mic 1", "Mic 2", "Mic 3", "Vibrometer", "Generator"]
    assert said["channels"][3]["rms"] == pytest.approx(5e-3, rel=1e-6)


def table(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_the_field_is_the_models_wherever_a_microphone_stands(rig, tmp_path):
    run(rig, "--field", "z=0.29", "--frequency", 200, "-o", tmp_path / "f.csv", "-e", "leak@y1")
    found = table(tmp_path / "f.csv")
    field = found["real_Pa_s_m"] + 1j * found["imaginary_Pa_s_m"]
    points = np.column_stack([found["x_m"], found["y_m"]])
    here = LinearNDInterpolator(points, field)(0.62, 0.41)
    expected = model_at(rig, [200.0], ["leak@y1"])[2, 0]
    assert abs(here - expected) < 5e-3 * abs(expected)
    near = np.argmax(np.abs(field))
    assert found["level_dB_re_20uPa_at_1mm_s"][near] == pytest.approx(
        20 * np.log10(abs(field[near]) * 1e-3 / 20e-6), abs=1e-4
    )
    assert found["phase_deg"][near] == pytest.approx(np.degrees(np.angle(field[near])), abs=1e-4)
    assert set(found["z_m"]) == {0.29}
    assert (found["x_m"].min(), found["x_m"].max()) == (0.0, 0.9)


@pytest.mark.parametrize("plane", ["x=0.45", "y=0"])
def test_every_plane_can_be_cut(rig, tmp_path, plane):
    run(rig, "--field", plane, "--frequency", 120, "-o", tmp_path / "f.csv")
    found = table(tmp_path / "f.csv")
    assert set(found[f"{plane[0]}_m"]) == {float(plane[2:])}
    assert np.all(np.isfinite(found["level_dB_re_20uPa_at_1mm_s"]))


def test_errors_of_microphones_do_not_change_the_field(rig, tmp_path):
    run(rig, "--field", "z=0.3", "--frequency", 120, "-o", tmp_path / "a.csv")
    said = run(
        rig,
        "--field",
        "z=0.3",
        "--frequency",
        120,
        "-o",
        tmp_path / "b.csv",
        "-e",
        "microphone-position@Mic 2",
    )
    assert "do not change the field" in said.stderr
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_a_picture_of_the_field(rig, tmp_path):
    said = run(rig, "--field", "z=0.3", "--frequency", 120, "-o", tmp_path / "f.png", "--json")
    assert (tmp_path / "f.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads(said.stdout)["reference"].startswith("20 uPa")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-o", "rec.tdms", "-e", "leek@y1"), "did you mean 'leak'"),
        (("-o", "rec.tdms", "-e", "wall-impedance@z3"), "z3"),
        (("-o", "rec.tdms", "--duration", "0"), "0.1 to 120 s"),
        (("-o", "rec.tdms", "--noise", "-1"), "from 0 to 1e30"),
        (("-o", "rec.tdms", "--frequency", "900"), "f_max_hz, 250 Hz"),
        (("-o", "rec.csv"), "ends in .tdms"),
        (("-o", "no/such/place.tdms"), "does not exist"),
        ((), "no output file"),
        (("-o", "f.csv", "--field", "z=0.3"), "needs a frequency"),
        (("-o", "f.csv", "--field", "z=0.8", "--frequency", "100"), "between 0 and 0.7 m"),
        (("-o", "f.csv", "--field", "height", "--frequency", "100"), "not a plane"),
        (("-o", "f.csv", "--field", "z=0.3", "--frequency", "300"), "f_max_hz, 250 Hz"),
        (("-o", "f.tdms", "--field", "z=0.3", "--frequency", "100"), "ends in .csv"),
        (("-o", "rec.tdms", "--set", "mics.position_m=[[0.1, 0.1, 0.9]]"), "outside the room"),
        (("-o", "rec.tdms", "--set", "mics.position_m=[[0.1,0.1,0.1],[0.1,0.1,0.1]]"), "in the same place"),
        (
            ("-o", "rec.tdms", "--set", "room.dims_m=[20.0, 0.6, 30.0]", "--set", "band.f_max_hz=2000"),
            "modes",
        ),
    ],
)
def test_requests_that_cannot_be_carried_out(rig, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RequestError, match=message):
        run(rig, *arguments)
    assert {p.name for p in Path().iterdir()} == {"rig.toml"}


def test_a_room_has_no_options_of_gears(rig):
    result = CliRunner().invoke(
        main, ["simulate", "room", str(rig), "-o", "rec.tdms", "--grid", "speed_rpm=1"]
    )
    assert result.exit_code == 2
    assert "No such option" in result.stderr


def test_the_mean_of_a_sine_over_whole_periods_is_shown_as_nothing(rig, tmp_path):
    said = run(rig, "-o", tmp_path / "a.tdms", "--duration", 1, "--frequency", 100).stdout
    assert [line.split()[2] for line in said.splitlines() if line.startswith("Mic ")] == ["0", "0", "0"]
