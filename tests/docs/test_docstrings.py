"""Examples in docstrings run."""

import doctest
import importlib
from pathlib import Path

import pytest

import specan

ROOT = Path(specan.__file__).parent
MODULES = sorted(
    ".".join(("specan", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")
    for path in ROOT.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_a_module(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0
