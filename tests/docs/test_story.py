"""The picture of the README shows what the sample data give today."""

import importlib.util
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.long

IMAGES = Path(__file__).parents[2] / "docs" / "images"


def test_the_numbers_that_are_drawn_are_those_of_today() -> None:
    spec = importlib.util.spec_from_file_location("make_story", IMAGES / "make_story.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = json.loads((IMAGES / "story.json").read_text(encoding="utf-8"))
    found = module.numbers()
    assert found.keys() == drawn.keys()
    for name, value in found.items():
        if isinstance(value, str) or isinstance(value[0], str):
            assert drawn[name] == value, name
        else:  # a fit ends within its tolerance: 1 mN m of at most 15 N m, 2 % of an error
            tolerance = {"residual_mN_m": 0.5, "held_out_N_m": 2e-4}.get(name, 1e-3)
            np.testing.assert_allclose(drawn[name], value, atol=tolerance, rtol=0, err_msg=name)


def test_the_picture_tells_the_story() -> None:
    drawn = json.loads((IMAGES / "story.json").read_text(encoding="utf-8"))
    errors, (before, after) = drawn["held_out_N_m"], np.array(drawn["residual_mN_m"])
    assert all(later < earlier for earlier, later in pairwise(errors))
    assert np.std(after) < np.std(before) / 3
    picture = IMAGES / "story.svg"
    assert picture.stat().st_size < 150_000
    assert "](docs/images/story.svg)" in (IMAGES.parents[1] / "README.md").read_text(encoding="utf-8")
