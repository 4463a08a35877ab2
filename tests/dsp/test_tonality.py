from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from specan.analysis.tone import Tone
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.tonality import Look, appearance

ANYTHING = arrays(
    np.float64,
    st.integers(256, 400),
    elements=st.floats(-1e6, 1e6, allow_nan=False) | st.sampled_from([0.0, 1.0]),
    fill=st.sampled_from([0.0, 1.0, -3e5]),
)


@pytest.mark.long
@settings(max_examples=80, deadline=None)
@given(ANYTHING, st.sampled_from([10.0, 2000.0, 51200.0]))
def test_anything_has_some_appearance(samples, rate):
    found = appearance(samples, rate)
    assert found.look in get_args(Look)
    assert 0 <= found.frequency_hz <= rate / 2


@settings(max_examples=80, deadline=None)
@given(ANYTHING)
def test_any_signal_gives_a_tone_table(samples):
    channel = Channel("Ch", sampling_rate=1000.0, n_samples=len(samples))
    found = Tone(frequency_hz=100.0)(Recording("a", (channel,), ArraySource([samples])))
    assert np.isfinite(found.rms).all()
    assert np.isfinite(found.tone_rms).all()


@pytest.mark.parametrize("cycles", [0.5, 127.5, 128.0, 127.99])
def test_square_waves_at_the_ends_of_the_band(cycles):
    samples = np.sign(np.cos(2 * np.pi * cycles * np.arange(256) / 256 + 0.1))
    assert appearance(samples, 256.0).look in get_args(Look)
