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
