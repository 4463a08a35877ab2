"""Fits against certified values: the nonlinear regressions of the Statistical Reference Datasets of NIST."""

import numpy as np
import pytest
from nist_strd import DATA, ENOUGH, read, residual_sd, scored, with_scipy, with_specan

from specan.models import Model
from specan.study.estimation.fit import fit
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import base_problem

NAMES = sorted(path.stem for path in DATA.glob("*.dat"))

# Its residuals, 9e-14, are the rounding of doubles near 1: their standard deviation has three digits in doubles,
# and so have standard errors that are scaled by it: 2.9 to 3.7 digits, by how rounding falls (MINPACK 3.3 and 3.5).
ROUNDED = "Lanczos1"


def test_all_regressions_of_nist_are_here():
    assert len(NAMES) == 27


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", NAMES)
def test_six_certified_digits_from_both_starts(name, start):
    case = read(DATA / f"{name}.dat")
    parameters, errors, errors_at_certified_scale = scored(case, case.starts[start], with_specan)
    assert parameters >= ENOUGH
    assert errors_at_certified_scale >= ENOUGH
    assert errors >= (2.5 if name == ROUNDED else ENOUGH)


@pytest.mark.long
def test_at_least_as_many_as_minpack_reaches():
    for start in (0, 1):
        counts = {}
        for run in (with_specan, with_scipy):
            cases = [read(DATA / f"{name}.dat") for name in NAMES]
            counts[run] = sum(min(scored(c, c.starts[start], run)[:2]) >= ENOUGH for c in cases)
        assert counts[with_specan] >= counts[with_scipy]


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_digits_do_not_depend_on_how_uncertain_the_data_are_said_to_be(factor):
    case = read(DATA / "Rat43.dat")
    model = Model.from_function(
        case.function(), conditions={"x": "1"}, observables={"y": "1"},
        parameters=dict(zip(case.names, map(float, case.starts[0]), strict=True)), name="rat",
    )  # fmt: skip
    rows = TableObservation(
        "rat", np.full(case.y.size, "y"), case.y, case.predictors, factor**2 * np.eye(case.y.size),
    )  # fmt: skip
    found = fit(base_problem(model, (rows,)))
    assert found.names == tuple(f"y.{n}" for n in case.names)
    assert found.theta == pytest.approx(case.certified, rel=1e-6)
    errors = residual_sd(case, found.theta) / factor * np.sqrt(np.diag(found.covariance))
    assert errors == pytest.approx(case.errors, rel=1e-6)
