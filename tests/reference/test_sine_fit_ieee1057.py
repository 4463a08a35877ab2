"""Sine fits: exact without noise for any number of cycles, at the Cramer-Rao bound with noise.

The bounds are those of a sine in white noise with unknown phase and frequency (Rife and Boorstyn, IEEE Trans. Inf.
Theory 20 (1974) 591-598), which the four-parameter fit of IEEE Std 1057 reaches asymptotically.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from specan.dsp.sine_fit import fit_frequency, fit_sine, peak_frequency

RATE = 1000.0


def wave(n, f, amplitude=1.0, phase=0.0, mean=0.0):
    return mean + amplitude * np.cos(2 * np.pi * f * np.arange(n) / RATE + phase)


@settings(max_examples=60)
@given(
    cycles=st.floats(1.3, 60.0),
    amplitude=st.floats(1e-6, 1e6),
    phase=st.floats(-3.1, 3.1),
    mean=st.floats(-10, 10),
)
def test_any_number_of_cycles(cycles, amplitude, phase, mean):
    n = 500
    fit = fit_sine(wave(n, cycles * RATE / n, amplitude, phase, mean * amplitude), RATE, cycles * RATE / n)
    assert abs(fit.phasors[0]) == pytest.approx(amplitude, rel=1e-9)
    assert np.angle(fit.phasors[0]) == pytest.approx(phase, abs=1e-9)
    assert fit.mean == pytest.approx(mean * amplitude, rel=1e-8, abs=1e-9 * amplitude)
    assert fit.residual_rms < 1e-9 * amplitude * (1 + abs(mean))


@settings(max_examples=40)
@given(cycles=st.floats(4.0, 200.0), phase=st.floats(-3.1, 3.1))
def test_frequency_is_found(cycles, phase):
    fit = fit_frequency(wave(1000, cycles, 2.0, phase, 5.0), RATE)
    assert fit.frequency_hz == pytest.approx(cycles, abs=1e-8)
    assert np.angle(fit.phasors[0]) == pytest.approx(phase, abs=1e-6)


def test_harmonics_are_fitted_along():
    x = wave(777, 33.3, 1.0, 0.4) + wave(777, 66.6, 0.2, -1.0) + wave(777, 99.9, 0.05, 2.0)
    fit = fit_sine(x, RATE, 33.3, harmonics=3)
    np.testing.assert_allclose(np.abs(fit.phasors), [1, 0.2, 0.05], rtol=1e-8)
    np.testing.assert_allclose(np.angle(fit.phasors), [0.4, -1, 2], atol=1e-8)


def test_harmonics_beyond_half_the_rate_are_left_out():
    assert fit_sine(wave(500, 180.0), RATE, 180.0, harmonics=10).phasors.shape == (2,)


def test_same_as_a_general_least_squares_program():
    rng = np.random.default_rng(2)
    x = wave(400, 20.37, 1.5, 0.8, 0.1) + 0.2 * rng.standard_normal(400)
    t = np.arange(400) / RATE
    expected, _ = curve_fit(
        lambda t, a, f, p, m: m + a * np.cos(2 * np.pi * f * t + p),
        t,
        x,
        [1.4, 20.3, 0.7, 0],
        ftol=1e-14,
        xtol=1e-14,
    )
    fit = fit_frequency(x, RATE)
    found = [abs(fit.phasors[0]), fit.frequency_hz, np.angle(fit.phasors[0]), fit.mean]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_cramer_rao_bounds():
    rng = np.random.default_rng(9)
    n, sigma, runs = 400, 0.1, 400
    fits = [
        fit_frequency(wave(n, 51.3, 1.0, 0.5) + sigma * rng.standard_normal(n), RATE) for _ in range(runs)
    ]
    frequency = np.std([f.frequency_hz for f in fits])
    amplitude = np.std([abs(f.phasors[0]) for f in fits])
    phase = np.std([np.angle(f.phasors[0]) for f in fits])
    assert frequency == pytest.approx(np.sqrt(6 * sigma**2 / (np.pi**2 * n**3)) * RATE, rel=0.12)
    assert amplitude == pytest.approx(sigma * np.sqrt(2 / n), rel=0.12)
    assert phase == pytest.approx(sigma * np.sqrt(8 / n), rel=0.12)


def test_rows_are_fitted_alone():
    rng = np.random.default_rng(3)
    x = rng.standard_normal((5, 300))
    together = fit_sine(x, RATE, 12.0, harmonics=3)
    alone = fit_sine(x[3], RATE, 12.0, harmonics=3)
    assert together.phasors[3].tobytes() == alone.phasors.tobytes()


def test_peak_within_a_range():
    x = wave(2000, 50.2, 10.0) + wave(2000, 120.4, 1.0)
    assert peak_frequency(x, RATE) == pytest.approx(50.2, abs=0.01)
    assert peak_frequency(x, RATE, 100.0, 150.0) == pytest.approx(120.4, abs=0.02)
    with pytest.raises(ValueError, match="no line"):
        peak_frequency(x, RATE, 100.1, 100.2)


@pytest.mark.parametrize("f", [0.0, 500.0, -3.0])
def test_frequency_out_of_range(f):
    with pytest.raises(ValueError, match="not between"):
        fit_sine(wave(100, 10), RATE, f)
