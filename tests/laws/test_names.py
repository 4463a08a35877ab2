"""A decibel is written dB: names of attributes, columns and JSON keys agree."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("package", ["specan", "cli", "benchmarks"])
def test_decibels_are_named_alike_everywhere(package: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"\w_db\b", line)
    ]
    assert not found
