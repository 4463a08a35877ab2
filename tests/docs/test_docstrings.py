"""Examples in docstrings run."""

import doctest
import importlib
import pkgutil

import pytest

import specan

MODULES = sorted(m.name for m in pkgutil.walk_packages(specan.__path__, "specan."))


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_a_module(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0


def test_there_are_examples() -> None:
    tried = sum(doctest.testmod(importlib.import_module(name)).attempted for name in MODULES[:40])
    assert tried > 20
