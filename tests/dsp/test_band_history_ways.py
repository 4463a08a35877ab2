"""Sections, thinned outputs, folded envelopes and single precision give what a filter over the whole record gives."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.signal import fftconvolve, lfilter

from specan.dsp import bands
from specan.dsp.band_history import (
    Average,
    BandHistoryAccumulator,
    Filter,
    Histories,
    Record,
    band_filter,
    weighting_filter,
)
from specan.dsp.bands import Bands
from specan.dsp.multirate import Sections, Shape, shape_for
from specan.dsp.record_edges import RecordStart
from specan.dsp.weighting import sampled_weighting

RATE, N, TAU = 51200.0, 210_777, 0.125
TIMES = np.arange(2, 41) * 0.1
KEEP = np.exp(-1 / (RATE * TAU))


def recorded(samples: np.ndarray, filters: list[Filter], derivatives: list[int] | None = None) -> Histories:
    found = BandHistoryAccumulator(
        Record(len(samples), RATE, samples.shape[1], derivatives), filters, Average(TAU, None, TIMES)
    )
    for first in range(0, samples.shape[1], 50_000):
        found.add(samples[:, first : first + 50_000])
    return found.result()


def everywhere(samples: np.ndarray, one: Filter) -> np.ndarray:
    """Levels from one transform of the whole record in double precision, squares at the full rate."""
    size = 1 << 19  # more than twice the record
    if one.weighting:
        output = fftconvolve(samples, sampled_weighting(one.weighting, RATE, 16384)[None], axes=1)
        start = RecordStart(sampled_weighting(one.weighting, RATE, 16384), RATE)
        square = np.square(start.without(output[:, : samples.shape[1]]))
        return np.asarray(lfilter([1 - KEEP], [1, -KEEP], square, axis=1))
    response = one.causal(RATE, size // 2 + 1)
    if response is None:
        response = one.response(np.arange(size // 2 + 1) * RATE / size)
    output = np.fft.irfft(np.fft.rfft(samples, size) * response, size)[:, : samples.shape[1]]
    return np.asarray(lfilter([1 - KEEP], [1, -KEEP], output**2, axis=1))


def direct(samples: np.ndarray, one: Filter) -> np.ndarray:
    """The same at `TIMES`."""
    weighted = everywhere(samples, one)
    place = TIMES * RATE - 0.5
    before = place.astype(int)
    return np.asarray(weighted[:, before] * (before + 1 - place) + weighted[:, before + 1] * (place - before))


@lru_cache
def signals() -> np.ndarray:
    noise = np.random.default_rng(3).standard_normal((4, N)) * np.array([[1.0], [1e-6], [1e9], [1.0]])
    noise[2, N // 2 :] *= 1e-4  # 80 dB down within a section ...
    noise[3, : N // 2] *= 1e-4  # ... and up
    return noise


@pytest.mark.parametrize("fraction", [1, *(pytest.param(n, marks=pytest.mark.long) for n in (3, 24))])
def test_readings_are_those_of_the_whole_record_at_the_full_rate(fraction: int) -> None:
    index = bands.band_range(25.0 if fraction < 24 else 200.0, 16000.0 / fraction**0.1, fraction)
    index = index[:: max(1, len(index) // 18)]
    filters = [band_filter(*Bands.octaves(fraction, int(k))) for k in index] + [
        weighting_filter(w) for w in "ABCZ"
    ]
    found = recorded(signals(), filters)
    for column, one in enumerate(filters):
        expected = direct(signals(), one)
        # Within 80 dB of the channel's largest level. The ripple of a low band's square between two readings is not
        # followed: 0.03 dB at 200 Hz, 0.023 dB at 670 Hz in narrow bands.
        loud = expected > 1e-8 * expected.max(axis=1, keepdims=True)
        loud[2:] &= np.abs(TIMES - N / 2 / RATE) > 0.1  # nor is a step of 80 dB
        if one.upper > RATE / 2:  # cut off at half the rate, a band rings ahead of the step
            loud[2:] = False
        limit = (
            (0.025 if fraction == 24 and one.lower < 1800.0 else 0.009)
            if one.lower > (245.0 if fraction == 24 else 1800.0) or one.weighting or one.identity
            else 0.07
        )
        error = 10 * np.log10(found.readings[:, column][loud] / expected[loud])
        assert np.abs(error).max() < limit, (one.lower, np.abs(error).max())


def test_a_band_reads_what_is_100_db_below_a_tone_elsewhere() -> None:
    t = np.arange(N) / RATE
    quiet = np.sqrt(2) * 1e-5 * np.sin(2 * np.pi * 8000 * t)
    # The tones lie outside the class 1 skirts by far: 1/3 octaves at 8 kHz attenuate 1 kHz by 136 dB.
    loud = np.sqrt(2) * np.sin(2 * np.pi * 1000 * t)
    found = recorded(np.stack([quiet + loud, quiet]), [band_filter(*Bands.octaves(3, 9))]).readings[:, 0]
    level = 10 * np.log10(found[:, 20:])
    assert level[1] == pytest.approx(-100.0, abs=0.05)
    assert level[0] == pytest.approx(level[1], abs=0.01)


def test_a_quiet_moment_is_not_lost_in_the_rounding_of_a_loud_one() -> None:
    """80 dB below what follows it, and alone: causal filters know nothing of the later."""
    noise = np.random.default_rng(7).standard_normal((2, N))
    noise[:, : round(3.0 * RATE)] *= 1e-4
    alone = np.where(np.arange(N) < round(3.0 * RATE), noise, 0.0)
    filters = [band_filter(*Bands.octaves(3, k)) for k in (-4, 0, 4)]
    found, expected = recorded(noise, filters).readings, recorded(alone, filters).readings
    quiet = (TIMES > 1.0) & (TIMES < 2.9)
    assert np.abs(10 * np.log10(found / expected))[:, :, quiet].max() < 1e-4


def test_the_extremes_of_a_steady_tone_have_its_ripple() -> None:
    one = band_filter(*Bands.octaves(24, -42))  # 0.02 dB from the largest to the smallest
    frequency = float(bands.mid_frequencies(-42, 24))
    tone = np.sin(2 * np.pi * frequency * np.arange(N) / RATE)[None]
    found, expected = recorded(tone, [one]), everywhere(tone, one)[0, round(2.0 * RATE) :]
    assert 10 * np.log10(found.later_maximum[0, 0] / expected.max()) == pytest.approx(0.0, abs=2e-3)
    expected = everywhere(tone, one)[0, round(found.settled_s[0] * RATE) :]
    assert 10 * np.log10(found.minimum[0, 0] / expected.min()) == pytest.approx(0.0, abs=2e-3)


def test_what_is_not_filtered_is_not_transformed() -> None:
    filters = [band_filter(*Bands.octaves(1, 2)), weighting_filter("Z")]
    plain = recorded(signals()[:3], filters)
    # Differentiated not at all, but on the way of channels that are.
    on_the_way = recorded(signals()[:3], filters, [0, 0, 1])
    np.testing.assert_allclose(on_the_way.readings[:2, -1], plain.readings[:2, -1], rtol=1e-9)


def test_the_last_interval_is_read_to_the_end() -> None:
    filters = [band_filter(*Bands.octaves(3, 11)), weighting_filter("Z")]
    end = N / RATE
    found = BandHistoryAccumulator(
        Record(4, RATE, N), filters, Average(0.125, None, np.array([end / 2, end]))
    )
    found.add(signals())
    assert np.isfinite(found.result().readings).all()


def test_the_thinned_stream_has_the_samples_of_a_low_tone() -> None:
    shape, n = shape_for(100.0, 10**6), 100_000
    sections = Sections(1, shape, thinned=True)
    x = np.cos(2 * np.pi * 0.01 * np.arange(n) + 0.3)
    low = [sections.low[0].copy() for _ in sections.of(x[None])] + [
        sections.low[0].copy() for _ in sections.rest()
    ]
    thin = np.concatenate(low)[2048 // 8 :][: n // 8]
    inside = slice(300, -300)  # the low-pass rings for 239 samples at the two ends
    np.testing.assert_allclose(thin[inside], x[::8][inside], atol=1e-12)


def test_sections_hold_every_sample_once() -> None:
    sections = Sections(1, Shape(4096, 5120, 1024), filtered=True)
    x = np.arange(20_001.0)
    fresh = [sections.fresh[0, :k].copy() for k in sections.of(x[None])]
    fresh += [sections.fresh[0, :k].copy() for k in sections.rest()]
    assert np.array_equal(np.concatenate(fresh), x)
