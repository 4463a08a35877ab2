"""How far a reader has to walk who follows a verdict: files of the engine, and depth of its calls."""

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import specan
from specan.study.create import begin
from specan.study.diagnose import diagnose
from specan.study.study import Study

ENGINE = str(Path(specan.__file__).parent / "study")
ROOT = Path(__file__).parents[2]
MOST_FILES, DEEPEST = 60, 20
# Bodies of modules and comprehensions are no step of the walk.
NO_STEP = {"<module>", "<listcomp>", "<genexpr>", "<dictcomp>", "<setcomp>", "<lambda>"}


class Walk:
    """Files and deepest nesting of the engine's functions while something runs."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self.path: list[str] = []
        self.deepest: list[str] = []

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if not code.co_filename.startswith(ENGINE) or code.co_name in NO_STEP:
            return
        if event == "call":
            self.files.add(code.co_filename)
            self.path.append(code.co_qualname)
            if len(self.path) > len(self.deepest):
                self.deepest = list(self.path)
        elif event == "return" and self.path:
            self.path.pop()


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


def test_depth_is_counted_in_calls_of_the_engine() -> None:
    problem = toy().problem(lambda x, z: 4 * x**2, [])
    found, _ = walk(lambda: problem.residual(np.zeros(len(problem.names))))
    assert found.deepest[:2] == ["Problem.residual", "TableObservation.predict"]
    assert 3 <= len(found.files) <= 8


def test_a_verdict_on_a_small_model_is_a_short_walk() -> None:
    problem = toy().problem(lambda x, z: 4 * x**2, ["square", "tilt", "cross"])
    found, verdict = walk(lambda: diagnose(problem))
    assert verdict.effects == ("square",)
    assert len(found.files) <= MOST_FILES
    assert len(found.deepest) <= DEEPEST, "\n".join(found.deepest)


@pytest.mark.timeout(300)
def test_a_verdict_on_a_gear_is_a_short_walk(tmp_path: Path) -> None:
    bench = ROOT / "sample_data" / "worm_gear" / "study" / "bench"
    begin(tmp_path / "gear", "worm-gear", bench / "rig.toml", [bench / "measurement.csv"])
    found, verdict = walk(lambda: Study(tmp_path / "gear").diagnose())
    assert verdict.effects == ("windage",)
    assert len(found.files) <= MOST_FILES
    assert len(found.deepest) <= DEEPEST, "\n".join(found.deepest)
