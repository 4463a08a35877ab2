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


@pytest.mark.parametrize("packed", [False, True])
def test_a_branch_that_is_checked_out(package: Path, packed: bool) -> None:
    git = package.parent / ".git"
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    if packed:
        (git / "packed-refs").write_text(f"# pack-refs with: peeled\n{HASH} refs/heads/main\n")
    else:
        (git / "refs" / "heads" / "main").write_text(HASH + "\n")
    assert program._commit(package) == HASH


def test_a_work_tree_of_its_own(package: Path, tmp_path: Path) -> None:
    own = tmp_path / "main" / ".git" / "worktrees" / "other"
    own.mkdir(parents=True)
    (own / "HEAD").write_text("ref: refs/heads/other\n")
    (own / "commondir").write_text("../..\n")
    (tmp_path / "main" / ".git" / "refs" / "heads").mkdir(parents=True)
    (tmp_path / "main" / ".git" / "refs" / "heads" / "other").write_text(HASH)
    (package.parent / ".git").write_text(f"gitdir: {own}\n")
    assert program._commit(package) == HASH


def test_without_a_repository_the_version_stands_alone(package: Path) -> None:
    assert program._commit(package) is None


def test_the_verb_prints_it() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "specan", "--version"], capture_output=True, text=True, check=True
    ).stdout
    assert said.startswith(f"specan {__version__}")
