"""How far a reader has to walk who follows a verdict: files that it passes, and depth of its calls."""

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import specan
import specan_cli
from specan.study.create import begin
from specan.study.diagnose import diagnose
from specan_cli.main import main

HOUSE = {"specan": Path(specan.__file__).parent, "cli": Path(specan_cli.__file__).parent}
ROOT = Path(__file__).parents[2]
DEEPEST = 20
MOST = 60  # files
# Bodies of modules and classes (not optimised), and comprehensions are no step of the walk.
OPTIMISED = 0x1
NO_STEP = {"<listcomp>", "<genexpr>", "<dictcomp>", "<setcomp>", "<lambda>"}


class Walk:
    """Files and deepest nesting of the program's functions while something runs."""

    def __init__(self) -> None:
        self.passed: set[str] = set()
        self.path: list[str] = []
        self.deepest: list[str] = []

    @property
    def files(self) -> set[str]:
        """Files of the program, by their place in it: ``specan/study/diagnose.py``."""
        return {
            f"{part}/{Path(file).relative_to(root).as_posix()}"
            for file in self.passed
            for part, root in HOUSE.items()
            if Path(file).is_relative_to(root)
        }

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if (
            not code.co_filename.startswith(STARTS)
            or code.co_name in NO_STEP
            or not code.co_flags & OPTIMISED
        ):
            return
        if event == "call":
            self.passed.add(code.co_filename)
            self.path.append(code.co_qualname)
            if len(self.path) > len(self.deepest):
                self.deepest = list(self.path)
        elif event == "return" and self.path:
            self.path.pop()


STARTS = tuple(map(str, HOUSE.values()))


def walk(run: Callable[[], Any]) -> tuple[Walk, Any]:
    found = Walk()
    sys.setprofile(found)
    try:
        result = run()
    finally:
        sys.setprofile(None)
    return found, result


def toy() -> Any:
    spec = spec_from_file_location("toy", Path(__file__).with_name("conftest.py"))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Toy()


def test_depth_is_counted_in_calls() -> None:
    problem = toy().problem(lambda x, z: 4 * x**2, [])
    theta = np.zeros(len(problem.names))
    problem.residual(theta)  # what is worked out once is no part of it
    found, _ = walk(lambda: problem.residual(theta))
    assert found.deepest[:3] == ["Problem.residual", "TableObservation.predict", "Evaluator.evaluate"]
    assert {f for f in found.files if f.startswith("specan/study/observation")} == {
        "specan/study/observation/table.py"
    }


def test_a_verdict_on_a_small_model_is_a_short_walk() -> None:
    problem = toy().problem(lambda x, z: 4 * x**2, ["square", "tilt", "cross"])
    found, verdict = walk(lambda: diagnose(problem))
    assert verdict.effects == ("square",)
    assert len(found.deepest) <= DEEPEST - 3, "\n".join(
        found.deepest
    )  # the command and the study come before


@pytest.mark.timeout(300)
def test_a_verdict_on_a_gear_is_a_short_walk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench = ROOT / "sample_data" / "worm_gear" / "study" / "bench"
    place = tmp_path / "gear"
    begin(place, "worm-gear", bench / "rig.toml", [bench / "measurement.csv"], hold_out=["torque=50"])
    found, _ = walk(lambda: main(["study", "diagnose", str(place)], standalone_mode=False))
    assert "Missing: windage." in capsys.readouterr().out
    assert len(found.deepest) <= DEEPEST, "\n".join(found.deepest)
    assert len(found.files) <= MOST, "\n".join(sorted(found.files))
