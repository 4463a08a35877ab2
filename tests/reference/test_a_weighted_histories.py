"""Time-weighted A and C levels against a direct filter in time, written from the poles of IEC 61672-1:2013, annex E.

The reference filters the analytic signal at a rate so high that the bilinear transform is right, squares, and
averages sample by sample. It knows nothing of blocks.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import bilinear_zpk, lfilter, sosfilt, sosfreqz, zpk2sos

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording

FINE = 204800.0
INTERVAL = 1 / 64
SECONDS = 6.0
# IEC 61672-1:2013, E.4.1, not rounded.
POLES = {"A": (20.598997, 20.598997, 107.65265, 737.86223, 12194.217, 12194.217)}
POLES["C"] = (POLES["A"][0], POLES["A"][0], POLES["A"][4], POLES["A"][4])
ZEROS = {"A": 4, "C": 2}
ZERO = 20e-6  # Pa
# What is before a record the reference has heard: its weightings have settled when the record begins.
BEFORE = 1.0

Parts = tuple[tuple[float, float, float], ...]


def weighting(name: str, rate: float) -> np.ndarray:
    poles = -2 * np.pi * np.array(POLES[name])
    sos = zpk2sos(*bilinear_zpk(np.zeros(ZEROS[name]), poles, 1.0, rate))
    gain = np.abs(sosfreqz(sos, [1000.0], fs=rate)[1][0])
    sos[0, :3] /= gain
    return sos


def signal(parts: Parts, rate: float, seconds: float = SECONDS, begin: float = 0.0) -> np.ndarray:
    t = begin + np.arange(round((seconds - begin) * rate)) / rate
    return np.sum([a * np.cos(2 * np.pi * f * t + phase) for a, f, phase in parts], axis=0)


@cache
def direct(parts: Parts, name: str, tau: float, interval: float = INTERVAL) -> np.ndarray:
    """Levels in dB at multiples of an interval."""
    rate = FINE
    square = sosfilt(weighting(name, rate), signal(parts, rate, begin=-BEFORE))[round(BEFORE * rate) :] ** 2
    keep = np.exp(-1 / (rate * tau))
    average = lfilter([1 - keep], [1, -keep], square)
    step = round(rate * interval)
    with np.errstate(divide="ignore"):
        return 10 * np.log10(average[step - 1 :: step] / ZERO**2)


def recording(samples: np.ndarray, rate: float) -> Recording:
    mic = Channel("Mic 1", unit="Pa", sampling_rate=rate, n_samples=samples.size)
    return Recording("r", (mic,), ArraySource([samples]))


def history(samples: np.ndarray, rate: float, name: str, averaging: str) -> np.ndarray:
    found = Octave(fraction=1, band=1000, averaging=averaging, interval_s=INTERVAL)(recording(samples, rate))
    assert found.history is not None
    return found.history.overall_dB[name][0]


def tone(f: float) -> Parts:
    return ((np.sqrt(2.0), f, 0.4),)


def rumble(seed: int) -> Parts:
    """90 dB with a density that falls as 1/f^2 from 2 to 20 Hz."""
    rng = np.random.default_rng(seed)
    f = np.linspace(2.0, 20.0, 40) + rng.uniform(-0.2, 0.2, 40)
    amplitude = 1 / f
    amplitude *= np.sqrt(2.0) * 0.63 / np.sqrt(np.sum(amplitude**2))
    return tuple(zip(amplitude, f, rng.uniform(0, 2 * np.pi, 40)))


RATES = [8000.0, 12800.0, 22050.0, 44100.0, 51200.0, 102400.0]
LOW_TONES = [4.13, 16.37, 31.5, 119.7]
settled = round(0.8 / INTERVAL)


@pytest.mark.parametrize("f", LOW_TONES)
def test_low_tones(f: float) -> None:
    for averaging, tau in (("fast", 0.125), ("slow", 1.0)):
        expected = {name: direct(tone(f), name, tau) for name in "AC"}
        for rate in RATES if averaging == "fast" else RATES[1:2]:
            for name in "AC":
                found = history(signal(tone(f), rate), rate, name, averaging)
                away = found[settled:] - expected[name][settled : found.size]
                assert np.abs(away).max() < 0.1, (rate, name, averaging)


@pytest.mark.parametrize("rate", RATES)
def test_tones_drawn_up_to_nearly_half_the_rate(rate: float) -> None:
    """Steady: the curve itself, as the reference bends at high frequencies."""
    for f in 1000.0 * 10 ** np.random.default_rng(round(rate)).uniform(-1.5, np.log10(0.95 * rate / 2000), 5):
        poles = 2 * np.pi * np.array(POLES["A"])
        gain = [np.abs((2j * np.pi * x) ** 4 / np.prod(2j * np.pi * x + poles)) for x in (f, 1000.0)]
        found = history(signal(tone(f), rate, 2.0), rate, "A", "slow")[-1]
        expected = 20 * np.log10(gain[0] / gain[1] / ZERO) + 10 * np.log10(1 - np.exp(-2.0))
        assert found == pytest.approx(expected, abs=0.03), f


@pytest.mark.long
@pytest.mark.parametrize("rate", RATES)
def test_rumble(rate: float) -> None:
    fine = direct(rumble(3), "A", 0.125, INTERVAL / 50)
    expected = fine[49::50]
    found = history(signal(rumble(3), rate), rate, "A", "fast")
    assert np.abs(found[settled:] - expected[settled : found.size]).max() < 0.1
    later = expected[round(0.625 / INTERVAL) :]
    levels = Levels(percentiles=(1.0, 10.0, 50.0))(recording(signal(rumble(3), rate), rate))
    for percent, value in levels.percentile_dB.items():
        # The readings are not those of the reference, and a few seconds of rumble move by some dB.
        assert value[0] == pytest.approx(np.percentile(later, 100 - percent), abs=0.3)
    assert levels.max_dB[0] == pytest.approx(fine.max(), abs=0.1)


@pytest.mark.parametrize("parts", [tone(16.37), rumble(5)], ids=["tone", "rumble"])
def test_no_boundary_of_blocks_shows_wherever_it_falls(parts: Parts) -> None:
    """The same signal, cut out 200 samples later each time: nothing of the block grid is left in its level."""
    rate, step = 12800.0, 200
    whole = signal(parts, rate, 8.0)
    first = history(whole, rate, "A", "fast")
    for shift in (1, 7, 23, 38, 41, 77, 82):
        found = history(whole[shift * step :], rate, "A", "fast")
        since = round(2.0 / INTERVAL)  # what the cut does to an average of 0.125 s has decayed by 70 dB
        assert found[since:] == pytest.approx(first[since + shift :], abs=0.005)


@pytest.mark.parametrize("rate", [8000.0, 12800.0, 51200.0])
@pytest.mark.parametrize("fraction", [1, 3, 24])
def test_a_low_tone_does_not_reach_bands_two_decades_above(rate: float, fraction: int) -> None:
    """Behind an order 4 band-pass nothing is left of 94 dB there; class 1 asks for 70 dB less."""
    found = Octave(fraction=fraction, fmin=1600, averaging="fast", interval_s=INTERVAL)(
        recording(signal(tone(16.37), rate), rate)
    )
    assert found.history is not None
    inside = (found.history.time_s > 2.0) & (found.history.time_s < SECONDS - 0.2)
    assert found.history.level_dB[0][:, inside].max() < 94.0 - 80.0


@pytest.mark.parametrize(("f", "expected"), [(16.0, 37.6), (31.5, 54.5), (50.0, 63.7)])
def test_the_cut_at_the_beginning_is_no_click_in_totals(f: float, expected: float) -> None:
    """A steady 94 dB: its level behind A (IEC 61672-1), with the ripple that Fast leaves of a low tone."""
    for rate in (12800.0, 51200.0):
        samples = signal(((np.sqrt(2.0), f, 0.0),), rate, 10.0)
        levels = Levels()(recording(samples, rate))
        ripple = 10 * np.log10(1 + 1 / np.hypot(1, 4 * np.pi * f * 0.125))
        assert levels.max_dB[0] == pytest.approx(expected + ripple, abs=0.1)
        assert levels.equivalent_dB["A"][0] == pytest.approx(expected, abs=0.1)
        held = Octave(fraction=1, averaging="fast", hold="max", band=1000)(recording(samples, rate))
        assert held.overall_dB["A"][0] == pytest.approx(expected + ripple, abs=0.1)
        # The cut is a click in a band, which counts; the level without it is told.
        _, left_out = held.band_flags(0, 0)
        assert float(left_out.removeprefix("left-out=")) < 30.0
