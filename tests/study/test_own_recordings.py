"""What is otherwise in one recording than in the others: places, air. Rooms of the independent simulator."""

import tomllib
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from specan.errors import InputError, RequestError
from specan.io.write_tdms import STARTED
from specan.models.catalogue import load_model
from specan.room.model import EXAMPLE_RIG
from specan.room.model.places import in_recording
from specan.room.model.rig import read_rig
from specan.room.model.rig_tables import TemperatureLog
from specan.room.study.open_recordings import open_data
from specan.room.study.receiver_places import _views
from specan.study.create import begin
from specan.study.estimation.continuation import linearised
from specan.study.estimation.fit import fit
from specan.study.observation import DataFile, MeasuredFiles
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from truth.rig_files import write_tdms
from truth.room import simulate, write

BAND = {"f_min_hz": 60.0, "f_max_hz": 280.0}
MICS = [f"Mic {i}" for i in range(1, 7)]
DRIFT_K = 1.0
REST = ["Vibrometer", "Generator"]


def reduced(problem):
    problem = linearised(problem)
    best = fit(problem)
    return best.chi2 / problem.n_data, problem.values_at(best.theta)


@pytest.fixture(scope="module")
def moved_array(tmp_path_factory):
    """Twelve places in one room, heard by six microphones in two recordings; the second 1.5 K warmer."""
    folder = tmp_path_factory.mktemp("moved")
    first = simulate(57, {}, n_mics=12, cache=folder)
    warmer = simulate(57, {"temperature": 1.5}, n_mics=12, repeat=1, cache=folder)
    second = replace(warmer.take.only([f"Mic {i}" for i in range(7, 13)] + REST), names=(*MICS, *REST))
    write_tdms(folder / "first.tdms", first.hardware, first.take.only(MICS + REST))
    write_tdms(folder / "second.tdms", first.hardware, second)
    rig = deepcopy(first.rig)
    rig["band"] |= BAND
    places = rig["mics"]["position_m"]
    rig["mics"] = {**rig["mics"], "position_m": places[:6], "cards": [[1, 6]]}
    rig["recordings"] = [{"file": "second.tdms", "position_m": places[6:]}]
    import tomlkit

    (folder / "rig.toml").write_text(tomlkit.dumps(rig), encoding="utf-8")
    return folder


@pytest.mark.long
def test_an_array_that_is_moved_is_one_study_and_each_recording_has_its_own_air(moved_array):
    folder = moved_array
    both = [folder / "first.tdms", folder / "second.tdms"]
    begun = begin(folder / "study", "room", folder / "rig.toml", both, hold_out=["channel=Mic 6"])
    study = begun.study
    for o, own in zip(
        study.data.fitted, ([f"{m}" for m in MICS[:5]], [f"{m} in second" for m in MICS[:5]]), strict=True
    ):
        assert list(dict.fromkeys(o.labels["channel"])) == own
    assert {str(c) for o in study.data.held_out for c in o.labels["channel"]} == {"Mic 6", "Mic 6 in second"}
    best = study.best
    assert best.chi2 / study.problem.n_data < 1.1
    offset = study.problem.values_at(best.theta)["temperature.offset"]
    assert np.diff(offset)[0] == pytest.approx(1.5, abs=0.2)
    assert study.held_out.reduced_chi2 < 1.3
    places = np.array([[0.3, 0.3, 0.3], [0.5, 0.4, 0.2]])
    (view,) = _views([Refit(frozenset(), study.problem, best)], places)  # of the first recording
    column = {name: k for k, name in enumerate(study.problem.names)}
    assert np.any(view.slopes[..., column["temperature.offset[first.tdms]"]])
    assert not np.any(view.slopes[..., column["temperature.offset[second.tdms]"]])
    wrong = (folder / "rig.toml").read_text().replace("second.tdms", "third.tdms")
    (folder / "unmoved.toml").write_text(wrong)
    there = begin(folder / "wrong", "room", folder / "unmoved.toml", both).study
    assert there.best.chi2 / there.problem.n_data > 100


@pytest.mark.long
def test_a_fit_allows_for_air_that_drifts_as_a_thermometer_has_logged_it(tmp_path):
    case = simulate(57, {"drifting-air": DRIFT_K}, n_mics=4, cache=tmp_path)
    path, rig = write(case, tmp_path)
    content = tomllib.loads(rig.read_text(encoding="utf-8"))
    content["band"] |= BAND
    plain = reduced(problem_of(content, path))[0]
    low = case.truth.temperature_C - DRIFT_K / 2
    start = np.datetime64(STARTED.replace(tzinfo=None))
    times = [start + np.timedelta64(s, "s") for s in (-600, 0, 5, 600)]
    lines = [f"{t},{c}" for t, c in zip(times, (low - 4, low, low + DRIFT_K, low + 9), strict=True)]
    (tmp_path / "air.csv").write_text("time_utc,temperature_C\n" + "\n".join(lines))
    content["air"]["temperature_log"] = str(tmp_path / "air.csv")
    content["uncertainty"]["temperature_K"] = 0.1
    logged = problem_of(content, path)
    (seen,) = logged.observations
    assert any("air of" in note and "0.8 K of drift" in note for note in seen.notes)
    assert seen.conditions_at_nodes["temperature_difference"] == pytest.approx(
        case.truth.temperature_C + 0.1 - (low + 1.5), abs=1e-6
    )  # over the mean of all readings; the first second is not analysed
    after = reduced(logged)[0]
    assert after < 1.1
    assert plain > 1.3


def problem_of(content, path):
    model = load_model("room", content)
    return base_problem(model, open_data(model, MeasuredFiles([DataFile(path.name, path)])).fitted)


def test_without_times_the_whole_log_counts_and_far_times_are_refused():
    day = np.datetime64("2026-05-12T10:00:00")
    log = TemperatureLog(np.array([20.0, 22.0]), np.array([day, day + np.timedelta64(100, "s")]))
    assert log.during(day + np.timedelta64(25, "s"), 50.0).mean() == pytest.approx(21.0)
    with pytest.raises(InputError, match="expected a log of the time of the recording"):
        log.during(day + np.timedelta64(1, "D"), 5.0)
    rig = read_rig(EXAMPLE_RIG)
    assert in_recording(rig, log, "a.tdms", None, 5.0).conditions == {}


PLACES = EXAMPLE_RIG["mics"]["position_m"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recordings": [{"file": "b.tdms", "position_m": PLACES[:2]}]}, "has 2 positions, [mics] 4"),
        ({"recordings": [{"file": "b.tdms"}, {"file": "b.tdms"}]}, "b.tdms occurs twice"),
        (
            {"recordings": [{"file": "b.tdms", "position_m": [[2.0, 0.1, 0.1], *PLACES[1:]]}]},
            "outside the room",
        ),
        (
            {"recordings": [{"file": "b.tdms", "driven": [2]}]},
            "driven = [2]; expected numbers of loudspeakers",
        ),
    ],
)
def test_what_cannot_be_is_told(changes, message):
    with pytest.raises(RequestError) as told:
        load_model("room", {**EXAMPLE_RIG, **changes})
    assert message in str(told.value)
