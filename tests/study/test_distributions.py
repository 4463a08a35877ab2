"""Laws of chi-square and F against closed forms; bounded steps and trees against scipy."""

import math

import numpy as np
import pytest
from scipy import special
from scipy.sparse.csgraph import minimum_spanning_tree

from specan.study.estimation.distributions import noncentral, quantile, tail
from specan.study.selection.significance import _spanning_tree


@pytest.mark.parametrize("chance", [1e-320, 1e-300, 1e-100, 1e-10, 0.05, 0.5])
def test_the_quantile_of_one_degree_of_freedom_is_that_of_a_normal_law_squared(chance) -> None:
    normal = special.ndtri_exp(math.log(chance) - math.log(2)) ** 2
    assert quantile(chance, 1) == pytest.approx(normal, rel=1e-6)
    assert tail(normal, 1) == pytest.approx(chance, rel=1e-6 if chance > 1e-307 else 0.01)


def test_the_quantile_of_f_is_also_right_far_out() -> None:
    # F with 2 and n degrees of freedom is above x with probability (1 + 2 x / n)^(-n / 2).
    for chance in (1e-200, 1e-7, 0.3):
        known = 39 * (chance ** (-1 / 39) - 1)
        assert quantile(chance, 2, 78) == pytest.approx(known, rel=1e-9)
        assert tail(known, 2, 78) == pytest.approx(chance, rel=1e-9)


@pytest.mark.parametrize("noncentrality", [2.0, 300.0, 4e8])
def test_the_noncentral_law_is_that_of_a_shifted_normal_variable(noncentrality) -> None:
    shift = math.sqrt(noncentrality)
    value = (shift + 0.3) ** 2
    known = special.ndtr(0.3) - special.ndtr(-2 * shift - 0.3)
    assert noncentral(value, 1, math.inf, noncentrality) == pytest.approx(known, abs=2e-5)
    assert noncentral(value, 1, 1e7, noncentrality) == pytest.approx(known, abs=1e-4) or noncentrality > 1e3


def test_the_spanning_tree_is_the_shortest() -> None:
    places = np.random.default_rng(2).standard_normal((40, 3))
    lengths = np.linalg.norm(places[:, None] - places, axis=-1)
    edges, (one, other) = _spanning_tree(lengths)
    np.testing.assert_allclose(np.sort(edges), np.sort(minimum_spanning_tree(lengths).data))
    np.testing.assert_array_equal(edges, lengths[one, other])
