"""The next measurement: where rivals differ, what each expects there, and what else to do where none differs."""

from dataclasses import replace

import numpy as np
import pytest

from specan.models import Condition, RigStatement, Use
from specan.study.design.operating_points import after_reading, expected_information, explore, propose
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.localisation.localise import localise
from specan.study.selection.refits import Refit, Refits
from specan.study.verdict import Diagnosis, Probability


def fitted(problem, *names):
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    return [refits.fit(refits.base, frozenset({Use(name)}), [{}]) for name in names]


def test_rivals_are_sent_where_their_curves_part(toy):
    # Measured up to x = 2, where a parabola and a wave can agree; the rig goes on to 4, where they cannot.
    rivals = fitted(toy.problem(lambda x, z: 4 * x**2, ["square", "wave"], seed=1), "square", "wave")
    first, *_ = propose(rivals)
    assert first.conditions["x"] > 3.5
    assert first.separation_sigma > 2
    assert set(first.predictions) == {"square", "wave"}
    assert "expects" in first.text


def test_predictions_and_separation_are_those_of_the_fits(toy):
    rivals = fitted(toy.problem(lambda x, z: 4 * x**2, ["square", "cross"], seed=2), "square", "cross")
    first = propose(rivals, count=1)[0]
    x, z = first.conditions["x"], first.conditions["z"]
    rows = {
        "square": np.array([1, x, x**2]),
        "cross": np.array([1, x, x * z]),
    }
    gap, variance = [], 1.0
    for refit, name in zip(rivals, ("square", "cross")):
        theta = [refit.fit.values[n] for n in ("line.offset", "line.slope", f"{name}.c")]
        assert first.predictions[name] == pytest.approx(rows[name] @ theta, rel=1e-6)
        gap.append(first.predictions[name])
        variance += rows[name] @ (refit.fit.covariance * refit.fit.dispersion) @ rows[name]
    assert first.sigma == pytest.approx(1.0)
    assert first.separation_sigma == pytest.approx(abs(gap[0] - gap[1]) / np.sqrt(variance), rel=1e-4)


def test_points_stay_within_the_limits_and_apart(toy):
    rivals = fitted(toy.problem(lambda x, z: 4 * x**2, ["square", "cross"], seed=3), "square", "cross")
    found = propose(rivals, count=3)
    places = np.array([[p.conditions["x"], p.conditions["z"]] for p in found])
    assert np.all((places[:, 0] >= 0.1) & (places[:, 0] <= 4.0))
    assert np.all((places[:, 1] >= -1.0) & (places[:, 1] <= 1.5))
    for a in range(len(found)):
        for b in range(a):
            assert np.max(np.abs((places[a] - places[b]) / [3.9, 2.5])) > 0.15


def test_a_planned_reading_tells_the_parameters_more():
    covariance = np.array([[2.0, 0.3], [0.3, 1.0]])
    slope = np.array([0.5, -1.5])
    want = np.linalg.inv(np.linalg.inv(covariance) + np.outer(slope, slope))
    np.testing.assert_allclose(after_reading(covariance, slope), want)


@pytest.mark.parametrize("gap", [0.5, 2.0, 4.0])
def test_what_a_reading_is_expected_to_tell_is_the_mutual_information(gap):
    """Against a Monte Carlo of ln p(reading | explanation) - ln p(reading); the closed form is a lower bound of it."""
    weights, means, variances = (
        np.array([0.7, 0.2, 0.1]),
        np.array([0.0, gap, -gap]),
        np.array([1.0, 1.5, 1.0]),
    )
    rng = np.random.default_rng(1)
    which = rng.choice(3, size=200_000, p=weights)
    reading = means[which] + np.sqrt(variances[which]) * rng.standard_normal(which.size)
    density = np.exp(-((reading[:, None] - means) ** 2) / (2 * variances)) / np.sqrt(2 * np.pi * variances)
    true = np.mean(np.log(density[np.arange(which.size), which] / (density @ weights)))
    found = expected_information(means[:, None], variances[:, None], weights)[0]
    assert 0.45 * true < found < true + 0.003


def test_two_friction_laws_are_told_apart_at_slow_speeds(tmp_path):
    """Coulomb friction, and one that rises with the slip as tanh(v / 8 mm/s): alike above, apart below 10 mm/s."""
    from open_tables import read_tables

    from specan.models import Model, Parameter, effect
    from specan.study.selection.candidates import base_problem

    @effect("dry", adds_to="drag", neutral={"size": 0.0})
    def dry(speed, *, size=Parameter(1.0, "N", min=0, max=5)):
        return size * np.sign(speed)

    @effect("regularised", adds_to="drag", neutral={"size": 0.0})
    def regularised(speed, *, size=Parameter(1.0, "N", min=0, max=5)):
        return size * np.tanh(speed / 8)

    def drag(speed, viscous=0.01):
        return viscous * speed

    model = Model.from_function(
        drag,
        conditions={"speed": ("mm/s", 0, 1000)},
        observables={"drag": ("N", 0.02)},
        effects=[dry, regularised],
    )
    speeds = np.linspace(100, 1000, 10)
    rows = [f"{v:g},{0.01 * v + 1:.4f}" for v in speeds]
    (tmp_path / "t.csv").write_text("speed,drag\n" + "\n".join(rows) + "\n", encoding="utf-8")
    problem = base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted)
    first = propose(fitted(problem, "dry", "regularised"), count=1)[0]
    assert 0 < first.conditions["speed"] <= 20


def test_a_reading_that_no_law_predicts_well_is_proposed_where_it_would_tell(tmp_path):
    """Friction that falls over a speed which the data hardly tell: simulated readings say how much one resolves."""
    from open_tables import read_tables

    from specan.models import Model, Parameter, effect
    from specan.study.selection.candidates import base_problem

    @effect("stribeck", adds_to="drag", neutral={"size": 0.0})
    def stribeck(
        speed,
        *,
        size=Parameter(5.0, "N", min=1, max=30, lower=-100, upper=100),
        scale=Parameter(5.0, "mm/s", min=1, max=50),
    ):
        return size * np.exp(-speed / scale)

    def drag(speed, level=20.0):
        return level + 0.0 * speed

    model = Model.from_function(
        drag,
        conditions={"speed": ("mm/s", 1, 200)},
        observables={"drag": ("N", 0.3)},
        effects=[stribeck],
    )
    rng = np.random.default_rng(0)
    speeds = np.repeat(np.linspace(20, 200, 10), 2)
    rows = [f"{v:g},{20 + 5 * np.exp(-v / 10) + 0.3 * rng.standard_normal():.4f}" for v in speeds]
    (tmp_path / "t.csv").write_text("speed,drag\n" + "\n".join(rows) + "\n", encoding="utf-8")
    problem = base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted)
    refits = Refits(Refit(frozenset(), problem, fit(problem)))
    rivals = [refits.fit(refits.base, frozenset({Use("stribeck")}), [{}]), refits.base]
    first = propose(rivals)[0]
    assert first.conditions["speed"] <= 10
    assert first.separation_sigma < 2
    v, theta = first.conditions["speed"], rivals[0].fit.theta
    decay = np.exp(-v / theta[2])
    slopes = np.array([1, decay, theta[1] * decay * v / theta[2] ** 2])
    spread = (
        np.array([slopes @ rivals[0].fit.covariance @ slopes, rivals[1].fit.covariance[0, 0]])
        + first.sigma**2
    )
    mean = np.array([first.predictions["stribeck"], first.predictions["the model as it is"]])
    law = rng.integers(2, size=20000)
    read = mean[law] + np.sqrt(spread[law]) * rng.standard_normal(law.size)
    density = np.exp(-((read[:, None] - mean) ** 2) / (2 * spread)) / np.sqrt(spread)
    share = density / density.sum(axis=1, keepdims=True)
    open_ = -np.mean(np.sum(share * np.log(np.maximum(share, 1e-300)), axis=1))
    resolved = float(first.text.split("at least ")[1].split(" %")[0]) / 100
    assert 0.4 < resolved < 1 - open_ / np.log(2)


def test_a_measured_point_decides_what_the_grid_could_not(toy):
    problem = toy.problem(lambda x, z: 1.1 * x**2, ["square", "wave"], seed=4)
    rivals = fitted(problem, "square", "wave")
    first = propose(rivals, count=1)[0]
    better = abs(first.predictions["square"] - first.predictions["wave"])
    inside = [abs(a - b) for a, b in zip(*(r.problem.predictions(r.fit.theta)[0] for r in rivals))]
    assert better > 2 * max(inside)


def test_aliases_ask_for_another_kind_of_measurement(toy):
    rivals = fitted(toy.problem(lambda x, z: 4 * x**2, ["square", "twin"], seed=5), "square", "twin")
    found = propose(rivals)
    assert [p.conditions for p in found] == [{}]
    assert "a second instrument" in found[0].text
    assert propose(rivals, other_kinds=False) == ()


def test_one_explanation_alone_has_nothing_to_decide(toy):
    [only] = fitted(toy.problem(lambda x, z: 4 * x**2, ["square"], seed=6), "square")
    assert propose([only]) == ()


def test_what_may_be_a_fault_of_the_data_is_read_again(toy):
    """Neither is decided, whatever the effect expects elsewhere: the same rows without the fault would tell."""
    both = [
        Probability(n, k, (), {}, p) for n, k, p in (("square", "effects", 0.7), ("first rows", "fault", 0.3))
    ]
    found = diagnose(toy.problem(lambda x, z: 0 * x, ["square"], seed=6))
    for verdict in ("effect", "nothing-missing"):
        doubted = replace(found, verdict=verdict, probabilities=tuple(both), next_measurement=()).next()
        assert doubted.otherwise.startswith("measure the same rows again")
        assert "first rows" in doubted.otherwise


def test_without_limits_nothing_is_proposed(toy):

    problem = toy.problem(lambda x, z: 4 * x**2, ["square", "cross"], seed=7)
    model = replace(problem.assembly.model, rig=RigStatement())
    problem = replace(problem, assembly=model.assemble(problem.assembly.uses))
    rivals = fitted(problem, "square", "cross")
    assert propose(rivals) == ()


def test_the_unknown_is_looked_for_where_nothing_was_measured(toy):
    problem = toy.problem(lambda x, z: 8 * (x > 1.7), ["cross"], seed=8)
    start = Refit(frozenset(), problem, fit(problem))
    blocks = localise(problem, start.fit).fails_at
    assert blocks
    for proposal in explore(start, blocks):
        assert proposal.separation_sigma is None
        assert "nothing was measured" in proposal.text


def test_a_verdict_carries_its_proposals(toy):
    found = diagnose(toy.problem(lambda x, z: 4 * x**2, ["square", "twin", "cross"], seed=9)).to_dict()
    for row in found["next_measurement"]:
        assert set(row) == {
            "text",
            "conditions",
            "predictions",
            "unit",
            "sigma",
            "separation_sigma",
            "least_sigma",
            "observable",
        }


def test_no_condition_is_proposed_twice_and_between_measured_ones_where_the_grid_is_too_coarse(tmp_path):
    """A model that fails at slow speeds, over limits whose grid has a single slow point, zero."""
    from open_tables import read_tables

    from specan.models import Model
    from specan.study.selection.candidates import base_problem

    model = Model.from_function(
        lambda speed, level=1.0: level + 0 * speed, conditions={"speed": ("rpm", -200, 200)},
        observables={"drag": ("N", 0.01)},
    )  # fmt: skip
    speeds = [-200, -100, -50, -20, -8, -4, -2, 2, 4, 8, 20, 50, 100, 200]
    rows = [f"{v},{1 + np.exp(-abs(v + 4)):.4f}" for v in speeds]
    (tmp_path / "t.csv").write_text("speed,drag\n" + "\n".join(rows) + "\n", encoding="utf-8")
    problem = base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted)
    start = Refit(frozenset(), problem, fit(problem))
    found = explore(start, localise(problem, start.fit).fails_at)
    proposed = sorted(one.conditions["speed"] for one in found)
    assert proposed == pytest.approx([-6, -3])  # the middles around -4


def test_a_limit_of_a_condition_that_the_data_lack_is_nothing_to_set(toy):
    problem = toy.problem(lambda x, z: 4 * x**2, ["square", "cross"], seed=3)
    model = problem.assembly.model
    limits = {**model.rig.limits, "draught": (0.0, 1.0)}
    draught = Condition("draught", "1", "Not in the table.", "draught", "1", default=0.0)
    conditions = {**model.conditions, "draught": draught}
    wider = replace(model, conditions=conditions, rig=replace(model.rig, limits=limits))
    rivals = fitted(replace(problem, assembly=wider.assemble(problem.assembly.uses)), "square", "cross")
    assert all(set(one.conditions) == {"x", "z"} for one in propose(rivals))
    assert len(propose(rivals)) == 3


@pytest.mark.parametrize(
    ("found", "needed"),
    [
        ([("nothing", (), 0.49), ("effects", ("a",), 0.37)], True),
        ([("effects", ("a",), 0.97), ("effects", ("b",), 0.02)], False),
        ([("effects", ("a",), 0.6), ("effects", ("a", "b"), 0.3)], False),  # a is missing either way
        ([("nothing", (), 0.6), ("unknown", (), 0.4)], False),
        ([], False),
    ],
)
def test_what_competes_is_not_said_to_be_decided(found, needed):
    stated = tuple(Probability("", kind, names, {}, share) for kind, names, share in found)
    said = Diagnosis("nothing-missing", "", probabilities=stated).next().summary()
    assert ("would distinguish" in said) == needed
    assert ("no two explanations compete" in said) != needed


@pytest.mark.parametrize("verdict", ["faulty-data", "cannot-tell"])
def test_what_must_come_before_a_measurement_is_said_in_place_of_one(verdict):
    assert (
        Diagnosis(verdict, "rows are copies: correct that").next().summary()
        == "rows are copies: correct that"
    )
