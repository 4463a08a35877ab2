"""The script behind the two commands of the README; CI runs both for real."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script as a module, whose environment is an empty place."""
    spec = importlib.util.spec_from_file_location("start", ROOT / "start.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "ENVIRONMENT", tmp_path)
    monkeypatch.setattr(module, "PYTHON", Path(sys.executable))
    return module


def test_it_uses_nothing_but_the_standard_library() -> None:
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(ROOT / "start.py")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "start.py demo" in done.stderr


def test_an_old_python_is_told(start: ModuleType, monkeypatch, capsys) -> None:
    monkeypatch.setattr(start.sys, "version_info", (3, 9, 2))
    assert start.main(["demo"]) == 2
    assert "needs Python 3.11 or newer, and this is 3.9.2" in capsys.readouterr().err


def test_it_installs_once_for_each_state_of_the_project(start: ModuleType, monkeypatch) -> None:
    calls: list[tuple[str, ...]] = []
    monkeypatch.setattr(start, "run", lambda *arguments: calls.append(arguments) or 0)
    for _ in range(2):
        assert start.main(["test"]) == 0
    installs = [call for call in calls if "pip" in call]
    assert [call[-1] for call in installs] == [".[test]"]
    assert calls.count(("-m", "pytest", "-n", "2", "--dist", "worksteal", "-m", "not long")) == 2


def test_all_leaves_nothing_out(start: ModuleType, monkeypatch) -> None:
    calls: list[tuple[str, ...]] = []
    monkeypatch.setattr(start, "run", lambda *arguments: calls.append(arguments) or 0)
    assert start.main(["test", "--all"]) == 0
    assert calls[-1] == ("-m", "pytest", "-n", "2", "--dist", "worksteal")
    assert start.main(["demo", "--all"]) == 2


def test_a_failed_installation_ends_it(start: ModuleType, monkeypatch) -> None:
    monkeypatch.setattr(start, "run", lambda *arguments: 1)
    with pytest.raises(SystemExit, match="The installation failed"):
        start.main(["demo"])


def test_the_demo_says_where_the_results_are(start: ModuleType, monkeypatch, capsys) -> None:
    monkeypatch.setattr(start, "install", lambda extras: None)
    monkeypatch.setattr(start, "run", lambda *arguments: 0)
    assert start.main(["demo"]) == 0
    assert f"The results are in {ROOT / 'results'}" in capsys.readouterr().out
    monkeypatch.setattr(start, "run", lambda *arguments: 1)
    assert start.main(["demo"]) == 1
    assert "The results are" not in capsys.readouterr().out
