"""``specan --version`` names the commit where one is known."""

import subprocess
import sys
from pathlib import Path

import pytest

from specan import __version__
from specan_cli import main as program

HASH = "0123456789abcdef0123456789abcdef01234567"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    (tmp_path / "specan").mkdir()
    return tmp_path / "specan"


def test_the_commit_of_a_build_stands_in_the_package(package: Path) -> None:
    (package / "commit.txt").write_text(HASH + "\n")
    assert program._commit(package) == HASH


def test_a_repository_that_is_checked_out(package: Path) -> None:
    def git(*words: str) -> str:
        command = ["git", "-C", str(package.parent), "-c", "user.name=x", "-c", "user.email=x", *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    git("init")
    git("commit", "--allow-empty", "-m", "x")
    assert program._commit(package) == git("rev-parse", "HEAD")


def test_without_a_repository_the_version_stands_alone(package: Path) -> None:
    assert program._commit(package) is None


def test_the_verb_prints_it() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "specan", "--version"], capture_output=True, text=True, check=True
    ).stdout
    assert said.startswith(f"specan {__version__}")
