"""The documentation site: built strictly, without a network, and nothing in it is fetched from elsewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    pytest.importorskip("material", reason="left out: the extra `docs` is not installed")
    target = tmp_path_factory.mktemp("site")
    # A proxy that nobody serves: a build that wants the network fails.
    environment = {
        **os.environ,
        "NO_MKDOCS_2_WARNING": "1",
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(target)],
        check=False, cwd=ROOT, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def test_nothing_is_fetched(site):
    fetched = re.compile(
        r"""<(?:script|img|iframe|source)[^>]*\ssrc\s*=\s*["']?(?:https?:)?//[^\s"'>]+|<link[^>]*\shref\s*=\s*["']?(?:https?:)?//[^\s"'>]+"""
    )
    found = {
        str(page.relative_to(site)): match
        for page in site.rglob("*.html")
        for match in fetched.findall(page.read_text(encoding="utf-8"))
        if 'rel="canonical"' not in match
    }
    assert found == {}
    styles = [
        path
        for path in site.rglob("*.css")
        if re.search(r"url\((?:https?:)?//", path.read_text(encoding="utf-8"))
    ]
    assert styles == []


def test_every_page_of_the_guide_and_every_command_is_there(site):
    for source in (ROOT / "docs").glob("*.md"):
        assert (site / source.stem / "index.html").exists() or source.stem == "index", source
    commands = (site / "commands" / "index.html").read_text(encoding="utf-8")
    for verb in ("specan batch", "specan study diagnose", "specan inspect"):
        assert f">{verb}<" in re.sub(r"<a .*?</a>", "", commands), verb
    assert (site / "search" / "search_index.json").stat().st_size > 100_000
    # What only the tests read is not printed.
    assert "# exit code" not in (site / "terminal" / "index.html").read_text(encoding="utf-8")
