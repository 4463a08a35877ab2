"""Verdicts on the analytic toy: what is there is named, what is not is not, and the numbers hold."""

import json
from dataclasses import replace

import numpy as np
import pytest

from specan.errors import ComputationError
from specan.models import Parameter, Use, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.estimation.linear import Projection
from specan.study.evidence.law_search import likeliest_law
from specan.study.history import KeptResults
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit, Refits, pulls
from specan.study.verdict import Diagnosis, parameter_table


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


def test_nothing_is_named_where_nothing_is(toy):
    verdicts = [diagnose(toy.problem(nothing, CATALOGUE, seed=s)).verdict for s in range(6)]
    assert verdicts == ["nothing-missing"] * 6


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
    problem = toy.problem(lambda x, z: 6 * x**3, ["cross", "zero-error", "saturating"], seed=6)
    found = diagnose(problem)
    assert found.verdict == "unknown-effect"
    assert found.unknown_possible
    law = likeliest_law(Refit(frozenset(), problem, fit(problem)))
    assert _left_of(6 * toy.x**3, law, toy) < 0.03
    assert found.residual_law == {"text": law.text, "quantity": "heat"}


def test_what_a_named_effect_leaves_is_told(toy):
    # Most of it is a parabola, the rest has no name.
    truth = lambda x, z: 20 * x**2 + 6 * np.cos(3 * z)  # noqa: E731
    found = diagnose(toy.problem(truth, ["square", "cross"], seed=7))
    assert found.unknown_possible
    assert "square would reduce the error from 7.9" in found.reason


def test_three_effects_are_one_unknown(toy):
    truth = lambda x, z: 12 * x**2 + 9 * x * z + 9 * np.cos(7 * x) + 20 * (z > 0)  # noqa: E731
    problem = toy.problem(truth, ["square", "cross", "wave", "zero-error"], seed=8)
    assert diagnose(problem).verdict == "unknown-effect"


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
    assert "more values than parameters" in found.reason


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


def _known_only_below(refit, name):
    """The problem with the range of a parameter so low that the fit lies 3.5 standard deviations outside."""
    k = refit.fit.names.index(name)
    tail = refit.fit.standard_error(name)
    problem = replace(refit.problem)
    ranges = problem.pseudo
    high, above = ranges.high.copy(), ranges.above.copy()
    row = problem.pseudo_rows[f"range of {name}"] - problem.n_data
    above[row], high[row] = tail, refit.fit.theta[k] - 3.5 * tail
    problem.__dict__["pseudo"] = replace(ranges, high=high, above=above)
    return problem


@pytest.mark.long
def test_a_noise_that_was_declared_too_small_blames_nobody(toy):
    found = [diagnose(toy.problem(nothing, CATALOGUE, seed=s, noise=2.5)) for s in range(2)]
    assert all(d.alternatives == () for d in found)
    assert all(d.verdict == "nothing-missing" for d in found)
    assert all(any("scatter more than declared" in text for text in d.remarks) for d in found)


def test_repeats_that_gave_the_noise_are_no_lack_of_fit(toy):
    problem = toy.problem(lambda x, z: 2 * x**2, ["cross"], seed=14)
    spent = problem.over([replace(problem.observations[0], noise_dof=24.0, pure_error_dof=24.0)])
    plain, careful = (Refit(frozenset(), p, fit(p)) for p in (problem, spent))
    assert careful.dof == plain.dof - 24
    assert careful.fit.reduced_chi2 == pytest.approx((plain.fit.chi2 - 24) / (plain.dof - 24))


def test_law_of_a_power(toy):
    problem = toy.problem(lambda x, z: 9 * x**2.5, ["square"], seed=15)
    law = likeliest_law(Refit(frozenset(), problem, fit(problem)))
    assert _left_of(9 * toy.x**2.5, law, toy) < 0.03


def _left_of(truth, law, toy):
    """Largest difference between what is missing and a straight line with the law, over the range of that."""
    line = np.column_stack([np.ones(toy.x.size), toy.x])
    shape = law.formula.value({"x": toy.x, "z": toy.z}, law.shapes)
    columns = np.column_stack([line, shape[:, None] * line])
    left = truth - columns @ np.linalg.lstsq(columns, truth, rcond=None)[0]
    return np.abs(left).max() / np.ptp(truth)


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
def test_json_is_the_contract_and_a_diagnosis_can_be_kept(toy, truth, tmp_path):
    names = ["cross", "zero-error", "wave"] if truth(1.0, 0.0) == 6 else CATALOGUE
    whole = diagnose(toy.problem(truth, names, seed=16))
    kept = KeptResults(tmp_path, {})
    kept.keep("diagnosis", whole)
    assert kept.find("diagnosis", Diagnosis).to_dict() == whole.to_dict()
    found = whole.to_dict()
    assert set(found) == KEYS
    assert all(set(row) == ROW for row in found["ranking"])
    assert set(found["lack_of_fit"]) == {"reduced_chi2", "p_value", "n_effective"}
    assert found["model_discrepancy_percent"] == pytest.approx(0.5)
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text) == found
    for row in found["ranking"]:
        for parameter in row["parameters"].values():
            assert set(parameter) == {"value", "low", "high", "unit", "plausible", "at_bound", "nuisance"}
    if found["residual_law"]:
        assert set(found["residual_law"]) == {"text", "quantity"}


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


@effect("tide", adds_to="heat", neutral={"c": 0.0})
def tide(x, *, c=Parameter(1.0, "W", min=0.0, max=4.0, upper=50.0),
         rate=Parameter(5.0, "1", min=4.0, max=6.0, lower=2.0, upper=12.0)):  # fmt: skip
    "A wave whose rate is known, and whose size is known roughly."
    return c * np.cos(rate * x)


@pytest.mark.long
def test_intervals_cover_the_truth(toy):
    inside = 0
    for seed in range(60):
        problem = toy.problem(lambda x, z: 4 * x**2, ["square"], seed=seed)
        refits = Refits(Refit(frozenset(), problem, fit(problem)))
        refit = refits.fit(refits.base, frozenset({Use("square")}), [{}])
        row = parameter_table(refit.problem, refit.fit)["square.c"]
        inside += row["low"] <= 4000 <= row["high"]
    assert 53 <= inside <= 60


def test_two_effects_that_hide_each_other_are_found_as_a_pair(toy):
    line = Projection.of(toy.x, np.column_stack([np.ones(48), toy.x]))
    cross, other = line.project_out(toy.x * toy.z), line.project_out(toy.x * toy.z**2)
    share = (cross @ other) / (cross @ cross)  # of the other that cross alone could explain
    truth = lambda x, z: 3 * x * (z**2 - share * z)  # noqa: E731
    found = diagnose(toy.problem(truth, ["cross", "nearly-cross", "square"], seed=4))
    assert ("cross", "nearly-cross") in found.alternatives
