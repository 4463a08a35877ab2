"""Levels exceeded during a part of the time: a switched tone, and noise that scipy filters too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.weighting import FAST
from specan.errors import RequestError
from specan.schema import parse

RATE = 8000.0


def recording(*records: np.ndarray) -> Recording:
    channels = tuple(
        Channel(f"Mic {k}", unit="Pa", sampling_rate=RATE, n_samples=len(x)) for k, x in enumerate(records, 1)
    )
    return Recording("r.tdms", channels, ArraySource(list(records)))


def switched() -> np.ndarray:
    """A tone of 74 dB during the last 30 % of every 20 s, 60 dB otherwise."""
    t = np.arange(round(40 * RATE)) / RATE
    amplitude = np.where(t % 20.0 >= 14.0, 0.1, 0.02) * np.sqrt(2)
    return amplitude * np.sin(2 * np.pi * 1000 * t)


def test_a_tone_switched_between_two_levels() -> None:
    found = Octave(band=1000, averaging="fast", percentiles=(10, 25, 50, 90))(recording(switched()))
    high, low = 20 * np.log10([0.1 / 20e-6, 0.02 / 20e-6])
    assert found.percentile_dB is not None
    assert found.percentile_overall_dB is not None
    assert list(found.percentile_dB) == [0, 10, 25, 50, 90, 100]
    within = (
        0.04  # dB: 1 - exp(-5) after five time constants is 0.029 dB; a filter that settles adds a little
    )
    for percent, expected in {0: high, 10: high, 25: high, 50: low, 90: low, 100: low}.items():
        assert found.percentile_dB[percent][0] == pytest.approx([expected], abs=within), percent
        assert found.percentile_overall_dB[percent]["Z"] == pytest.approx([expected], abs=within), percent


def test_noise_has_the_percentiles_that_scipy_finds() -> None:
    x = np.random.default_rng(5).standard_normal(round(60 * RATE)) * 0.02
    found = Octave(fraction=1, band=500, averaging="fast", percentiles=(5, 50, 95))(recording(x))
    assert found.percentile_dB is not None
    assert found.percentile_overall_dB is not None
    edges = [found.lower_hz[0], found.upper_hz[0]]
    keep = np.exp(-1 / (RATE * FAST))
    x = x - x.mean()
    band = signal.sosfilt(signal.butter(4, edges, "bandpass", fs=RATE, output="sos"), x)
    for samples, levels, within in (
        (band, {p: v[0, 0] for p, v in found.percentile_dB.items()}, 0.15),  # another sampled filter
        (x, {p: v["Z"][0] for p, v in found.percentile_overall_dB.items()}, 0.02),
    ):
        weighted = signal.lfilter([1 - keep], [1, -keep], samples**2)[round(6 * FAST * RATE) :]
        for percent in (5, 50, 95):
            expected = 10 * np.log10(np.quantile(weighted, 1 - percent / 100) / 20e-6**2)
            # 480 readings in place of every sample.
            assert levels[percent] == pytest.approx(expected, abs=within + 0.1), percent
        assert levels[0] == pytest.approx(10 * np.log10(weighted.max() / 20e-6**2), abs=within)
        assert levels[100] == pytest.approx(10 * np.log10(weighted.min() / 20e-6**2), abs=within)


def test_readings_before_a_band_has_settled_do_not_count() -> None:
    # A steady tone: what rises from rest would make the low percentiles of 2 s lower.
    t = np.arange(round(2 * RATE)) / RATE
    tone = 0.02 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * t)
    found = Octave(band=1000, averaging="fast", percentiles=(99,))(recording(tone))
    assert found.percentile_dB is not None
    assert found.percentile_dB[99][0, 0] == pytest.approx(60.0, abs=0.04)
    short = Octave(band=1000, averaging="fast", percentiles=(99,))(recording(tone[:4000]))
    assert short.percentile_dB is not None
    assert np.isnan(short.percentile_dB[99]).all()


def test_many_channels_in_groups_have_theirs() -> None:
    t = np.arange(round(2 * RATE)) / RATE
    tones = [10 ** (k / 40) * 1e-3 * np.sin(2 * np.pi * 1000 * t) for k in range(40)]
    found = Octave(band=1000, averaging="fast", percentiles=(50,))(recording(*tones))
    assert found.percentile_dB is not None
    assert found.percentile_overall_dB is not None
    rise = 0.5 * np.arange(40)
    assert found.percentile_dB[50][:, 0] - found.percentile_dB[50][0, 0] == pytest.approx(rise, abs=1e-5)
    totals = found.percentile_overall_dB[50]["Z"]
    assert totals - totals[0] == pytest.approx(rise, abs=1e-5)


@pytest.mark.parametrize("wrong", [0, 100, -5, float("nan")])
def test_a_percentage_lies_between_0_and_100(wrong: float) -> None:
    with pytest.raises(RequestError, match="percentiles"):
        parse(Octave, {"averaging": "fast", "percentiles": [wrong]}, "settings")


def test_a_linear_average_has_none() -> None:
    with pytest.raises(RequestError, match="percentiles need averaging fast"):
        parse(Octave, {"percentiles": [10]}, "settings")
