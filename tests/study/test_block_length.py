"""Blocks as long as a field rings: modes whose decay is known, with noise."""

import numpy as np
import pytest
from scipy.signal import fftconvolve

from specan.room.study.estimate_frf import USUAL_S, block_length, reverberation_s

RATE = 1000.0


def recorded(time_s, duration_s, noise=0.01):
    """Noise through modes that all lose 60 dB in `time_s`, heard from before the record begins."""
    rng = np.random.default_rng(1)
    n, before = int(duration_s * RATE), int(20 * RATE)
    source = rng.standard_normal(before + n)
    t = np.arange(before) / RATE
    modes = sum(np.sin(2 * np.pi * f * t + f) for f in (90, 150, 171, 230, 280, 333))
    heard = fftconvolve(source, 10 ** (-3 * t / time_s) * modes)[before : before + n]
    return source[before:], heard + noise * heard.std() * rng.standard_normal(n)


@pytest.mark.parametrize("time_s", [0.8, 2.5, 5.0])
def test_the_decay_of_the_modes_is_found(time_s):
    source, heard = recorded(time_s, 40.0)
    assert reverberation_s(source, heard, RATE, (40.0, 400.0)) == pytest.approx(time_s, rel=0.1)
    blocks = block_length(source, [heard], RATE, (40.0, 400.0))
    assert blocks == (USUAL_S if time_s < 2 else pytest.approx(time_s, rel=0.1))


def test_a_short_record_keeps_the_usual_blocks():
    source, heard = recorded(5.0, 6.0)
    assert block_length(source, [heard], RATE, (40.0, 400.0)) == USUAL_S


def test_noise_alone_has_no_decay():
    rng = np.random.default_rng(2)
    source, heard = rng.standard_normal((2, 30_000))
    assert block_length(source, [heard], RATE, (40.0, 400.0)) == USUAL_S
