"""What a release says of itself is the same everywhere."""

import re
import tomllib
from pathlib import Path

import specan

ROOT = Path(__file__).parents[2]


def test_version_and_date_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = re.search(r"^version: (\S+)$", citation, re.MULTILINE)[1]
    date = re.search(r'^date-released: "(\S+)"$', citation, re.MULTILINE)[1]
    assert version == specan.__version__
    assert f"## {version} ({date})" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_every_python_that_is_classified_is_admitted() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    minors = [int(m[1]) for c in project["classifiers"] if (m := re.search(r":: 3\.(\d+)$", c))]
    assert f">=3.{min(minors)}" == project["requires-python"]
