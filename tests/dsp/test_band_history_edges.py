"""Histories of bands that reach half the sampling rate, and maxima of short records, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from specan.dsp import bands
from specan.dsp.band_history import Average, BandHistoryAccumulator, Histories, Record, band_filter
from specan.dsp.bands import Bands

TAU = 0.125


def recorded(samples: np.ndarray, rate: float, index: int, fraction: int) -> Histories:
    n = samples.shape[1]
    found = BandHistoryAccumulator(
        Record(len(samples), rate, n),
        [band_filter(*Bands.octaves(fraction, index))],
        Average(TAU, None, np.array([n / rate])),
    )
    found.add(samples)
    return found.result()


def sampled_filter(index: int, fraction: int, rate: float) -> np.ndarray:
    """A causal Butterworth filter by the bilinear transform, with the same -3 dB frequencies."""
    mid, half = float(bands.mid_frequencies(index, fraction)), np.exp(bands.filter_half_width(fraction))
    return np.asarray(butter(bands.FILTER_ORDER, [mid / half, mid * half], "bandpass", fs=rate, output="sos"))


def weighted(output: np.ndarray, rate: float) -> np.ndarray:
    keep = np.exp(-1 / (rate * TAU))
    return np.asarray(lfilter([1 - keep], [1, -keep], np.square(output), axis=-1))


def dB(ratio: np.ndarray) -> np.ndarray:
    return 10 * np.log10(ratio)


HIGHEST = [(8000.0, 47, 24), (8000.0, 46, 24), (8000.0, 11, 6), (44100.0, 106, 24), (48000.0, 13, 3)]


@pytest.mark.parametrize(("rate", "index", "fraction"), HIGHEST)
def test_the_end_of_a_record_is_not_heard_before_it(rate: float, index: int, fraction: int) -> None:
    """A tone far below the band, 85 dB above the noise in it: cutting it off must not change the last reading."""
    n, more = round(2.5 * rate), 4000
    noise = np.random.default_rng(1).standard_normal(n + more)
    floor = sosfilt(sampled_filter(index, fraction, rate), noise).std()
    tone = np.sqrt(2) * np.sin(2 * np.pi / 8.03 * np.arange(n + more) + 0.3)
    going_on = (tone + 10 ** (-85 / 20) / floor * noise)[None]
    one, times = band_filter(*Bands.octaves(fraction, index)), np.array([n / rate])
    whole = BandHistoryAccumulator(Record(1, rate, n + more), [one], Average(TAU, None, times))
    whole.add(going_on)
    found = recorded(going_on[:, :n], rate, index, fraction).readings[0, 0, 0]
    assert dB(found / whole.result().readings[0, 0, 0]) == pytest.approx(0.0, abs=0.05)
    if fraction == 24:  # a wider band is another one after the bilinear transform
        truth = weighted(sosfilt(sampled_filter(index, fraction, rate), going_on), rate)[0, n - 1]
        assert dB(found / truth) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize(("rate", "index", "fraction"), HIGHEST)
def test_the_highest_bands_read_tones_and_noise_right(rate: float, index: int, fraction: int) -> None:
    n, mid = round(3.0 * rate), float(bands.mid_frequencies(index, fraction))
    lower = float(bands.band_edges(index, fraction)[0])
    times = np.linspace(1.7, 2.99, 3000)
    sines = [np.sin(2 * np.pi * f * np.arange(n) / rate) for f in (mid, lower, 0.97 * lower)]
    noise = np.random.default_rng(4).standard_normal(n)
    samples = np.stack([*sines, noise])
    found = BandHistoryAccumulator(
        Record(4, rate, n), [band_filter(*Bands.octaves(fraction, index))], Average(TAU, None, times)
    )
    found.add(samples)
    readings = found.result().readings[:, 0]
    # Closed form for tones. The square of samples ripples with twice their distance from half the rate.
    for row, f in enumerate((mid, lower, 0.97 * lower)):
        expected = 0.5 * float(bands.power_response(np.log(f / mid), fraction))
        assert dB(readings[row].mean() / expected) == pytest.approx(0.0, abs=0.005)
        assert np.abs(dB(readings[row] / expected)).max() < 0.36 / ((rate / 2 - f) * TAU) + 0.01
    # White noise: |H|^2 on one transform of the record, which is what a linear band level is.
    size = 1 << 19
    response = np.zeros(size // 2 + 1)
    response[1:] = bands.power_response(np.log(np.arange(1, size // 2 + 1) * rate / size / mid), fraction)
    output = np.fft.irfft(np.fft.rfft(noise, size) * np.sqrt(response), size)[:n]
    weights = weighted(output, rate)[(times * rate - 0.5).astype(int)]
    assert dB(readings[3].mean() / weights.mean()) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    "rate", [8000.0, *(pytest.param(rate, marks=pytest.mark.long) for rate in (44100.0, 51200.0))]
)
def test_maxima_of_short_records_are_those_of_every_sample(rate: float) -> None:
    """The average begins 6 / B after the record and is looked at to its last sample, be it a few cycles later."""
    worst: dict[float, float] = {}
    for duration in (0.6, 1.4873, 1.5):
        n = round(rate * duration)
        noise = np.random.default_rng(3).standard_normal((2, n))
        noise[1, : round(0.9 * n)] *= 0.01
        size = 1 << int(np.ceil(np.log2(3 * n + 4 * rate)))
        lines, frequency = np.fft.rfft(noise, size), np.arange(size // 2 + 1) * rate / size
        index = [int(k) for k in bands.band_range(130.0, 440.0, 24)]
        filters = [band_filter(*Bands.octaves(24, k)) for k in index]
        found = BandHistoryAccumulator(Record(2, rate, n), filters, Average(TAU, None, np.array([n / rate])))
        found.add(noise)
        maximum = found.result().later_maximum
        for column, one in enumerate(filters):
            lower, upper = bands.band_edges(index[column], 24)
            begins = 6.0 / float(upper - lower)
            first = int(np.ceil(begins * rate - 0.5))  # a sample stands for half an interval on either side
            if duration - begins < 0.002:
                continue
            output = np.fft.irfft(lines * one.response(frequency), size)[:, first:n]
            expected = weighted(output, rate).max(axis=1)
            error = float(np.abs(dB(maximum[:, column] / expected)).max())
            # What is left of the record: a few milliseconds, some cycles, or more than half a time constant.
            left = next(limit for limit in (0.06, 0.009, 0.0) if duration - begins > limit)
            worst[left] = max(worst.get(left, 0.0), error)
    assert worst[0.06] < 0.2, worst
    assert worst.get(0.009, 0.0) < 0.2, worst
    assert worst[0.0] < 0.5, worst
