"""Problem and fit on a toy model whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest

from specan.errors import ComputationError, RequestError
from specan.models import Condition, Model, Nuisance, Observable, Parameter, Use, effect, quantity
from specan.study.estimation.fit import fit, intervals_95
from specan.study.observation import Observation
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import base_problem, without


@quantity(unit="W")
def loss(speed, *, drag=Parameter(2.0, "W", min=0.0, max=10.0, lower=0.0)):
    "Power loss."
    return drag * speed**2


@quantity(unit="W")
def indicated(loss):
    "What the instrument shows."
    return loss


@effect("seal", adds_to="loss", neutral={"torque": 0.0})
def seal(speed, *, torque=Parameter(0.3, "N*m", min=0.0, max=2.0, lower=0.0)):
    "A seal."
    return torque * speed


@effect("zero", adds_to="indicated", neutral={"offset": 0.0}, instrument=True)
def zero(*, offset=Parameter(100.0, "mW", min=-5000.0, max=5000.0)):
    "A zero error."
    return offset


@effect("power-law", adds_to="loss", neutral={"size": 0.0})
def power_law(
    speed, *, size=Parameter(0.2, "W", min=0.0, max=2.0), by=Parameter(1.0, min=0.0, max=4.0, fixed=True)
):
    "A power law of the speed that asks about its parameter as a scalar."
    return size * speed**by if size > 0 else 0.0 * speed


@effect("hole", adds_to="loss", neutral={"area": 0.0})
def hole(
    speed,
    *,
    area=Parameter(2.0, "m^2", min=0.1, max=50.0, lower=0.0),
    per_area=Parameter(0.5, min=0.1, max=1.0, fixed=True, spread=0.25),
):
    "A loss of which only the product of two parameters is seen."
    return area * per_area * speed


@effect("drift", adds_to="loss", neutral={"step": 0.0})
def drift(speed, *, step=Parameter(0.1, "W", min=-2.0, max=2.0, per="recording")):
    "Each recording has its own loss."
    return step * np.ones_like(speed)


MODEL = Model(
    "toy",
    "a toy",
    {"speed": Condition("speed", "rad/s", "speed", "speed", "rad/s")},
    {"loss": loss, "indicated": indicated},
    {e.name: e for e in (seal, zero, power_law, hole, drift)},
    {"loss": Observable("loss", "indicated", "W", "loss")},
    base_effects=("seal",),
    nuisances=(Nuisance("zero", "offset", 20.0),),
)
SPEED = np.linspace(1.0, 5.0, 30)
SIGMA = 0.1


def table(measured, speed=SPEED, covariance=None, **more):
    covariance = SIGMA**2 * np.eye(speed.size) if covariance is None else covariance
    return TableObservation(
        "toy.csv", np.full(speed.size, "loss"), np.asarray(measured), {"speed": speed}, covariance, **more
    )


def noisy(truth, seed=1):
    return truth + SIGMA * np.random.default_rng(seed).standard_normal(truth.size)


def test_a_table_keeps_the_protocol():
    assert isinstance(table(SPEED), Observation)


def test_a_linear_fit_is_generalised_least_squares():
    truth = 3.0 * SPEED**2 + 0.5 * SPEED
    gap = np.abs(SPEED[:, None] - SPEED[None, :])
    covariance = SIGMA**2 * np.eye(30) + 0.2**2 * np.exp(-gap)
    observed = table(noisy(truth), covariance=covariance)
    problem = base_problem(MODEL, [observed])
    found = fit(problem)
    design = np.stack([SPEED**2, SPEED, np.ones(30)], axis=1)
    prior = np.diag([0, 0, 1 / 0.02**2])
    weight = np.linalg.inv(covariance)
    normal = design.T @ weight @ design + prior
    expected = np.linalg.solve(normal, design.T @ weight @ observed.measured)
    got = [found.values[n] for n in ("loss.drag", "seal.torque", "zero.offset")]
    np.testing.assert_allclose(got, expected, rtol=1e-6)
    order = [problem.names.index(n) for n in ("loss.drag", "seal.torque", "zero.offset")]
    np.testing.assert_allclose(found.covariance[np.ix_(order, order)], np.linalg.inv(normal), rtol=1e-6)
    gap = observed.measured - design @ expected
    assert found.chi2 == pytest.approx(gap @ weight @ gap + (expected[2] / 0.02) ** 2, rel=1e-8)
    assert found.dof == 30 + 1 - 3


def test_what_is_held_widens_the_interval_by_a_factor():
    """Of a product of two, one known to 50 %: the other is known to exp(1.96 x 0.5), were there no noise."""
    problem = without(base_problem(MODEL, [table(noisy(3 * SPEED**2 + 4 * SPEED))]), "seal").with_uses(
        ["hole"]
    )
    found = fit(problem)
    area = found.values["hole.area"]
    alone = found.dispersion**0.5 * found.standard_error("hole.area") / area
    low, high = intervals_95(problem, found)["hole.area"]
    expected = 1.96 * np.hypot(alone, 0.25 / 0.5)
    assert np.log([area / low, high / area]) == pytest.approx([expected, expected], rel=1e-3)
    drag = found.values["loss.drag"]  # does not see the other two's product shared otherwise
    reach = 1.96 * found.dispersion**0.5 * found.standard_error("loss.drag")
    assert intervals_95(problem, found)["loss.drag"] == pytest.approx((drag - reach, drag + reach), rel=1e-4)


def test_sizes_that_share_an_error_are_known_to_a_factor(monkeypatch):
    """A size is known to exp(1.96 x 0.5) where a machine's answer is to 50 %, were there no noise."""
    monkeypatch.setattr(TableObservation, "size_error", 0.5)
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2 + 0.5 * SPEED))])
    found = fit(problem)
    torque = found.values["seal.torque"]
    alone = found.dispersion**0.5 * found.standard_error("seal.torque") / torque
    low, high = intervals_95(problem, found)["seal.torque"]
    expected = 1.96 * np.hypot(alone, 0.5)
    assert np.log([torque / low, high / torque]) == pytest.approx([expected, expected], rel=1e-2)


def test_what_a_study_states_has_no_spread():
    problem = without(base_problem(MODEL, [table(noisy(3 * SPEED**2 + 4 * SPEED))]), "seal").with_uses(
        ["hole"]
    )
    stated = replace(problem, values={**problem.values, "hole.per_area": 0.5})
    found = fit(stated)
    reach = 1.96 * found.dispersion**0.5 * found.standard_error("hole.area")
    low, high = intervals_95(stated, found)["hole.area"]
    assert (high - low) / 2 == pytest.approx(reach, rel=1e-4)


def test_the_jacobian_is_that_of_the_residual_also_at_a_bound():
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2))]).with_uses(["power-law"])
    theta = problem.start({"seal.torque": 0.0, "power-law.size": 0.4})
    analytic = problem.jacobian(theta)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-6
        slope = (problem.residual(theta + step) - problem.residual(theta)) / 1e-6
        np.testing.assert_allclose(analytic[:, k], slope, rtol=1e-4, atol=1e-5)


def test_a_curved_dependence_has_its_slope_also_at_an_end_of_the_domain():
    @effect("bent", adds_to="loss", neutral={"size": 0.0})
    def bent(speed, *, size=Parameter(1.0, "W", min=0.0, max=2.0), by=Parameter(0.0, min=0.0, max=2.0)):
        "A power law of the speed."
        return size * speed**by

    problem = base_problem(MODEL.with_effect(bent), [table(noisy(SPEED**2))]).with_uses(["bent"])
    for end in (0.0, 2.0):
        theta = problem.start({"bent.size": 1.0, "bent.by": end})
        slope = problem.sensitivities(theta)[0][:, problem.names.index("bent.by")]
        np.testing.assert_allclose(slope, SPEED**end * np.log(SPEED), rtol=1e-5, atol=1e-6)


def test_an_effect_that_looks_at_earlier_rows_sees_them_all():
    @effect("memory", adds_to="loss", neutral={"share": 0.0})
    def memory(speed, *, share=Parameter(0.5, "W", min=0.0, max=2.0)):
        "What was done before adds up."
        return share * np.cumsum(np.asarray(speed, dtype=float))

    model = MODEL.with_effect(memory)
    problem = base_problem(model, [table(noisy(SPEED**2))]).with_uses(["memory"])
    observed, values = problem.observations[0], problem.values_at(problem.start({"memory.share": 0.7}))
    whole = observed.predict(problem.assembly, values)
    kept = np.arange(30) % 3 == 1
    np.testing.assert_allclose(observed.take(kept).predict(problem.assembly, values), whole[kept])
    again = observed.take(kept).take(np.arange(10) > 4)
    np.testing.assert_allclose(again.predict(problem.assembly, values), whole[kept][5:])
    slope = problem.sensitivities(problem.start())[0][:, problem.names.index("memory.share")]
    np.testing.assert_allclose(slope, np.cumsum(SPEED), rtol=1e-7)
    two = np.repeat([0, 1], 15)
    parted = table(noisy(SPEED**2), recording=two, recordings=("a", "b"))
    apart = parted.predict(problem.assembly, values)
    np.testing.assert_allclose(apart[15] - whole[15], -0.7 * SPEED[:15].sum())


def test_an_effect_that_mixes_the_steps_is_found_out():
    @effect("mixing", adds_to="loss", neutral={"by": 0.0})
    def mixing(speed, *, by=Parameter(0.5, "W", min=0.0, max=2.0)):
        "Takes the mean of what it is given."
        return float(np.mean(by)) * speed

    problem = base_problem(MODEL.with_effect(mixing), [table(noisy(SPEED**2))]).with_uses(["mixing"])
    for _ in range(2):  # the first time is a trial, the second rests on what it showed
        slope = problem.sensitivities(problem.start())[0][:, problem.names.index("mixing.by")]
        np.testing.assert_allclose(slope, SPEED, rtol=1e-7)


def test_one_pass_over_all_steps_equals_step_by_step():
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2))])
    observed = problem.observations[0]
    many = [{"loss.drag": 1.0, "seal.torque": t, "zero.offset": 0.0} for t in (0.1, 0.2, 0.7)]
    together = observed.predict_many(problem.assembly, many)
    for k, values in enumerate(many):
        np.testing.assert_allclose(together[:, k], observed.predict(problem.assembly, values), rtol=1e-15)


def test_a_fit_that_cannot_move_a_parameter_says_so():
    found = fit(base_problem(MODEL, [table(noisy(3 * SPEED**2 - 0.4 * SPEED))]))
    assert found.at_bound == ("seal.torque",)
    assert found.values["seal.torque"] == 0.0


def test_a_candidate_starts_at_its_default_and_keeps_what_is_fixed():
    problem = base_problem(MODEL, [table(noisy(SPEED**2))]).with_uses([Use("power-law")])
    assert "power-law.size" in problem.names
    assert "power-law.by" not in problem.names
    assert problem.start()[problem.names.index("power-law.size")] == 0.2
    assert without(problem, "power-law").names == base_problem(MODEL, problem.observations).names


def test_a_nuisance_named_as_candidate_loses_its_certificate_and_gets_it_back():
    problem = base_problem(MODEL, [table(noisy(2 * SPEED**2 + 0.5))])
    assert problem.priors == {"zero.offset": (0.0, pytest.approx(0.02))}
    assert problem.nuisances == {Use("zero")}
    free = problem.with_uses([Use("zero")])
    assert free.priors == {}
    assert free.n_priors == 0
    assert fit(free).values["zero.offset"] == pytest.approx(0.5, abs=0.3)
    assert abs(fit(problem).values["zero.offset"]) < 0.1
    assert without(free, "zero").priors == problem.priors


def test_parameters_per_recording_have_one_element_each():
    which = np.arange(30) // 10
    truth = 2 * SPEED**2 + np.array([0.0, 1.0, -1.0])[which]
    observed = table(noisy(truth), recording=which, recordings=("a", "b", "c"))
    problem = base_problem(MODEL, [observed], []).with_uses(["drift"])
    assert problem.names[-3:] == ("drift.step[a]", "drift.step[b]", "drift.step[c]") or set(
        problem.names
    ) >= {"drift.step[b]"}
    found = fit(problem)
    np.testing.assert_allclose(found.values["drift.step"], [0, 1, -1], atol=0.25)
    parts = [observed.take(which == k) for k in range(3)]
    named = [TableObservationOf(p, name) for p, name in zip(parts, "abc", strict=True)]
    apart = fit(problem.over(named))
    np.testing.assert_allclose(apart.values["drift.step"], found.values["drift.step"], rtol=1e-5)


def TableObservationOf(part, name):
    from dataclasses import replace

    return replace(part, recordings=(name,), recording=None, series=None, position=None)


def test_a_profile_interval_of_a_linear_problem_is_the_symmetric_one():
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2 + SPEED))])
    found = fit(problem)
    low, high = intervals_95(problem, found)["loss.drag"]
    se = found.dispersion**0.5 * found.standard_error("loss.drag")
    np.testing.assert_allclose(
        [low, high], found.values["loss.drag"] + np.array([-1, 1]) * 1.95996 * se, rtol=1e-4
    )


def test_a_profile_interval_ends_at_the_domain():
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2))])
    found = fit(problem)
    low, high = intervals_95(problem, found)["seal.torque"]
    assert low == 0.0
    assert 0.0 < high < 0.5


def test_what_is_not_finite_is_an_error_and_no_verdict():
    @effect("bad", adds_to="loss", neutral={"by": 0.0})
    def bad(speed, *, by=Parameter(0.5, min=0.0, max=1.0)):
        "Not a number."
        return by * np.log(-speed)

    problem = base_problem(MODEL.with_effect(bad), [table(SPEED)]).with_uses(["bad"])
    with pytest.raises(ComputationError, match="not finite"):
        fit(problem)


def test_a_fit_that_does_not_settle_says_so(monkeypatch):
    problem = base_problem(MODEL, [table(noisy(SPEED**2 + SPEED))])
    expected = fit(problem, starts=2).theta
    monkeypatch.setattr("specan.study.estimation.levenberg_marquardt.MOST_JACOBIANS", 0)
    np.testing.assert_allclose(fit(problem).theta, expected, rtol=1e-9)  # the second method takes over
    monkeypatch.setattr("specan.study.estimation.fit.MOST_EXACT", 1)
    best = fit(problem)
    assert not best.converged


def test_more_parameters_than_values_are_refused():
    few = table(SPEED[:2] ** 2, SPEED[:2])
    with pytest.raises(RequestError, match="cannot determine"):
        fit(base_problem(MODEL, [few]).with_uses(["zero", "power-law"]))


def test_several_starts_are_the_same_every_time():
    problem = base_problem(MODEL, [table(noisy(3 * SPEED**2 + SPEED))]).with_uses(["power-law"])
    one, two = fit(problem, starts=4), fit(problem, starts=4)
    np.testing.assert_array_equal(one.theta, two.theta)
    assert one.chi2 <= fit(problem).chi2 * (1 + 1e-9)


def test_an_estimated_noise_gives_the_f_distribution():
    truth = noisy(3 * SPEED**2)
    known = fit(base_problem(MODEL, [table(truth)]))
    guessed = fit(base_problem(MODEL, [table(truth, noise_dof=4.0)]))
    assert known.chi2 == guessed.chi2
    bad = table(truth + np.sin(5 * SPEED))
    assert fit(base_problem(MODEL, [bad])).p_value < 1e-6
    from dataclasses import replace

    assert fit(base_problem(MODEL, [replace(bad, noise_dof=4.0)])).p_value > 1e-4
