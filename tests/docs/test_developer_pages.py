"""Files that the developers' pages name are there: others move them."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "developers").glob("*.md"))
# What a page may leave out before a path, since the text says where it is.
WITHIN = ("", "specan/", "specan/study/", "specan/analysis/batch/")


def named(text: str) -> set[str]:
    """Paths of modules; words in capitals stand for a name."""
    found = set(re.findall(r"[\w./]+\.py\b", text.replace("\\_", "_")))
    return {path for path in found if "/" in path and not re.search(r"[A-Z]{3}", path)}


def test_paths_are_found() -> None:
    assert named(
        "see `study/data/setpoints.py`, \\_\\_init\\_\\_.py, x/\\_\\_init\\_\\_.py and cli/VERB.py"
    ) == {
        "study/data/setpoints.py",
        "x/__init__.py",
    }


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_file_that_is_named_exists(page: Path) -> None:
    paths = named(page.read_text(encoding="utf-8"))
    lost = {path for path in paths if not any((ROOT / start / path).is_file() for start in WITHIN)}
    assert lost == set()
