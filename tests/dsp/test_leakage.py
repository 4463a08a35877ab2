"""What blocks take from a response, against the exact smoothing of responses in closed form."""

import numpy as np
import pytest

from specan.dsp.transfer_function import leakage_bias
from specan.dsp.windows import window_correlation

LINES = 600


def seen(lags, strengths, ratio=1):
    """Expectation of H1 with a Hann window, and what is missing, for arrivals at lags in blocks."""
    line = np.arange(1, LINES * ratio + 1) / ratio
    turn = np.exp(-2j * np.pi * np.outer(line, lags))
    rho = np.array([window_correlation("hann", lag / ratio) for lag in lags])
    short = np.array([window_correlation("hann", lag) for lag in lags])
    return turn @ (rho * strengths), turn @ ((1 - short) * np.asarray(strengths))


def rms(values):
    return np.sqrt(np.mean(np.abs(values) ** 2))


@pytest.mark.parametrize("lag", [0.1, 0.2, 0.3, 0.4, 0.45])
def test_an_echo_within_half_a_block_is_told_from_the_estimate_itself(lag):
    response, missing = seen([0.0, lag], [1.0, 0.6])
    found = leakage_bias(response, np.full(LINES, 1e-9), "hann")
    # The line at 0 Hz is not among them: the first few cannot be told exactly.
    assert rms((found - missing)[10:]) < 0.1 * rms(missing)


@pytest.mark.parametrize("lag", [0.3, 0.8, 1.5, 3.0])
def test_longer_blocks_show_what_shorter_ones_take(lag):
    response, missing = seen([0.0, lag], [1.0, 0.6], ratio=8)
    found = leakage_bias(response, np.full(8 * LINES, 1e-9), "hann", 8)
    assert rms(found - missing) < 0.1 * rms(missing)


def test_a_decaying_response():
    """tau the time of the energy: rms of (1 - rho) h over h is 32.2 (tau / block)^2 where it is small."""
    tau, lags = 0.02, np.arange(0, 0.5, 1 / 600)
    strengths = np.random.default_rng(1).standard_normal(lags.size) * np.exp(-lags / tau / 2)
    response, missing = seen(lags, strengths)
    found = leakage_bias(response, np.full(LINES, 1e-9), "hann")
    assert rms(found) == pytest.approx(rms(missing), rel=0.1)
    assert rms(found) / rms(response) == pytest.approx(32.2 * tau**2, rel=0.3)


def test_noise_is_not_taken_for_leakage():
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((20, LINES, 2)) @ [1, 1j] * 0.1
    found = leakage_bias(1 + noise, np.full((20, LINES), 0.02), "hann")
    assert rms(found) < 0.25 * rms(noise)  # adds 3 % to an uncertainty


def test_noise_of_a_few_long_blocks_is_not_taken_for_leakage():
    """What longer blocks show is judged beside the noise of the short ones, of which there are eight times as many."""
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((20, 8 * LINES, 2)) @ [1, 1j] * 0.1
    found = leakage_bias(1 + noise, np.full((20, 8 * LINES), 0.02), "hann", 8)
    assert rms(found) < 0.35 * rms(noise) / np.sqrt(8)  # adds 6 % to an uncertainty
    echo = 0.1 * np.exp(-2j * np.pi * np.arange(1, 8 * LINES + 1) * 2.5 / 8)  # 3 dB below the noise of a line
    seen_echo = leakage_bias(1 + noise + echo, np.full((20, 8 * LINES), 0.02), "hann", 8)
    assert 0.6 < rms(seen_echo) / 0.1 < 2.0


def test_lines_that_are_unknown_count_as_zero():
    response = np.ones(LINES, dtype=complex)
    response[7] = np.nan
    assert np.all(np.isfinite(leakage_bias(response, np.full(LINES, np.nan), "hann")))


@pytest.mark.parametrize("n", [8, 13, 64, 65, 100])
def test_few_lines(n):
    assert leakage_bias(np.ones(n, dtype=complex), np.full(n, 1e-9), "hann").shape == (n,)
