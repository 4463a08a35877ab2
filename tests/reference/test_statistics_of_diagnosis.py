"""The statistics behind a verdict against closed forms and against simulation with fixed seeds."""

import numpy as np
import pytest

from specan.study.estimation.fit import misfit_p_value
from specan.study.estimation.left_out import blocks, left_out_score
from specan.study.estimation.linear import Projection


def test_lack_of_fit_allows_for_a_noise_that_is_itself_estimated():
    rng = np.random.default_rng(7)
    chi2 = rng.chisquare(40, 20_000) / (rng.chisquare(15, 20_000) / 15)
    p = np.array([misfit_p_value(c, 40, 15) for c in chi2[:5000]])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01)


def test_left_out_blocks_equal_a_refit_without_them():
    rng = np.random.default_rng(8)
    x = np.repeat(np.arange(6.0), 4)
    jacobian = np.column_stack([np.ones(24), x, x**2])
    residual_of = rng.standard_normal(24)
    fit = np.linalg.lstsq(jacobian, residual_of, rcond=None)[0]
    linear = Projection.of(residual_of - jacobian @ fit, jacobian)
    left_out = blocks({"x": x})
    assert [list(b) for b in left_out][:2] == [[0, 1, 2, 3], [4, 5, 6, 7]]
    want = 0.0
    for rows in left_out:
        rest = np.setdiff1d(np.arange(24), rows)
        other = np.linalg.lstsq(jacobian[rest], residual_of[rest], rcond=None)[0]
        error = residual_of[rows] - jacobian[rows] @ other
        spread = np.eye(4) + jacobian[rows] @ np.linalg.solve(
            jacobian[rest].T @ jacobian[rest], jacobian[rows].T
        )
        want += error @ np.linalg.solve(spread, error) + np.linalg.slogdet(spread)[1]
    assert left_out_score(linear, left_out) == pytest.approx(want)


def test_cross_validation_takes_what_is_there_and_vetoes_what_is_not():
    rng = np.random.default_rng(9)
    x = np.repeat(np.linspace(-1, 1, 6), 5)
    base = np.column_stack([np.ones(30), x])
    more = np.column_stack([base, x**2])
    left_out = blocks({"x": x})

    def gain_of(data):
        fits = [Projection.of(data - j @ np.linalg.lstsq(j, data, rcond=None)[0], j) for j in (base, more)]
        return left_out_score(fits[0], left_out) - left_out_score(fits[1], left_out)

    assert gain_of(6 * x**2 + rng.standard_normal(30)) > 0
    assert np.mean([gain_of(rng.standard_normal(30)) > 0 for _ in range(200)]) < 0.3


def test_a_variable_with_two_levels_is_no_block():
    assert blocks({"side": np.array([0, 1, 0, 1])}) == []
    many = blocks({"frequency": np.arange(1000.0)})
    assert len(many) == 12
    assert np.array_equal(np.sort(np.concatenate(many)), np.arange(1000))
