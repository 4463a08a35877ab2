import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from specan.dsp.tone_series import ToneSeries, block_length, variance_of_mean

RATE = 8000.0


def coloured(rng, rows, n):
    """Noise whose density falls by 20 dB a decade."""
    spectrum = np.fft.rfft(rng.standard_normal((rows, n)))
    f = np.maximum(np.fft.rfftfreq(n, 1 / RATE), 1.0)
    return np.fft.irfft(spectrum * (100 / f), n)


@pytest.mark.long
def test_phase_uncertainty_is_that_of_the_noise_at_the_tone():
    """Red and white noise, no whole number of cycles, the frequency known to 3 mHz only."""
    rng, n, f = np.random.default_rng(3), 24000, 123.456
    t = np.arange(n) / RATE
    error, stated = [], []
    for _ in range(150):
        red, white = coloured(rng, 1, n)[0], rng.standard_normal(n)
        x = np.stack([np.cos(2 * np.pi * f * t + 1) + 0.2 * red, np.cos(2 * np.pi * f * t) + 0.1 * white])
        series = ToneSeries(RATE, f + 0.003, block_length(n, RATE, f), n_channels=2)
        series.add(x)
        tone = series.result(leader=1)
        error.append(np.angle(tone.phasors[0] / tone.phasors[1]) - 1)
        stated.append(variance_of_mean((tone.deviations[0] - tone.deviations[1]).imag))
    assert np.std(error) == pytest.approx(np.sqrt(np.mean(stated)), rel=0.15)
    assert abs(np.mean(error)) < 4 * np.std(error) / np.sqrt(150)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 3000), max_size=5))
def test_bytes_do_not_depend_on_the_pieces(pieces):
    x = np.random.default_rng(1).standard_normal((2, 9000))
    whole, parts = (ToneSeries(RATE, 200.0, 700, n_channels=2) for _ in range(2))
    whole.add(x)
    at = 0
    for piece in [*pieces, 9000]:
        parts.add(x[:, at : at + piece])
        at += piece
    for a, b in zip(whole.result(0), parts.result(0)):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_a_wandering_frequency_is_followed():
    n, t = 80000, np.arange(80000) / RATE
    phase = 2 * np.pi * 200 * t + 3 * np.sin(2 * np.pi * 0.3 * t)  # +- 0.9 Hz
    series = ToneSeries(RATE, 200.0, block_length(n, RATE, 200.0), n_channels=2)
    series.add(np.stack([np.cos(phase), 2 * np.cos(phase - 0.5)]))
    tone = series.result(leader=0)
    assert tone.wandering
    ratio = tone.phasors[1] / tone.phasors[0]
    assert abs(ratio) == pytest.approx(2, rel=1e-3)
    assert np.angle(ratio) == pytest.approx(-0.5, abs=1e-3)
    assert abs(tone.phasors[0]) == pytest.approx(1, rel=0.02)


def test_a_steady_tone_in_noise_does_not_wander():
    rng, t = np.random.default_rng(2), np.arange(40000) / RATE
    series = ToneSeries(RATE, 200.0, 800, n_channels=1)
    series.add((np.cos(2 * np.pi * 200 * t) + rng.standard_normal(40000))[None])
    assert not series.result(0).wandering


def test_a_frequency_known_badly_costs_neither_amplitude_nor_phase():
    n, f = 40000, 1000.0
    series = ToneSeries(RATE, f + 0.5, 800, n_channels=1)
    series.add(np.cos(2 * np.pi * f * np.arange(n) / RATE + 0.7)[None])
    tone = series.result(0)
    assert tone.frequency_hz == pytest.approx(f, abs=1e-4)
    assert abs(tone.phasors[0]) == pytest.approx(1, abs=5e-4)  # 0.4 % are lost within the blocks
    assert np.angle(tone.phasors[0]) == pytest.approx(0.7, abs=2e-3)  # 0.16 rad to the middle of a block


def test_residual_is_the_noise():
    noise = 0.1 * np.random.default_rng(4).standard_normal(80000)
    t = np.arange(80000) / RATE
    series = ToneSeries(RATE, 123.4, 800, n_channels=1)
    series.add((np.cos(2 * np.pi * 123.4 * t) + noise)[None])
    assert np.sqrt(series.result(0).residual[0]) == pytest.approx(np.std(noise), rel=2e-3)


def test_mean_and_power():
    t = np.arange(8000) / RATE
    series = ToneSeries(RATE, 100.0, 800, n_channels=1)
    series.add((3 + 2 * np.cos(2 * np.pi * 100 * t))[None])
    tone = series.result(0)
    assert tone.mean[0] == pytest.approx(3)
    assert tone.power[0] == pytest.approx(2)


@pytest.mark.parametrize(
    ("f", "duration"), [(10.0, 1.0), (20.0, 5.0), (1000.0, 5.0), (1000.0, 3600.0), (3.0, 1.0)]
)
def test_blocks_hold_enough_cycles_and_waste_little(f, duration):
    n = round(duration * RATE)
    block = block_length(n, RATE, f)
    count = n // block
    assert n - count * block < count
    assert block * f / RATE >= min(3.0, duration * f)
    assert count <= max(8, duration / 0.1)


def test_variance_of_the_mean_of_coloured_series():
    rng, runs, n = np.random.default_rng(7), 2000, 200
    white = rng.standard_normal((runs, n + 1))
    series = white[:, 1:] + 0.8 * white[:, :-1]  # positively correlated neighbours
    seen = np.var(series.mean(axis=1))
    assert np.mean(variance_of_mean(series)) == pytest.approx(seen, rel=0.1)
    assert np.mean(np.var(series, axis=1) / n) < 0.6 * seen  # what white noise would have meant
    assert np.isnan(variance_of_mean(np.ones((2, 3)))).all()


def test_no_block():
    with pytest.raises(ValueError, match="no complete block"):
        ToneSeries(RATE, 100.0, 800, n_channels=1).result(0)
