"""The statistics behind a verdict against closed forms and against simulation with fixed seeds."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from specan.study.estimation.fit import misfit_p_value
from specan.study.estimation.linear import Projection
from specan.study.estimation.prediction_error import blocks
from specan.study.evidence.law_search import gain_of


def test_lack_of_fit_allows_for_a_noise_that_is_itself_estimated():
    rng = np.random.default_rng(7)
    chi2 = rng.chisquare(40, 20_000) / (rng.chisquare(15, 20_000) / 15)
    p = np.array([misfit_p_value(c, 40, 15) for c in chi2[:5000]])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("dispersion", [1.0, 3.0])
def test_the_evidence_of_a_law_is_the_ratio_of_two_normal_densities(dispersion):
    """Parameters of the model with a prior of 1e4 deviations, and the law's of one, integrated out in closed form."""
    rng = np.random.default_rng(8)
    x = np.linspace(-1, 1, 20)
    own, law = np.column_stack([np.ones(20), x]), np.column_stack([3 * x**2, x**3])
    data = 2 * x**2 + np.sqrt(dispersion) * rng.standard_normal(20)
    linear = Projection.of(data - own @ np.linalg.lstsq(own, data, rcond=None)[0], own)
    without = dispersion * np.eye(20) + 1e8 * own @ own.T
    wide = [multivariate_normal(np.zeros(20), cov) for cov in (without + law @ law.T, without)]
    want = wide[0].logpdf(data) - wide[1].logpdf(data)
    assert gain_of(linear, law, dispersion) == pytest.approx(want, rel=1e-4)


def test_a_variable_with_two_levels_is_no_block():
    assert blocks({"side": np.array([0, 1, 0, 1])}) == []
    many = blocks({"frequency": np.arange(1000.0)})
    assert len(many) == 12
    assert np.array_equal(np.sort(np.concatenate(many)), np.arange(1000))
