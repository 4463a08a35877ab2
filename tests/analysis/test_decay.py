"""Decay times and energy ratios: exponentials have closed forms, diffuse decays a known scatter."""

import numpy as np
import pytest

from specan.analysis.decay import Decay
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.energy_decay import decay_line, energy_decay, noise_floor
from specan.errors import InputError, RequestError

RATE = 16000.0
NEPERS = 6 * np.log(10)  # 60 dB of energy


def recording(*samples: np.ndarray, role: str = "microphone") -> Recording:
    channels = tuple(
        Channel(f"Mic {k + 1}", role=role, unit="Pa", sampling_rate=RATE, n_samples=x.size)
        for k, x in enumerate(samples)
    )
    return Recording("room.wav", channels, ArraySource(list(samples)))


def diffuse(seed: int, t60: float, noise: float = 0.0, delay: int = 800) -> np.ndarray:
    rng = np.random.default_rng(seed)
    t = np.arange(int(RATE * max(1.0, 1.6 * t60))) / RATE
    decay = np.append(np.zeros(delay), rng.standard_normal(t.size) * 10 ** (-3 * t / t60))
    return decay + noise * rng.standard_normal(decay.size)


@pytest.mark.parametrize("t60", [0.3, 1.2])
def test_a_decaying_tone_in_the_middle_of_a_band_has_its_closed_forms(t60: float) -> None:
    # p^2 = exp(-k t): C80 = 10 lg(exp(0.08 k) - 1), D50 = 1 - exp(-0.05 k), Ts = 1 / k, T = 6 ln 10 / k.
    t = np.arange(int(2 * RATE)) / RATE
    k = NEPERS / t60
    found = Decay(fmin=1000, fmax=1000)(recording(np.sin(2 * np.pi * 1000 * t) * np.exp(-k * t / 2)))
    assert found.edt_s[0, 0] == pytest.approx(t60, rel=2e-3)
    assert found.t20_s[0, 0] == pytest.approx(t60, rel=2e-3)
    assert found.t30_s[0, 0] == pytest.approx(t60, rel=2e-3)
    # The band takes a part of the onset, whose spectrum is wide: some per cent of the energy for k of 46 1/s.
    assert found.c80_dB[0, 0] == pytest.approx(10 * np.log10(np.exp(0.08 * k) - 1), abs=0.3)
    assert found.d50_percent[0, 0] == pytest.approx(100 * (1 - np.exp(-0.05 * k)), abs=1.0)
    assert found.centre_time_s[0, 0] == pytest.approx(1 / k, abs=1e-3)
    assert found.curvature_percent[0, 0] == pytest.approx(0, abs=0.2)
    assert found.band_flags(0, 0) == ()


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_diffuse_decays_scatter_about_the_truth_as_the_standard_says(noise: float) -> None:
    # ISO 3382-2:2008, 7.1 for one position; 3 bands of 30 decays: the ratio is known to about 8 %.
    t60 = 0.8
    found = Decay(fmin=500, fmax=2000)(recording(*(diffuse(seed, t60, noise) for seed in range(30))))
    for times, u in ((found.t20_s, found.u_t20_s), (found.t30_s, found.u_t30_s)):
        scatter = times.std(axis=0, ddof=1)
        assert np.all(np.abs(times.mean(axis=0) - t60) < 3.5 * scatter / np.sqrt(30))
        assert 0.6 < np.mean(scatter / u.mean(axis=0)) < 1.2
    assert np.allclose(found.start_s, 0.05, atol=0.002)


def test_noise_30_dB_higher_costs_the_long_range_and_not_the_truth() -> None:
    quiet, loud = (Decay(fmin=1000, fmax=1000)(recording(diffuse(3, 0.8, noise))) for noise in (1e-4, 0.01))
    assert np.isnan(loud.t30_s[0, 0])
    assert np.isfinite(quiet.t30_s[0, 0])
    assert loud.t20_s[0, 0] == pytest.approx(quiet.t20_s[0, 0], rel=0.02)
    # The record's level is that of white noise in the band, 20 lg(0.01): 40 dB, less the fluctuation of 10 ms means.
    assert loud.range_dB[0, 0] == pytest.approx(40, abs=3)


def test_two_slopes_are_called_curved() -> None:
    rng = np.random.default_rng(5)
    t = np.arange(int(3 * RATE)) / RATE
    bent = rng.standard_normal(t.size) * np.sqrt(10 ** (-6 * t / 0.3) + 10 ** (-6 * t / 2.0 - 2.2))
    found = Decay(fmin=2000, fmax=2000)(recording(bent))
    assert {"curved", "not-linear"} <= set(found.band_flags(0, 0))


def test_the_noise_that_is_found_is_that_which_was_added() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(40000) / 20000
    power = np.exp(-NEPERS * t / 0.9) + 1e-4
    found = noise_floor(power * rng.exponential(size=t.size), 200)
    assert found.power == pytest.approx(1e-4, rel=0.05)
    assert found.end / 20000 == pytest.approx(0.9 * 4 / 6, abs=0.05)  # 40 dB down
    curve = energy_decay(power * rng.exponential(size=t.size), found)
    assert curve[0] == pytest.approx(20000 * 0.9 / NEPERS, rel=0.03)


def test_a_range_that_is_not_there_has_no_line() -> None:
    assert np.isnan(decay_line(np.linspace(0, -20, 100), -5, -25).samples)


def test_what_cannot_be_evaluated_is_refused() -> None:
    with pytest.raises(InputError, match="holds one value only; expected an impulse response"):
        Decay()(recording(np.zeros(4000)))
    with pytest.raises(RequestError, match="8000 Hz, sampled at 16000 Hz"):
        Decay(fmax=8000)(recording(diffuse(1, 0.5)))


@pytest.mark.parametrize("left", [1, 3, 20, 100])
def test_a_record_that_ends_at_its_arrival_has_no_decay_and_costs_no_other_channel_one(left: int) -> None:
    """A band of width B is known 1 / B after an arrival: 100 samples are 6 ms, those of 22 ms and more are not."""
    good = diffuse(3, 0.5)
    late = 1e-9 * good
    late[-left] = 1.0
    alone, beside = Decay()(recording(good)), Decay()(recording(late, good))
    assert beside.t20_s[1] == pytest.approx(alone.t20_s[0], nan_ok=True)
    assert np.isnan(beside.t20_s[0][alone.bandwidth_hz < RATE / 100]).all()
    assert left > 3 or beside.flags[0] == ("short",)


def test_a_definition_is_a_percentage_or_left_out():
    """Of noise alone no response is left: what would be a definition of -160 % is none."""
    noise = np.random.default_rng(1).standard_normal(4000)
    noise[:5] *= 4
    found = Decay(fmax=1000)(Recording.from_arrays({"Mic 1": noise}, 5000, units={"Mic 1": "Pa"}))
    known = np.isfinite(found.d50_percent)
    assert 0 < known.sum() < known.size
    assert np.all((found.d50_percent[known] >= 0) & (found.d50_percent[known] <= 100))
