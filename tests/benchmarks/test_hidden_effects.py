"""The bench itself: fixed cases, fair counting, results that survive a broken run."""

import dataclasses
import importlib
import json
import sys
import types
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from hidden_effects import cases, judge, run  # noqa: E402
from truth.worm_gear import EFFECTS  # noqa: E402


def record(kind="single", truth=("windage",), verdict="effect", alternatives=(("windage",),), **more):
    said = {
        "verdict": verdict,
        "alternatives": [list(a) for a in alternatives],
        "ranking": more.pop("ranking", [{"effects": list(a)} for a in alternatives]),
        "unknown_possible": more.pop("unknown_possible", False),
        "smallest_visible": more.pop("smallest_visible", {}),
    }
    base = {
        "lambda": 200.0,
        "d": 50.0,
        "planted": {},
        "conditional_lambda": 50.0,
        "effects": {"windage": 1.0},
    }
    return {"kind": kind, "truth": list(truth), "verdict": said, **base, **more}


def row(records, text):
    return next(r for r in judge.table(records) if r["row"].strip().startswith(text))


def test_cases_are_fixed_by_kind_and_seed():
    for kind in cases.KINDS:
        first, again = cases.planned(kind, 8), cases.planned(kind, 5)
        assert first[:5] == again
        assert all(c.simulate().seed == c.seed for c in first[:1])


def test_development_and_reserved_seeds_never_meet():
    development = cases.planned("single", 400)
    reserved = cases.planned("single", 400, reserved=True)
    assert max(c.seed for c in development) < cases.FIRST_RESERVED_SEED <= min(c.seed for c in reserved)
    assert cases.FIRST_DEVELOPMENT_SEED + cases.MOST_CASES < cases.FIRST_RESERVED_SEED
    with pytest.raises(ValueError, match="at most"):
        cases.planned("null", cases.MOST_CASES + 1)


def test_every_catalogue_effect_and_every_unknown_is_hidden_alone_within_its_physical_range():
    single, unknown = cases.planned("single", 340), cases.planned("unknown", 84)
    assert {n for c in single for n in c.effects} == set(cases.CATALOGUE)
    assert {n for c in unknown for n in c.effects} == set(cases.OUTSIDE)
    for case in (*single, *unknown):
        ((name, strength),) = case.effects.items()
        assert abs(strength) <= max(abs(EFFECTS[name].low), EFFECTS[name].high) * 1.001
        assert strength * EFFECTS[name].low > 0 or EFFECTS[name].low < 0
        if EFFECTS[name].needs in ("elapsed_time", "idle"):
            assert case.design == {"elapsed_time": "campaign", "idle": "idle"}[EFFECTS[name].needs]


def test_pairs_are_of_two_candidates():
    assert all(len(c.truth) == 2 for c in cases.planned("pair", 80))


def test_what_is_left_out_is_what_is_hidden():
    assert all(c.without == c.truth and c.truth for c in cases.planned("left-out", 30))


def test_effects_can_be_chosen():
    assert {n for c in cases.planned("single", 9, only=("windage",)) for n in c.effects} == {"windage"}


def test_the_rig_file_can_be_told_more():
    case = dataclasses.replace(cases.planned("null", 1)[0], rig={"oil.vogel_constant_C": 145.0})
    assert case.simulate().rig["oil"]["vogel_constant_C"] == 145.0
    assert "vogel_constant_C" not in cases.planned("null", 1)[0].simulate().rig["oil"]


@pytest.mark.parametrize(
    ("right", "of", "low", "high"),
    [
        (0, 300, 0.0, 1.22),
        (3, 800, 0.08, 1.09),
        (97, 100, 91.48, 99.38),
        (50, 50, 92.89, 100.0),
    ],  # tables of Clopper & Pearson
)
def test_intervals(right, of, low, high):
    np.testing.assert_allclose(100 * np.array(judge.interval(right, of)), [low, high], atol=0.01)


def test_a_null_counts_whatever_is_named():
    records = [
        record("null", (), v, ())
        for v in ("nothing-missing", "effect", "group", "unknown-effect", "cannot-tell")
    ]
    assert row(records, "null: something")["count"] == 3
    assert row(records, "null: something")["met"] is False
    assert row([record("null", (), "nothing-missing", ())] * 300, "null: something")["met"] is True


def test_right_is_first_or_in_the_named_group():
    group = record(alternatives=(("seal-drag",), ("windage",)), verdict="group")
    wrong = record(alternatives=(("seal-drag",),))
    superset = record(alternatives=(("seal-drag", "windage"),))
    silent = record(verdict="nothing-missing", alternatives=(), ranking=[{"effects": ["windage"]}])
    assert judge.truth_first(record())
    assert judge.truth_first(group)
    assert not judge.top_one(group)
    assert judge.top_one(silent)
    for r in (wrong, superset, silent):
        assert not judge.truth_first(r)
        assert not judge.among(r)


def test_classes_by_lambda_and_d():
    records = [record(**{"lambda": value, "d": d}) for value, d in ((200, 50), (200, 5), (50, 50), (20, 50))]
    assert row(records, "single, lambda >= 100, D >= 20")["of"] == 1
    assert row(records, "single, lambda 30-100, D >= 20")["of"] == 1
    assert row(records, "single, lambda >= 30: truth")["of"] == 3
    assert row(records, "single, lambda 10-30")["of"] == 1


def test_a_weak_effect_must_be_called_invisible():
    def weak(visible, planted=1.0, verdict="nothing-missing"):
        return record(
            verdict=verdict,
            alternatives=(),
            planted={"windage": planted},
            smallest_visible={"windage": visible},
        )

    assert judge.honestly_nothing(weak({"value": 2.0, "unit": "W"}))
    assert judge.honestly_nothing(weak(None))  # invisible at any size
    assert not judge.honestly_nothing(weak({"value": 0.5, "unit": "W"}))
    assert not judge.honestly_nothing(weak({"value": 2.0, "unit": "W"}, verdict="effect"))


def test_unknown_alone_or_as_a_doubt():
    assert judge.unknown_recognised(record("unknown", (), "unknown-effect", ()))
    assert judge.unknown_recognised(record("unknown", (), "effect", unknown_possible=True))
    assert not judge.unknown_recognised(record("unknown", (), "effect"))


def test_pairs_are_counted_where_both_are_strong():
    both, one = ("seal-drag", "windage"), ("windage",)
    records = [
        record("pair", both, alternatives=(both,)),
        record("pair", both, alternatives=(one,)),
        record("pair", both, alternatives=(one,), conditional_lambda=3.0),
    ]
    assert (row(records, "pair,")["count"], row(records, "pair,")["of"]) == (1, 2)


def test_sure_and_wrong_is_a_name_without_a_doubt_that_is_not_the_truth():
    both = ("seal-drag", "windage")
    assert not judge.sure_and_wrong(record())
    assert judge.sure_and_wrong(record(alternatives=(("seal-drag",),)))
    assert not judge.sure_and_wrong(record(alternatives=(("seal-drag",),), unknown_possible=True))
    assert not judge.sure_and_wrong(record(alternatives=(("seal-drag",), ("windage",)), verdict="group"))
    assert judge.sure_and_wrong(record("null", ()))
    assert not judge.sure_and_wrong(record("null", (), "unknown-effect"))
    assert judge.sure_and_wrong(record("pair", both))  # one of two that both show
    assert not judge.sure_and_wrong(record("pair", both, conditional_lambda=3.0))
    assert judge.sure_and_wrong(record("pair", both, alternatives=(("churning",),), conditional_lambda=3.0))


def test_the_statement_of_the_smallest_size_is_held_against_what_was_planted():
    def planted(size, visible):
        return record(planted={"windage": size}, smallest_visible={"windage": visible})

    assert judge.visible(planted(2.0, {"value": 2.0, "unit": "W"}))
    assert not judge.visible(planted(1.9, {"value": 2.0, "unit": "W"}))
    assert not judge.visible(planted(1.9, None))
    assert not judge.visible(planted(None, {"value": 2.0, "unit": "W"}))


@pytest.fixture
def engine(monkeypatch):
    """An engine that always says what is hidden, and fails where the seed is 1003."""
    module = types.ModuleType("oracle")
    module.calls = []

    def diagnose(case, directory):
        module.calls.append(case.key)
        assert (directory / "measurement.csv").exists()
        assert (directory / "rig.toml").exists()
        if case.seed == 1003:
            raise RuntimeError("broke")
        sets = [list(case.truth)] if case.truth else []
        return {
            "verdict": "effect" if sets else "nothing-missing",
            "alternatives": sets,
            "ranking": [{"effects": s} for s in sets],
            "unknown_possible": False,
            "smallest_visible": {},
            "worst": float("nan"),
        }

    module.diagnose = diagnose
    module.measure = lambda case, truth, directory, verdict: {
        "lambda": 200.0, "d": 50.0, "conditional_lambda": 50.0, "planted": {}
    }  # fmt: skip
    monkeypatch.setitem(sys.modules, "oracle", module)
    return module


def test_a_broken_run_goes_on_where_it_stopped(engine, tmp_path):
    path = tmp_path / "out.jsonl"
    some = cases.planned("single", 3)
    assert len(list(run.run(some[:2], path, workers=1, engine="oracle"))) == 2
    with path.open("a") as file:
        file.write('{"key": "single/10')  # the power went
        file.write("\n")
    engine.calls.clear()
    records = list(run.run(some, path, workers=1, engine="oracle"))
    assert engine.calls == [some[2].key]
    assert {r["key"] for r in records} == {c.key for c in some}
    assert all(json.loads(line) for line in path.read_text().splitlines() if '"code"' in line)
    assert row(records, "single, lambda >= 100")["count"] == 3


def test_results_of_other_code_or_another_plan_are_not_taken(engine, tmp_path):
    path = tmp_path / "out.jsonl"
    (case,) = cases.planned("single", 1)
    (made,) = run.run([case], path, workers=1, engine="oracle")
    for change in ({"code": "another"}, {"effects": {"windage": 99.0}}):
        path.write_text(json.dumps({**made, "code": run.fingerprint(), "verdict": None, **change}) + "\n")
        engine.calls.clear()
        list(run.run([case], path, workers=1, engine="oracle"))
        assert engine.calls == [case.key]


def test_a_failure_is_a_record_and_counts_nowhere(engine, tmp_path):
    records = list(run.run(cases.planned("single", 4), tmp_path / "o.jsonl", workers=1, engine="oracle"))
    (failed,) = [r for r in records if "error" in r]
    assert "RuntimeError: broke" in failed["error"]
    assert row(records, "single, lambda >= 100")["of"] == 3


# --- a small fixed part of the bench, with the study engine ------------------------------------------


@pytest.mark.long
def test_the_engine_finds_nothing_in_a_healthy_gear():
    found = run.run_case(cases.planned("null", 1)[0])
    assert "error" not in found, found["error"]
    assert not judge.names_something(found)
    assert found["lambda"] < 20


@pytest.mark.long
def test_the_engine_knows_an_effect_that_is_in_no_catalogue():
    found = run.run_case(cases.Case("unknown", 1500, "grid", {"speed-bump": 20.0}))
    assert "error" not in found, found["error"]
    assert found["lambda"] > 300
    assert judge.unknown_recognised(found)


def measured(strength, folder):
    """What the data of a hidden effect could know, whatever a verdict says."""
    case = cases.Case("single", 1500, "grid", {"windage": strength})
    truth = case.simulate()
    case.write(truth, folder)
    return importlib.import_module(case.engine).measure(case, truth, folder, {})


@pytest.mark.long
def test_lambda_and_d_are_those_of_the_planted_effect(tmp_path):
    """A stronger effect leaves more (less than its square: the declared discrepancy grows with the loss)."""
    once, twice = (measured(strength, tmp_path) for strength in (8.0, 16.0))
    assert 2.0 < twice["lambda"] / once["lambda"] < 4.2
    assert twice["d"] > 1.5 * once["d"] > 30
    assert twice["planted"]["windage"] / once["planted"]["windage"] == pytest.approx(2.0, rel=0.2)


@pytest.mark.long
def test_look_alikes_leave_no_d():
    seal = run.run_case(cases.Case("single", 1500, "grid", {"seal-drag": 0.4}))
    assert seal["rival"] in ("torque-zero-error", "bearing-preload")
    assert seal["d"] < 3.0  # negative: a look-alike with more freedom follows the planted form better
