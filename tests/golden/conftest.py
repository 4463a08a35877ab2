"""One batch over the sample data, shared by the golden tests."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def batch() -> Run:
    """Runs ``specan batch`` in a process of its own, from the root of the project."""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "specan_cli", "batch", *arguments]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)

    return run


@pytest.fixture(scope="session")
def tables(batch: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables of the good recordings with the settings that the README's command uses."""
    out = tmp_path_factory.mktemp("truth")
    done = batch("sample_data/recordings", "-o", str(out))
    assert done.returncode == 0, done.stderr
    return out
