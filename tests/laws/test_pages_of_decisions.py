"""Every part of the study engine names its page of decisions."""

import re
from pathlib import Path

import pytest

import specan

ENGINE = Path(specan.__file__).parent / "study"
DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"


@pytest.mark.parametrize("part", sorted(p.parent.name for p in ENGINE.glob("*/__init__.py")))
def test_a_part_of_the_engine_names_its_page_of_decisions(part: str) -> None:
    pages = re.findall(
        r"docs/decisions/(\w+\.md)", (ENGINE / part / "__init__.py").read_text(encoding="utf-8")
    )
    assert pages
    assert all((DECISIONS / page).is_file() for page in pages)
