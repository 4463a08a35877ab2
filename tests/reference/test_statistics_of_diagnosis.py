"""The statistics behind a verdict against closed forms and against simulation with fixed seeds."""

import numpy as np
import pytest
from scipy import stats

from specan.study.estimation.linear import Projection, orthonormal
from specan.study.selection.acceptance import blocks, left_out_score
from specan.study.selection.significance import (
    MultipleTestingFamily,
    detectable_noncentrality,
    improvement_probability,
    lack_of_fit_probability,
    needed_reduction,
)


def arc(length: float, count: int = 200) -> np.ndarray:
    """Directions along a great circle."""
    s = np.linspace(0, length, count)
    return np.vstack([np.cos(s), np.sin(s)])


def simulated_probability(family: MultipleTestingFamily, p_value: float, draws: int, seed: int) -> float:
    """Share of draws of white noise, projected on all directions, whose smallest p-value is at most `p_value`."""
    generator = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(family.directions.T @ family.directions)
    keep = values > 1e-10 * values[-1]
    mixing, hits = vectors[:, keep] * np.sqrt(values[keep]), 0
    for _ in range(draws // 1000):
        z = generator.standard_normal((1000, mixing.shape[1])) @ mixing.T
        single = np.where(family.one_sided, stats.norm.sf(z), 2 * stats.norm.sf(np.abs(z)))
        hits += int(np.sum(single.min(axis=1) <= p_value))
    return (hits + 1) / (draws + 1) + family.subspaces * p_value


@pytest.mark.parametrize("length", [0.3, 1.0, 2.0])
def test_a_shape_scan_costs_what_davies_says(length):
    # On a circle the level-crossing bound is exact: P = 2 Phi(-c) + L/pi exp(-c^2/2).
    p = 1e-3
    level = stats.norm.isf(p / 2)
    family = MultipleTestingFamily(arc(length), np.zeros(200, bool))
    want = p + length / np.pi * np.exp(-(level**2) / 2)
    assert family.probability(p) == pytest.approx(want, rel=1e-6)
    assert simulated_probability(family, p, 200_000, seed=1) == pytest.approx(want, rel=0.12)


def test_one_sided_shape_scan_costs_half_of_it():
    p, length = 1e-3, 1.5
    level = stats.norm.isf(p)
    family = MultipleTestingFamily(arc(length), np.ones(200, bool))
    want = p + length / (2 * np.pi) * np.exp(-(level**2) / 2)
    assert family.probability(p) == pytest.approx(want, rel=1e-6)
    assert simulated_probability(family, p, 200_000, seed=2) == pytest.approx(want, rel=0.12)


def test_the_family_bound_holds_for_any_directions_and_is_close():
    rng = np.random.default_rng(3)
    mixing = rng.standard_normal((6, 40)) @ np.diag(np.linspace(0.2, 2, 40))
    directions = orthonormal(rng.standard_normal((50, 6))) @ mixing
    directions /= np.linalg.norm(directions, axis=0)
    family = MultipleTestingFamily(directions, rng.random(40) < 0.3)
    for p in (1e-2, 1e-3):
        bound, simulated = family.probability(p), simulated_probability(family, p, 100_000, seed=4)
        assert simulated < 1.05 * bound
        assert bound < 40 * p  # cheaper than counting every direction


def test_orthogonal_tests_add_up_and_equal_ones_count_once():
    apart = MultipleTestingFamily(np.eye(12), np.zeros(12, bool), subspaces=3)
    assert apart.probability(1e-4) == pytest.approx(15e-4)
    same = MultipleTestingFamily(np.tile(np.eye(12)[:, :1], 7), np.zeros(7, bool))
    assert same.probability(1e-4) == pytest.approx(1e-4, rel=1e-3)


def test_improvement_is_an_f_test():
    assert improvement_probability(9.0, 2, dispersion=1.5, noise_dof=30) == pytest.approx(
        stats.f.sf(9.0 / 2 / 1.5, 2, 30)
    )
    assert improvement_probability(9.0, 2) == pytest.approx(stats.chi2.sf(9.0, 2))
    assert improvement_probability(9.0, 1, sided=1) == pytest.approx(stats.chi2.sf(9.0, 1) / 2)
    assert improvement_probability(-0.1, 1) == 1.0


def test_boundary_amplitude_follows_the_half_and_half_law():
    rng = np.random.default_rng(5)
    z = rng.standard_normal(200_000)
    fall = np.where(z > 0, z**2, 0.0)
    for threshold in (2.71, 6.63):
        want = improvement_probability(threshold, 1, sided=1)
        assert np.mean(fall > threshold) == pytest.approx(want, rel=0.1)


def test_pooling_the_degrees_of_freedom_keeps_the_level():
    # Noise from 8 replicate degrees, residual on 20: max(s^2, 1) is at least their pooled variance.
    rng = np.random.default_rng(6)
    n, nu, residual = 100_000, 8, 20
    noise = rng.chisquare(nu, n) / nu
    fall, rest = rng.chisquare(1, n) / noise, rng.chisquare(residual, n) / noise
    p = [
        improvement_probability(a, 1, dispersion=max(b / residual, 1.0), noise_dof=nu + residual)
        for a, b in zip(fall[:20_000], rest[:20_000])
    ]
    assert np.mean(np.array(p) < 0.01) < 0.01 * 1.2


def test_lack_of_fit_allows_for_a_noise_that_is_itself_estimated():
    rng = np.random.default_rng(7)
    chi2 = rng.chisquare(40, 20_000) / (rng.chisquare(15, 20_000) / 15)
    p = np.array([lack_of_fit_probability(c, 40, 15) for c in chi2[:5000]])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01)


def test_power_of_the_smallest_visible_size():
    level = 1e-3
    noncentrality = detectable_noncentrality(needed_reduction(level))
    power = stats.ncx2.sf(stats.chi2.isf(level, 1), 1, noncentrality)
    assert power == pytest.approx(0.8, abs=1e-4)
    assert noncentrality == pytest.approx((stats.norm.isf(level / 2) + stats.norm.ppf(0.8)) ** 2, rel=1e-4)


@pytest.mark.parametrize(("amplitudes", "dof"), [(1, 12), (1, 60), (2, 30)])
def test_power_of_the_smallest_visible_size_with_a_noise_that_is_estimated(amplitudes, dof):
    # Drawn: the gain of a noncentral chi-square over an independent estimate of the variance.
    level, rng = 1e-3, np.random.default_rng(9)
    gain = needed_reduction(level, amplitudes, dof)
    noncentrality = detectable_noncentrality(gain, amplitudes, dof)
    drawn = rng.noncentral_chisquare(amplitudes, noncentrality, 40_000) / (rng.chisquare(dof, 40_000) / dof)
    assert np.mean(drawn > gain) == pytest.approx(0.8, abs=0.01)
    assert improvement_probability(gain, amplitudes, noise_dof=dof) == pytest.approx(level, rel=1e-6)


def test_a_one_sided_amplitude_needs_a_smaller_gain():
    assert improvement_probability(needed_reduction(0.01, sided=1), 1, sided=1) == pytest.approx(
        0.01, rel=1e-6
    )


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
