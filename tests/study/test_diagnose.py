"""Verdicts on the analytic toy: what is there is named, what is not is not, and the numbers hold."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from specan.errors import ComputationError
from specan.models import Parameter, Use, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.observation.table import TableObservation
from specan.study.selection.acceptance import (
    AcceptanceTest,
    Decision,
    DetectableSize,
    by_effect,
    minimum_detectable_sizes,
    noise_dof,
)
from specan.study.selection.alternatives import alternatives, distance
from specan.study.selection.candidates import base_problem
from specan.study.selection.pulls import pulls, too_far
from specan.study.selection.refits import Refit, Refits
from specan.study.selection.residual_law import residual_law, simplest
from specan.study.selection.search import Search
from specan.study.selection.significance import improvement_probability
from specan.study.verdict import parameters_of


@effect("timid", adds_to="heat", neutral={"c": 0.0})
def timid(x, *, c=Parameter(0.1, "W", min=0.0, max=0.2, upper=50.0)):
    "A parabola that is never large."
    return c * x**2


@effect("upside-down", adds_to="heat", neutral={"c": 0.0})
def upside_down(x, *, c=Parameter(1.0, "W", min=0.0, max=50.0)):
    "A parabola of the other sign."
    return -c * x**2


@effect("bowl", adds_to="heat", neutral={"c": 0.0})
def bowl(x, *, c=Parameter(1.0, "W", min=-200.0, max=200.0)):
    "Nearly a parabola."
    return c * x**2.3


CATALOGUE = ["square", "wave", "saturating", "cross", "zero-error", "tilt", "drift"]


def nothing(x, z):
    return 0 * x


def searched(problem):
    search = Search(Refits(Refit(frozenset(), problem, fit(problem))))
    search.run()
    return search


# --- the verdict -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("truth", "name"),
    [
        (lambda x, z: 3 * x**2, "square"),
        (lambda x, z: 3 * np.cos(6 * x), "wave"),
        (lambda x, z: 3 * z * (1 - np.exp(-9 * x)), "saturating"),
        (lambda x, z: 4 * (z > 0), "zero-error"),
    ],
)
def test_one_effect_is_named(toy, truth, name):
    found = diagnose(toy.problem(truth, CATALOGUE, seed=1))
    assert found.verdict == "effect"
    assert found.alternatives == ((name,),)
    assert not found.unknown_possible
    assert found.ranking[0].effects == (name,)
    assert found.ranking[0].probability > 0.75


def test_its_parameters_come_back_in_their_own_unit(toy):
    found = diagnose(toy.problem(lambda x, z: 3 * x**2, CATALOGUE, seed=2))
    row = found.ranking[0].parameters["square.c"]
    assert row["unit"] == "mW"
    assert row["low"] < 3000 < row["high"]
    assert row["high"] - row["low"] < 2500


def test_intervals_cover_the_truth(toy):
    inside = 0
    for seed in range(60):
        problem = toy.problem(lambda x, z: 4 * x**2, ["square"], seed=seed)
        refits = Refits(Refit(frozenset(), problem, fit(problem)))
        step = Search(refits).step(refits.base)
        row = parameters_of(refits.fit(refits.base, [[step.scored[0]]]))["square.c"]
        inside += row["low"] <= 4000 <= row["high"]
    assert 53 <= inside <= 60


def test_nothing_is_named_where_nothing_is(toy):
    verdicts = [diagnose(toy.problem(nothing, CATALOGUE, seed=s)).verdict for s in range(15)]
    assert verdicts == ["nothing-missing"] * 15


def test_what_cannot_be_tested_is_said(toy):
    found = diagnose(toy.problem(nothing, CATALOGUE))
    assert found.not_testable == {"drift": "needs clock"}
    assert found.smallest_visible["tilt"] is None
    assert found.smallest_visible["square"]["unit"] == "mW"


def test_twins_are_a_group_and_another_measurement_is_proposed(toy):
    found = diagnose(toy.problem(lambda x, z: 3 * x**2, ["square", "twin", "cross"], seed=3))
    assert found.verdict == "group"
    assert set(found.alternatives) == {("square",), ("twin",)}
    assert found.effects == ("square", "twin")
    assert any("a second instrument" in row["text"] for row in found.next_measurement)


def test_two_effects_that_no_one_law_imitates_are_named_without_a_doubt(toy):
    found = diagnose(toy.problem(lambda x, z: 5 * x**2 + 4 * x * z, CATALOGUE, seed=4))
    assert ("cross", "square") in found.alternatives
    assert not found.unknown_possible


def test_a_second_effect_becomes_probable_as_it_grows(toy):
    """Without noise the wave takes at most 24 size^2 off chi-square: 1, 16 and 96."""
    names = ["square", "wave", "cross", "zero-error", "saturating"]
    both = []
    for size in (0.2, 0.82, 2.0):
        found = diagnose(toy.problem(lambda x, z, s=size: 5 * x**2 + s * np.cos(7 * x), names, noise=0.0))
        told = {one.effects: one.probability for one in found.probabilities if one.kind == "effects"}
        both.append(told.get(("square", "wave"), 0.0))
    assert both[0] < 0.05 < both[1] < 0.6
    assert both[2] > 0.95


def test_something_unknown_is_called_unknown_and_described(toy):
    found = diagnose(toy.problem(lambda x, z: 6 * x**3, ["cross", "zero-error", "saturating"], seed=6))
    assert found.verdict == "unknown-effect"
    assert found.unknown_possible
    assert found.residual_law.low["x"] < 3 < found.residual_law.high["x"]
    assert "x^" in found.residual_law.text


def test_what_a_named_effect_leaves_is_told(toy):
    # Most of it is a parabola, the rest has no name.
    truth = lambda x, z: 20 * x**2 + 6 * np.cos(3 * z)  # noqa: E731
    found = diagnose(toy.problem(truth, ["square", "cross"], seed=7))
    assert found.unknown_possible
    assert "square would take the error from 7.9" in found.reason


def test_three_effects_are_one_unknown(toy):
    truth = lambda x, z: 12 * x**2 + 9 * x * z + 9 * np.cos(7 * x) + 20 * (z > 0)  # noqa: E731
    problem = toy.problem(truth, ["square", "cross", "wave", "zero-error"], seed=8)
    assert diagnose(problem).verdict == "unknown-effect"


def test_a_third_effect_is_seen_among_many_rows_that_fit(toy):
    toy.x, toy.z = np.tile(toy.x, 20), np.tile(toy.z, 20)
    truth = lambda x, z: 0.9 * x**2 + 0.35 * x * z + 5.0 * (z > 0)  # noqa: E731
    search = searched(toy.problem(truth, ["square", "cross", "zero-error"], seed=8))
    assert len(search.best.uses) == 2
    assert search.best.lack_of_fit > 1e-3
    assert len(search.third.uses) == 3


def known_to(largest):
    """A parabola that was never found larger than this."""

    @effect("timid", adds_to="heat", neutral={"c": 0.0})
    def timid(x, *, c=Parameter(largest / 2, "W", min=0.0, max=largest, upper=50.0)):
        "A parabola."
        return c * x**2

    return timid


def test_knowledge_beforehand_is_no_veto(toy):
    # 3 W where at most 2.4 W were found: one standard deviation of the tail (a quarter of the range) outside.
    found = diagnose(toy.problem(lambda x, z: 3 * x**2, ["timid", "cross"], seed=9, also=[known_to(2.4)]))
    assert found.verdict == "effect"
    assert found.alternatives == (("timid",),)
    assert found.pulls == () or abs(found.pulls[0].pull) < 2


def test_an_effect_that_needs_what_was_never_found_is_no_plain_verdict(toy):
    # 12 W where at most 6 W were found: four standard deviations.
    found = diagnose(toy.problem(lambda x, z: 12 * x**2, ["timid", "cross"], seed=9, also=[known_to(6.0)]))
    assert found.verdict == "fits-only-if"
    assert found.unknown_possible
    assert found.pulls[0].parameter == "timid.c"
    assert found.pulls[0].pull > 3
    assert "timid.c = " in found.reason
    assert "known 0 to 6 W" in found.reason
    [row] = [r for r in found.ranking if r.effects == ("timid",)]
    assert not row.plausible


@effect("line", adds_to="heat", neutral={"offset": 0.0, "slope": 0.0})
def flat_line(
    x,
    *,
    offset=Parameter(1.0, "W", min=-1e4, max=1e4),
    slope=Parameter(1.0, "W", min=0.0, max=20.0, lower=0.0, upper=1e4),
):
    "A straight line that was never found steep."
    return offset + slope * x


def test_a_base_that_needs_what_was_never_found_is_not_called_whole(toy):
    # A slope of 60 where 0 to 20 are known, eight standard deviations of the tail; nothing else is wrong.
    found = diagnose(toy.problem(lambda x, z: 60.0 * x, ["cross"], seed=9, also=[flat_line]))
    assert found.verdict == "fits-only-if"
    assert found.pulls[0].parameter == "line.slope"
    assert found.pulls[0].pull > 3
    assert "known 0 to 20 W" in found.reason


@effect("line", adds_to="heat", neutral={"offset": 0.0, "slope": 0.0})
def gentle_line(
    x,
    *,
    offset=Parameter(1.0, "W", min=-1e4, max=1e4),
    slope=Parameter(0.2, "W", min=0.0, max=0.4, lower=0.0, upper=1e4),
):
    "A straight line whose slope is known as well as the data tell it."
    return offset + slope * x


def test_a_pull_is_the_gaussian_tail_of_a_quarter_of_the_range(toy):
    # Linear base: the minimum of chi-square plus the square of (slope - 20) / 5, from the normal equations.
    problem = toy.problem(lambda x, z: 60.0 * x, ["cross"], seed=9, also=[flat_line])
    best = fit(problem)
    columns = np.vstack([np.column_stack([np.ones(48), toy.x]), [0.0, 1 / 5]])
    right = np.append(problem.observations[0].measured, 20 / 5)
    want = np.linalg.lstsq(columns, right, rcond=None)[0]
    assert best.theta == pytest.approx(want, rel=1e-5)
    assert pulls(Refit(frozenset(), problem, best))[0].pull == pytest.approx((want[1] - 20) / 5, rel=1e-4)


def test_what_is_inside_its_range_costs_nothing(toy):
    problem = toy.problem(nothing, ["cross"], seed=9, also=[flat_line])
    free = toy.problem(nothing, ["cross"], seed=9)
    assert fit(problem).chi2 == pytest.approx(fit(free).chi2, rel=1e-9)


def test_too_few_conditions_cannot_tell(toy):
    problem = toy.problem(nothing, ["square"])
    few = problem.over([problem.observations[0].take(np.arange(4))])
    found = diagnose(few)
    assert found.verdict == "cannot-tell"
    assert "degrees of freedom" in found.reason


def test_an_undetermined_base_cannot_tell(toy):
    problem = toy.problem(nothing, ["square"])
    one = problem.over([problem.observations[0].take(toy.x == toy.x[0])])
    found = diagnose(one)
    assert found.verdict == "cannot-tell"
    assert "determine only 1" in found.reason


def test_a_base_that_is_not_finite_is_an_error_not_a_verdict(toy):
    @effect("broken", adds_to="heat", neutral={"c": 0.0})
    def broken(x, *, c=Parameter(1.0, "W", min=0.0, max=2.0)):
        "Never a number."
        return c * np.log(-x)

    problem = base_problem(toy.model("broken", also=[broken]), [toy.observation(toy.x)], ["line", "broken"])
    with pytest.raises(ComputationError):
        diagnose(problem)


def test_a_candidate_without_finite_values_is_said_to_be_untestable(toy):
    @effect("broken", adds_to="heat", neutral={"c": 0.0})
    def broken(x, *, c=Parameter(1.0, "W", min=0.0, max=2.0)):
        "A number only where it is neutral."
        return np.where(c == 0, 0.0, np.nan) * x

    found = diagnose(toy.problem(nothing, ["square", "broken"], also=[broken]))
    assert "finite" in found.not_testable["broken"]


# --- the numbers -------------------------------------------------------------------------------------------


def test_distance_is_what_the_rival_leaves_of_noise_free_data(toy):
    search = searched(toy.problem(lambda x, z: 6 * x**2, ["square", "wave", "cross"], seed=10))
    square = search.refits.done[frozenset({Use("square")})]
    cross = search.refits.done[frozenset({Use("cross")})]
    c = square.fit.values["square.c"]
    columns = np.column_stack([np.ones(48), toy.x, toy.x * toy.z])
    rest = toy.x**2 - columns @ np.linalg.lstsq(columns, toy.x**2, rcond=None)[0]
    assert distance(square, cross) == pytest.approx(c**2 * rest @ rest, rel=1e-6)


def test_distance_counts_a_certificate_as_met_by_who_put_it_aside(toy):
    # Whoever blames the instrument predicts that its certificate (0.5 W) is wrong; for everybody else it holds.
    search = searched(toy.problem(lambda x, z: 5.0 * (z > 0), ["zero-error", "cross"], seed=20))
    blamed = search.refits.done[frozenset({Use("zero-error")})]
    cross = search.refits.done[frozenset({Use("cross")})]
    shift = blamed.fit.values["zero-error.shift"]
    columns = np.column_stack([np.ones(48), toy.x, toy.x * toy.z, toy.z > 0])
    rows = np.vstack([columns, [0, 0, 0, 2.0]])
    seen = np.append(shift * (toy.z > 0), 0.0)
    rest = seen - rows @ np.linalg.lstsq(rows, seen, rcond=None)[0]
    assert distance(blamed, cross) == pytest.approx(rest @ rest, rel=1e-5)


def test_distance_keeps_to_the_domain_of_the_rival(toy):
    search = searched(
        toy.problem(lambda x, z: 6 * x**2, ["square", "upside-down"], seed=21, also=[upside_down])
    )
    square = search.refits.done[frozenset({Use("square")})]
    rival = search.refits.done[frozenset({Use("upside-down")})]
    assert rival.fit.at_bound
    line = np.column_stack([np.ones(48), toy.x])
    rest = toy.x**2 - line @ np.linalg.lstsq(line, toy.x**2, rcond=None)[0]
    want = square.fit.values["square.c"] ** 2 * rest @ rest
    assert distance(square, rival) == pytest.approx(want, rel=1e-4)


def test_a_twin_that_contradicts_what_is_known_is_named_beside_the_verdict(toy):
    found = diagnose(toy.problem(lambda x, z: 6 * x**2, ["square", "timid"], seed=23, also=[timid]))
    assert found.alternatives == (("square",),)
    assert not found.unknown_possible  # thirty times the largest size known


def test_a_size_beyond_what_is_known_is_found_where_nothing_else_is(toy):
    """Without the known range it would be named; to go there costs (3 - 0.4) / 0.1 = 26 sigma, more than it gains."""
    truth = lambda x, z: 3 * x**2  # noqa: E731
    found = diagnose(toy.problem(truth, ["timid", "cross"], seed=9, also=[known_to(0.4)]))
    assert found.verdict == "fits-only-if"
    assert "it fits only with timid.c = " in found.reason
    assert found.pulls[0].parameter == "timid.c"


def test_an_effect_that_a_set_could_do_without_is_seen(toy):
    problem = toy.problem(lambda x, z: 5 * x**2 + 4 * x * z, ["square", "cross", "wave"], seed=24)
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    search = Search(refits)
    step = search.step(refits.base)
    square, cross, wave = (step.by_use[Use(n)][0] for n in ("square", "cross", "wave"))
    for single in (square, cross, wave):
        refits.fit(refits.base, [[single]])
    assert search.needs_all(refits.fit(refits.base, [[square, cross]]))
    assert not search.needs_all(refits.fit(refits.base, [[square, wave]]))


def test_a_certificate_that_would_have_to_be_wrong_is_not_plausible(toy):
    problem = toy.problem(lambda x, z: 3 * x**2, ["square", "zero-error"], seed=25)
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    step = Search(refits).step(refits.base)
    square = refits.fit(refits.base, [[step.by_use[Use("square")][0]]])
    assert not too_far(square, refits.base)
    theta = square.fit.theta.copy()
    theta[square.fit.names.index("zero-error.shift")] = 4 * 0.5
    [pull] = too_far(replace(square, fit=replace(square.fit, theta=theta)), refits.base)
    assert pull.parameter == "zero-error.shift"
    assert pull.pull == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("size", "pushed", "believed"),
    [
        (
            10.0,
            "line.slope",
            True,
        ),  # a chi-square of some 1000 explained: its form may push by 6 standard errors
        (1.3, "line.slope", False),  # some 20: by not even one
        (10.0, "square.c", False),  # of the effect itself nothing is excused
    ],
)
def test_a_base_parameter_may_be_pushed_as_far_as_the_form_of_an_effect_can(
    toy, monkeypatch, size, pushed, believed
):
    problem = toy.problem(lambda x, z: size * x**2, ["square"], seed=26)
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    square = refits.fit(refits.base, [[Search(refits).step(refits.base).by_use[Use("square")][0]]])
    square = replace(square, problem=_known_only_below(square, pushed))
    assert (not too_far(square, refits.base)) == believed


def _known_only_below(refit, name):
    """The problem with the range of a parameter so low that the fit lies 3.5 standard deviations outside."""
    k = refit.fit.names.index(name)
    tail = refit.fit.standard_error(name)
    problem = replace(refit.problem)
    ranges = problem.pseudo.ranges
    high, above = ranges.high.copy(), ranges.above.copy()
    row = problem.pseudo_rows[f"range of {name}"] - problem.n_data - problem.n_priors
    above[row], high[row] = tail, refit.fit.theta[k] - 3.5 * tail
    problem.__dict__["pseudo"] = replace(problem.pseudo, ranges=replace(ranges, high=high, above=above))
    return problem


@pytest.mark.long
def test_a_law_of_nothing_is_as_improbable_as_it_says(toy):
    problems = [toy.problem(nothing, ["square"], seed=s) for s in range(40)]
    p = [residual_law(Refit(frozenset(), problem, fit(problem))).p_value for problem in problems]
    assert sum(value < 0.1 for value in p) <= 4
    assert min(p) > 1e-3


def test_a_pair_is_refitted_from_the_single_that_promises_most(toy):
    search = searched(toy.problem(lambda x, z: 6 * x**2 + 5 * x * z, ["square", "cross", "wave"], seed=24))
    single = min(search.refits.of_size(1), key=lambda r: r.chi2)
    offered = {frozenset(s.uses | {m.use for m in members}): value
               for value, s, members in search._promising_pairs(single)}  # fmt: skip
    price = np.log(48)
    promised = [
        (
            start.uses | {use},
            start.chi2 - items[0].chi2_reduction + price * (start.count + 1 + len(items[0].signature.shapes)),
        )
        for start in search.refits.of_size(1)
        for use, items in search.step(start).by_use.items()
    ]
    assert len(promised) > len({pair for pair, _ in promised})
    assert all(offered[pair] <= value + 1e-9 for pair, value in promised)


def test_a_noise_that_was_declared_too_small_blames_nobody(toy):
    found = [diagnose(toy.problem(nothing, CATALOGUE, seed=s, noise=2.5)) for s in range(8)]
    assert all(d.alternatives == () for d in found)
    assert all(d.verdict == "unknown-effect" for d in found)


def test_smallest_visible_size_is_seen_four_times_in_five(toy):
    problem = toy.problem(nothing, ["square", "cross", "wave"])
    start = Refit(frozenset(), problem, fit(problem))
    step = Search(Refits(start)).step(start)
    [size] = [v.value for v in minimum_detectable_sizes(start, step.acceptance, 1.0) if v.use == "square"]
    signature = step.by_use[Use("square")][0]
    shift = signature.projected[:, 0] * size / (1e3 * signature.signature.size[0])
    noise = np.random.default_rng(1).standard_normal((4000, shift.size))
    unit = shift / np.linalg.norm(shift)
    gains = ((shift + noise) @ unit) ** 2
    level = stats.chi2.isf(step.acceptance.single_level, 1)
    needed = max(level, 6 + np.log(48))  # BIC asks for more than the level here
    assert np.mean(gains > needed) == pytest.approx(0.8, abs=0.025)


def test_the_family_wise_level_holds_for_the_signatures_of_a_model(toy):
    problem = toy.problem(nothing, ["square", "cross", "wave", "saturating"])
    start = Refit(frozenset(), problem, fit(problem))
    step = Search(Refits(start)).step(start)
    noise = np.random.default_rng(2).standard_normal((20_000, 48))
    noise = np.hstack([noise, np.zeros((20_000, start.fit.residual.size - 48))])  # known ranges have none
    projected = noise - (noise @ start.linear.basis) @ start.linear.basis.T
    best = np.zeros(20_000)
    for item in step.scored:
        along = -(projected @ item.projected[:, 0]) / np.linalg.norm(item.projected[:, 0])
        z = np.maximum(along, 0) if item.signature.one_sided else np.abs(along)
        p = stats.norm.sf(z) * (1 if item.signature.one_sided else 2)
        best = np.maximum(best, 1 - p)
    for level in (0.05, 0.005):
        single = np.exp(
            brentq(
                lambda x, of=level: step.acceptance.family.probability(np.exp(x)) - of,
                np.log(1e-9),
                np.log(level),
            )
        )
        share = np.mean(1 - best < single)
        assert 0.5 * level < share < 1.15 * level


@pytest.mark.parametrize(
    "fault",
    [
        {"p_value": 0.002},
        {"p_with_tolerance": 0.002},
        {"delta_bic": 5.9},
        {"held_out_gain": -0.1},
    ],
)
def test_each_condition_of_the_acceptance_test_can_stop_an_effect(fault):
    good = Decision(1e-4, 1e-4, 20.0, 15.0, 0.001)
    assert good.accepted
    assert not replace(good, **fault).accepted


def test_the_equation_of_an_effect_is_trusted_to_a_fifth(toy):
    search = searched(toy.problem(lambda x, z: 60 * x**2 + 4 * x * z, ["square", "cross"], seed=12))
    step = search.step(search.refits.done[frozenset({Use("square")})])
    assert step.acceptance.explained > 1000
    pair = search.refits.done[frozenset({Use("square"), Use("cross")})]
    decision = step.acceptance.decision(pair)
    assert decision.accepted_if_exact
    assert not decision.accepted
    assert search.best.uses == {Use("square")}
    assert [r.uses for r in search.extensions] == [pair.uses]
    assert [r.uses for r in alternatives(search)] == [search.best.uses, pair.uses]
    exact = AcceptanceTest(step.start, step.acceptance.family, 0.0, step.acceptance.level)
    assert exact.decision(pair).accepted


class OfResonances(TableObservation):
    """Rows that are searched as those of transfer functions are."""

    strategy = replace(TableObservation.strategy, continuation=True)


def test_the_form_of_an_effect_reaches_a_certificate_through_the_data_only(toy):
    """What the worst error of form, of unit length in the data, gains without a certificate: plain least squares."""
    model = toy.model("square", "zero-error")
    values = 2.0 + 3.0 * toy.x + 60 * toy.x**2 + 2.0 * (toy.z > 0)
    plain = toy.observation(values)
    seen = OfResonances(**{f.name: getattr(plain, f.name) for f in fields(plain) if f.init})
    problem = base_problem(model, [seen])
    base = Refit(frozenset(), problem, fit(problem))
    family = Search(Refits(base)).step(base).acceptance.family
    alone, both = problem.with_uses(["square"]), problem.with_uses(["square", "zero-error"])
    square = Refit(frozenset({Use("square")}), alone, fit(alone), 1, 1)
    freed = Refit(frozenset({Use("square"), Use("zero-error")}), both, fit(both), 2, 2)
    certificate = 0.5
    shown = np.column_stack([np.ones(48), toy.x, toy.x**2, toy.z > 0]).astype(float)
    held = np.vstack([shown, [0.0, 0.0, 0.0, 1 / certificate]])

    def gained(error):
        def left(columns, y):
            return np.sum((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2)

        return left(held, np.append(error, 0.0)) - left(shown, error)

    rest = shown[:, 3] - shown[:, :3] @ np.linalg.lstsq(shown[:, :3], shown[:, 3], rcond=None)[0]
    most = gained(rest / np.linalg.norm(rest))
    rng = np.random.default_rng(1)
    assert all(gained(e / np.linalg.norm(e)) <= most for e in rng.standard_normal((200, 48)))
    assert 0.05 < most < 0.5

    test = AcceptanceTest(square, family, 1000.0)
    decision = test.decision(freed)
    tolerated = test.left_by_form * most
    single = improvement_probability(
        square.chi2 - freed.chi2, 1, noise_dof=noise_dof(freed), tolerated=tolerated
    )
    assert decision.p_with_tolerance == pytest.approx(test.family.probability(single), rel=1e-6)


def test_repeats_that_gave_the_noise_are_no_lack_of_fit(toy):
    problem = toy.problem(lambda x, z: 2 * x**2, ["cross"], seed=14)
    spent = problem.over([replace(problem.observations[0], noise_dof=24.0, pure_error_dof=24.0)])
    plain, careful = (Refit(frozenset(), p, fit(p)) for p in (problem, spent))
    assert careful.dof == plain.dof - 24
    assert careful.reduced == pytest.approx((plain.chi2 - 24) / (plain.dof - 24))


def test_law_of_a_power(toy):
    problem = toy.problem(lambda x, z: 9 * x**2.5, ["square"], seed=15)
    start = Refit(frozenset(), problem, fit(problem))
    law = residual_law(start)
    assert law.low["x"] < 2.5 < law.high["x"]
    assert law.unit == "W"
    assert law.amplitude == pytest.approx(9 * law.reference["x"] ** 2.5, rel=0.8)


def test_a_law_next_to_one_that_the_model_has_is_no_larger_than_all_that_is_lost(toy):
    # x log x is the difference of two nearly equal powers of x, each as large as one likes.
    problem = toy.problem(lambda x, z: 8 * x * np.log(x), ["square"], seed=15, noise=0.05)
    law = residual_law(Refit(frozenset(), problem, fit(problem)))
    assert 0.6 < law.exponents["x"] < 2.0
    assert 0.0 < law.amplitude <= 1.2 * np.mean(np.abs(problem.observations[0].measured))
    assert "near x" not in law.text
    assert "the model has a term of nearly this form" in law.text


def test_idle_runs_are_not_the_middle_of_the_data(toy):
    toy.x = np.where(toy.x < 0.4, 1e-6 * toy.x, toy.x)
    problem = toy.problem(lambda x, z: 9 * x**2.5, ["square"], seed=15)
    law = residual_law(Refit(frozenset(), problem, fit(problem)))
    assert law.reference["x"] == pytest.approx(np.exp(np.mean(np.log(toy.x[toy.x > 0.1]))))
    assert law.low["x"] < 2.5 < law.high["x"]


@pytest.mark.parametrize(
    ("low", "high", "want"), [(2.6, 3.2, "3"), (-0.3, 0.2, "0"), (0.4, 0.6, "1/2"), (0.3, 0.35, "1/3")]
)
def test_simplest_rational(low, high, want):
    assert str(simplest(low, high)) == want


# --- the contract ------------------------------------------------------------------------------------------

KEYS = {
    "verdict", "reason", "alternatives", "effects", "at", "unknown_possible", "ranking", "lack_of_fit",
    "model_discrepancy_percent", "fails_at", "residual_law", "smallest_visible", "not_testable",
    "next_measurement", "pulls", "error", "remarks", "other_form", "probabilities",
}  # fmt: skip
ROW = {
    "effects", "at", "probability", "ln_evidence", "error_after", "parameters", "plausible", "at_bound", "pulls",
}  # fmt: skip


@pytest.mark.parametrize("truth", [nothing, lambda x, z: 3 * x**2, lambda x, z: 6 * x**3])
def test_json_is_the_contract(toy, truth):
    names = ["cross", "zero-error", "wave"] if truth(1.0, 0.0) == 6 else CATALOGUE
    found = diagnose(toy.problem(truth, names, seed=16)).to_dict()
    assert set(found) == KEYS
    assert all(set(row) == ROW for row in found["ranking"])
    assert set(found["lack_of_fit"]) == {"reduced_chi2", "p_value", "n_effective"}
    assert found["model_discrepancy_percent"] == pytest.approx(0.5)
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text) == found
    for row in found["ranking"]:
        for parameter in row["parameters"].values():
            assert set(parameter) == {"value", "low", "high", "unit"}
    if found["residual_law"]:
        assert set(found["residual_law"]) == {"text", "exponents", "low", "high"}


def test_progress_is_told(toy):
    told = []
    diagnose(
        toy.problem(lambda x, z: 3 * x**2, CATALOGUE, seed=17),
        progress=lambda text, *share: told.append(text),
    )
    assert any("square" in text for text in told)


def test_the_same_problem_gives_the_same_verdict(toy):
    one, two = (diagnose(toy.problem(lambda x, z: 3 * x**2, CATALOGUE, seed=18)).to_dict() for _ in range(2))
    assert one == two


def test_an_effect_with_a_kink_at_nothing_is_tried_to_both_sides(toy):
    @effect("kinked", adds_to="heat", neutral={"a": 0.0, "b": 0.0})
    def kinked(
        x,
        z,
        *,
        a=Parameter(1.0, "W", min=-50.0, max=50.0),
        b=Parameter(1.0, "W", min=-50.0, max=50.0),
    ):
        "One thing above nothing and another below it."
        return np.maximum(a, 0) * np.cos(6 * x) + np.minimum(a, 0) * x**2 + b * x * z

    for size in (-6.0, 6.0):
        truth = lambda x, z, a=size: max(a, 0) * np.cos(6 * x) + min(a, 0) * x**2  # noqa: E731
        found = diagnose(toy.problem(truth, ["kinked"], seed=3, also=[kinked]))
        assert found.alternatives == (("kinked",),)
        row = found.ranking[0].parameters["kinked.a"]
        assert row["low"] < size < row["high"]


def test_one_place_that_sees_nothing_makes_no_effect_invisible():
    found = by_effect(
        [DetectableSize("gain@Mic 1", "gain", 0.02, "1"), DetectableSize("gain@Mic 2", "gain", None, "1"),
         DetectableSize("leak", "area", None, "m^2")]
    )  # fmt: skip
    assert found["gain"] == {"value": 0.02, "unit": "1", "places": {"Mic 1": 0.02, "Mic 2": None}}
    assert found["leak"] is None


@effect("tide", adds_to="heat", neutral={"c": 0.0})
def tide(x, *, c=Parameter(1.0, "W", min=0.0, max=4.0, upper=50.0),
         rate=Parameter(5.0, "1", min=4.0, max=6.0, lower=2.0, upper=12.0)):  # fmt: skip
    "A wave whose rate is known, and whose size is known roughly."
    return c * np.cos(rate * x)


def test_the_smallest_visible_size_is_seen_beside_a_base_that_follows_far(toy):
    """A base 3 (1 - exp(-a x)) z takes up c x z by far steps of a, which the tangent plane at a = 2 does not know."""
    base = replace(toy.model("saturating", "cross"), base_effects=("line", "saturating"))

    def problem_of(added):
        readings = 2.0 + 3.0 * toy.x + 3.0 * (1 - np.exp(-2.0 * toy.x)) * toy.z + added * toy.x * toy.z
        return base_problem(base, [toy.observation(readings)])

    clean = problem_of(0.0)
    start = Refit(frozenset(), clean, fit(clean, starts=3))
    step = Search(Refits(start)).step(start)
    size = by_effect(minimum_detectable_sizes(start, step.acceptance, 1.0))["cross"]["value"]
    gain = max(step.acceptance.needed_reduction, 6 + np.log(48))
    wanted = brentq(lambda shift: stats.ncx2.sf(gain, 1, shift) - 0.8, 1.0, 100.0)
    planted = problem_of(size)
    assert fit(planted, starts=3).chi2 == pytest.approx(wanted, rel=0.15)
    change = np.zeros(start.fit.residual.size)
    change[:48] = size * toy.x * toy.z
    assert abs(np.log(start.linear.free_chi2(change) / wanted)) > 0.2
