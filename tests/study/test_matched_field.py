"""Where an effect at one place may sit: a source planted by a textbook sum of a rigid box's modes is found."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.room.study.matched_field import EACH_WAY, FROM_EDGE, likely_places
from specan.study.estimation.fit import describe
from specan.study.selection.candidates import base_problem, candidates
from specan.study.selection.refits import Refit
from tests.study.test_coarse import RIG, recorded

DIMS = np.array(RIG["room"]["dims_m"])


@pytest.fixture(scope="module")
def model():
    return load_model("room", RIG)


def rigid_box(frequency, at, source):
    """``sum_N psi_N(r) psi_N(s) / (V (K_N^2 - k^2))`` (Kuttruff, Room Acoustics, ch. 3), a little damped."""
    k2 = (2 * np.pi * frequency / 343.2) ** 2 * (1 - 0.01j)
    total = 0.0
    for numbers in product(range(6), repeat=3):
        n = np.array(numbers)
        weight = np.prod(np.where(n == 0, 1.0, 2.0)) / np.prod(DIMS)
        shapes = np.prod(np.cos(np.pi * n * at / DIMS)) * np.prod(np.cos(np.pi * n * source / DIMS))
        total = total + weight * shapes / (np.sum((np.pi * n / DIMS) ** 2) - k2)
    return total


@pytest.mark.parametrize(
    ("wall", "place"), [("y1", (0.92, 0.92)), ("z0", (0.04, 0.5)), ("x1", (0.28, 0.7)), ("z1", (0.6, 0.1))]
)
def test_a_source_is_found_where_it_is_whatever_it_emits(model, wall, place):
    o = recorded(model, [], {})
    axis = "xyz".index(wall[0])
    source = np.insert(np.array(place), axis, float(wall[1])) * DIMS
    rng = np.random.default_rng(5)
    lines = o.frequency_hz.size
    strength = rng.standard_normal(lines) + 1j * rng.standard_normal(lines)
    heard = np.array([rigid_box(o.frequency_hz, np.array(p), source) for p in RIG["mics"]["position_m"]])
    planted = heard * strength / np.abs(heard).mean(axis=0) * np.abs(o.response).mean(axis=0)
    problem = base_problem(model, [replace(o, response=o.response + 0.5 * planted)])
    refit = Refit(frozenset(), problem, describe(problem, problem.start()))
    found = likely_places(refit, candidates(problem)[0])
    leaks = {use.at: places[0] for use, places in found.items() if use.name == "leak"}
    # in a corner the next wall's nearest place is five centimetres away, and hardly tells
    assert leaks[wall].share > 0.97 * max(place.share for place in leaks.values())
    step = (1 - 2 * FROM_EDGE) / (EACH_WAY - 1)
    values = leaks[wall].shapes
    assert [values[f"leak@{wall}.{name}"] for name in ("across", "along")] == pytest.approx(
        place, abs=0.75 * step
    )


def test_a_model_that_cannot_tell_of_places_gives_none(model):
    problem = base_problem(
        replace(model, for_kinds={"frf": replace(model.for_kinds["frf"], box=None)}),
        [recorded(model, [], {})],
    )
    refit = Refit(frozenset(), problem, describe(problem, problem.start()))
    assert likely_places(refit, candidates(problem)[0]) == {}
