"""What looks wrong with the samples of a recording that a study is given; nothing does in steady noise and modes."""

import numpy as np
import pytest
from scipy.signal import lfilter

from specan.data.channel import Channel
from specan.data.recording import ArraySource, Recording
from specan.study.data.recordings import doubts

RATE, SECONDS = 4000, 12
T = np.arange(RATE * SECONDS) / RATE


def said(change, seed=1, full_scale=None):
    rng = np.random.default_rng(seed)
    source = rng.standard_normal(T.size)
    # A mode at 100 Hz that rings for two seconds, as a room has one.
    radius, angle = np.exp(-6.9 / 2 / RATE), 2 * np.pi * 100 / RATE
    ringing = lfilter([1.0], [1, -2 * radius * np.cos(angle), radius**2], source)
    mic = ringing / ringing.std() + 0.3 * source + 0.01 * rng.standard_normal(T.size)
    samples = {"Mic 1": mic, "Mic 2": change(mic, source), "Vibrometer": source}
    channels = tuple(
        Channel(
            name,
            unit="Pa" if "Mic" in name else "m/s",
            sampling_rate=RATE,
            n_samples=T.size,
            full_scale=full_scale,
        )
        for name in samples
    )
    recording = Recording("r", channels, ArraySource(list(samples.values())))
    return doubts(recording, channels[:2], channels[2])[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda y, x: y + 0.2 * np.sin(2 * np.pi * 50 * T) + 0.2 * np.sin(2 * np.pi * 150 * T),
            "hum at 50 Hz",
        ),
        (
            lambda y, x: y + 0.2 * np.sin(2 * np.pi * 60 * T) + 0.2 * np.sin(2 * np.pi * 180 * T),
            "hum at 60 Hz",
        ),
        (lambda y, x: np.clip(y, -2, 2), "clipped"),
        (lambda y, x: y * 10 ** (T / SECONDS / 20 * 2), "a drift of +2.0 dB"),
        (lambda y, x: np.where(T == 1, np.nan, y), "nan"),
    ],
)
def test_each_is_told_of_its_channel(change, words):
    (found,) = said(change)
    assert words in found.replace("+2.1", "+2.0").replace("+1.9", "+2.0")
    assert "in Mic 2:" in found


def test_a_microphone_that_overloads_below_the_range_of_the_converter():
    (found,) = said(lambda y, x: np.clip(y, -2 * y.std(), 2 * y.std()), full_scale=200.0)
    assert "clipped in Mic 2:" in found


def test_steady_channels_are_left_alone():
    assert [said(lambda y, x: y, seed) for seed in range(12)] == [[]] * 12
