"""What can be added to a model, what it does to the residual, and what a refit would gain."""

from itertools import pairwise

import numpy as np
import pytest

from specan.models import Parameter, Use, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.estimation.linear import Projection
from specan.study.selection.candidates import base_problem, candidates, grid
from specan.study.selection.refits import Refit, Refits, start_from
from specan.study.selection.signatures import Signatures, best_of_each, score


def scored(problem):
    start = Refit(frozenset(), problem, fit(problem))
    found, not_testable = candidates(problem)
    at = Signatures(problem, start.fit)
    points = at.grid(found)
    seen = [s for c in found if c.use in points for s in at.at(c, points[c.use])]
    return start, score(start.linear, seen), not_testable


def refitted(start, items):
    refits, uses = Refits(start), frozenset(item.use for item in items)
    return refits.fit(start, uses, [start_from(start, items, refits.with_uses(uses))])


def nothing(x, z):
    return 0 * x


def test_candidates_are_what_is_missing_and_what_has_a_prior(toy):
    problem = toy.problem(nothing, ["square", "drift", "zero-error"])
    found, not_testable = candidates(problem)
    assert [str(c.use) for c in found] == ["square", "zero-error"]
    assert not_testable == {"drift": "needs clock"}
    assert found[1].without_prior == ("zero-error.shift",)
    assert len(found[0].own) == 1


def test_an_effect_with_fixed_amplitudes_is_no_candidate(toy):
    @effect("held", adds_to="heat", neutral={"c": 0.0})
    def held(x, *, c=Parameter(1.0, "W", min=0.0, max=2.0, fixed=True)):
        "Held."
        return c * x**2

    found, not_testable = candidates(toy.problem(nothing, ["held"], also=[held]))
    assert found == []
    assert "fixed" in not_testable["held"]


def test_the_score_of_a_linear_effect_is_the_gain_of_its_refit(toy):
    problem = toy.problem(lambda x, z: 1.5 * x**2, ["square"], seed=1)
    start, [only], _ = scored(problem)
    after = refitted(start, [only])
    assert only.chi2_reduction == pytest.approx(start.fit.chi2 - after.fit.chi2, rel=1e-6)
    x = np.column_stack([np.ones(48), toy.x, toy.x**2])
    measured = problem.observations[0].measured
    exact = np.linalg.lstsq(x, measured, rcond=None)
    assert after.fit.chi2 == pytest.approx(float(exact[1][0]), rel=1e-9)
    assert after.fit.values["square.c"] == pytest.approx(exact[0][2], rel=1e-5)


def test_a_removed_prior_gains_what_the_refit_without_it_gains(toy):
    problem = toy.problem(lambda x, z: 4.0 * (z > 0), ["zero-error"], seed=2)
    start, [only], _ = scored(problem)
    after = refitted(start, [only])
    assert only.chi2_reduction == pytest.approx(start.fit.chi2 - after.fit.chi2, rel=1e-6)
    assert after.problem.priors == {}
    assert after.fit.values["zero-error.shift"] == pytest.approx(4.0, abs=1.0)


def test_what_is_collinear_with_the_base_is_not_tested(toy):
    _, found, _ = scored(toy.problem(nothing, ["tilt", "square"]))
    assert {str(s.use) for s in found} == {"square"}


def test_an_amplitude_of_one_sign_gains_nothing_from_the_other(toy):
    _, found, _ = scored(toy.problem(lambda x, z: -8 * np.cos(4 * x), ["wave"], seed=3))
    at_four = [s for s in found if abs(s.signature.shapes["wave.rate"] - 4) < 1e-9]
    assert all(s.signature.multiplier_bounds[0] > -1e-9 for s in found)
    assert max(s.chi2_reduction for s in at_four) <= 1e-9


def test_a_shape_is_tried_where_its_signature_turns(toy):
    start, found, _ = scored(toy.problem(nothing, ["wave"]))
    ordered = sorted(found, key=lambda s: s.signature.shapes["wave.rate"])
    left = [start.linear.project_out(s.signature.columns[:, 0]) for s in ordered]
    units = [column / np.linalg.norm(column) for column in left]
    steps = [abs(a @ b) for a, b in pairwise(units)]
    assert min(steps) > 0.6
    assert len(found) > 3


def test_a_saturating_effect_is_seen_at_its_size(toy):
    # Far up its curve the signature has no part of that at small sizes; a derivative at zero misses it.
    _, found, _ = scored(toy.problem(lambda x, z: 3 * z * (1 - np.exp(-60 * x)), ["saturating"], noise=0.2))
    best = best_of_each(found)[Use("saturating")][0]
    start = Refit(
        frozenset(), best_problem := toy.problem(lambda x, z: 0 * x, ["saturating"]), fit(best_problem)
    )
    assert start.fit.chi2 > 0
    assert best.signature.size[0] >= 20
    small = min(found, key=lambda s: s.signature.size[0])
    assert best.chi2_reduction > small.chi2_reduction


def test_elements_of_an_axis_are_candidates_of_their_own(toy):
    from dataclasses import replace

    from specan.study.selection.candidates import base_problem

    @effect("spot", adds_to="heat", at="place", neutral={"c": 0.0})
    def spot(x, *, c=Parameter(1.0, "W", min=-5.0, max=5.0)):
        "At one place."
        return c * x**2

    model = replace(toy.model(), axes={"place": ("a", "b")}).with_effect(spot)
    found, _ = candidates(base_problem(model, [toy.observation(toy.x)]))
    assert [str(c.use) for c in found] == ["spot@a", "spot@b"]


def test_grid_goes_in_ratios_over_wide_ranges():
    np.testing.assert_allclose(grid(1.0, 100.0, 3), [1, 10, 100])
    np.testing.assert_allclose(grid(-1.0, 1.0, 3), [-1, 0, 1])


def test_projection_ignores_columns_that_add_nothing():
    columns = np.array([[1.0, 2.0], [1.0, 2.0], [0.0, 0.0]])
    assert Projection.of(np.zeros(3), columns).rank == 1


def test_an_effect_of_each_recording_is_a_candidate_whatever_the_files_are_called(toy):
    @effect("offset", adds_to="heat", neutral={"c": 0.0})
    def offset(x, *, c=Parameter(1.0, "W", min=-20.0, max=20.0, per="recording")):
        "Another day, another heat."
        return c + 0 * x

    recording = np.arange(toy.x.size) % 2
    values = 2.0 + 3.0 * toy.x + 9.0 * recording + np.random.default_rng(4).standard_normal(toy.x.size)
    observed = toy.observation(values, recordings=("day.1.csv", "day.2.csv"), recording=recording)
    problem = base_problem(toy.model("offset", "square", also=(offset,)), [observed])
    found = {c.use.name: c for c in candidates(problem)[0]}
    assert found["offset"].amplitudes == ("offset.c[day.1.csv]", "offset.c[day.2.csv]")
    diagnosis = diagnose(problem)
    assert diagnosis.alternatives == (("offset",),)
    table = diagnosis.ranking[0].parameters
    assert table["offset.c[day.2.csv]"]["value"] - table["offset.c[day.1.csv]"]["value"] == pytest.approx(
        9, abs=1
    )
