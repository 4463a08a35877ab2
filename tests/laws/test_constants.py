"""Figures that the study engine goes by say what they are; every part of the engine names its page of decisions."""

import ast
import re
from pathlib import Path

import pytest

import specan

ENGINE = Path(specan.__file__).parent / "study"
DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"


def figures(path: Path) -> list[tuple[str, bool]]:
    """Numeric constants of a module, and whether a comment is beside each or above its block."""
    text = path.read_text(encoding="utf-8")
    lines, found = text.splitlines(), []
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            continue
        names = [t.id for t in ast.walk(node.targets[0]) if isinstance(t, ast.Name) and t.id.isupper()]
        number = any(
            isinstance(c, ast.Constant) and type(c.value) in (int, float) for c in ast.walk(node.value)
        )
        if names and number:
            own = lines[node.lineno - 1 : node.end_lineno]
            above = []  # the block that it is in, up to an empty line
            while node.lineno - 2 - len(above) >= 0 and lines[node.lineno - 2 - len(above)].strip():
                above.append(lines[node.lineno - 2 - len(above)])
            told = any(line.startswith("#") for line in above) or any("#" in line for line in own)
            found.append((", ".join(names), told))
    return found


@pytest.mark.parametrize("path", sorted(ENGINE.rglob("*.py")), ids=lambda p: p.relative_to(ENGINE).as_posix())
def test_a_figure_says_what_it_is(path: Path) -> None:
    assert [name for name, told in figures(path) if not told] == []


def test_figures_are_seen() -> None:
    assert ("LEVEL", True) in figures(ENGINE / "selection" / "acceptance.py")


@pytest.mark.parametrize("part", sorted(p.parent.name for p in ENGINE.glob("*/__init__.py")))
def test_a_part_of_the_engine_names_its_page_of_decisions(part: str) -> None:
    pages = re.findall(
        r"docs/decisions/(\w+\.md)", (ENGINE / part / "__init__.py").read_text(encoding="utf-8")
    )
    assert pages
    assert all((DECISIONS / page).is_file() for page in pages)
