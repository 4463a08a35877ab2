"""The page of a batch."""

import html
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

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
    assert "transfer_function.lines" in written


def test_names_are_text(written):
    assert html.escape(NAME) in written
    assert html.escape(BROKEN) in written
    assert "<b>$1$" not in written


def test_each_unit_of_a_batch_has_its_axis():
    from specan.report.batch_report import band_figure, transfer_figure

    hertz = np.array([100.0, 125.0, 160.0])
    one = {
        name: np.array([hertz, [level, level, level]]) for name, level in (("Mic 1", 70.0), ("Laser", 140.0))
    }
    figure = band_figure("a.tdms", one, {"Mic 1": "20 uPa", "Laser": "1 nm/s"}, ["noise"])
    assert [axes.get_ylabel() for axes in figure.axes] == ["Level / dB re 20 µPa", "Level / dB re 1 nm/s"]
    rows = np.array([hertz, [1.0, 10.0, 100.0], [0.0, 90.0, -90.0], [1.0, 1.0, 1.0]])
    both = transfer_figure("a.tdms", {"Mic 1": rows, "Force": rows}, {"Mic 1": "Pa/V", "Force": "N/V"}, [])
    labels = [axes.get_ylabel() for axes in both.axes]
    assert labels == ["Magnitude / dB re 1 Pa/V", "Magnitude / dB re 1 N/V", "Phase / degrees", "Coherence"]
    np.testing.assert_allclose(both.axes[0].lines[0].get_ydata(), [0.0, 20.0, 40.0])
