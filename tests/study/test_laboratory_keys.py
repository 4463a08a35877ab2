"""What a laboratory declares of its recordings, on rooms of the independent simulator."""

import re
import tomllib
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from specan.errors import RequestError
from specan.io.open import open_recording
from specan.models.catalogue import load_model
from specan.room.study.estimate_frf import observe_recording
from specan.room.study.open_recordings import open_data
from specan.study.diagnose import diagnose
from specan.study.estimation.continuation import linearised
from specan.study.estimation.fit import fit
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from truth.room import simulate, write

SEED = 57


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A room that hides nothing; the recording, and what its rig file says."""
    folder = tmp_path_factory.mktemp("room")
    made = simulate(SEED, {}, n_mics=6, cache=folder)
    made.rig["band"] |= {"f_min_hz": 60.0, "f_max_hz": 300.0}
    path, rig = write(made, folder)
    return path, tomllib.loads(rig.read_text(encoding="utf-8"))


def described(recorded, **changes):
    path, rig = recorded
    rig = deepcopy(rig)
    for table, keys in changes.items():
        rig[table] = rig[table] | keys
    model = load_model("room", rig)
    data = open_data(model, MeasuredFiles([DataFile("take", path)]))
    return base_problem(model, data.fitted), data.statements


def reduced(problem):
    problem = linearised(problem)
    return fit(problem).chi2 / problem.n_data


def shifted(recorded, by):
    places = np.array(recorded[1]["mics"]["position_m"]) + by
    return {"position_m": places.tolist()}


def times(factor, seen):
    return replace(
        seen, response=factor * seen.response, noise=factor * seen.noise, random=factor * seen.random
    )


@pytest.mark.long
def test_a_frame_that_is_shifted_as_a_whole_is_allowed_for_where_it_is_declared(recorded):
    mics = shifted(recorded, [0.024, -0.018, 0.021])  # m; single places are known to 2 mm
    plain, _ = described(recorded, mics=mics)
    framed, said = described(recorded, mics=mics, uncertainty={"frame_m": 0.024})
    assert reduced(plain) > 1.4
    assert reduced(framed) < 1.1
    assert any("24 mm and 0 degrees of their frame" in text for text in said)


@pytest.mark.long
def test_a_frame_that_is_tilted_is_allowed_for_where_it_is_declared(recorded):
    places = np.array(recorded[1]["mics"]["position_m"])
    arm = places - places.mean(axis=0)
    tilted = {"position_m": (places + np.cross(np.radians([6.0, -4.0, 4.8]), arm)).tolist()}
    plain, _ = described(recorded, mics=tilted)
    framed, _ = described(recorded, mics=tilted, uncertainty={"frame_tilt_deg": 5.0})
    assert reduced(plain) > 1.4
    assert reduced(framed) < 1.1


@pytest.mark.long
def test_one_microphone_may_be_known_less_well(recorded):
    places = np.array(recorded[1]["mics"]["position_m"])
    places[2] += [0.02, -0.016, 0.018]
    mics = {"position_m": places.tolist()}
    each = [0.002] * 6
    each[2] = 0.02
    plain, _ = described(recorded, mics=mics)
    single, said = described(recorded, mics=mics, uncertainty={"position_m": each})
    fall = (reduced(plain) - reduced(single)) * plain.n_data
    assert fall > 50  # one of six microphones, three coordinates
    assert reduced(single) < 1.1
    assert any("place 2 to 20 mm" in text for text in said)


@pytest.mark.long
def test_a_level_error_of_the_calibrator_is_common_to_all_microphones(recorded):
    path, rig = recorded
    rig = deepcopy(rig)
    rig["uncertainty"] |= {"vibrometer_gain_percent": 0.05, "calibrator_dB": 0.5}
    model = load_model("room", rig)
    seen = open_data(model, MeasuredFiles([DataFile("take", path)])).fitted[0]
    louder = times(10 ** (0.6 / 20), seen)
    rig["uncertainty"]["calibrator_dB"] = 0.0
    plain = open_data(load_model("room", rig), MeasuredFiles([DataFile("take", path)])).fitted[0]
    same = times(10 ** (0.6 / 20), plain)
    known, unknown = base_problem(model, [louder]), base_problem(load_model("room", rig), [same])
    assert reduced(known) < 1.1
    assert (reduced(unknown) - reduced(known)) * known.n_data > 100  # six channels, each six times its 0.1 dB


@pytest.mark.long
def test_bands_and_harmonics_of_the_mains_are_left_out(recorded):
    problem, _ = described(recorded, band={"hum_hz": 50.0, "left_out_hz": [[120.0, 130.0]]})
    lines = np.unique(problem.observations[0].conditions["frequency"])
    assert 125.0 not in lines
    assert not {49.0, 50.0, 51.0, 99.0, 100.0, 101.0, 300.0} & set(lines)
    assert {98.0, 102.0, 119.0, 131.0} <= set(lines)
    assert reduced(problem) < 1.3


def test_nothing_left_is_refused(recorded):
    with pytest.raises(RequestError, match="all lines of the band are left out"):
        described(recorded, band={"left_out_hz": [[1.0, 1000.0]]})


@pytest.mark.long
def test_longer_blocks_bring_lines_nearer_and_fit_as_well(recorded):
    path, rig = recorded
    rig = deepcopy(rig)
    rig["band"] |= {"block_s": 0.5}
    short = load_model("room", rig)
    found = observe_recording(open_recording(path), short)
    assert found.line_hz == pytest.approx(2.0, rel=0.02)
    assert reduced(base_problem(short, [found])) < 1.3


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"uncertainty": {"position_m": [0.002, 0.002]}}, "2 values for 6 microphones"),
        ({"band": {"left_out_hz": [[130.0, 120.0]]}}, r"left_out_hz says \[130, 120\]"),
    ],
)
def test_what_cannot_be_is_refused(recorded, keys, said):
    with pytest.raises(RequestError, match=said):
        described(recorded, **keys)


@pytest.mark.long
def test_air_that_warms_while_it_is_recorded_is_told(tmp_path):
    made = simulate(SEED, {"drifting-air": 1.0}, n_mics=4, cache=tmp_path)
    made.rig["band"] |= {"f_min_hz": 60.0, "f_max_hz": 300.0}
    path, rig = write(made, tmp_path)
    problem, _ = described((path, tomllib.loads(rig.read_text(encoding="utf-8"))))
    said = diagnose(linearised(problem))
    assert said.verdict == "cannot-tell"
    kelvin = float(re.search(r"the air warms by about ([\d.]+) K while", said.reason)[1])
    assert kelvin == pytest.approx(0.8, abs=0.3)  # the first fifth of the record is not looked at
