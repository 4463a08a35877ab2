"""Laws of chi-square and F, roots and bounded steps: held to scipy, whose libraries take long to load."""

import math

import numpy as np
import pytest
from scipy import special
from scipy.optimize import brentq, lsq_linear
from scipy.sparse.csgraph import minimum_spanning_tree

from specan.study.estimation.distributions import noncentral, quantile, root, tail
from specan.study.estimation.linear import held_inside
from specan.study.selection.significance import _spanning_tree

NOISE = [3.0, 10.0, 78.0, 250.5, 5000.0, math.inf]


@pytest.mark.parametrize("noise_dof", NOISE)
@pytest.mark.parametrize("dof", [0.5, 1, 2, 3, 7, 30, 172.3, 1000, 20000])
def test_the_tail_is_that_of_chi_square_and_of_f(dof, noise_dof) -> None:
    for value in [1e-3, 0.1, 0.5, 0.9, 1.0, 1.1, 1.5, 2.0, 4.0, 10.0, 50.0]:
        chi2 = math.isinf(noise_dof)
        known = special.chdtrc(dof, dof * value) if chi2 else special.fdtrc(dof, noise_dof, value)
        assert tail(value, dof, noise_dof) == pytest.approx(known, rel=2e-10, abs=1e-290)


@pytest.mark.parametrize("noise_dof", NOISE)
@pytest.mark.parametrize("dof", [1, 2, 3, 7])
def test_the_quantile_undoes_the_tail(dof, noise_dof) -> None:
    for chance in [0.9, 0.5, 0.05, 1e-3, 1e-7]:
        known = (
            special.chdtri(dof, chance) / dof
            if math.isinf(noise_dof)
            else special.fdtri(dof, noise_dof, 1 - chance)
        )
        assert quantile(chance, dof, noise_dof) == pytest.approx(known, rel=1e-8)


@pytest.mark.parametrize("noise_dof", [10.0, 78.0, 250.5, math.inf])
@pytest.mark.parametrize("dof", [1, 2, 3, 7, 150])
def test_noncentral_laws(dof, noise_dof) -> None:
    for noncentrality in [0.0, 0.1, 3.0, 20.0, 100.0, 1000.0, 8000.0]:
        for share in [0.25, 0.5, 1.0, 2.0]:
            value = share * (dof + noncentrality) / dof
            known = (
                special.chndtr(dof * value, dof, noncentrality)
                if math.isinf(noise_dof)
                else special.ncfdtr(dof, noise_dof, noncentrality, value)
            )
            for least, most in ((0.0, 2 * noncentrality + 10), (noncentrality, noncentrality)):
                found = noncentral(value, dof, noise_dof, least, most)(noncentrality)
                assert found == pytest.approx(known, abs=1e-9)


@pytest.mark.parametrize("close", [2e-12, 1e-4])
@pytest.mark.parametrize(
    ("function", "low", "high"),
    [
        (math.cos, 1.0, 2.0),
        (lambda x: x**3 - 2 * x - 5, 0.0, 5.0),
        (lambda x: math.exp(x) - 1e5, 0.0, 30.0),
    ],
)
def test_roots_are_found_as_brent_finds_them(function, low, high, close) -> None:
    asked: list[float] = []
    known, told = brentq(function, low, high, xtol=close, full_output=True)
    assert root(lambda x: asked.append(x) or function(x), low, high, close) == known
    assert len(asked) == told.function_calls


def test_a_step_inside_bounds_is_the_best_one() -> None:
    generator = np.random.default_rng(1)
    for _ in range(300):
        count = generator.integers(1, 9)
        columns = generator.standard_normal((count + generator.integers(0, 20), count))
        columns *= 10.0 ** generator.uniform(-1, 1, count)
        residual = generator.standard_normal(len(columns))
        low = -generator.exponential(0.3, count) * (generator.random(count) < 0.8)
        high = generator.exponential(0.3, count) * (generator.random(count) < 0.8) + 1e-300
        found = held_inside(columns, residual, low, high)
        known = lsq_linear(columns, -residual, (low, high), method="bvls", tol=1e-14)
        assert np.all((low <= found) & (found <= high))
        assert np.sum((residual + columns @ found) ** 2) <= 2 * known.cost * (1 + 1e-9)


def test_the_spanning_tree_is_the_shortest() -> None:
    places = np.random.default_rng(2).standard_normal((40, 3))
    lengths = np.linalg.norm(places[:, None] - places, axis=-1)
    edges, (one, other) = _spanning_tree(lengths)
    np.testing.assert_allclose(np.sort(edges), np.sort(minimum_spanning_tree(lengths).data))
    np.testing.assert_array_equal(edges, lengths[one, other])
