"""The examples of the pages on band levels and RMS run as they are printed."""

import doctest
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from specan_cli.main import main

ROOT = Path(__file__).parents[2]
PAGES = ("octave.md", "levels.md")


def commands() -> list[str]:
    pages = "\n".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in PAGES)
    return re.findall(r"^\$ specan (.*)$", pages, re.MULTILINE)


def test_there_are_examples():
    assert len(commands()) >= 2


@pytest.mark.parametrize("line", commands())
def test_a_command(line, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = CliRunner().invoke(main, shlex.split(line), catch_exceptions=False, standalone_mode=False)
    assert "Mic 1" in found.stdout


@pytest.mark.parametrize("page", PAGES)
def test_the_python_examples(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = doctest.testfile(str(ROOT / "docs" / page), module_relative=False)
    assert found.attempted > 3
    assert found.failed == 0
