"""Refits of sets of effects: each reaches the minimum that a smaller set has reached already, or a lower one."""

import numpy as np
import pytest

from specan.models import Parameter, Use, effect
from specan.study.estimation.fit import fit
from specan.study.selection.refits import Refit, Refits, start_nested


@effect("hollow", adds_to="heat", neutral={"a": 0.0})
def hollow(x, *, a=Parameter(1.0, "1", min=-3.0, max=3.0)):
    "A hump at a = 1 with a hollow behind it, at a = 2, whose floor lies above zero."
    return 20.0 * (a**3 / 3 - 1.5 * a**2 + 2 * a) * x**2


def refits_of(problem):
    return Refits(Refit(frozenset(), problem, fit(problem)))


def in_the_hollow(refits, start):
    """The fit of a set with the hollow, begun there."""
    return refits.fit(start, start.uses | {Use("hollow")}, [{**start.fit.values, "hollow.a": 2.0}])


def test_a_refit_that_ends_in_a_hollow_is_begun_anew_from_the_base(toy):
    refits = refits_of(toy.problem(lambda x, z: 0 * x, ["hollow"], also=[hollow]))
    after = in_the_hollow(refits, refits.base)
    assert after.fit.chi2 <= refits.base.fit.chi2
    assert abs(after.fit.values["hollow.a"]) < 0.5
    assert refits.base.bic(1.0) - after.bic(1.0) >= -np.log(48)


def test_a_refit_never_ends_above_a_set_that_it_contains(toy):
    refits = refits_of(toy.problem(lambda x, z: 4 * x * z, ["hollow", "cross"], also=[hollow]))
    cross = refits.fit(refits.base, frozenset({Use("cross")}), [refits.base.fit.values])
    after = in_the_hollow(refits, cross)
    assert after.uses == {Use("hollow"), Use("cross")}
    assert after.fit.chi2 <= cross.fit.chi2 < refits.base.fit.chi2 - 100


def test_a_part_that_stopped_before_a_hump_is_led_over_it_by_a_larger_set(toy):
    """Its equation reaches 16.7 x^2 at the hump, a = 1, and the 17.5 of the data at a = 2.55 only."""
    problem = toy.problem(lambda x, z: 17.5 * x**2 + 4 * x * z, ["hollow", "cross"], also=[hollow])
    refits = refits_of(problem)
    alone, both = frozenset({Use("hollow")}), frozenset({Use("hollow"), Use("cross")})
    near = refits.base.fit.values
    before = refits.fit(refits.base, alone, [{**near, "hollow.a": 0.5}])
    refits.fit(before, both, [{**near, "hollow.a": 2.6}])
    assert before.fit.values["hollow.a"] < 1.5
    assert refits.lowered(both) == [alone]
    after = refits.done[alone]
    at_its_minimum = fit(problem.with_uses(["hollow"]), start={**near, "hollow.a": 2.55})
    assert after.fit.chi2 == pytest.approx(at_its_minimum.chi2, rel=1e-3)
    assert after.fit.chi2 < before.fit.chi2 - 10
    assert refits.lowered(both) == []


def test_an_effect_that_is_not_worth_it_leaves_what_a_certificate_holds(toy):
    problem = toy.problem(lambda x, z: 0.4 * (z > 0), ["hollow", "zero-error"], also=[hollow])
    refits = refits_of(problem)
    after = in_the_hollow(refits, refits.base)
    assert after.fit.chi2 <= refits.base.fit.chi2
    assert after.fit.values["zero-error.shift"] == pytest.approx(
        refits.base.fit.values["zero-error.shift"], abs=0.1
    )


def test_a_start_within_keeps_a_value_whose_prior_is_removed(toy):
    problem = toy.problem(lambda x, z: 0.4 * (z > 0), ["hollow", "zero-error"], also=[hollow])
    refits = refits_of(problem)
    richer = problem.with_uses(["hollow", "zero-error"])
    values = start_nested(refits.base, {"hollow.a": 2.0}, richer)
    assert values["hollow.a"] == 0.0
    assert values["zero-error.shift"] == refits.base.fit.values["zero-error.shift"] != 0.0
