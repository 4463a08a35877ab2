"""Noise of recordings: its predictor against that of Kalman, and models that lack nothing beside it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are, toeplitz
from scipy.signal import lfilter
from scipy.stats import invgamma, multivariate_normal

from specan.models import Model, Signal, State
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import covariance, fit, intervals_95
from specan.study.evidence.diagnosis import larger_noise
from specan.study.evidence.noise import own_noises
from specan.study.observation.time import (
    Noise,
    TimeObservation,
    coloured,
    excess,
    innovations,
    ln_volume,
    of_process,
)
from specan.study.selection.candidates import base_problem
from tests.rates.runge_kutta import displacement, halves
from tests.rates.test_solver import cubic_spring, damper, dv, dx, spring

RATE, COUNT = 500.0, 1000
STEP = expm(np.array([[0, 1], [-1e4, -20.0]]) / RATE)  # mass 1 kg, stiffness 1e4 N/m, damping 20 N s/m


def test_the_predictor_errs_as_that_of_kalman():
    """Displacement of an oscillator that random kicks drive, under white noise: the variance of the innovations."""
    kick, noise = 0.02, 2e-5
    rng = np.random.default_rng(3)
    covariance = solve_discrete_are(
        STEP.T, np.array([[1.0], [0.0]]), np.diag([1e-30, kick**2]), np.array([[noise**2]])
    )
    expected = covariance[0, 0] + noise**2
    response = np.array([np.linalg.matrix_power(STEP, k)[0, 1] for k in range(1000)])
    moved = lfilter(response, [1.0], kick * rng.standard_normal(60000))[1000:]
    y = moved + noise * rng.standard_normal(moved.size)
    share = kick**2 * float(response @ response) / (kick**2 * float(response @ response) + noise**2)
    rows = np.arange(y.size)
    left = innovations(y / np.std(y), [rows], of_process(response, share))
    gain = np.prod(1 - np.square(of_process(response, share)))  # of unit variance where y is
    assert np.var(left) * gain * np.var(y) == pytest.approx(expected, rel=0.03)


def observed(model, rng, disturbed, coloured, size=0.0, stated=()):
    """A recording of a force in closed form; exact to 1e-4 mm."""
    time, fine = np.arange(COUNT) / RATE, halves(RATE, COUNT, 4)
    lines = 2 * np.pi * np.arange(2, 40, 0.33)
    force = np.cos(np.outer(fine, lines) + rng.uniform(0, 6, lines.size)).sum(axis=1)
    force *= 30 / np.std(force[::8])
    push = force + np.interp(fine, time, disturbed * rng.standard_normal(COUNT))
    y = 1e3 * displacement(push, RATE, 4, lambda f, x, v: f - 1e4 * x - 20 * v - size * x**3)
    own = rng.standard_normal(COUNT)
    y += 0.05 * lfilter([np.sqrt(1 - coloured**2)], [1, -coloured], own)
    given = {"time": time, "force_channel": force[::8]}
    rows = np.arange(COUNT)
    return TimeObservation(
        name="run", observable=np.full(COUNT, "x"), measured=y, conditions=given, covariance=np.full(COUNT, 0.05**2),
        recordings=("run",), recording=np.zeros(COUNT, dtype=np.intp), noise_dof=1.0, stated=stated,
        series=(given, np.zeros(COUNT, dtype=np.intp)), position=rows, lines=rows + 1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def model():
    from specan import shelf

    kept = ("dry-friction", "backlash", "viscous-friction", "tuned-mass", "maxwell-element", "bouc-wen")
    on_spring = shelf.mechanics(force=("spring", 60, "N"), x=("x", 6e-3, "m"), v=("v", 0.6, "m/s"))
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm")},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "mass": (1.0, 0.1, 10, "kg"),
            "damping": (20.0, 1, 200, "N*s/m")},
        units={"spring": "N", "damper": "N"},
        effects=[cubic_spring, *(e for e in on_spring if e.name in kept)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        (("x",), "4 times as large as declared"),
        ((), "4 times as large as estimated from its fastest changes"),
    ],
)
def test_a_larger_noise_is_compared_with_what_it_is_larger_than(model, stated, words):
    seen = observed(model, np.random.default_rng(0), 0.0, 0.9, stated=stated)
    coloured = lfilter([1.0], [1, -0.9], np.random.default_rng(2).standard_normal(COUNT))
    seen = seen.with_noise_of(4.0 * coloured / np.sqrt(np.mean(coloured**2)), {})
    assert words in larger_noise(base_problem(model, [seen]))


@pytest.mark.long
@pytest.mark.parametrize(("disturbed", "coloured"), [(3.0, 0.0), (0.0, 0.9)])
def test_nothing_is_named_beside_noise_of_any_form(model, disturbed, coloured):
    seen = observed(model, np.random.default_rng(0), disturbed, coloured, stated=("x",))
    found = diagnose(base_problem(model, [seen]))
    assert (found.verdict, found.alternatives) == ("nothing-missing", ())
    # a large force moves the mass by more than the 0.05 mm that are declared; correlation makes no noise larger
    assert any("times as large as declared" in text for text in found.remarks) == (disturbed > 1)


@pytest.mark.long
def test_an_effect_is_named_beside_a_force_that_nobody_measured(model):
    seen = observed(model, np.random.default_rng(1), 3.0, 0.0, size=2e7)
    found = diagnose(base_problem(model, [seen]))
    assert found.alternatives == (("cubic-spring",),)


@pytest.mark.long
def test_what_no_candidate_describes_is_no_noise(model):
    """A spring that hardens, for which there is no candidate: what is left answers to the force."""
    seen = observed(model, np.random.default_rng(2), 0.0, 0.0, size=2e7)
    poor = Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm")},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "mass": (1.0, 0.1, 10, "kg"),
            "damping": (20.0, 1, 200, "N*s/m")},
        units={"spring": "N", "damper": "N"},
        effects=[e for n, e in model.effects.items() if n in ("viscous-friction", "dry-friction")],
    )  # fmt: skip
    found = diagnose(base_problem(poor, [seen]))
    assert found.verdict == "unknown-effect"


@pytest.mark.parametrize("reflections", [(), (0.9,), (0.9, -0.3, 0.2)])
def test_what_has_the_innovations_of_rows_is_the_rows(reflections):
    rows = np.random.default_rng(1).standard_normal((50, 2))
    assert coloured(innovations(rows, [np.arange(50)], reflections), reflections) == pytest.approx(rows)


def test_each_explanation_has_the_likeliest_noise_of_its_own():
    """A noise with a memory of 0.99, whitened as one of 0.95: ln of its likelihood is that of the rows at first."""
    rng, rows = np.random.default_rng(1), np.arange(COUNT)
    own = 5 * lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], rng.standard_normal(COUNT))
    before = Noise("autoregressive", (0.95,), 1)
    seen = replace(observed(None, rng, 0.0, 0.0), noise={"x": before}, covariance=np.ones(COUNT))
    whitened = innovations(own, [rows], before.reflections)
    (found,) = own_noises(SimpleNamespace(observations=[seen]), whitened)
    assert found.reflections[0] == pytest.approx(0.99, abs=0.01)
    left = found.innovations(whitened)
    matrix = found.size**2 * toeplitz(found.reflections[0] ** rows.astype(float))
    expected = multivariate_normal.logpdf(own, cov=matrix) + 0.5 * COUNT * np.log(2 * np.pi)
    told = -0.5 * left @ left + found.ln_volume + ln_volume([rows], before.reflections)
    assert told == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("doubtful", [1.0, 100.0])
def test_noise_beyond_what_is_stated_is_likelier_something_else(model, doubtful):
    """A variance 100 times that which ten degrees of freedom tell: scipy's density of that over one of any size."""
    seen = replace(observed(model, np.random.default_rng(0), 0.0, 0.0), noise_dof=10.0)
    seen = replace(seen, noise={"x": Noise("autoregressive", (0.5,), 1, 10.0)})
    known = invgamma.logpdf(100, 5, scale=5) + np.log(100)
    expected = np.log(1 / np.log(1e6)) - known if doubtful < 10 else 0.0
    prediction = seen.measured - 10.0
    assert seen.ln_not_noise(prediction, np.full(COUNT, doubtful)) == pytest.approx(expected)


@pytest.mark.long
@pytest.mark.parametrize("runs_away", [True, False])
def test_what_lies_in_few_samples_is_no_noise(model, runs_away):
    """A displacement that runs away to 40 m, as 1 / (t0 - t); or one sample of a sensor that fails."""
    seen = observed(model, np.random.default_rng(3), 0.0, 0.0)
    away = 0.04 / np.maximum((601 - np.arange(601.0)) / RATE, 1e-6) if runs_away else 20.0
    there = slice(0, 601) if runs_away else slice(600, 601)
    measured = seen.measured.copy()
    measured[there] += away
    found = diagnose(base_problem(model, [replace(seen, measured=measured)]))
    assert found.verdict == "cannot-tell"
    assert "around 1.2 s of run" in found.reason
    aside = np.abs(np.arange(COUNT) - 600) > 100
    left = replace(seen, measured=measured).take(aside)
    assert runs_away or diagnose(base_problem(model, [left])).verdict == "nothing-missing"


@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda x, t: x + 0.2 * np.sin(2 * np.pi * 50.04 * t) + 0.1 * np.sin(2 * np.pi * 150.12 * t),
            "at 50 Hz and multiples",
        ),
        (lambda x, t: np.minimum(x, np.quantile(x, 0.98)), "stays at its largest value"),
    ],
)
def test_hum_and_samples_that_were_cut_off_are_faults_of_the_data(model, spoil, words):
    seen = observed(model, np.random.default_rng(4), 0.0, 0.0, size=2e7)
    spoilt = replace(seen, measured=spoil(seen.measured, np.arange(COUNT) / RATE))
    found = diagnose(base_problem(model, [spoilt]))
    assert found.verdict == "faulty-data"
    assert words in found.reason
    assert "cubic-spring" in found.alternatives[0]


def test_scores_under_noise_that_follows_itself_as_by_its_whole_matrix():
    """J'(R - 1)J with R = 0.9^|i - j|, two chains."""
    columns = np.random.default_rng(1).standard_normal((300, 2))
    chains = [np.arange(200), np.arange(200, 300)]
    lags = np.abs(np.subtract.outer(np.arange(300), np.arange(300)))
    apart = np.not_equal.outer(np.arange(300) < 200, np.arange(300) < 200)
    matrix = np.where(apart, 0.0, 0.9**lags) - np.eye(300)
    assert excess(columns, chains, [0.9]) == pytest.approx(columns.T @ matrix @ columns, rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(("disturbed", "coloured"), [(0.0, 0.0), (0.0, 0.95), (3.0, 0.0)])
def test_intervals_hold_the_truth_beside_noise_that_follows_itself(disturbed, coloured):
    """Monte Carlo: of 95 % intervals at least 85 % hold (three standard errors); those of white noise hold fewer."""
    model = Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm", 0.05)}, units={"spring": "N", "damper": "N"},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"), "mass": (1, 0.1, 10, "kg")},
    )  # fmt: skip
    truth = {"spring.stiffness": 1e4, "damper.damping": 20.0, "dv.mass": 1.0}
    held, as_white, recordings = [], [], 40
    for seed in range(recordings):
        rng = np.random.default_rng([seed, int(disturbed), int(100 * coloured)])
        problem = base_problem(model, [observed(model, rng, disturbed, coloured)])
        found = fit(problem, starts=1)
        white = replace(found, covariance=covariance(found.jacobian, problem.scale))
        for one, count in ((found, held), (white, as_white)):
            ends = intervals_95(problem, one)
            count += [ends[name][0] <= value <= ends[name][1] for name, value in truth.items()]
    assert np.mean(held) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / recordings)
    assert coloured + disturbed == 0 or np.mean(as_white) < 0.85
