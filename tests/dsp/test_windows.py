import numpy as np
import pytest
from scipy import signal

from specan.dsp.windows import (
    WINDOWS,
    line_correlation,
    window,
    window_correlation,
    window_properties,
)

SCIPY = {"rectangular": "boxcar", "blackman-harris": "blackmanharris", "flat-top": "flattop"}


@pytest.mark.parametrize("name", WINDOWS)
@pytest.mark.parametrize("n", [64, 101])
def test_same_as_scipy(name, n):
    expected = signal.get_window(SCIPY.get(name, name), n, fftbins=True)
    np.testing.assert_allclose(window(name, n), expected, atol=1e-14)


@pytest.mark.parametrize("name", WINDOWS)
def test_properties_are_those_of_the_samples(name):
    n = 4096
    w, found = window(name, n), window_properties(name)
    assert found.coherent_gain == pytest.approx(w.mean(), rel=1e-12)
    assert found.enbw_lines == pytest.approx(n * np.sum(w**2) / np.sum(w) ** 2, rel=1e-12)
    outside = np.exp(2j * np.pi * found.half_lobe_lines * np.arange(n) / n)
    assert abs(np.sum(w * outside)) < 1e-9 * n


@pytest.mark.parametrize("name", WINDOWS)
@pytest.mark.parametrize("shift", [0.0, 0.1, 1 / 3, 0.5, 0.75, 1.2])
def test_correlation_is_that_of_the_samples(name, shift):
    n = 30000
    w, s = window(name, n), round(shift * n)
    expected = np.sum(w[s:] * w[: n - s]) / np.sum(w**2) if s < n else 0.0
    assert window_correlation(name, shift) == pytest.approx(expected, abs=1e-4)


def test_hann_neighbours_are_correlated_four_ninths():
    assert line_correlation("hann") == pytest.approx(4 / 9)
    assert line_correlation("rectangular") == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("name", WINDOWS)
def test_the_closed_form_of_the_correlation_is_that_of_a_sampled_window(name) -> None:
    n = 4096
    shape = window(name, n)
    lags = np.array([0, 1, 100, 1365, 2048, 4000, 4096])
    sampled = [np.sum(shape[lag:] * shape[: n - lag]) / np.sum(shape**2) for lag in lags]
    np.testing.assert_allclose(window_correlation(name, lags / n), sampled, atol=2e-5)
