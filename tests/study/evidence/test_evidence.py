"""The evidence against laws written out whole, and what is said of planted effects, unknowns, faults and nothing."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from open_tables import read_tables
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from specan.models import Model, Parameter, Use, effect
from specan.models.catalogue import load_model
from specan.models.quantity import SettingError
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.evidence import marginal
from specan.study.evidence.diagnosis import stated
from specan.study.evidence.diagnosis import told as diagnosis_of
from specan.study.evidence.explanations import Explanation, Explanations
from specan.study.evidence.form_errors import kernel_root, operating_points
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.evidence.noise import Autoregression, Rough, autoregressions, scatter
from specan.study.observation import Strategy
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import _ShapeGrid
from specan.study.verdict import headline, headline_of
from truth.worm_gear import simulate, write


def tangent_of(problem):
    best = fit(problem)
    return Tangent.at(problem, best.theta, best.residual, best.jacobian)


def ln_density(tangent, columns):
    """ln of the normal law of the residuals, coefficients and parameters integrated out, without its constant."""
    n = tangent.residual.size
    known = tangent.jacobian * tangent.widths
    law = multivariate_normal(cov=np.eye(n) + columns @ columns.T + known @ known.T)
    return law.logpdf(tangent.residual) + 0.5 * n * np.log(2 * np.pi)


def test_evidence_is_the_normal_law_with_everything_integrated_out(toy):
    tangent = tangent_of(toy.problem(lambda x, z: 0.3 * np.sin(3 * x), [], seed=3))
    columns = 0.5 * kernel_root(operating_points(tangent.problem), 0.5)
    none = np.zeros((columns.shape[0], 0))
    # The law is centred on the fit; what the width of a range adds to chi-square there is far below this tolerance.
    for own in (none, columns):
        assert Marginal(tangent, own).ln_evidence == pytest.approx(ln_density(tangent, own), abs=0.02)


def test_columns_beside_a_fit_gain_what_they_gain_in_a_law_with_them(toy):
    tangent = tangent_of(toy.problem(lambda x, z: 0.8 * z, [], seed=4))
    column = toy.z[:, None] * np.array([[1.0, 0.0]]) + toy.x[:, None] ** 2 * np.array([[0.0, 1.0]])
    gains, _ = Marginal(tangent).beside(column, np.array([0.1, 1.0]))
    alone = ln_density(tangent, np.zeros((48, 0)))
    for gain, size in zip(gains, (0.1, 1.0), strict=True):
        assert gain == pytest.approx(ln_density(tangent, size * column) - alone, abs=0.02)


@pytest.mark.parametrize("rounding", [0.0, 3e-14])
def test_columns_gain_nothing_from_parameters_at_ends_of_their_domains(toy, monkeypatch, rounding):
    """Two amplitudes that the data want beyond their ends stay there, whatever rounding a solver leaves of the ends."""
    exact = marginal.held_inside
    monkeypatch.setattr(marginal, "held_inside", lambda *given: exact(*given) - rounding)
    problem = toy.problem(lambda x, z: 90 * x**2 + 80 * x * z + 60 * x, ["twin", "cross"], seed=4)
    problem = problem.with_uses(["twin", "cross"])
    tangent = tangent_of(problem)
    at_end = [problem.names.index(name) for name in ("twin.c", "cross.c")]
    np.testing.assert_allclose(tangent.theta[at_end], 50.0)
    column = (toy.x**2 * (1 + toy.z))[:, None]
    (gain,), _ = Marginal(tangent).beside(column, np.array([30.0]))
    free = np.setdiff1d(np.arange(tangent.theta.size), at_end)
    q, _ = np.linalg.qr(tangent.jacobian[:, free])
    seen = (column - q @ (q.T @ column))[:, 0]
    fall = (seen @ tangent.residual) ** 2 / (seen @ seen + 30.0**-2)
    assert gain == pytest.approx(0.5 * fall - 0.5 * np.log1p(30.0**2 * (seen @ seen)), rel=1e-3)


def test_a_lattice_makes_the_innovations_of_the_correlation():
    rng = np.random.default_rng(5)
    first, second = 0.8, -0.5  # reflections: lag-1 correlation, and what lag 2 adds
    phi = np.array([first * (1 - second), second])
    lags = [1.0, first]
    while len(lags) < 60:
        lags.append(phi @ [lags[-1], lags[-2]])
    root = np.linalg.cholesky(toeplitz(lags))
    form = Autoregression((np.arange(60),), (first, second))
    r = rng.standard_normal((60, 2))
    np.testing.assert_allclose(form.innovations(r), np.linalg.solve(root, r), atol=1e-10)
    estimated = 0.5 * 2 * np.log(60)  # half ln of the rows for each of two coefficients
    assert form.ln_volume + estimated == pytest.approx(-np.sum(np.log(np.diag(root))))
    drawn = np.linalg.cholesky(toeplitz(lags)) @ rng.standard_normal((60, 200))
    chains = tuple(np.arange(60) + 60 * k for k in range(200))
    found = autoregressions(chains, drawn.T.ravel())[-1].reflections
    np.testing.assert_allclose(found, (first, second), atol=0.03)


def test_smooth_functions_have_the_covariance_that_is_asked_for():
    points = np.random.default_rng(1).uniform(size=(70, 2))
    root = kernel_root(points, 0.5)
    apart = np.sum((points[:, None] - points) ** 2, axis=2)
    np.testing.assert_allclose(root @ root.T, np.exp(-apart / 2 / 0.5**2), atol=2e-3)


CANDIDATES = ["tilt", "cross", "wave"]


def told(problem):
    found = diagnose(problem)
    assert 0.98 < sum(one.probability for one in found.probabilities) < 1 + 1e-9
    return found


def test_a_planted_effect_is_named_with_its_probability(toy):
    found = told(toy.problem(lambda x, z: 2.0 * x * z, CANDIDATES))
    assert (found.verdict, found.alternatives) == ("effect", (("cross",),))
    assert headline(found).startswith("Missing: cross (")
    assert found.probabilities[0].effects == ("cross",)
    assert found.probabilities[0].probability > 0.9
    assert (
        found.ranking[0].parameters["cross.c"]["low"] < 2.0 < found.ranking[0].parameters["cross.c"]["high"]
    )


def test_a_name_whose_equation_would_be_far_off_is_doubted(toy):
    far, near = (
        told(toy.problem(lambda x, z, w=w: 60.0 * x * z * (1 + w * np.cos(2 * x)), ["cross"]))
        for w in (0.3, 0.0)
    )
    assert far.alternatives == near.alternatives == (("cross",),)
    assert far.unknown_possible
    assert "off by about 30 %" in far.reason
    assert not near.unknown_possible


def test_nothing_is_missing_in_complete_models(toy):
    for seed in range(8):
        found = told(toy.problem(lambda x, z: 0.0 * x, CANDIDATES, seed=seed))
        assert found.verdict == "nothing-missing"
        assert found.alternatives == ()


def test_what_no_effect_describes_is_something_else(toy):
    found = told(toy.problem(lambda x, z: 4.0 * np.tanh(6 * z) ** 2, ["tilt", "cross"]))
    assert found.verdict == "unknown-effect"
    assert found.probabilities[0].kind == "unknown"
    assert "something else" in found.probabilities[0].explanation


@pytest.mark.long
def test_what_lets_a_parameter_leave_the_end_of_its_range_is_something_else_too(tmp_path):
    """The wheel runs on its edge above a torque, in a gear of other formulas: no surely named effect does that."""
    case = simulate(90000, {"misalignment": 0.295}, drawn=True)
    table, _ = write(case, tmp_path)
    model = load_model("worm-gear", case.rig)
    found = diagnose(base_problem(model, read_tables(model, [table]).fitted))
    assert found.verdict == "unknown-effect"


def test_readings_that_drift_with_their_order_are_a_fault_of_the_data(toy):
    order = np.random.default_rng(8).permutation(48)  # the plan was run in another order than it is sorted
    problem = toy.problem(lambda x, z: 6.0 * (order / 47 - 0.5), ["tilt", "cross"])
    (rows,) = problem.observations
    problem = problem.over([replace(rows, lines=order + 2, recording=np.zeros(48, int))])
    found = told(problem)
    assert found.verdict == "faulty-data"
    assert "drift" in headline(found)


def test_an_instrument_with_play_is_a_fault_of_the_data(toy):
    """Its pointer follows what it shows only after a gap is closed (the play operator)."""
    order = np.random.default_rng(8).permutation(48)
    problem = toy.problem(lambda x, z: 20.0 * x, ["tilt", "cross"])
    (rows,) = problem.observations
    shown, at = rows.measured.copy(), rows.measured[np.argmin(order)]
    for row in np.argsort(order):
        at = shown[row] = np.clip(at, rows.measured[row] - 2.0, rows.measured[row] + 2.0)
    found = told(problem.over([replace(rows, measured=shown, lines=order + 2, recording=np.zeros(48, int))]))
    assert found.verdict == "faulty-data"
    assert "hysteresis" in headline(found)


def test_an_effect_is_told_beside_a_fault_of_the_data(toy):
    order = np.random.default_rng(8).permutation(48)
    problem = toy.problem(lambda x, z: 8.0 * (order / 47 - 0.5) + 6.0 * x * z, ["tilt", "cross"])
    (rows,) = problem.observations
    problem = problem.over([replace(rows, lines=order + 2, recording=np.zeros(48, int))])
    found = told(problem)
    assert found.verdict == "faulty-data"
    assert found.alternatives == (("cross",),)
    said = headline(found)
    assert said.startswith("The data have a fault: drift")
    assert "Missing beside it: cross (" in said


@pytest.mark.parametrize("offset", [0.0, -0.8])
def test_parts_that_were_changed_between_two_rows_are_told_with_their_sizes(toy, offset):
    """The slope goes from 3 W to 4.5 W, perhaps the offset from 2 W to 1.2 W; x is set to 0.2 %."""
    order = np.random.default_rng(8).permutation(48)
    changed = toy.problem(lambda x, z: (offset + 1.5 * x) * (order >= 20), [], noise=0.3)
    rows = replace(
        changed.observations[0], covariance=0.09 * np.eye(48), lines=order + 2, recording=np.zeros(48, int)
    )
    model = toy.model("tilt", "cross")
    model = replace(model, rig=replace(model.rig, setting={"x": SettingError(relative=0.002)}))
    found = told(base_problem(model, [rows]))
    assert found.verdict == "faulty-data"
    assert "the machine behaves differently from line 22 on" in found.reason
    change = np.where(order >= 20, offset + 1.5 * toy.x, 0.0)
    (size,) = re.findall(r"reading by up to ([\d.]+) W", found.reason)
    assert float(size) == pytest.approx(np.ptp(change), rel=0.15)


def test_faults_between_which_nothing_decides_are_all_said():
    faults = {
        "drift of the zero": 0.36,
        "zero from a row on beside windage": 0.05,
        "zero from a row on": 0.25,
    }
    stated = [
        {"explanation": name, "kind": "fault", "effects": [], "probability": p} for name, p in faults.items()
    ]
    content = {"verdict": "faulty-data", "alternatives": [[]], "probabilities": stated}
    assert headline_of(content) == (
        "The data have a fault: drift of the zero (36 %) or zero from a row on (30 %); these data cannot tell which."
    )


def test_a_form_with_which_perhaps_nothing_is_missing_is_no_sure_one():
    stated = [
        {"explanation": name, "kind": kind, "effects": [], "probability": p}
        for name, kind, p in (("something else", "unknown", 0.51), ("nothing is missing", "nothing", 0.45))
    ]
    content = {
        "verdict": "nothing-missing",
        "alternatives": [],
        "probabilities": stated,
        "other_form": "A in place of B",
    }
    assert "perhaps nothing is missing (45 %) or something else (51 %)" in headline_of(content)


def test_a_headline_with_a_name_says_how_probable_a_fault_is_instead():
    """What a fault leaves beside the named effect counts for the name: 70 and 1 %."""
    told = [
        ("effects", "windage", 0.7),
        ("fault", "first rows", 0.29),
        ("fault", "drift beside windage", 0.01),
    ]
    stated = [
        {
            "kind": kind,
            "explanation": text,
            "probability": p,
            "effects": ["windage"] if "windage" in text else [],
        }
        for kind, text, p in told
    ]
    content = {"verdict": "effect", "alternatives": [["windage"]], "probabilities": stated}
    assert headline_of(content) == "Missing: windage (71 %) or a fault of the data (29 %)."


def test_noise_that_follows_itself_names_nothing(toy):
    rng, wrong = np.random.default_rng(9), 0
    for _ in range(10):
        noise = np.empty(48)
        noise[0] = rng.standard_normal()
        for k in range(1, 48):
            noise[k] = 0.95 * noise[k - 1] + np.sqrt(1 - 0.95**2) * rng.standard_normal()
        found = told(toy.problem(lambda x, z, own=noise: own, ["tilt", "cross"], noise=0.0))
        wrong += found.verdict != "nothing-missing"
    assert wrong <= 1


def test_readings_that_scatter_more_than_declared_cost_no_verdict(toy):
    complete = told(toy.problem(lambda x, z: 0 * x, ["tilt", "cross"], noise=2.5, seed=21))
    assert complete.verdict == "nothing-missing"
    (said,) = [text for text in complete.remarks if "scatter more than declared" in text]
    assert 2.0 < float(re.search(r"([\d.]+) times", said)[1]) < 3.0
    missing = told(toy.problem(lambda x, z: 9.0 * x * z, ["tilt", "cross"], noise=2.5, seed=22))
    assert missing.alternatives == (("cross",),)
    (said,) = [text for text in missing.remarks if "scatter more than declared" in text]
    assert 2.0 < float(re.search(r"([\d.]+) times", said)[1]) < 3.0


def test_what_goes_with_the_operating_variables_is_no_scatter(toy):
    found = told(toy.problem(lambda x, z: 8 * np.sin(7 * x), ["tilt", "cross"], seed=23))
    assert found.verdict == "unknown-effect"
    assert not any("scatter" in text for text in found.remarks)


def test_scatter_by_the_normal_law_with_that_scatter(toy):
    problem = toy.problem(lambda x, z: 0 * x, ["tilt"], noise=3.0, seed=24)
    tangent = tangent_of(problem)
    (alike, _) = scatter(problem, tangent.residual, np.ones(48), 1.0)
    variance = np.mean(tangent.residual**2)
    known = tangent.jacobian * tangent.widths
    law = multivariate_normal(cov=variance * np.eye(48) + known @ known.T)
    expected = law.logpdf(tangent.residual) + 24 * np.log(2 * np.pi) - 0.5 * np.log(48)
    assert Marginal(tangent.with_noise(alike)).ln_evidence == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(("share", "named"), [(0.0, True), (0.25, True), (0.5, False), (0.9, False)])
def test_complex_lines_that_an_equation_cannot_leave_name_no_effect(share, named):
    # Of a change c an equation that is wrong by a share s leaves s c: of chi-square s^2 |c|^2 beside the noise.
    rng = np.random.default_rng(4)
    noise, change = rng.standard_normal(4000), 30 * np.sin(np.arange(4000) / 50)
    lines = SimpleNamespace(strategy=Strategy(frugal=True))

    def left(part):
        residual = noise + part * change
        return SimpleNamespace(chi2=residual @ residual, residual=residual, problem=lines)

    form = SimpleNamespace(tangent=left(1.0))
    found = Explanation("effects", form, frozenset({Use("leak")}), left(share), 0.0, 0.0)
    explanations = SimpleNamespace(probabilities=[(1.0, found)])
    likeliest, *others = stated(explanations)
    assert (likeliest.kind, likeliest.probability) == ("effects" if named else "unknown", 1.0)
    assert [one.kind for one in others] == ([] if named else ["effects"])  # it stays among what was tried


def test_where_a_model_fails_is_told_of_the_fit_that_a_person_is_shown(toy):
    missing = toy.problem(lambda x, z: 8 * np.sin(7 * x), ["wave"], seed=1)
    complete = toy.problem(lambda x, z: 0 * x, ["wave"], seed=2)
    explanations = Explanations(missing, fit(missing))
    shown = Refit(frozenset(), complete, fit(complete))
    assert diagnosis_of(explanations).fails_at
    assert not diagnosis_of(explanations, shown).fails_at


@pytest.mark.parametrize(("of_speed", "of_temperature", "rival"), [(2.0, 40.0, False), (1.9, 38.0, True)])
def test_a_strong_pair_and_its_rival_are_found(tmp_path, of_speed, of_temperature, rival):
    """Each effect alone is strained by the other, so that a straight line promises little of the second one."""

    def power(flow, speed, friction, a, b):
        return a * flow * speed + b * speed + friction

    def friction(flow, drop):
        return drop * flow**2

    @effect("falls", scales="friction", neutral={"exponent": 0.0})
    def falls(flow, *, exponent=Parameter(0.1, "1", min=0.01, max=0.5, lower=0, upper=1)):
        return np.asarray(flow, dtype=float) ** -exponent

    @effect("cold", adds_to="power", neutral={"size": 0.0})
    def cold(speed, temperature, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000)):
        return size * speed**2 * np.exp(-(temperature - 20) / 40)

    @effect("stiff", adds_to="power", neutral={"size": 0.0})
    def stiff(speed, temperature, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000)):
        return size * speed**2 * np.exp(-(temperature - 20) / 40.2)

    model = Model.from_function(
        power,
        friction,
        conditions={"flow": ("1", 0.2, 2), "speed": ("1", 0.5, 1.5), "temperature": ("1", -5, 45)},
        observables={"power": ("W", 0.5)},
        parameters={"a": (300.0, 50, 900, "W"), "b": (40.0, 5, 200, "W"), "drop": (100.0, 10, 500, "W")},
        units={"friction": "W"},
        effects=[falls, cold, *([stiff] if rival else [])],
    )
    rng = np.random.default_rng(7)
    flow, speed, warm = (
        x.ravel() for x in np.meshgrid(np.linspace(0.2, 2, 8), [0.6, 0.9, 1.2], [-5.0, 20.0, 45.0])
    )
    read = 300 * flow * speed + 40 * speed + 100 * flow**1.82 + rng.normal(0, 0.5, flow.size)
    read = read + 25 * speed**of_speed * np.exp(-(warm - 20) / of_temperature)
    rows = [f"{f:.5g},{n},{t},{y:.3f}" for f, n, t, y in zip(flow, speed, warm, read, strict=True)]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["flow,speed,temperature,power", *rows]) + "\n", encoding="utf-8")
    found = diagnose(base_problem(model, read_tables(model, [path]).fitted))
    assert set(found.alternatives) == {("cold", "falls"), *([("falls", "stiff")] if rival else [])}


def test_an_error_that_repeats_share_is_that_of_their_covariance():
    groups, sizes = np.array([0, 0, 0, 1, 2, 2]), np.array([1.5, 0.7, 2.0])
    shared = groups[:, None] == np.arange(3)
    covariance = np.eye(6) + shared @ np.diag(sizes**2) @ shared.T
    noise, columns = Rough(sizes, groups, price=0.25), np.random.default_rng(3).standard_normal((6, 2))
    seen = noise.innovations(columns)
    np.testing.assert_allclose(seen.T @ seen, columns.T @ np.linalg.solve(covariance, columns), rtol=1e-12)
    assert noise.ln_volume == pytest.approx(-0.5 * np.linalg.slogdet(covariance)[1] - 0.25, rel=1e-12)


@pytest.mark.long
def test_a_pair_of_which_neither_half_promises_the_other_is_found(tmp_path):
    """Turbulence hides behind a base that is strained, and drying paste then has the wrong sign."""

    def rise(power, conductance, contact):
        return power / conductance + contact

    def conductance(air, still, forced):
        return still + forced * air**0.5

    def contact(power, paste):
        return paste * power

    @effect("turbulence", adds_to="conductance", neutral={"size": 0.0})
    def turbulence(
        air, *, size=Parameter(0.1, "1", min=0.01, max=1, lower=0), onset=Parameter(3.0, "1", min=1.5, max=6)
    ):
        return size * np.maximum(air - onset, 0)

    @effect("drying", scales="contact", neutral={"rate": 0.0})
    def drying(power, *, rate=Parameter(0.2, "1", min=0.02, max=2, lower=0)):
        return 1 + rate * power / 100

    @effect("buoyancy", adds_to="conductance", neutral={"size": 0.0})
    def buoyancy(
        power,
        air,
        *,
        size=Parameter(0.1, "1", min=0.01, max=1, lower=0),
        fade=Parameter(0.8, "1", min=0.3, max=2),
    ):
        return size * (power / 50) ** 0.25 * np.exp(-air / fade)

    @effect("zero", adds_to="rise", neutral={"zero": 0.0})
    def zero(*, zero=Parameter(0.3, "1", min=-3, max=3)):
        return zero

    @effect("board", adds_to="conductance", neutral={"size": 0.0})
    def board(air, *, size=Parameter(0.05, "1", min=0.005, max=0.5, lower=0)):
        return size / (1 + air)

    model = Model.from_function(
        rise,
        conductance,
        contact,
        conditions={"power": ("1", 10, 120), "air": ("1", 0, 8), "ambient": ("1", 10, 45)},
        observables={"rise": ("1", 0.15)},
        parameters={
            "still": (0.8, 0.3, 2, "1"),
            "forced": (0.9, 0.3, 3, "1"),
            "paste": (0.1, 0.02, 0.4, "1"),
        },
        units={"conductance": "1", "contact": "1"},
        effects=[turbulence, drying, buoyancy, zero, board],
    )
    power, air, ambient = (
        x.ravel()
        for x in np.meshgrid(np.linspace(10, 120, 6), np.linspace(0, 8, 5), [10.0, 27.5, 45.0], indexing="ij")
    )
    seen = 1.0286 + 0.6737 * np.sqrt(air) + 0.1057 * np.maximum(air - 2.4142, 0)
    read = power / seen + 0.1064 * power * (1 + 0.486 * power / 100)
    read = read + np.random.default_rng(4).normal(0, 0.15, read.size)
    rows = [f"{p:.6g},{v:.6g},{t},{y:.6g}" for p, v, t, y in zip(power, air, ambient, read, strict=True)]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["power,air,ambient,rise", *rows]) + "\n", encoding="utf-8")
    found = diagnose(base_problem(model, read_tables(model, [path]).fitted))
    assert ("drying", "turbulence") in found.alternatives


def test_an_effect_that_begins_beyond_its_usual_size_is_found(tmp_path):
    """Below some height a wall is smooth: neither the usual size nor a straight line from the largest tells of it."""

    def drag(speed, a, rough):
        return a * speed**2 * (1 + rough)

    def rough(speed):
        return 0.0

    @effect("roughness", adds_to="rough", neutral={"height": 0.0})
    def roughness(speed, *, height=Parameter(50, "um", min=5, max=1000, lower=0, upper=5000)):
        return np.maximum(0.05 * (np.cbrt(height) - 10 * speed**-0.3), 0)

    model = Model.from_function(
        drag, rough, conditions={"speed": ("1", 0.5, 3)}, observables={"drag": ("N", 0.05)},
        parameters={"a": (10.0, 1, 50, "N")}, units={"rough": "1"}, effects=[roughness],
    )  # fmt: skip
    speed = np.linspace(0.5, 3, 60)
    read = 12 * speed**2 * (1 + np.maximum(0.05 * (np.cbrt(450) - 10 * speed**-0.3), 0))
    read += np.random.default_rng(3).normal(0, 0.05, 60)
    path = tmp_path / "t.csv"
    rows = "".join(f"{s:.6g},{y:.5g}\n" for s, y in zip(speed, read, strict=True))
    path.write_text("speed,drag\n" + rows, encoding="utf-8")
    found = diagnose(base_problem(model, read_tables(model, [path]).fitted))
    assert found.alternatives == (("roughness",),)


def test_the_size_at_which_an_effect_does_nothing_is_none_to_start_from():
    """Between the ends of a range lies nothing, where what is integrated differs by the steps of the solver only."""

    class Turning(_ShapeGrid):
        def _units(self, name, values, held):
            return [np.array([np.cos(9 * v), np.sin(9 * v)]) for v in values]

    bend = SimpleNamespace(
        amplitudes=("size",), shapes=(), plausible=lambda name: (-1.0, 1.0), neutral=lambda name: 0.0,
        parameter=lambda name: SimpleNamespace(si=SimpleNamespace(default=0.5)),
    )  # fmt: skip
    sizes = Turning(None, bend, 60).sizes()
    assert len(sizes) > 3
    assert all(abs(size) > 1e-3 for size in sizes)
