"""The bench on rooms: which cases there are, and how verdicts, places and held-out errors are counted."""

import dataclasses
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from hidden_effects import judge, judge_rooms, room_cases, room_engine
from specan.models.catalogue import example_model
from truth.room import EFFECTS

SMALL = {"n_mics": 4, "duration_s": 5.0, "rig": {"band.f_min_hz": 60.0, "band.f_max_hz": 110.0}}


def small(kind, seed, effects, held_out=("Mic 2",), **more):
    return room_cases.Case(kind, seed, 0, effects, held_out, **{**SMALL, **more})


def test_nulls_are_of_many_rooms_and_never_twice_the_same():
    nulls = room_cases.planned("null", room_cases.FULL["null"])
    assert len({c.seed for c in nulls}) >= 20
    assert len({(c.seed, c.take) for c in nulls}) == len(nulls) == 160
    assert not any(c.effects for c in nulls)


def test_cases_are_fixed_and_reserved_seeds_apart():
    for kind in room_cases.KINDS:
        assert room_cases.planned(kind, 9)[:4] == room_cases.planned(kind, 4)
        assert (
            min(c.seed for c in room_cases.planned(kind, 5, reserved=True)) >= room_cases.FIRST_RESERVED_SEED
        )
    assert room_cases.FIRST_DEVELOPMENT_SEED + room_cases.MOST_CASES < room_cases.FIRST_RESERVED_SEED


def test_every_effect_is_hidden_alone_and_every_unknown():
    def names(kind, count):
        return {n.partition("@")[0] for c in room_cases.planned(kind, count) for n in c.effects}

    assert names("single", room_cases.FULL["single"]) == set(room_cases.CATALOGUE)
    assert names("unknown", room_cases.FULL["unknown"]) == set(room_cases.OUTSIDE)
    assert set(EFFECTS) == set(room_cases.CATALOGUE) | set(room_cases.OUTSIDE)
    assert all(len(c.truth) == 2 for c in room_cases.planned("pair", 40))
    assert all(c.without == c.truth for c in room_cases.planned("left-out", 30))


def test_what_is_held_out_has_no_error_of_its_own():
    cases = [c for kind in ("single", "pair") for c in room_cases.planned(kind, 300)]
    bad = [(c, n.partition("@")[2]) for c in cases for n in c.effects if "@Mic" in n]
    assert len(bad) > 20
    assert all(mic not in c.held_out and c.validated for c, mic in bad)
    assert all(len(c.held_out) == 2 for c in cases)


def test_strengths_stay_within_what_is_usual():
    for case in room_cases.planned("single", 300):
        ((name, strength),) = case.effects.items()
        effect = EFFECTS[name.partition("@")[0]]
        assert abs(strength) <= effect.high
        assert strength > 0 or effect.both_signs


def record(**more):
    said = {
        "verdict": "effect",
        "alternatives": [["leak"]],
        "ranking": [{"effects": ["leak"]}],
        "unknown_possible": False,
    }
    added = {"reduced_chi2_after": 1.2, "excess_before": 1.0, "excess_after": 0.3}
    base = {"kind": "single", "truth": ["leak"], "verdict": {**said, "at": {"leak": ["z1"]}}, "lambda": 500.0}
    return {**base, "d": 60.0, "at": {"leak": "z1"}, "conditional_lambda": None, "added": added, **more}


def counted(text, *records):
    row = next(r for r in judge.table(records, judge_rooms.ROWS) if r["row"].strip().startswith(text))
    return row["count"], row["of"]


def test_the_place_counts():
    assert counted("the place too", record(), record(at={"leak": "x0"})) == (1, 2)


def test_one_false_alarm_in_160_is_allowed():
    silent = {"verdict": "nothing-missing", "alternatives": [], "ranking": [], "unknown_possible": False}
    quiet, loud = record(kind="null", truth=[], verdict=silent), record(kind="null", truth=[])
    for alarms, met in ((1, True), (2, False)):
        table = judge.table([quiet] * (160 - alarms) + [loud] * alarms, judge_rooms.ROWS)
        assert table[0]["met"] is met


def test_held_out_errors_after_adding():
    worse = {"reduced_chi2_after": 1.6, "excess_before": 1.0, "excess_after": 0.6}
    records = [record(), record(added=worse), record(added=None), record(added=worse, **{"lambda": 50.0})]
    assert counted("after add", *records) == (1, 2)
    assert counted("excess error", *records) == (1, 2)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("responses")


def test_what_is_written_is_measured_without_a_hint(cache, tmp_path):
    case = small("single", 1003, {"microphone-gain@Mic 1": 1.0}, validated=True)
    case.write(case.simulate(cache), tmp_path, cache)
    assert {p.name for p in tmp_path.iterdir()} == {
        "recording.tdms",
        "quiet.tdms",
        "healthy.tdms",
        "validation.tdms",
        "rig.toml",
    }
    assert "f_max_hz = 110" in (tmp_path / "rig.toml").read_text()
    first, second = (case.simulate(cache, repeat=k) for k in (0, 1))
    assert (first.truth.gain_dB == second.truth.gain_dB).all()
    assert abs(first.take.volts - second.take.volts).max() > 0.001


def opened(case, folder, cache):
    truth = case.simulate(cache)
    case.write(truth, folder, cache)
    return case, truth, folder


@pytest.mark.long
def test_what_the_data_could_know_and_what_adding_does(cache, tmp_path):
    """Measured without a search: the verdict is given, and few candidates are."""
    rivals = {"microphone-gain", "piston-size"}
    held = {"temperature", "dimension-error", "microphone-delay", "vibrometer-delay", "vibrometer-gain"}
    denied = tuple(n for n in example_model("room").effects if n not in rivals | held)
    case = small("single", 1003, {"microphone-gain@Mic 1": 3.0}, validated=True, without=denied)
    row = {"value": 0.41, "low": 0.4, "high": 0.42, "unit": "1"}
    first = {
        "effects": ["microphone-gain"],
        "at": {"microphone-gain": ["Mic 1"]},
        "parameters": {"microphone-gain@Mic 1.gain": row},
    }
    found = room_engine.measure(*opened(case, tmp_path, cache), {"verdict": "effect", "ranking": [first]})
    assert found["at"] == {"microphone-gain": "Mic 1"}
    assert 900 > found["lambda"] > 300 > found["misfit"]  # a certificate of 0.1 dB allows no more
    assert found["d"] > 100
    assert found["planted"]["microphone-gain"] == pytest.approx(10**0.15 - 1, rel=0.1)
    assert found["added"]["reduced_chi2_after"] < 1.5 < found["added"]["reduced_chi2_before"]
    assert found["added"]["excess_after"] < 0.5 * found["added"]["excess_before"]


@pytest.mark.long
def test_an_undisturbed_room_leaves_little(cache, tmp_path):
    silent = {"verdict": "nothing-missing", "ranking": []}
    found = room_engine.measure(*opened(small("null", 1003, {}), tmp_path, cache), silent)
    assert found["lambda"] == found["misfit"] < 300
    assert found["added"] is None
    assert found["base"]["held_out_reduced_chi2"] < 2.0


def test_results_are_kept_with_the_size_of_the_case():
    assert dataclasses.asdict(small("null", 1, {}))["n_mics"] == 4
