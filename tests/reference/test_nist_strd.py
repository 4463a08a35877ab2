"""A fit against certified values: Misra1a of NIST's Statistical Reference Datasets (public domain), a nonlinear regression."""

import numpy as np
import pytest

from specan.models import Model
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import base_problem
from specan.study.observation.table import TableObservation

VOLUME = [
    10.07e0,
    14.73e0,
    17.94e0,
    23.93e0,
    29.61e0,
    35.18e0,
    40.02e0,
    44.82e0,
    50.76e0,
    55.05e0,
    61.01e0,
    66.40e0,
    75.47e0,
    81.78e0,
]
PRESSURE = [
    77.6e0,
    114.9e0,
    141.1e0,
    190.8e0,
    239.9e0,
    289.0e0,
    332.8e0,
    378.4e0,
    434.8e0,
    477.3e0,
    536.8e0,
    593.1e0,
    689.1e0,
    760.0e0,
]
CERTIFIED, ERRORS = (2.3894212918e02, 5.5015643181e-04), (2.7070075241, 7.2668688436e-06)
SQUARES = 1.2455138894e-01  # residual sum of squares


def volume(pressure, b1, b2):
    return b1 * (1 - np.exp(-b2 * pressure))


@pytest.mark.parametrize("start", [(500.0, 0.0001), (250.0, 0.0005)])
def test_misra1a_from_both_starts(start):
    model = Model.from_function(
        volume,
        conditions={"pressure": "1"},
        observables={"volume": "1"},
        parameters=dict(zip(("b1", "b2"), start)),
    )
    rows = TableObservation(
        "misra", np.full(14, "volume"), np.array(VOLUME), {"pressure": np.array(PRESSURE)}, np.eye(14),
        available=frozenset({"pressure"}),
    )  # fmt: skip
    found = fit(base_problem(model, (rows,)))
    assert found.names == ("volume.b1", "volume.b2")
    assert found.theta == pytest.approx(CERTIFIED, rel=1e-8)
    assert np.sqrt(found.chi2 / 12 * np.diag(found.covariance)) == pytest.approx(ERRORS, rel=1e-7)
    assert found.chi2 == pytest.approx(SQUARES, rel=1e-9)
