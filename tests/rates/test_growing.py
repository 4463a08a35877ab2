"""A recording that a model is far from is found by fits that grow with it; the truth is by scipy's LSODA."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from specan import Study
from specan.models import Model, Signal, State
from specan.study.estimation.growing import growing
from tests.rates.test_solver import cubic_spring, damper, dv, dx, oscillator, spring

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
    found = growing(problem, base.best.values)
    expected = {
        "dv.mass": MASS,
        "spring.stiffness": STIFFNESS,
        "damper.damping": DAMPING,
        "cubic-spring.size": CUBIC,
    }
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=0.01)
    assert growing(problem, found) is None
    assert study.diagnose().effects == ("cubic-spring",)


@pytest.mark.long
def test_a_force_that_alone_is_measured_leads_to_the_effect(recorded):
    """The force of the same spring in place of its displacement: no state is measured."""

    def holder(spring):
        return spring

    model = Model.from_rates(
        dx, dv, spring, damper, holder,
        states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"}, observables={"holder": Signal("N")},
        parameters={
            "stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"), "mass": (1, 0.1, 10, "kg"),
        },
        units={"spring": "N", "damper": "N", "holder": "N"}, effects=[cubic_spring],
    )  # fmt: skip
    x = recorded.pop("x") / 1e3
    frame = recorded.assign(holder=STIFFNESS * x + CUBIC * x**3)
    assert Study(model, frame).diagnose().effects == ("cubic-spring",)
