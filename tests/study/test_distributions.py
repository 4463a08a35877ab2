"""Laws of chi-square and F against closed forms; bounded steps and trees against scipy."""

import math

import pytest
from scipy import special

from specan.study.estimation.fit import quantile, tail


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
