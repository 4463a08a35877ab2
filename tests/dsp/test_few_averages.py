"""Student's factor and the logarithm of a chi-square, against tables, closed forms and drawn values."""

import numpy as np
import pytest
from scipy.special import digamma, polygamma, stdtrit

from specan.dsp.transfer_function import noise_freedom, smoothed_noise
from specan.dsp.welch import log_bias, log_variance, student_factor


@pytest.mark.parametrize(
    ("nu", "t_95"), [(1, 12.71), (2, 4.30), (4, 2.78), (6, 2.45), (10, 2.23), (50, 2.01)]
)
def test_quantiles_are_those_of_the_guide(nu, t_95):
    """JCGM 100:2008, table G.2, p = 95 %."""
    assert 1.959964 * student_factor(nu) == pytest.approx(t_95, abs=0.005)


@pytest.mark.parametrize("nu", [0.2, 1.0, 1.5, 2.0, 3.7, 9.0, 40.0, 199.0, 201.0, 1e4, 1e8])
def test_quantiles_are_those_of_another_program(nu):
    assert student_factor(nu) == pytest.approx(stdtrit(nu, 0.975) / 1.959963984540054, rel=1e-9)


def test_two_degrees_of_freedom_have_a_closed_form():
    """F(t) = 1/2 + t / (2 sqrt(2 + t^2))."""
    t = 1.959963984540054 * float(student_factor(2.0))
    assert 0.5 + t / (2 * np.sqrt(2 + t**2)) == pytest.approx(0.975, abs=1e-14)


@pytest.mark.parametrize("n", [0.05, 0.8, 3.0, 11.9, 250.0, 1e6])
def test_logarithms_are_those_of_another_program(n):
    assert log_bias(n) == pytest.approx(digamma(n) - np.log(n), rel=1e-9)
    assert log_variance(n) == pytest.approx(polygamma(1, n), rel=1e-12)


def test_no_freedom_and_no_end_of_it():
    assert student_factor([0, np.inf, np.nan]).tolist()[:2] == [np.inf, 1.0]
    assert np.isnan(student_factor(np.nan))


def test_logarithm_of_one_and_two_averages_in_closed_form():
    euler = 0.5772156649015329
    np.testing.assert_allclose(log_bias([1, 2]), [-euler, 1 - euler - np.log(2)], rtol=1e-12)
    np.testing.assert_allclose(log_variance([1, 2]), [np.pi**2 / 6, np.pi**2 / 6 - 1], rtol=1e-12)


@pytest.mark.parametrize("freedom", [1.0, 2.5, 9.0])
def test_smoothed_noise_has_no_bias_and_the_freedom_that_is_stated(freedom):
    """A scaled chi-square of nu degrees of freedom has the relative variance 2 / nu; here lines are independent."""
    noise = np.random.default_rng(5).gamma(freedom, 3.0 / freedom, (4000, 40))
    smooth = smoothed_noise(noise, freedom)
    stated = noise_freedom(noise, smooth, freedom, 0.0)
    middle = (smooth != noise)[:, 20]
    assert np.exp(np.mean(np.log(smooth[middle, 20]))) == pytest.approx(3.0, rel=0.03)
    assert np.var(np.log(smooth[middle, 20])) == pytest.approx(2 / stated[middle, 20][0], rel=0.08)
    kept = smooth == noise
    np.testing.assert_allclose(stated[kept], 2 * freedom)
