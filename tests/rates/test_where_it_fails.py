"""Bands in which what a model leaves follows an input, where the band is put in."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from specan.study.localisation.by_frequency import following

RATE = 1000.0


@pytest.fixture
def signals():
    rng = np.random.default_rng(4)
    force, wind = rng.normal(size=(2, 16000))
    through = sosfilt(butter(6, [60, 80], "bandpass", fs=RATE, output="sos"), force)
    return np.arange(16000) / RATE, force, wind, through / through.std(), rng.normal(size=16000)


def test_the_band_that_follows_the_force_is_found(signals):
    time, force, wind, through, noise = signals
    low, high, share, source, p_value = following(through + 0.2 * noise, {"wind": wind, "force": force}, time)
    assert source == "force"
    assert p_value < 1e-4
    assert low == pytest.approx(60, abs=3)  # the ends of the filter, which is steep
    assert high == pytest.approx(80, abs=3)
    # The noise in the band: 0.04 of power one over 500 Hz, 20 Hz of it.
    assert share == pytest.approx(1 / (1 + 0.04 * 20 / 500), abs=0.06)


def test_what_follows_no_input_is_told_as_nothing(signals):
    time, force, wind, _, noise = signals
    assert following(noise, {"wind": wind, "force": force, "still": np.zeros(time.size)}, time) is None
