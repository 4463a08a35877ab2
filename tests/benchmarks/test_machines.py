"""The bench of machines: what it hides is in the readings, how visible that is, and what a verdict is worth."""

import numpy as np
import pytest
from scipy.stats import norm

from machines import judge
from machines.cases import Case, Strengths, candidates, drawn
from machines.run import MACHINES


def case(name, strengths, kind="single", noise=0.5):
    machine, rng = MACHINES[name], np.random.default_rng(3)
    table, forms = machine.plan(rng), machine.forms(rng)
    return Case(machine, name, 3, kind, table, forms, Strengths(strengths), noise, False)


@pytest.mark.parametrize("name", MACHINES)
def test_whatever_can_be_hidden_changes_the_readings_and_has_its_candidate(name):
    plain, machine = case(name, {}), MACHINES[name]
    assert set(machine.inside) <= set(candidates(plain))
    assert not set(machine.outside) & set(candidates(plain))
    for mechanism, (_, most) in {**machine.inside, **machine.outside}.items():
        changed = case(name, {mechanism: most}).clean
        assert max(np.max(np.abs(changed[o] / y - 1)) for o, y in plain.clean.items()) > 0.01, mechanism


def test_what_a_linear_model_leaves_is_known_in_closed_form():
    """The collector's model is a plane: generalised least squares, and the same with a zero of the loss."""
    sky = case("solar-collector", {"cold-sky": 40.0})
    seen = sky.without_noise
    weight = np.linalg.inv(seen.covariance)
    columns = [sky.table["irradiance"], sky.table["excess"], np.ones(seen.n)]
    for effects, count in (((), 2), (("cold-sky",), 3)):
        x = np.stack(columns[:count], axis=1)
        rest = seen.measured - x @ np.linalg.solve(x.T @ weight @ x, x.T @ weight @ seen.measured)
        assert sky.left(*effects) == pytest.approx(rest @ weight @ rest, rel=1e-4)


def test_errors_that_remember_have_the_declared_variance_and_memory():
    found = [case("fuel-cell", {}, "ar-0.9")._white(np.random.default_rng(k), 200) for k in range(400)]
    rows = np.array(found)
    assert rows.var() == pytest.approx(1.0, abs=0.05)
    assert np.mean(rows[:, 1:] * rows[:, :-1]) == pytest.approx(0.9, abs=0.05)


def test_a_case_is_the_same_each_time_and_its_kinds_have_their_shares():
    one, two = drawn(17, MACHINES), drawn(17, MACHINES)
    np.testing.assert_array_equal(one.observation.measured, two.observation.measured)
    assert one.strengths == two.strengths


def record(said, alternatives=(), truth=(), **more):
    hidden = dict.fromkeys(more.pop("hidden", truth), 1.0)
    known = {
        "verdict": said,
        "alternatives": alternatives,
        "truth": list(truth),
        "strengths": hidden,
        "lambda": 100.0,
    }
    return {**known, **more}


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        (record("nothing-missing"), "right"),
        (record("effect", [["a"]]), "false name"),
        (record("unknown-effect"), "unknown called"),
        (record("effect", [["a"]], ["a"]), "right"),
        (record("group", [["b"], ["a"]], ["a"]), "in group"),
        (record("effect", [["a", "b"]], ["a"]), "false name"),
        (record("nothing-missing", truth=["a"]), "missed"),
        (record("nothing-missing", truth=["a"], **{"lambda": 19.0}), "missed (not visible)"),
        (record("effect", [["a"]], ["a", "b"], weakest=30.0), "false name"),
        (record("effect", [["a"]], ["a", "b"], weakest=10.0), "right"),
        (record("unknown-effect", hidden=["x"]), "unknown right"),
        (record("effect", [["a"]], hidden=["x"]), "false name"),
    ],
)
def test_outcomes(about, expected):
    assert judge.outcome(about) == expected


def test_intervals_are_those_where_the_score_test_turns():
    low, high = judge.wilson(7, 20)
    for end in (low, high):
        score = (7 / 20 - end) / np.sqrt(end * (1 - end) / 20)
        assert 2 * norm.sf(abs(score)) == pytest.approx(0.05, abs=1e-6)


def test_reliability_and_brier_score_of_two_statements():
    one = record("effect", [["a"]], ["a"], probabilities=[[["a"], 0.9], [[], 0.1]])
    two = record("nothing-missing", probabilities=[[["a"], 0.2], [[], 0.75]], hidden=[])
    classes, score = judge.reliability([one, two])
    assert [c[:2] for c in classes if c[0]] == [(1, 0), (1, 0), (1, 1), (1, 1)]
    assert score == pytest.approx((0.1**2 + 0.1**2 + 0.2**2 + 0.25**2) / 2)
