"""The examples of the pages on spectra, transfer functions and tones run as they are printed."""

import doctest
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from specan_cli.main import main

ROOT = Path(__file__).parents[2]
PAGES = ("fft.md", "transfer_functions.md", "tones.md")


def commands() -> list[str]:
    lines = [
        line for page in PAGES for line in (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines()
    ]
    return [line.removeprefix("$ specan ") for line in lines if line.startswith("$ specan ")]


@pytest.mark.parametrize("page", PAGES)
def test_python_examples(page):
    found = doctest.testfile(str(ROOT / "docs" / page), module_relative=False)
    assert found.attempted > 0
    assert found.failed == 0


@pytest.mark.parametrize("command", commands())
def test_commands(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = [
        str(ROOT / part) if part.startswith("sample_data/") else part for part in shlex.split(command)
    ]
    found = CliRunner().invoke(main, arguments, catch_exceptions=False, standalone_mode=False)
    assert found.return_value == 0
    for name in re.findall(r"\b\w+\.(?:svg|png|txt)\b", command):
        assert (tmp_path / name).stat().st_size > 1000
