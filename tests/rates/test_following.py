"""A recording that a model is far from is found by states that follow it; the truth is by scipy's LSODA."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from specan import Study
from specan.models import Model, Parameter, Signal, State
from specan.study.observation.following import following
from tests.rates.test_solver import cubic_spring, oscillator

MASS, STIFFNESS, DAMPING, CUBIC = 1.3, 1.4e4, 9.0, 5e8
TIME = np.arange(8192) / 2048


@pytest.fixture(scope="module")
def recorded():
    """A spring that hardens to nearly three times its force: a linear one is off by most of the motion."""
    random = np.random.default_rng(1)
    spectrum, hz = np.fft.rfft(random.standard_normal(TIME.size)), np.fft.rfftfreq(TIME.size, TIME[1])
    force = np.fft.irfft(np.where((hz > 2) & (hz < 60), spectrum, 0), TIME.size)
    force *= 25 / force.std()
    at = CubicSpline(TIME, force)

    def rates(t, state):
        x, v = state
        return v, (at(t) - DAMPING * v - STIFFNESS * x - CUBIC * x**3) / MASS

    x = solve_ivp(rates, (0, TIME[-1]), (0, 0), "LSODA", TIME, rtol=1e-8, atol=1e-11, max_step=TIME[1]).y[0]
    noise = 0.004 * x.std() * random.standard_normal(x.size)
    return pd.DataFrame({"time": TIME, "force": force, "x": 1e3 * (x + noise)})


@pytest.mark.long
def test_parameters_are_found_from_a_fit_that_is_far_off(recorded):
    study = Study(oscillator([cubic_spring]), recorded)
    base = study.opened
    assert base.errors[0].rms > 0.5 * recorded["x"].std()
    problem = base.problem.with_uses(["cubic-spring"])
    found, chi2 = following(problem, base.best.values)
    expected = {
        "dv.mass": MASS,
        "spring.stiffness": STIFFNESS,
        "damper.damping": DAMPING,
        "cubic-spring.size": CUBIC,
    }
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=0.01)
    assert chi2 < 3 * TIME.size  # the recording has noise too
    assert following(problem, found) is None
    assert study.diagnose().effects == ("cubic-spring",)


@pytest.mark.long
def test_a_state_may_have_any_name_that_python_allows():
    """Air that is heated, ``c dT/dt = u - g T``, by the closed form of a step; the start of the fit is far off."""

    def dt_Air2(u, loss, capacity):
        return (u - loss) / capacity

    def loss(t_Air2, conductance):
        return conductance * t_Air2

    model = Model.from_rates(
        dt_Air2, loss,
        states={"t_Air2": State("K")}, inputs={"u": "W"}, observables={"t_Air2": Signal("K", 0.01)},
        parameters={"capacity": Parameter(1e3, "J/K", fixed=True), "conductance": (500, 1, 1e3, "W/K")},
        units={"loss": "W"},
    )  # fmt: skip
    time = np.arange(400.0)
    frame = pd.DataFrame({"time": time, "u": 1e3, "t_Air2": 100 * (1 - np.exp(-time / 100))})
    problem = Study(model, frame).opened.problem
    found, _ = following(problem, {"dt_Air2.capacity": 1e3, "loss.conductance": 500.0})
    assert found["loss.conductance"] == pytest.approx(10, rel=0.01)
