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


@pytest.mark.parametrize(
    ("name", "at_three_quarters", "at_a_half"),
    [("rectangular", 75.0, 50.0), ("hann", 65.9, 16.7), ("hamming", 70.7, 23.5), ("blackman", 56.7, 9.0),
     ("blackman-harris", 46.0, 3.8)],
)  # fmt: skip
def test_correlation_of_overlapped_blocks_is_that_of_the_table_of_harris(
    name, at_three_quarters, at_a_half
) -> None:
    """F. J. Harris, On the use of windows for harmonic analysis with the DFT, Proc. IEEE 66 (1978), table 1."""
    found = 100 * window_correlation(name, [0.25, 0.5])
    np.testing.assert_allclose(found, [at_three_quarters, at_a_half], atol=0.2)  # of windows of 50 samples
