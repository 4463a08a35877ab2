"""What holds for band levels whatever the signal: they do not depend on how the samples are delivered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from specan.divisions import FRACTIONS
from specan.dsp import band_energy, bands
from specan.dsp.band_energy import BandEnergyAccumulator
from specan.dsp.bands import Bands
from specan.dsp.multirate import LENGTH

RATE = 51200.0
SAMPLES = np.random.default_rng(5).standard_normal((7, 2 * LENGTH + 12345))
INDEX = bands.band_range(20.0, 20000.0, 3)


def levels(samples: np.ndarray, pieces: list[int]) -> np.ndarray:
    accumulator = BandEnergyAccumulator(samples.shape[0], RATE, samples.shape[1])
    for first, last in zip([0, *pieces], [*pieces, samples.shape[1]], strict=True):
        accumulator.add(samples[:, first:last])
    spectrum = accumulator.result()
    return np.concatenate(
        [spectrum.mean_square[:, None], spectrum.band_mean_square(Bands.octaves(3, INDEX))], axis=1
    )


@pytest.fixture(scope="module", autouse=True)
def in_blocks():
    """Short records are transformed at once; here they are taken as long ones are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(band_energy, "LONGEST", 0)
        yield


@pytest.fixture(scope="module")
def whole() -> np.ndarray:
    return levels(SAMPLES, [])


@pytest.mark.long
@settings(max_examples=8, deadline=None)
@given(pieces=st.lists(st.integers(0, SAMPLES.shape[1]), max_size=4))
def test_the_pieces_do_not_change_a_bit(whole: np.ndarray, pieces: list[int]) -> None:
    assert np.array_equal(levels(SAMPLES, sorted(pieces)), whole)


@pytest.mark.parametrize("rows", [[0], [6], [1, 2], [2, 3, 4, 5, 6]])
def test_the_company_of_a_channel_does_not_change_a_bit(whole: np.ndarray, rows: list[int]) -> None:
    assert np.array_equal(levels(SAMPLES[rows], []), whole[rows])


def test_a_transposed_array_gives_the_same_bits(whole: np.ndarray) -> None:
    assert np.array_equal(levels(np.asfortranarray(SAMPLES), []), whole)


@settings(max_examples=20, deadline=None)
@given(gain=st.floats(1e-9, 1e9), shift=st.integers(0, 3000))
def test_levels_scale_with_the_signal_and_do_not_depend_on_when_it_comes(gain: float, shift: int) -> None:
    short = SAMPLES[:1, :4000] * np.hanning(4000)
    later = np.zeros((1, 7000))
    later[:, shift : shift + 4000] = gain * short
    plain = levels(np.pad(short, ((0, 0), (0, 3000))), [])
    np.testing.assert_allclose(levels(later, []), gain**2 * plain, rtol=1e-9)


def test_bands_of_noise_add_up_to_the_whole() -> None:
    """White noise from 16 Hz to 16 kHz octaves: the bands' widths add up, whatever the fraction."""
    accumulator = BandEnergyAccumulator(7, RATE, SAMPLES.shape[1])
    accumulator.add(SAMPLES)
    spectrum = accumulator.result()
    sums = [
        spectrum.band_mean_square(Bands.octaves(b, bands.band_range(45.0, 11000.0, b))).sum(axis=1)
        for b in FRACTIONS
        if b != 2  # half octaves have other edges
    ]
    for other in sums[1:]:
        assert np.abs(10 * np.log10(other / sums[0])).max() < 0.1
