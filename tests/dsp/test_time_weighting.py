"""The exponential average against scipy's recursive filter."""

import itertools
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from specan.dsp.weighting import TimeWeighting


@pytest.mark.parametrize(("rate", "tau"), [(51200.0, 0.125), (12.5, 0.125), (1.0, 0.035), (3200.0, 1.0)])
def test_it_is_the_recursive_filter_whatever_the_pieces(rate: float, tau: float) -> None:
    x = np.square(np.random.default_rng(3).standard_normal((2, 20000)))
    x[:, :700] *= 1e12  # a loud beginning is not to be heard in the silence behind it
    x[:, 15000:] *= 1e-12
    keep = math.exp(-1.0 / (rate * tau))
    expected = lfilter([1.0 - keep], [1.0, -keep], x, axis=1)
    weighting = TimeWeighting(2, rate, tau)
    edges = [0, 1, 1300, 9000, 20000]
    found = np.concatenate([weighting(x[:, a:b]) for a, b in itertools.pairwise(edges)], axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_what_is_not_finite_stays_so() -> None:
    x = np.ones((2, 5000))
    x[0, 100] = np.nan
    found = TimeWeighting(2, 1000.0, 0.125)(x)
    assert np.isfinite(found[0, :100]).all()
    assert np.isnan(found[0, 100:]).all()
    assert np.isfinite(found[1]).all()
