"""Clipped, dead and missing samples; and the signals that only look like it."""

import numpy as np
import pytest
from scipy.stats import norm

from specan.analysis.quality import QualityAccumulator
from specan.data.recording import ArraySource, Channel, Recording

TIME = np.arange(20000) / 5000.0
SINE = np.sin(2 * np.pi * 37.0 * TIME)
NOISE = np.random.default_rng(3).standard_normal(20000)


def flags(samples: np.ndarray, size: int = 20000, **known: float) -> tuple[str, ...]:
    accumulator = QualityAccumulator((Channel("x", unit="Pa", **known),))
    for first in range(0, samples.size, size):
        accumulator.add(samples[None, first : first + size])
    return accumulator.result()[0].flags


@pytest.mark.parametrize("size", [20000, 4096, 7, 1])
@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        (np.zeros(200), ("dead",)),
        (np.full(200, -0.25), ("dead",)),
        (np.clip(1.4 * SINE, -1, 1)[:2000], ("clipped",)),
        (np.clip(1.4 * SINE, -1, 9)[:2000], ("clipped",)),
        (SINE[:2000], ()),
        (NOISE[:2000], ()),
        (np.where(np.arange(500) == 77, np.nan, NOISE[:500]), ("nan",)),
        (np.where(np.arange(500) == 77, np.inf, NOISE[:500]), ("nan",)),
        (np.where(np.arange(500) == 77, -1e200, NOISE[:500]), ("nan",)),  # its square is none
    ],
)
def test_flags_do_not_depend_on_the_blocks(samples: np.ndarray, expected: tuple[str, ...], size: int) -> None:
    assert flags(samples, size) == expected


def test_a_lower_flat_top_is_no_rail() -> None:
    samples = np.concatenate([np.clip(SINE, -0.5, 0.5), SINE])
    assert flags(samples, 1000) == ()
    assert flags(samples[::-1].copy(), 1000) == ()


def test_the_rounded_top_of_a_slow_quantised_sine_is_not_clipping() -> None:
    slow = np.round(900 * np.sin(2 * np.pi * 0.7 * TIME)) / 1000
    assert np.count_nonzero(slow == slow.max()) > 10
    assert flags(slow) == ()


def test_a_tacho_that_holds_the_level_of_its_pulses_is_not_clipped() -> None:
    pulses = np.clip(1.4 * SINE, -1, 1)
    assert flags(pulses) == ("clipped",)
    assert flags(pulses, role="tacho") == ()


def test_a_periodic_signal_that_is_clipped_hard() -> None:
    """Every period has the same few samples between the rails."""
    heavy = 8 * np.sin(2 * np.pi * 125 * np.arange(8000) / 8000)
    assert flags(np.clip(heavy, -1, 1)) == ("clipped",)
    assert flags(heavy) == ()


@pytest.mark.parametrize("hz", [1813.6, 1952.1, 1964.0, 2028.0, 2094.0, 2112.6])
def test_a_tone_near_a_quarter_of_the_rate_that_jumps_between_its_rails_is_clipped(hz: float) -> None:
    whole = np.sin(2 * np.pi * hz * np.arange(40000) / 8000 + 1)
    assert flags(np.clip(whole, -0.5, 0.5)) == ("clipped",)
    assert flags(whole) == ()


def test_a_square_wave_is_not_clipping() -> None:
    assert flags(np.sign(SINE + 1e-9)) == ()


def test_runs_at_a_full_scale_that_is_known() -> None:
    assert flags(SINE, full_scale=1.5) == ()
    assert flags(np.clip(1.6 * SINE, -1.5, 1.5), full_scale=1.5) == ("clipped",)
    # the largest positive code of a 16-bit converter
    top = 1.5 * 32767 / 32768
    assert flags(np.clip(1.6 * SINE, -1.4, top), full_scale=1.5) == ("clipped",)
    # one sample that touches the rail is a peak, not a run
    assert flags(np.concatenate([SINE, [1.5], SINE]), full_scale=1.5) == ()


@pytest.mark.parametrize("step", [1e-12, 2.0**-20, 2.0**-12, 2.0**-8])  # of a standard deviation
@pytest.mark.parametrize("sigmas", [1.5, 2.0, 2.5])
def test_an_amplifier_that_overloads_below_full_scale(sigmas: float, step: float) -> None:
    """Samples of white noise lie beyond with the probability of the normal distribution, hardly two in a row.

    Without the overload the rounded ones near the extreme are ever fewer, and 10 000 of 1e-12 hardly ever equal.
    """
    rounded = step * np.round(NOISE[:10240] / step)
    cut = np.clip(rounded, -step * np.round(sigmas / step), step * np.round(sigmas / step))
    assert np.mean(np.abs(cut) == cut.max()) == pytest.approx(2 * norm.sf(sigmas - step / 2), rel=0.15)
    for size in (10240, 1000):
        assert flags(cut, size, full_scale=200.0) == ("clipped",)
        assert flags(rounded, size, full_scale=200.0) == ()
    # a larger value later: what came before it was no rail
    assert flags(np.concatenate([cut, 2 * rounded]), 1000, full_scale=200.0) == ()


def test_a_rail_that_is_known_has_a_tolerance_in_every_block() -> None:
    peak = np.concatenate([SINE, [1.5], SINE])
    almost = np.clip(1.6 * SINE, -1.4, 1.49997)
    assert flags(np.concatenate([peak, almost]), 30000, full_scale=1.5) == ("clipped",)
    assert flags(np.concatenate([almost, peak]), 30000, full_scale=1.5) == ("clipped",)


def test_extremes_of_a_recording_that_comes_in_blocks() -> None:
    channels = (
        Channel("a", unit="Pa", sampling_rate=5000.0, n_samples=20000, gain=2.0),
        Channel("b", unit="V", sampling_rate=5000.0, n_samples=20000),
    )
    recording = Recording("r", channels, ArraySource([SINE, np.zeros(20000)]))
    accumulator = QualityAccumulator(recording.channels)
    for block in recording.blocks(recording.channels, 4096):
        accumulator.add(block)
    first, second = accumulator.result()
    assert (first.maximum, first.minimum) == (2 * SINE.max(), 2 * SINE.min())
    assert (first.flags, second.flags) == ((), ("dead",))


def tone(hz: float, rate: float, noise: float, step: float, top: float) -> np.ndarray:
    """Three seconds of a tone of amplitude 1 with noise, cut off at `top`, rounded to `step`."""
    time = np.arange(int(3 * rate)) / rate
    samples = np.sin(2 * np.pi * hz * time + 0.3)
    samples += noise * np.random.default_rng(1).standard_normal(time.size)
    return np.round(np.clip(samples, -top, top) / step) * step


@pytest.mark.parametrize("step", [1e-12, 1e-7, 1e-5])  # computed, 24 bits, 16 bits at a fifth of the range
@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize(
    ("hz", "rate"), [(50.0, 51200.0), (50.0, 12800.0), (1000.02, 8000.0), (997.0, 48000.0)]
)
def test_a_tone_is_seen_to_be_clipped_without_a_full_scale(
    hz: float, rate: float, noise: float, step: float
) -> None:
    for top in (0.95, 0.9, 0.8, 0.5):
        assert flags(tone(hz, rate, noise, step, top)) == ("clipped",), top
    assert flags(tone(hz, rate, noise, step, 9.0)) == ()


@pytest.mark.parametrize("hz", [1000.0, 1100.0, 1250.0, 1300.0, 1700.0, 2450.0])
def test_a_clean_tone_that_repeats_is_seen_to_be_clipped(hz: float) -> None:
    """At 8 kHz, wherever it is sampled: of four samples besides the rails no other sine can be made."""
    time = np.arange(24000) / 8000.0
    for phase in np.random.default_rng(round(hz)).uniform(0, 2 * np.pi, 6):
        whole = np.sin(2 * np.pi * hz * time + phase)
        assert flags(whole) == ()
        for top in (0.95, 0.9, 0.8):
            cut = np.clip(whole, -top, top)
            seen = np.unique(np.abs(cut[:160]).round(9))
            enough = seen.size > 3 and np.abs(whole).max() > top + 1e-3
            if enough:
                assert flags(cut) == ("clipped",), (phase, top)


def test_a_period_that_is_not_whole_samples_long_to_the_last_digit() -> None:
    time = np.arange(51200) / 51200.0
    for phase in np.random.default_rng(3).uniform(0, 2 * np.pi, 20):
        assert flags(np.sin(2 * np.pi * 8533.3333333 * time + phase)) == ()


@pytest.mark.parametrize("hz", [1000.0, 1100.0, 1600.0, 2000.0])
@pytest.mark.parametrize("step", [1e-12, 1e-5, 1e-3])
def test_a_distorted_tone_that_repeats_is_not_clipped(hz: float, step: float) -> None:
    """Harmonics of an amplifier: its samples are on no sine, the largest no more than the others."""
    time = np.arange(24000) / 8000.0
    for phase in np.random.default_rng(1).uniform(0, 2 * np.pi, 8):
        angle = 2 * np.pi * hz * time + phase
        for share in (1e-6, 1e-3, 0.05):
            samples = np.sin(angle) + share * np.sin(3 * angle + 0.4) + share / 2 * np.cos(2 * angle)
            assert flags(np.round(samples / step) * step) == (), (phase, share)


def test_a_clean_slow_sine_cut_near_its_top_is_clipped() -> None:
    time = np.arange(51200) / 51200.0
    clean = np.sin(2 * np.pi * 50 * time)
    assert flags(clean) == ()
    for top in (0.95, 0.9, 0.7, 0.5):
        assert flags(np.clip(clean, -top, 9)) == ("clipped",)


def test_noise_cut_at_three_standard_deviations_is_clipped() -> None:
    assert flags(np.clip(NOISE, -3, 3)) == ("clipped",)
    assert flags(np.round(np.clip(NOISE, -3, 3), 4)) == ("clipped",)


@pytest.mark.parametrize("step", [1e-12, 1e-2, 0.3])
@pytest.mark.parametrize("rate", [8000.0, 48000.0, 102400.0])
@pytest.mark.parametrize("hz", [0.5, 16.0, 50.0, 997.0, 1000.0, 1000.02, 2500.0])
def test_no_tone_is_called_clipped_because_it_repeats_or_is_rounded(
    hz: float, rate: float, step: float
) -> None:
    for noise in (0.0, 1e-4):
        assert flags(tone(hz, rate, noise, step, 9.0)) == (), noise


@pytest.mark.parametrize("step", [1e-12, 1e-3, 1e-2, 0.1])
def test_what_comes_to_rest_slowly_is_not_clipped(step: float) -> None:
    """A temperature that settles stays at its highest value, but arrives there step by step."""
    warm = 20 + 5 * (1 - np.exp(-np.arange(100_000) / 5000.0))
    assert flags(np.round(warm / step) * step) == ()


def test_signals_of_one_sign_and_of_two_values_are_not_clipped() -> None:
    assert flags(np.maximum(NOISE, 0.0)) == ()
    assert flags(np.where(NOISE > 0, 1.0, -1.0)) == ()
