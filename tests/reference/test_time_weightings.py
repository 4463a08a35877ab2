"""Fast and Slow (IEC 61672-1) and Impulse (IEC 60651) through the public function, with tone bursts."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.octave import Octave
from specan.data.band_levels import BandLevels
from specan.data.recording import ArraySource, Channel, Recording

RATE = 51200.0
# IEC 61672-1:2013, table 4: duration in ms of a 4 kHz burst, maximum F and S levels re the steady level.
BURSTS = [
    (1000, 0.0, -2.0), (500, -0.1, -4.1), (200, -1.0, -7.4), (100, -2.6, -10.2), (50, -4.8, -13.1),
    (20, -8.3, -17.0), (10, -11.1, -20.0), (5, -14.1, -23.0), (2, -18.0, -27.0),
    (1, -21.0, None), (0.5, -24.0, None), (0.25, -27.0, None),
]  # fmt: skip
# IEC 60651, table of the 2 kHz bursts: single ones, and 5 ms ones repeated so often a second.
SINGLE_IMPULSES = [(20, -3.6), (5, -8.8), (2, -12.6)]
REPEATED_IMPULSES = [(100, -2.7), (20, -7.6), (2, -8.8)]


def measured(samples: np.ndarray, **settings: object) -> BandLevels:
    mic = Channel("Mic 1", unit="Pa", sampling_rate=RATE, n_samples=samples.size)
    return Octave(band=1000, **settings)(Recording("burst", (mic,), ArraySource([samples])))


def tone(frequency: float, seconds: float) -> np.ndarray:
    """94 dB, a whole number of cycles."""
    return np.sqrt(2) * np.sin(2 * np.pi * frequency * np.arange(round(seconds * RATE)) / RATE)


STEADY = 20 * np.log10(1 / 20e-6)


def burst(frequency: float, milliseconds: float, length: float) -> np.ndarray:
    samples = np.zeros(round(length * RATE))
    part = tone(frequency, milliseconds / 1000)
    samples[5000 : 5000 + part.size] = part
    return samples


@pytest.mark.parametrize("row", BURSTS, ids=lambda row: f"{row[0]} ms")
def test_fast_and_slow_tone_bursts(row: tuple[float, float, float | None]) -> None:
    milliseconds, *printed = row
    samples = burst(4000.0, milliseconds, 0.2 + milliseconds / 1000)
    for averaging, tau, reference in zip(("fast", "slow"), (0.125, 1.0), printed, strict=True):
        if reference is None:
            continue
        found = measured(samples, averaging=averaging, hold="max").overall_dB
        formula = 10 * np.log10(1 - np.exp(-milliseconds / 1000 / tau))
        assert found["Z"][0] - STEADY == pytest.approx(formula, abs=0.01)
        assert found["Z"][0] - STEADY == pytest.approx(reference, abs=0.06)
        if milliseconds >= 2:  # a weighting rings: shorter bursts are longer behind it
            steady_a = measured(tone(4000.0, 1.0)).overall_dB["A"][0]
            assert found["A"][0] - steady_a == pytest.approx(formula, abs=0.1)


@pytest.mark.parametrize(
    ("averaging", "rate"), [("fast", 34.7), ("slow", 4.34), ("impulse", 2.9), (0.5, 8.69)]
)
def test_the_level_falls_as_it_should(averaging: str | float, rate: float) -> None:
    samples = np.concatenate([tone(1000.0, 4.0), np.zeros(round(2.5 * RATE))])
    found = measured(samples, averaging=averaging, interval_s=0.25).history
    assert found is not None
    after = (found.time_s > 4.5) & (found.time_s < 6.4)
    falling = found.overall_dB["Z"][0, after]
    assert -np.diff(falling) / 0.25 == pytest.approx(rate, rel=0.01)


@pytest.mark.parametrize(("milliseconds", "reference"), SINGLE_IMPULSES)
def test_a_single_burst_with_impulse(milliseconds: float, reference: float) -> None:
    found = measured(burst(2000.0, milliseconds, 0.5), averaging="impulse", hold="max")
    assert found.overall_dB["Z"][0] - STEADY == pytest.approx(reference, abs=0.1)


@pytest.mark.parametrize(("per_second", "reference"), REPEATED_IMPULSES)
def test_repeated_bursts_with_impulse(per_second: float, reference: float) -> None:
    samples = np.zeros(round(5 * RATE))
    part = tone(2000.0, 0.005)
    for start in np.arange(0, 4.9, 1 / per_second):
        first = round(start * RATE)
        samples[first : first + part.size] = part
    found = measured(samples, averaging="impulse", hold="max")
    assert found.overall_dB["Z"][0] - STEADY == pytest.approx(reference, abs=0.1)


@pytest.mark.parametrize("weighting", ["A", "B", "C", "Z"])
def test_a_steady_tone_has_the_level_of_the_linear_average(weighting: str) -> None:
    samples = tone(2000.0, 3.0)
    linear = measured(samples, weighting=weighting)
    for averaging in ("fast", 0.3, "impulse"):
        found = measured(samples, weighting=weighting, averaging=averaging)
        for name in "ABCZ":
            assert found.overall_dB[name][0] == pytest.approx(linear.overall_dB[name][0], abs=0.03)


@pytest.mark.parametrize(("averaging", "tau"), [("fast", 0.125), ("slow", 1.0)])
def test_bursts_at_a_high_rate(averaging: str, tau: float) -> None:
    rate, length = 204800.0, 0.05
    samples = np.zeros(round(0.2 * rate))
    part = np.sqrt(2) * np.sin(2 * np.pi * 4000 * np.arange(round(length * rate)) / rate)
    samples[20000 : 20000 + part.size] = part
    mic = Channel("Mic 1", unit="Pa", sampling_rate=rate, n_samples=samples.size)
    recording = Recording("burst", (mic,), ArraySource([samples]))
    found = Octave(band=1000, averaging=averaging, hold="max")(recording).overall_dB["Z"][0]
    assert found - STEADY == pytest.approx(10 * np.log10(1 - np.exp(-length / tau)), abs=0.01)
