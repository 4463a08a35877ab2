"""Left-out blocks against real refits, on a toy whose fits are exact."""

from dataclasses import fields, replace

import numpy as np
import pytest

from specan.study.estimation.fit import discoveries, fit
from specan.study.estimation.prediction_error import LeftOut, held_out_error, observable_errors
from specan.study.localisation.localise import curve_errors, localise
from specan.study.observation.table import TableObservation


def test_a_left_out_block_is_what_a_refit_without_it_says(toy):
    gap = np.abs(toy.x[:, None] - toy.x) + np.abs(toy.z[:, None] - toy.z)
    problem = toy.problem(lambda x, z: 0 * x, ["square"]).with_uses(["square"])
    observed = replace(problem.observations[0], covariance=np.eye(48) + 0.5 * np.exp(-gap))
    problem = problem.over([observed])
    rows = toy.x > 1.5
    statistic, dof = LeftOut(problem, fit(problem)).statistic(rows)
    rest = problem.over([observed.take(~rows)])
    best = fit(rest)
    predicted = problem.predictions(best.theta)[0]
    slopes = problem.sensitivities(best.theta)[0]
    v = observed.covariance
    bridge = v[np.ix_(rows, ~rows)] @ np.linalg.inv(v[np.ix_(~rows, ~rows)])
    expected = predicted[rows] + bridge @ (observed.measured - predicted)[~rows]
    pull = slopes[rows] - bridge @ slopes[~rows]
    spread = v[np.ix_(rows, rows)] - bridge @ v[np.ix_(~rows, rows)] + pull @ best.covariance @ pull.T
    off = observed.measured[rows] - expected
    assert dof == rows.sum()
    assert statistic == pytest.approx(off @ np.linalg.solve(spread, off), rel=0.02)


def test_the_direction_is_the_mean_relative_error_that_a_refit_finds(toy):
    problem = toy.problem(lambda x, z: 1.0 * (2 + 3 * x) * (z > 1.0), [], noise=0.01)
    rows = toy.z > 1.0
    error, z = LeftOut(problem, fit(problem)).directions([rows])[0]
    whole = 1 + 1 / 6  # what the fit makes of five sixths at one and a sixth at two
    assert error == pytest.approx((1 - 2) / whole, rel=0.05)
    assert z < -10


def test_a_planted_failure_is_found_at_its_place_and_said(toy):
    problem = toy.problem(lambda x, z: 5.0 * ((z > 1.0) & (x > 1.8)), [])
    found = localise(problem, fit(problem))
    assert found.fails_at[0].where == {"x": 2.0, "z": 1.5}
    assert found.fails_at[0].z < -4
    assert "low" in found.fails_at[0].text
    trends = {t.variable: t for t in found.trends}
    assert trends["z"].significant
    assert any("fails" in s and "1.5" in s for s in found.sentences())


def test_a_failure_at_an_end_of_a_range_is_said_as_such(toy):
    problem = toy.problem(lambda x, z: 4.0 * (z > 0.5), [], noise=0.5)
    text = " ".join(localise(problem, fit(problem)).sentences())
    assert "low" in text or "high" in text
    assert "no dependence on x" in text


def test_a_true_model_is_left_alone(toy):
    flagged = 0
    for seed in range(60):
        problem = toy.problem(lambda x, z: 0 * x, [], seed=seed)
        flagged += bool(localise(problem, fit(problem)).fails_at)
    assert flagged <= 6


def test_parameters_cannot_run_out_of_their_domain_without_a_block(toy):
    problem = toy.problem(lambda x, z: 3.0 * (x > 1.9), [])
    tight = replace(problem, domains={"line.slope": (2.9, 3.1), "line.offset": (1.9, 2.1)})
    free = LeftOut(problem, fit(problem)).directions([toy.x > 1.9])[0]
    held = LeftOut(tight, fit(tight)).directions([toy.x > 1.9])[0]
    assert abs(held[1]) > abs(free[1])


def test_the_same_rows_under_two_names_count_once(toy):
    observed = toy.observation(2.0 + 3.0 * toy.x)
    doubled = replace(observed, labels={**observed.labels, "copy": toy.z.copy()})
    problem = toy.problem(lambda x, z: 0 * x, []).over([observed])
    assert len(localise(problem.over([doubled]), fit(problem)).blocks) == len(
        localise(problem, fit(problem)).blocks
    )


def test_false_discoveries_are_controlled_whatever_the_dependence():
    p = [0.001, 0.02, 0.2, float("nan")]
    assert discoveries(p, 0.05).tolist() == [True, False, False, False]
    assert discoveries([], 0.05).size == 0


@pytest.mark.long
def test_held_out_chi_square_knows_the_parameters_uncertainty(toy):
    """Mean of r'(V + JCJ')^-1 r is the number of values; without JCJ' it would be far above."""
    ratio, bare = [], []
    for seed in range(80):
        whole = toy.problem(lambda x, z: 0 * x, ["square"], seed=seed).with_uses(["square"])
        observed = whole.observations[0]
        near = toy.x < 1.2
        problem = whole.over([observed.take(near)])
        far = observed.take(~near)
        best = fit(problem)
        found = held_out_error(problem, best, [far])
        ratio.append(found.reduced_chi2)
        predicted = whole.predictions(best.theta)[0][~near]
        bare.append(np.mean((predicted - far.measured) ** 2))
        assert found.sigma[0].min() > 1.0
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)
    assert np.mean(bare) > 1.5


def test_errors_are_in_the_observables_unit(toy):
    problem = toy.problem(lambda x, z: 0 * x, [])
    observed = problem.observations[0]
    [error] = observable_errors(problem, [observed], [observed.measured * 1.1])
    assert (error.unit, error.n) == ("W", 48)
    assert error.rms == pytest.approx(0.1 * np.sqrt(np.mean(observed.measured**2)))
    assert [error.relative_rms, error.relative_max] == pytest.approx([10.0, 10.0])
    assert error.bias == pytest.approx(0.1 * observed.measured.mean())


def test_an_installed_kind_of_measurement_brings_its_own_view(toy, monkeypatch):
    class Module:
        @staticmethod
        def localise(problem, best):
            return "its own places"

        @staticmethod
        def curve_errors(observation, predicted):
            return observation.n, predicted.size

    class Point:
        name = "wear"
        load = staticmethod(lambda: Module)

    class Wear(TableObservation):
        kind = "wear"

    problem = toy.problem(lambda x, z: 0 * x, [])
    table = problem.observations[0]
    own = Wear(**{name: getattr(table, name) for name in (f.name for f in fields(table))})
    problem = problem.over([own])
    best = fit(problem)
    assert curve_errors(problem, best) == []  # nobody knows that kind: blocks, and no curves
    blocks = localise(problem, best)

    def points(group, name=Point.name):
        return [Point()] if name == Point.name else []

    monkeypatch.setattr("specan.study.observation.entry_points", points)
    assert localise(problem, best) == "its own places"
    assert curve_errors(problem, best) == [(48, 48)]
    assert localise(problem.over([table]), best).fails_at == blocks.fails_at
