"""Single-number values against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.levels import Levels, LevelsAccumulator
from specan.analysis.octave import Octave, OctaveAccumulator
from specan.data.levels import SignalLevels
from specan.data.recording import ArraySource, Channel, Recording

RATE, SECONDS = 8000.0, 12.0
TIME = np.arange(round(RATE * SECONDS)) / RATE
SINE = np.sin(2 * np.pi * 1000 * TIME)


def measured(*channels: tuple[str, np.ndarray], **settings: object) -> SignalLevels:
    return Levels(**settings)(
        Recording(
            "r.tdms",
            tuple(
                Channel(f"{i} {unit}", unit=unit, sampling_rate=RATE, n_samples=x.size)
                for i, (unit, x) in enumerate(channels)
            ),
            ArraySource([x for _, x in channels]),
            flags=("truncated",),
        )
    )


def test_a_sine_on_a_constant() -> None:
    found = measured(("Pa", 3.0 + 2 * SINE), ("m/s", -1e-3 * SINE), ("Nm", 40 + 0.5 * SINE))
    assert found.mean == pytest.approx([3.0, 0.0, 40.0], abs=1e-9)
    assert found.rms == pytest.approx(np.array([2.0, 1e-3, 0.5]) / np.sqrt(2), rel=1e-9)
    assert found.peak == pytest.approx([2.0, 1e-3, 0.5], rel=1e-9)
    assert found.crest_factor == pytest.approx(np.full(3, np.sqrt(2)), rel=1e-9)
    assert (found.maximum[0], found.minimum[0]) == (3.0 + 2 * SINE.max(), 3.0 + 2 * SINE.min())
    assert found.level_dB == pytest.approx([96.99, 116.99, -9.03], abs=0.01)
    assert found.peak_dB == pytest.approx(found.level_dB + 3.0103, abs=1e-4)
    assert [r.text for r in found.references] == ["20 uPa", "1 nm/s", "1 Nm"]
    assert found.equivalent_dB["A"][0] == pytest.approx(96.99, abs=0.01)
    assert np.isnan(found.equivalent_dB["C"][1:]).all()
    assert found.flags == (("truncated",),) * 3


def test_the_constant_part_does_not_reach_the_weighted_levels() -> None:
    """It would strike the filters at the beginning: 100 dB of it on a signal of 60 dB."""
    found = measured(("Pa", 2.0 + 0.02 * np.sqrt(2) * SINE), ("V", 5.0 + 1e-3 * np.sqrt(2) * SINE))
    assert found.max_dB == pytest.approx([60.0, -60.0], abs=0.02)
    assert found.equivalent_dB["A"][0] == pytest.approx(60.0, abs=0.02)
    for levels in found.percentile_dB.values():
        assert levels == pytest.approx([60.0, -60.0], abs=0.02)


def test_percentiles_of_a_level_that_steps() -> None:
    """70 dB for 30 %, 60 dB for 50 % and 50 dB for 20 % of the time."""
    level = np.select([TIME < 0.3 * SECONDS, TIME < 0.8 * SECONDS], [70.0, 60.0], 50.0)
    samples = 20e-6 * 10 ** (level / 20) * np.sqrt(2) * SINE
    found = measured(("Pa", samples), percentiles=(5, 25, 35, 50, 75, 90))
    expected = [70, 70, 60, 60, 60, 50]
    assert [float(v[0]) for v in found.percentile_dB.values()] == pytest.approx(expected, abs=0.2)
    assert found.max_dB[0] == pytest.approx(70.0, abs=0.02)
    assert found.min_dB[0] == pytest.approx(50.0, abs=0.02)
    energy = 0.3 * 1e7 + 0.5 * 1e6 + 0.2 * 1e5
    assert found.equivalent_dB["A"][0] == pytest.approx(10 * np.log10(energy), abs=0.02)
    slow = measured(("Pa", samples), averaging="slow")
    assert slow.percentile_dB[95.0][0] > found.percentile_dB[90][0] - 0.5
    assert (slow.averaging, slow.weighting) == ("slow", "A")


def test_the_weighting_of_the_time_weighted_level() -> None:
    low = 0.02 * np.sqrt(2) * np.sin(2 * np.pi * 100 * TIME)
    levels = {w: measured(("Pa", low), weighting=w).percentile_dB[50.0][0] for w in "ABCZ"}
    assert levels == pytest.approx({"A": 40.86, "B": 54.35, "C": 59.70, "Z": 60.0}, abs=0.05)


def test_broken_channels() -> None:
    found = measured(
        ("Pa", np.zeros(TIME.size)),
        ("Pa", np.where(np.arange(TIME.size) == 9, np.nan, SINE)),
        ("Pa", np.clip(1.3 * np.sin(2 * np.pi * 101 * TIME), -1, 1)),
        ("Pa", SINE),
    )
    assert [words[0] for words in found.flags] == ["dead", "nan", "clipped", "truncated"]
    assert np.isneginf(found.level_dB[0])
    assert np.isnan(found.crest_factor[0])
    assert np.isneginf(found.percentile_dB[50.0][0])
    assert np.isnan(found.rms[1])
    assert np.isnan(found.percentile_dB[50.0][1])
    assert found.rms[3] == pytest.approx(np.sqrt(0.5))


def test_a_section_shorter_than_the_time_weighting_has_no_percentiles() -> None:
    found = measured(("Pa", SINE), start_s=1.0, stop_s=1.5)
    assert found.rms[0] == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert np.isnan(found.percentile_dB[50.0][0])
    assert np.isnan(found.min_dB[0])
    assert np.isfinite(found.max_dB[0])
    assert (found.start_s, found.duration_s) == (1.0, 0.5)
    assert not any(sheet.title.startswith("Percentiles") for sheet in found.sheets())


def test_many_channels_are_analysed_in_groups_that_change_nothing():
    """34 channels in groups of 32, the last one shorter: the same section, and bit for bit what one pass gives."""
    rng, lengths = np.random.default_rng(8), [8000] * 33 + [7500]
    channels = tuple(
        Channel(f"c {k}", unit="Pa" if k == 33 else "V", sampling_rate=8000.0, n_samples=n)
        for k, n in enumerate(lengths)
    )
    source = Recording("r", channels, ArraySource([rng.standard_normal(n) for n in lengths]))
    single = LevelsAccumulator(source, Levels())
    single.add(source.read(channels, 0, 7500))
    whole, parts = single.result(), Levels()(source)
    assert parts.channels == whole.channels
    assert parts.duration_s == whole.duration_s == 7500 / 8000
    assert parts.percentile_dB.keys() == whole.percentile_dB.keys()
    assert np.array_equal(parts.percentile_dB[50.0], whole.percentile_dB[50.0], equal_nan=True)
    for name in ("rms", "peak", "crest_factor", "max_dB"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name))
    for averaging, fmin in (("linear", 100), ("fast", 1000)):
        octave = Octave(averaging=averaging, fmin=fmin)
        at_once = OctaveAccumulator(source, octave)
        at_once.add(source.read(channels, 0, 7500))
        found, expected = octave(source), at_once.result()
        assert found.channels == expected.channels
        assert found.overall_dB.keys() == expected.overall_dB.keys()
        assert np.array_equal(found.level_dB, expected.level_dB)
        assert np.array_equal(found.overall_dB["A"], expected.overall_dB["A"], equal_nan=True)
        assert found.level_dB.shape[0] == len(found.flags) == 34


def test_a_slow_signal_has_levels_too():
    """A shaft's speed at 7.76 Hz: half the rate is far below where A weighting begins."""
    time = np.arange(200) / 7.76
    slow = Recording.from_arrays(
        {"Speed": 3.0 + np.sin(2 * np.pi * 0.97 * time)}, 7.76, units={"Speed": "Hz"}
    )
    found = Levels()(slow)
    assert found.rms[0] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert np.isfinite(found.max_dB[0])
