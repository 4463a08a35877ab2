"""The gallery shows what the commands draw today."""

import importlib.util
import json
import math
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


@pytest.fixture(scope="module")
def gallery():
    spec = importlib.util.spec_from_file_location("make_gallery", DOCS / "images" / "make_gallery.py")
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules["make_gallery"] = module
    spec.loader.exec_module(module)
    return module


def same(one: str, other: str) -> bool:
    """The same words, and numbers that differ by no more than another processor or library makes them."""
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return False
    pairs = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=0.03, abs_tol=1e-12) for a, b in pairs)


@pytest.mark.long
def test_every_figure_says_what_it_says_in_the_gallery(gallery):
    kept = json.loads((DOCS / "images" / "gallery.json").read_text(encoding="utf-8"))
    entries = [entry for rows in gallery.SECTIONS.values() for entry in rows]
    assert list(kept) == [entry.name for entry in entries]
    with gallery.workplace():
        for entry in entries:
            if entry.cheap:
                found = gallery.drawn(entry)
                assert len(found) == len(kept[entry.name]), entry.name
                wrong = [pair for pair in zip(kept[entry.name], found, strict=True) if not same(*pair)]
                assert wrong == [], entry.name


def test_the_page_has_every_picture_and_no_palette(gallery):
    from PIL import Image

    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page(gallery.SECTIONS)
    shown = {f"{entry.name}.png" for rows in gallery.SECTIONS.values() for entry in rows}
    assert {path.name for path in (DOCS / "images" / "gallery").iterdir()} == shown
    # A palette merges colours that tell channels apart.
    pictures = (DOCS / "images").rglob("*.png")
    assert [p.name for p in pictures if Image.open(p).mode == "P"] == []


def test_numbers_may_differ_and_words_may_not():
    assert same("chi²/n 1.05, a", "chi²/n 1.051, a")
    assert not same("chi²/n 1.05, a", "chi²/n 1.25, a")
    assert not same("chi²/n 1.05, a", "chi²/n 1.05, b")
