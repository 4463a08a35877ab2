"""The bench of searches from far away: what it hides, where the truth lies in the catalogue's terms, how it counts."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import room_search

from truth.room.case import _draw_truth
from truth.room.effects import hide


def hidden(effects, seed=11):
    truth = hide(_draw_truth(seed, 0, 8), effects, seed)
    return SimpleNamespace(truth=truth, effects=effects)


def numbers(text):
    return np.array([float(v) for v in str(text).strip("()").split(",")])


@pytest.mark.parametrize("seed", range(5))
def test_a_resonator_in_a_corner_is_4_to_8_cm_from_two_edges(seed):
    made = hidden({"helmholtz-resonator@corner": 2e-3}, seed)
    details = made.truth.details["helmholtz-resonator@corner"]
    dims = np.array(made.truth.layout.dims_m)
    place = numbers(details["place_m"])
    gaps = np.minimum(place, dims - place)
    axis = "xyz".index(details["wall"][0])
    assert gaps[axis] == 0.0
    assert all(0.04 <= gap <= 0.08 for gap in np.delete(gaps, axis))


def test_what_is_drawn_elsewhere_does_not_change_with_the_corner():
    """Streams of random numbers are what frozen cases hang on."""
    plain = hidden({"helmholtz-resonator": 2e-3}).truth.details["helmholtz-resonator"]
    corner = hidden({"helmholtz-resonator@corner": 2e-3}).truth.details["helmholtz-resonator@corner"]
    assert {k: v for k, v in plain.items() if k != "place_m"} == {
        k: v for k, v in corner.items() if k != "place_m"
    }


def test_a_box_on_the_floor_stands_on_it():
    made = hidden({"scatterer@floor": 3e-3})
    details = made.truth.details["scatterer@floor"]
    centre, edges = numbers(details["place_m"]), numbers(details["edges_m"])
    assert centre[2] - edges[2] / 2 == pytest.approx(0.02)
    assert np.prod(edges) == pytest.approx(3e-3)


def test_the_truth_is_told_in_the_terms_of_the_catalogue():
    """m w^2 is a spring's stiffness; a neck resonates at (c / 2 pi) sqrt(S / (V l))."""
    lining = room_search.at_truth(hidden({"wall-impedance@z1": 0.4}))["wall-impedance@z1"]
    details = hidden({"wall-impedance@z1": 0.4}).truth.details["wall-impedance@z1"]
    assert lining["conductance"] == 0.4
    assert np.sqrt(lining["stiffness"] / lining["mass"]) / 2 / np.pi == pytest.approx(details["frequency_hz"])
    made = hidden({"helmholtz-resonator@corner": 2e-3})
    ((use, found),) = room_search.at_truth(made).items()
    assert use.startswith("helmholtz-resonator@")
    c, (_, details) = made.truth.room.sound_speed, made.truth.details.popitem()
    radius = details["neck_radius_m"]
    assert found["neck_area"] == pytest.approx(np.pi * radius**2)
    whole = found["neck_area"] / 2e-3 / (2 * np.pi * found["resonance"] / c) ** 2
    assert (
        0.2 * radius < whole - details["length_m"] < 8 / 3 / np.pi * radius
    )  # the grid moves a part of that air


def record(named, chi2, wanted=("leak@z1",)):
    verdict = {"alternatives": [list(n) for n in named], "verdict": "effect" if named else "nothing-missing"}
    return {
        "at_truth": {use: {} for use in wanted},
        "verdict": verdict,
        "chi2": chi2,
        "effects": {"leak": 1.0},
    }


def test_a_minimum_is_missed_where_every_set_of_the_search_lies_above_that_at_the_truth():
    assert not room_search.missed(
        record([["leak"]], {"truth": 1.0, "leak@z1": 1.05, "panel-resonance@z1": 30.0})
    )
    assert room_search.missed(record([["leak"]], {"truth": 1.0, "leak@x0": 1.3}))
    assert room_search.missed(record([], {"truth": 1.0}))


@pytest.mark.parametrize(
    ("named", "expected"),
    [([["leak"]], "right"), ([["leak"], ["panel-resonance"]], "group"), ([["panel-resonance"]], "wrong")],
)
def test_a_verdict_is_right_where_what_is_hidden_stands_alone(named, expected):
    assert room_search.right(record(named, {})) == expected
