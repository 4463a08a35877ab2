"""The exponential average against scipy's recursive filter."""

import itertools
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from specan.dsp.time_weighting import TimeWeighting


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


@pytest.mark.parametrize("tau", [0.002, 0.125, 1.0])
@pytest.mark.parametrize("kind", ["noise", "steady", "not finite"])
def test_the_averages_found_on_demand_are_those_of_all(tau: float, kind: str) -> None:
    rng = np.random.default_rng(5)
    all_of_them, some = TimeWeighting(4, 800.0, tau), TimeWeighting(4, 800.0, tau)
    factor, nothing = np.array([1.0, 2.0, 4.0, 0.5]), np.full(4, np.nan)
    for n in (1, 5, 16, 33, 400, 1000):
        x = np.ones((4, n)) if kind == "steady" else rng.random((4, n)) ** 6
        if kind == "not finite" and n == 400:
            x[2, 100] = np.nan
        before = all_of_them._state.copy()
        y, found = all_of_them(x, factor), some.sparse(x, factor)
        np.testing.assert_allclose(found.at(np.arange(-1, n)), np.hstack([before, y]), rtol=1e-12)
        for span in (slice(0, n), slice(n // 3, n), slice(n // 3, 2 * n // 3 + 1)):
            lowest = np.fmin.reduce(y[:, span], axis=1)
            np.testing.assert_allclose(found.smallest(span, nothing), lowest, rtol=1e-12)
            # As if the signal had begun three intervals before the span.
            begun = before if span.start < 3 else y[:, [span.start - 3]]
            since = 0 if span.start < 3 else span.start - 2
            left = begun * math.exp(-1 / (800.0 * tau)) ** (np.arange(n)[span] - since + 1)
            highest = np.fmax.reduce(y[:, span] - left, axis=1)
            # A first value may be all rounding: what is left of the difference of two equal numbers.
            np.testing.assert_allclose(
                found.largest(span, nothing, begun, -since), highest, rtol=1e-9, atol=1e-12
            )
