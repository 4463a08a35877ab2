"""Bands with edges: critical bands beside a published formula, levels of noise and tones in them."""

import numpy as np
import pytest

from specan import divisions, schema
from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.bands import Bands

RATE = 51200.0


def measured(samples: np.ndarray, **settings: object):
    mic = Channel("Mic 1", unit="Pa", role="microphone", sampling_rate=RATE, n_samples=samples.size)
    return Octave(**settings)(Recording("r", (mic,), ArraySource([samples])))


def test_edges_of_critical_bands_are_whole_numbers_of_bark() -> None:
    """Zwicker and Terhardt, J. Acoust. Soc. Am. 68 (1980) 1523: within 0.2 Bark."""
    found = Bands.between("bark", 1.0, 30000.0)
    rate = 13 * np.arctan(0.76e-3 * found.upper) + 3.5 * np.arctan((found.upper / 7500) ** 2)
    assert np.abs(rate - np.arange(1, 25)).max() < 0.2
    assert np.array_equal(found.upper[:-1], found.lower[1:])
    assert ((found.lower < found.nominal) & (found.nominal < found.upper)).all()


@pytest.mark.parametrize(("division", "count"), [(2, 21), ("bark", 24)])
@pytest.mark.parametrize("averaging", ["linear", "slow"])
def test_white_noise_has_the_level_of_a_bands_width(division: object, count: int, averaging: str) -> None:
    seconds = 40.0
    noise = np.random.default_rng(3).standard_normal(round(seconds * RATE))
    found = measured(noise, fraction=division, averaging=averaging)
    expected = 10 * np.log10((found.upper_hz - found.lower_hz) / (RATE / 2) / 4e-10)
    assert found.exact_hz.size == count
    assert np.abs((found.level_dB[0] - expected) / found.u_dB).max() < 4.0


def test_a_tone_is_in_its_critical_band_and_on_an_edge_in_two() -> None:
    t = np.arange(round(4 * RATE)) / RATE
    fade = np.sin(np.pi * np.arange(t.size) / t.size) ** 2
    for hz, share in ((1000.0, 0.0), (1080.0, -3.48)):  # the filter has -3.48 dB on its edges
        tone = fade * np.sin(2 * np.pi * hz * t)
        whole = 10 * np.log10(np.mean(tone**2) / 4e-10)
        found = measured(tone, fraction="bark")
        level = found.level_dB[0, found.nominal_hz == 1000.0]
        assert level == pytest.approx([whole + share], abs=0.08)
    above = found.level_dB[0, found.nominal_hz == 1170.0]
    assert above == pytest.approx(level, abs=0.08)


def test_half_octaves_are_those_of_the_standard() -> None:
    """IEC 61260-1:2014, formula (3): of two, one edge of each is an edge of a whole octave."""
    found = Bands.between(2, 800.0, 1300.0)
    ratio = 10**0.3
    assert found.mid == pytest.approx([1000 * ratio**-0.25, 1000 * ratio**0.25], rel=1e-12)
    assert found.lower[0] == pytest.approx(1000 * ratio**-0.5, rel=1e-12)
    assert found.nominal.tolist() == [841.0, 1190.0]


def test_a_row_in_a_table_is_a_new_set_of_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three bands, one of them 3000 Hz wide: white noise is 10 lg 30 dB above that of 100 Hz."""
    bands = divisions.BandTable(
        "traffic band", "1 traffic", (100.0, 200.0, 1000.0, 4000.0), (150.0, 500.0, 2000.0)
    )
    monkeypatch.setitem(divisions.TABLES, "traffic", bands)
    monkeypatch.setattr(schema, "DIVISIONS", (*divisions.DIVISIONS, "traffic"))
    found = measured(np.random.default_rng(3).standard_normal(round(20 * RATE)), fraction="traffic")
    assert found.nominal_hz.tolist() == [150.0, 500.0, 2000.0]
    assert found.level_dB[0, 2] - found.level_dB[0, 0] == pytest.approx(10 * np.log10(30), abs=0.5)
    with pytest.raises(ValueError, match="traffic"):
        Octave(fraction="trafic")
