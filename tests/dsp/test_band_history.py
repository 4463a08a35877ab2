"""Histories against sampled Butterworth filters at the full rate and a plain recursion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from specan.dsp import bands
from specan.dsp.band_history import (
    Average,
    BandHistoryAccumulator,
    Histories,
    Record,
    band_filter,
    weighting_filter,
)
from specan.dsp.bands import Bands
from specan.dsp.multirate import LENGTH
from specan.dsp.record_edges import SlowPart
from specan.dsp.weighting import TimeWeighting

RATE = 25600.0
N = 3 * LENGTH + 777
SAMPLES = np.random.default_rng(2).standard_normal((3, N)) * np.array([[1.0], [1e-3], [30.0]])
BANDS = [-17, -12, -8, -4, 0, 3]  # low enough for the bilinear transform to be right


def histories(samples: np.ndarray, tau: float, times: np.ndarray, pieces: int = N) -> Histories:
    filters = [band_filter(*Bands.octaves(3, k)) for k in BANDS] + [weighting_filter("Z")]
    mean = samples.mean(axis=1)
    found = BandHistoryAccumulator(
        Record(samples.shape[0], RATE, samples.shape[1], slow=SlowPart.only(mean)),
        filters,
        Average(tau, None, times),
    )
    for first in range(0, samples.shape[1], pieces):
        found.add(samples[:, first : first + pieces])
    return found.result()


def plain(samples: np.ndarray, index: int, tau: float) -> np.ndarray:
    """The definition, sample by sample, with scipy's filters."""
    mid = float(bands.mid_frequencies(index, 3))
    half = np.exp(bands.filter_half_width(3))
    sos = butter(4, [mid / half, mid * half], "bandpass", fs=RATE, output="sos")
    return averaged(sosfilt(sos, samples) ** 2, tau)


def averaged(squares: np.ndarray, tau: float) -> np.ndarray:
    keep = np.exp(-1 / (RATE * tau))
    return lfilter([1 - keep], [1, -keep], squares, axis=1)


@pytest.mark.parametrize("tau", [0.035, 0.125, 0.5])
def test_readings_and_extremes_are_those_of_sampled_filters(tau: float) -> None:
    times = np.array([0.7, 1.3, 2.9, N / RATE])
    found = histories(SAMPLES, tau, times)
    at = np.minimum(np.round(times * RATE).astype(int), N - 1)
    for column, index in enumerate(BANDS):
        expected = plain(SAMPLES - SAMPLES.mean(axis=1, keepdims=True), index, tau)
        settled = round(found.settled_s[column] * RATE)
        errors = [10 * np.log10(found.readings[:, column] / expected[:, at])]
        errors.append(10 * np.log10(found.maximum[:, column] / expected.max(axis=1)))
        # For the later maximum the averages begin 6 / B after the record.
        lower, upper = bands.band_edges(index, 3)
        start = round(6.0 / float(upper - lower) * RATE)
        later = expected[:, start:] - expected[:, [start - 1]] * np.exp(
            -np.arange(1, N - start + 1) / (RATE * tau)
        )
        errors.append(10 * np.log10(found.later_maximum[:, column] / later.max(axis=1)))
        errors.append(10 * np.log10(found.minimum[:, column] / expected[:, settled:].min(axis=1)))
        assert max(np.abs(error).max() for error in errors) < 0.03, index


def test_nothing_depends_on_the_pieces_or_on_the_company() -> None:
    times = np.linspace(0.1, 3.0, 7)
    whole = histories(SAMPLES, 0.125, times)
    for found, rows in (
        (histories(SAMPLES, 0.125, times, pieces=10007), slice(None)),
        (histories(SAMPLES[1:2], 0.125, times), slice(1, 2)),
    ):
        assert np.array_equal(found.readings, whole.readings[rows])
        assert np.array_equal(found.maximum, whole.maximum[rows])
        assert np.array_equal(found.minimum, whole.minimum[rows])


def test_a_record_too_short_to_settle_has_no_minimum() -> None:
    found = histories(SAMPLES[:, : round(0.6 * RATE)], 0.125, np.array([0.5]))
    assert np.isnan(found.minimum[:, :-1]).all()
    # The 20 Hz band takes 1.3 s, that of 63 Hz 0.4 s.
    assert np.isnan(found.later_maximum[:, 0]).all()
    assert np.isfinite(found.later_maximum[:, 1:]).all()
    assert np.isfinite(found.maximum).all()


def test_the_level_at_the_very_end_is_there_at_any_rate() -> None:
    for rate in (8000.0, 44100.0, 48000.0, 51200.0, 102400.0):
        for n in (round(rate), round(10 * rate), 3 * LENGTH, 2 * LENGTH - 1, 2 * LENGTH - 1000):
            found = BandHistoryAccumulator(
                Record(1, rate, n),
                [weighting_filter("A"), band_filter(*Bands.octaves(1, 3))],
                Average(0.125, None, np.array([n / rate])),
            )
            found.add(np.ones((1, n)))
            assert np.isfinite(found.result().readings).all(), (rate, n)


def test_a_channel_is_differentiated_and_integrated() -> None:
    t = np.arange(N) / RATE
    signal = np.sin(2 * np.pi * 1000 * t)[None]
    omega = 2 * np.pi * 1000
    found = BandHistoryAccumulator(
        Record(3, RATE, N, derivatives=[0, 1, -1]),
        [band_filter(*Bands.octaves(3, 0))],
        Average(0.125, None, np.array([3.0])),
    )
    found.add(np.concatenate([signal, signal / omega, signal * omega]))
    assert found.result().readings[:, 0, 0] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("pieces", [1, 7, 400])
def test_the_peak_detector_is_a_running_maximum_that_falls(pieces: int) -> None:
    squared = np.random.default_rng(4).random((2, 400)) ** 8
    squared[:, 150:300] = 0.0
    average, peaks = TimeWeighting(2, 100.0, 0.035), []
    smooth = average(squared)
    held, fall = np.zeros(2), np.exp(-1 / 150.0)
    for column in smooth.T:
        held = np.maximum(held * fall, column)
        peaks.append(held)
    found = TimeWeighting(2, 100.0, 0.035, 1.5)
    parts = [found(squared[:, first : first + pieces]) for first in range(0, 400, pieces)]
    np.testing.assert_allclose(np.concatenate(parts, axis=1), np.array(peaks).T, rtol=1e-12)


def test_a_reading_on_the_end_of_the_last_interval_is_found_by_the_peak_detector() -> None:
    """At these numbers the place of a reading, as computed, is a rounding error behind the end of an interval."""
    rate, seconds, tau = 51200.0, 7.3, 0.035
    n, times = round(rate * seconds), np.append(np.arange(1, 7.3 / tau) * tau, 7.3)
    found = BandHistoryAccumulator(Record(1, rate, n), [weighting_filter("Z")], Average(tau, 1.5, times))
    found.add(np.ones((1, n)))
    np.testing.assert_allclose(found.result().readings[0, 0, 60:], 1.0, atol=1e-9)
