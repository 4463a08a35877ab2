"""The page of a batch."""

import datetime
import html
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

import specan
from specan_cli.batch import command

RATE = 8000
BROKEN = "broken <i>"
NAME = "sine <b>$1$ & more"


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> str:
    place: Path = tmp_path_factory.mktemp("batch")
    t = np.arange(2 * RATE) / RATE
    tone = 0.2 * np.sin(2 * np.pi * 500 * t)
    wavfile.write(place / f"{NAME.replace('/', '_')}.wav", RATE, tone.astype(np.float32))
    (place / f"{BROKEN}.tdms").write_bytes(b"no recording")
    out = place / "out"
    result = CliRunner().invoke(command, [str(place), "-o", str(out), "--jobs", "1", "--report"])
    assert "1 failed" in result.output
    return (out / "report.html").read_text(encoding="utf-8")


def test_it_needs_nothing_from_elsewhere(written):
    sources = re.findall(r'(?:src|href)\s*=\s*"([^"]*)"', written)
    assert all(s.startswith("data:image/png;base64,") for s in sources)
    assert "url(" not in written
    assert "http" not in re.sub(r"base64,[^\"]*", "", written)


def test_it_says_what_was_skipped_and_with_which_settings(written):
    assert "is a text file" in written
    assert "1 failed" in written
    assert "settings " in written


def test_names_are_text(written):
    assert html.escape(NAME) in written
    assert html.escape(BROKEN) in written
    assert "<b>$1$" not in written


def test_a_recording_has_its_level_its_bands_and_its_calibration(tmp_path):
    """A sine of 0.2 Pa at 1 kHz: 76.99 dB, A weighting 0 dB (IEC 61672-1, table 3); the band of 1 kHz has all of it."""
    t = np.arange(2 * RATE) / RATE
    lines = "\n".join(f"{a:.6f},{b:.6e}" for a, b in zip(t, 0.2 * np.sin(2 * np.pi * 1000 * t)))
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "tone.csv").write_text(f"time [s],Mic 1 [Pa]\n{lines}\n", encoding="utf-8")
    out = tmp_path / "out"
    CliRunner().invoke(command, [str(tmp_path / "in"), "-o", str(out), "--jobs", "1", "--report"])
    text = re.sub(r"<[^>]*>", "|", (out / "report.html").read_text(encoding="utf-8"))
    text = re.sub(r"\|+", "|", text)
    level = 20 * np.log10(0.2 / np.sqrt(2) / 20e-6)
    assert f"|{level:.1f}|{level:.1f} (Mic 1)|{level:.1f} (Mic 1)|" in text
    assert f"|1000|{level:.2f}|" in text
    assert "1 microphone, 8000 Hz" in text
    assert f"|Report of|{datetime.date.today():%Y-%m-%d}|" in text


def test_the_rms_of_an_acceleration_has_its_unit(tmp_path):
    """A sine of 8 m/s² over whole periods: 8 / sqrt(2) = 5.657 m/s²."""
    t = np.arange(2 * RATE) / RATE
    lines = "\n".join(f"{a:.6f},{b:.9e}" for a, b in zip(t, 8 * np.sin(2 * np.pi * 100 * t)))
    (tmp_path / "shaker.csv").write_text(f"time [s],Acc 1 [m/s^2]\n{lines}\n", encoding="utf-8")
    CliRunner().invoke(command, [str(tmp_path), "-o", str(tmp_path / "out"), "--jobs", "1", "--report"])
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f'<td>m/s^2</td><td class="n">{8 / np.sqrt(2):.5g}</td>' in text


def test_the_calibration_of_the_batch_is_that_of_the_report(tmp_path):
    samples = Path(__file__).parents[2] / "sample_data" / "recordings"
    for place in ("calibration", "noise"):
        shutil.copytree(samples / place, tmp_path / "in" / place)
    specan_cli = [str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--jobs", "1", "--report"]
    CliRunner().invoke(command, specan_cli, catch_exceptions=False)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    recording = specan.read(
        samples / "noise" / "noise_4_microphones_float32.tdms",
        calibration=tmp_path / "out" / "calibration.toml",
    )
    level = specan.rms(recording, channels="Mic 1").equivalent_dB["A"][0]
    assert f'<td class="n">{level:.2f}</td>' in text
    assert "calibration.toml (Mic 1" in text


def test_channels_ignored_for_one_reason_have_one_row_and_a_clock_never_set_is_no_date(tmp_path):
    sys.path.insert(0, str(Path(__file__).parent.parent / "io"))
    import tdms_bytes as tb

    wave = {"wf_increment": 1 / RATE, "wf_start_time": np.datetime64("1904-01-01T00:00:00")}
    noise = np.random.default_rng(1).standard_normal(RATE)
    single = [(f"one {k}", np.zeros(1), {}) for k in range(5)]
    tb.write(tmp_path / "a.tdms", [("c", noise, wave), *single])
    result = CliRunner().invoke(
        command, [str(tmp_path), "-o", str(tmp_path / "out"), "--jobs", "1", "--report"]
    )
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "1904" not in page
    assert page.count("it is a single number") == 1
    assert "g/one 0, g/one 1, g/one 2 and 2 more" in page
