"""The core imports no wing, in no form: with the folder of a wing deleted, the rest is whole."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import specan

ROOT = Path(specan.__file__).parent
WINGS = ("fmu", "planetary_gear", "room", "worm_gear")
PLACE = re.compile(rf"\bspecan[./]({'|'.join(WINGS)})\b")


@pytest.mark.parametrize("folder", ["specan", "cli"])
def test_no_file_of_the_core_names_a_wing(folder):
    place = ROOT.parent / folder
    files = [
        p for p in place.rglob("*.py") if not (folder == "specan" and p.relative_to(place).parts[0] in WINGS)
    ]
    assert len(files) > 10
    assert [str(p) for p in files if PLACE.search(p.read_text(encoding="utf-8"))] == []


LOOK = """
import importlib, pkgutil, sys
sys.path.insert(0, sys.argv[1])
import specan
assert specan.__file__.startswith(sys.argv[1])
for module in pkgutil.walk_packages(specan.__path__, "specan."):
    if not module.name.endswith("__main__") and not module.name.startswith("specan.inspect"):
        importlib.import_module(module.name)
model = specan.load_model(sys.argv[2])
print(model.name)
"""


@pytest.mark.parametrize(
    "gone", [WINGS, *(pytest.param((wing,), marks=pytest.mark.long) for wing in WINGS)], ids="+".join
)
def test_without_wings_everything_else_is_imported_and_an_own_model_loads(gone, tmp_path):
    shutil.copytree(ROOT, tmp_path / "specan", ignore=shutil.ignore_patterns("__pycache__"))
    for wing in gone:
        shutil.rmtree(tmp_path / "specan" / wing)
    spring = Path(__file__).parents[1] / "own_model" / "spring.py"
    done = subprocess.run(
        [sys.executable, "-I", "-c", LOOK, str(tmp_path), str(spring)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip()
