"""A room one wall of which leans, by an element of its shape: the lean is named, and nothing that does as much."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from specan.models.catalogue import load_model
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import base_problem
from tests.room.test_leaning_walls import CENTRE, EDGES, RADIUS, at_points, element
from tests.study.few import beside
from tests.study.test_coarse import FREQUENCY, RIG, recorded

ADMITTANCE = 0.005
MODES = 300  # what those above add hardly depends on frequency
BAND = (FREQUENCY < 300.0) & (FREQUENCY % 2 == 0)


def leaning(model):
    """Transfer functions of the room with wall x1 leaning by 1.5 degrees along z."""
    air = model.assemble().evaluate(
        {"frequency": FREQUENCY}, wanted=["air_attenuation", "air_dispersion", "density", "sound_speed"]
    )
    k = (
        2 * np.pi * FREQUENCY / (air["sound_speed"] * (1 + air["air_dispersion"]))
        - 1j * air["air_attenuation"]
    )
    stiffness, mass, skin, driven = element()
    squares, shapes = eigh(stiffness, mass, subset_by_index=[0, MODES - 1])
    own_skin, own_driven = shapes.T @ skin @ shapes, shapes.T @ driven
    at = at_points(np.array(RIG["mics"]["position_m"]))
    heard, found = at @ shapes, np.zeros((len(at), k.size), dtype=complex)

    def of_modes(k):
        matrix = np.diag(squares - k**2) + 1j * k.real * ADMITTANCE * own_skin
        return heard @ np.linalg.solve(matrix, own_driven)

    middle = k[k.size // 3]
    whole = stiffness + 1j * middle.real * ADMITTANCE * skin - middle**2 * mass
    above = at @ np.linalg.solve(whole, driven) - of_modes(middle)
    for n in np.flatnonzero(BAND):
        found[:, n] = of_modes(k[n]) + above
    return 2j * np.pi * FREQUENCY * air["density"] * np.pi * RADIUS**2 * found


@pytest.mark.long
def test_a_wall_that_leans_is_named_and_by_its_angle():
    assert (RIG["room"]["dims_m"], RIG["piston"]["centre_m"]) == (list(EDGES), list(CENTRE))
    model = load_model("room", RIG)
    upright = recorded(model, [], {})
    noise = (
        upright.response
        - model.assemble().evaluate(upright.conditions_at_nodes, {}, ["indicated_frf"])["indicated_frf"]
    )
    measured = replace(upright, response=leaning(model) + noise, kept=upright.kept & BAND)
    few = beside(model, "microphone-position", "leaning-wall")
    verdict = diagnose(base_problem(few, [measured]))
    assert verdict.alternatives == (("leaning-wall",),)
    assert [*verdict.at["leaning-wall"]] == ["x1 along z"]
    (angle,) = verdict.ranking[0].parameters.values()
    assert angle["low"] < 1.5 < angle["high"]
