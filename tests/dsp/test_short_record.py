"""A short record transformed at once has the energy that blocks of it have, and that closed forms have."""

import numpy as np
import pytest

from specan.dsp import band_energy, bands
from specan.dsp.band_energy import LONGEST, BandEnergyAccumulator, EnergySpectrum
from specan.dsp.bands import Bands
from specan.dsp.record_edges import SlowPart

RNG = np.random.default_rng(4)


def signals(n: int, rate: float) -> np.ndarray:
    t = np.arange(n) / rate
    tone = np.sin(2 * np.pi * 1000 * t) + 1e-4 * RNG.standard_normal(n)
    drift = 0.1 * np.cumsum(RNG.standard_normal(n))
    return np.stack([RNG.standard_normal(n), tone, drift, np.sin(2 * np.pi * 25 * t)])


def found(samples: np.ndarray, rate: float, pieces: int) -> EnergySpectrum:
    at_work = BandEnergyAccumulator(len(samples), rate, samples.shape[1], SlowPart.only(samples.mean(axis=1)))
    for first in range(0, samples.shape[1], pieces):
        at_work.add(samples[:, first : first + pieces])
    return at_work.result()


@pytest.mark.parametrize("n", [60, 1000, 33000, LONGEST])
@pytest.mark.parametrize("rate", [8000.0, 51200.0])
def test_at_once_is_what_blocks_give(n: int, rate: float, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = signals(n, rate)
    once = found(samples, rate, 700)
    monkeypatch.setattr(band_energy, "LONGEST", 0)
    blocks = found(samples, rate, n)
    for fraction in (3, 24):
        index = bands.band_range(2.0, 0.4 * rate, fraction)
        for one, other in ((once, blocks), (once.between_ends(), blocks.between_ends())):
            a, b = (each.band_mean_square(Bands.octaves(fraction, index)) for each in (one, other))
            loud = b > 1e-10 * b.max(axis=1, keepdims=True)
            # Both interpolate the response between nodes, which is good to 0.0005 dB.
            assert np.abs(10 * np.log10(a[loud] / b[loud])).max() < 1e-4
    np.testing.assert_allclose(once.mean_square, blocks.mean_square, rtol=1e-12)
    np.testing.assert_allclose(once.mean, blocks.mean, atol=1e-12)


@pytest.mark.parametrize("fraction", [1, 3])
def test_wide_bands_need_shorter_transforms_only(fraction: int) -> None:
    """Where filters ring less long, longer transforms of zeros give the same levels."""
    t = np.arange(51200) / 51200.0
    samples = np.concatenate([signals(51200, 51200.0), np.sin(2 * np.pi * 997.3 * t)[None]])
    at_work = BandEnergyAccumulator(
        len(samples), 51200.0, samples.shape[1], SlowPart.only(samples.mean(axis=1))
    )
    at_work.add(samples)
    short, whole = at_work.result(fraction), found(samples, 51200.0, 51200)
    index = bands.band_range(20.0, 20000.0, fraction)
    for one, other in ((short, whole), (short.between_ends(), whole.between_ends())):
        a, b = (each.band_mean_square(Bands.octaves(fraction, index)) for each in (one, other))
        loud = b > 1e-12 * b.max(axis=1, keepdims=True)
        assert np.abs(10 * np.log10(a[loud] / b[loud])).max() < 1e-7
        a, b = (each.nodes @ each.weights("A") for each in (one, other))
        assert np.abs(10 * np.log10(a / b)).max() < 1e-7


def test_a_click_has_the_energy_of_the_filter() -> None:
    """One sample of 1: the energy behind a filter is the integral of |H|^2 over the sampling rate, both sides."""
    rate, samples = 51200.0, np.zeros((1, 51200))
    samples[0, 25000] = 1.0
    at_work = BandEnergyAccumulator(1, rate, samples.shape[1])
    at_work.add(samples)
    index = bands.band_range(25.0, 8000.0, 24)
    f = np.linspace(0.02, rate / 2, 4_000_000)
    energy = at_work.result().band_mean_square(Bands.octaves(24, index))[0] * samples.shape[1]
    for k in (0, index.size // 2, index.size - 1):
        mid = float(bands.mid_frequencies(index[k], 24))
        exact = 2 * np.sum(bands.power_response(np.log(f / mid), 24)) * (f[1] - f[0]) / rate
        assert energy[k] == pytest.approx(exact, rel=2e-4)


def test_rows_do_not_depend_on_each_other() -> None:
    samples = np.concatenate([signals(20000, 51200.0), signals(20000, 51200.0)])
    alone = found(samples[5:6], 51200.0, 20000)
    np.testing.assert_array_equal(found(samples, 51200.0, 20000).nodes[5], alone.nodes[0])
