"""``specan frf`` as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan.errors import InputError, RequestError
from specan_cli.main import main

RATE, LATE, GAIN = 8000, 4, 3.0


@pytest.fixture(scope="module")
def noise(tmp_path_factory) -> Path:
    """A velocity, a pressure that is 3 Pa/(m/s) of it and 4 samples late, a generator; and what they are."""
    rng = np.random.default_rng(1)
    drive = 0.1 * rng.standard_normal(8 * RATE)
    velocity = drive + 0.02 * rng.standard_normal(len(drive))
    pressure = GAIN * np.roll(drive, LATE) + 0.01 * rng.standard_normal(len(drive))
    folder = tmp_path_factory.mktemp("frf")
    wavfile.write(
        folder / "noise.wav", RATE, np.stack([pressure, velocity, drive], axis=1).astype(np.float32)
    )
    return folder / "noise.wav"


def names(path):
    from specan.io.open import open_recording

    return [c.name for c in open_recording(path).channels]


@pytest.fixture(scope="module")
def table(noise) -> Path:
    mic, vib, gen = names(noise)
    rows = [
        "channel,role,unit",
        f"{mic},microphone,Pa",
        f"{vib},vibrometer,m/s",
        f"{gen},generator,V",
    ]
    path = noise.parent / "roles.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def run(*arguments):
    return CliRunner().invoke(
        main, ["frf", *map(str, arguments)], catch_exceptions=False, standalone_mode=False
    )


def content(*arguments):
    return json.loads(run(*arguments, "--json").stdout)


def test_magnitude_phase_and_coherence(noise, table):
    found = content(noise, "--channel-table", table, "--lines", 400)
    (mic,) = found["channels"]
    f = np.array(found["frequency_hz"])
    assert len(f) == 400
    assert (found["reference_unit"], mic["unit"]) == ("m/s", "Pa/(m/s)")
    assert np.mean(mic["magnitude"]) == pytest.approx(GAIN / (1 + 0.2**2), rel=0.01)
    phase = np.unwrap(mic["phase_deg"], period=360)
    assert np.polyfit(f, phase, 1)[0] == pytest.approx(-360 * LATE / RATE, rel=0.01)
    assert 0.9 < np.mean(mic["coherence"]) < 0.98
    assert all(0 < u < 20 for u in mic["u_magnitude_percent"])


def test_generator_as_instrument_removes_the_bias(noise, table):
    found = content(noise, "--channel-table", table, "--lines", 400, "--estimator", "h3c")
    assert found["estimator"] == "H3c"
    assert np.mean(found["channels"][0]["magnitude"]) == pytest.approx(GAIN, rel=0.01)


def test_reference_by_name(noise):
    mic, _, drive = names(noise)
    found = content(noise, "--reference", drive, "--channel", mic, "--lines", 200)
    assert found["reference"] == drive
    assert [c["channel"] for c in found["channels"]] == [mic]


def test_text_file_and_table(noise, table, tmp_path):
    out = tmp_path / "frf.txt"
    found = run(noise, "--channel-table", table, "--lines", 100, "--at", 500, "--at", 1000, "-o", out)
    assert "Pa/(m/s)" in found.stdout
    lines = out.read_text().splitlines()
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    assert rows[0][:5] == ["channel", "frequency_hz", "magnitude", "phase_deg", "coherence"]
    assert len(rows) == 101
    assert all(-180 < float(row[3]) <= 180 for row in rows[1:])
    assert any("exp(+j w t)" in line for line in lines if line.startswith("#"))


@pytest.mark.parametrize("suffix", ["png", "svg", pytest.param("pdf", marks=pytest.mark.long)])
def test_plots_are_the_same_every_time(noise, table, tmp_path, suffix):
    pictures = []
    for name in ("a", "b"):
        out = tmp_path / f"{name}.{suffix}"
        run(noise, "--channel-table", table, "--lines", 100, "--plot", out)
        pictures.append(out.read_bytes())
    assert pictures[0] == pictures[1]
    assert len(pictures[0]) > 5000


def test_range_of_the_lines(noise, table):
    found = content(noise, "--channel-table", table, "--lines", 100, "--fmin", 300, "--fmax", 900)
    assert 300 <= min(found["frequency_hz"]) < max(found["frequency_hz"]) <= 900


def test_no_vibrometer(noise, tmp_path):
    rows = ["channel,role,unit", *(f"{name},microphone,Pa" for name in names(noise))]
    roles = tmp_path / "roles.csv"
    roles.write_text("\n".join(rows) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="no vibrometer"):
        run(noise, "--channel-table", roles)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--reference", "Vib"], "no channel 'Vib'"),
        (["--plot", "figure.doc"], ".png"),
        (["--plot", "nowhere/figure.png"], "does not exist"),
        (["--fmin", "5000"], "no line"),
        (["--overlap", "1.5"], "overlap"),
    ],
)
def test_requests_that_cannot_be_carried_out(noise, table, arguments, message):
    with pytest.raises(RequestError, match=message):
        run(noise, "--channel-table", table, *arguments)
