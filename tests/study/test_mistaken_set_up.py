"""Positions of other channels, reversed signs, the loudspeaker elsewhere: on rooms of the independent simulator."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from specan.models import Use
from specan.models.catalogue import load_model
from specan.room.study.of_field import InitialFit, mistake_beside
from specan.room.study.open_recordings import open_data
from specan.study.diagnose import diagnose
from specan.study.localisation.localise import mistaken_set_up
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from truth.room import simulate, write

SEED = 41


@pytest.fixture(scope="module")
def lined(tmp_path_factory):
    """A recording of a room with a lining that the model lacks."""
    folder = tmp_path_factory.mktemp("lined")
    made = simulate(SEED, {"wall-impedance": 0.1}, n_mics=7, cache=folder)
    made.rig["band"]["f_max_hz"] = 300.0
    path, _ = write(made, folder)
    return path, made.rig


def described(lined, change=lambda rig: None, hold_out=()):
    path, rig = lined
    rig = deepcopy(rig)
    change(rig)
    aside = [(None, where) for where in hold_out]
    data = open_data(load_model("room", rig), MeasuredFiles([DataFile("take", path)], hold_out=aside))
    return base_problem(load_model("room", rig), data.fitted)


def with_signs(problem, signs):
    seen = problem.observations[0]
    return problem.over([replace(seen, response=np.array(signs)[:, None] * seen.response)])


def exchange(rig):
    places = rig["mics"]["position_m"]
    places[1], places[4] = places[4], places[1]


@pytest.mark.long
def test_a_lining_is_no_mistake(lined):
    assert not mistaken_set_up(described(lined)).text


@pytest.mark.long
def test_exchanged_positions_are_named_beside_a_lining(lined):
    found = mistaken_set_up(described(lined, exchange))
    assert found.text == "positions of the rig file belong to other channels (Mic 2 and Mic 5 are exchanged)"
    assert found.after_percent < 0.7 * found.before_percent


@pytest.fixture(scope="module")
def deadened(tmp_path_factory):
    """A room with a lining that makes the larger part of the misfit, and a first fit that has found it."""
    folder = tmp_path_factory.mktemp("deadened")
    made = simulate(SEED, {"wall-impedance@z1": 0.8}, n_mics=7, cache=folder)
    made.rig["band"]["f_max_hz"] = 300.0
    path, _ = write(made, folder)
    details = made.truth.details["wall-impedance@z1"]
    omega, mass = 2 * np.pi * details["frequency_hz"], details["mass_kg_m2"]
    own = {"conductance": 0.8, "mass": mass, "stiffness": mass * omega**2}
    uses = frozenset({Use.parse("wall-impedance@z1")})
    known = {uses: {f"wall-impedance@z1.{name}": value for name, value in own.items()}}

    def near(left):
        return InitialFit(None, (), known, uses, left)  # type: ignore[arg-type]

    return (path, made.rig), near


@pytest.mark.long
def test_an_exchange_shows_once_a_strong_lining_is_in_the_model(deadened):
    recorded, near = deadened
    problem = described(recorded, exchange)
    assert not mistaken_set_up(problem).text
    found = mistake_beside(near(left=20.0), problem)
    assert found.text == (
        "beside wall-impedance@z1, positions of the rig file belong to other channels (Mic 2 and Mic 5 are exchanged)"
    )
    assert not mistake_beside(near(left=20.0), described(recorded)).text
    assert not mistake_beside(near(left=0.5), problem).text  # what meets the view is not looked at again


@pytest.mark.long
def test_a_place_of_a_channel_that_is_held_out_is_found(lined):
    found = mistaken_set_up(described(lined, exchange, ["channel=Mic 5"]))
    assert "Mic 2 and Mic 5 are exchanged" in found.text


@pytest.mark.long
def test_channels_in_a_circle_are_named_one_by_one(lined):
    def turn(rig):
        places = rig["mics"]["position_m"]
        places[0], places[2], places[3] = places[2], places[3], places[0]

    text = mistaken_set_up(described(lined, turn)).text
    for channel, place in ((1, 4), (3, 1), (4, 3)):
        assert f"Mic {channel} stands at the place of Mic {place}" in text


@pytest.mark.long
def test_a_vibrometer_of_reversed_sign_is_named(lined):
    assert (
        mistaken_set_up(with_signs(described(lined), -np.ones(7))).text == "the vibrometer has reversed sign"
    )


@pytest.mark.long
def test_a_microphone_of_reversed_sign_is_named(lined):
    signs = np.ones(7)
    signs[5] = -1
    text = mistaken_set_up(with_signs(described(lined), signs)).text
    assert text == "Mic 6 has reversed sign against the vibrometer"


@pytest.mark.long
def test_a_loudspeaker_in_another_wall_is_found_near_its_place(lined):
    _, rig = lined
    true = rig["piston"]

    def elsewhere(rig):
        far = {"0": "1", "1": "0"}[true["wall"][1]]
        axis = "xyz".index(true["wall"][0])
        rig["piston"]["wall"] = true["wall"][0] + far
        rig["piston"]["centre_m"][axis] = rig["room"]["dims_m"][axis] if far == "1" else 0.0

    text = mistaken_set_up(described(lined, elsewhere)).text
    assert f"in wall {true['wall']} near [" in text
    there = [float(c) for c in text.split("[")[1].split("]")[0].split(",")]
    assert np.linalg.norm(np.array(there) - true["centre_m"]) < 0.29  # m, a quarter of a wavelength


@pytest.mark.long
def test_a_diagnosis_says_so_and_blames_no_effect(lined):
    found = diagnose(described(lined, exchange))
    assert found.verdict == "cannot-tell"
    assert not found.alternatives
    assert "Mic 2 and Mic 5 are exchanged" in found.reason
