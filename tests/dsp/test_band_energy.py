"""Band energies from blocks against one zero-padded transform of the whole record."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.fft import next_fast_len, rfft

from specan.dsp import band_energy, bands
from specan.dsp.band_energy import BandEnergyAccumulator, EnergySpectrum, LagSpectrum
from specan.dsp.bands import Bands
from specan.dsp.multirate import LENGTH
from specan.dsp.weighting import power_weighting
from specan.dsp.windows import falling_step

RATE = 8000.0
RNG = np.random.default_rng(11)


def one_transform(samples: np.ndarray, rate: float, mid: np.ndarray, fraction: int) -> np.ndarray:
    """The definition: mean square behind the analogue Butterworth filter, from one transform.

    Edges of the filter: the band's, brought together until white noise passes as much as through the
    band, (pi/8) / sin(pi/8) for order 4.
    """
    n = samples.size
    size = next_fast_len(n + round(60 * rate), real=True)
    lines = np.abs(rfft(samples, size)) ** 2
    lines[1 : (size + 1) // 2] *= 2
    f = np.arange(lines.size)[1:] * rate / size
    result = []
    for f_m in mid:
        width = f_m * (10 ** (0.15 / fraction) - 10 ** (-0.15 / fraction))
        width *= np.sin(np.pi / 8) / (np.pi / 8)
        offset = (f * f - f_m * f_m) / (f * width)
        eighth = np.square(np.square(np.square(offset)))
        result.append(np.sum(lines[1:] / (1 + eighth)) / size / n)
    return np.array(result)


@pytest.fixture(autouse=True)
def in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short records are transformed at once; here they are taken as long ones are."""
    monkeypatch.setattr(band_energy, "LONGEST", 0)


def collected(samples: np.ndarray, rate: float = RATE, piece: int = 50000) -> EnergySpectrum:
    accumulator = BandEnergyAccumulator(samples.shape[0], rate, samples.shape[1])
    for first in range(0, samples.shape[1], piece):
        accumulator.add(samples[:, first : first + piece])
    return accumulator.result()


def tone(frequency: float, n: int) -> np.ndarray:
    return np.sin(2 * np.pi * frequency * np.arange(n) / RATE + 0.3)


def burst(n: int) -> np.ndarray:
    samples = np.zeros(n)
    samples[n // 3 : n // 3 + 200] = tone(700.0, 200)
    return samples


SIGNALS: dict[str, Callable[[int], np.ndarray]] = {
    "noise": RNG.standard_normal,
    "red noise": lambda n: np.cumsum(RNG.standard_normal(n)),
    "tone": lambda n: tone(1000.0, n),
    "tone that fades in and out": lambda n: tone(1000.0, n) * np.sin(np.pi * np.arange(n) / n) ** 3,
    "tone at the cross-over of two stages": lambda n: tone(0.33 * RATE / 8, n),
    "tone on an edge": lambda n: tone(float(bands.band_edges(-3, 24)[1]), n),
    "low tone": lambda n: tone(23.4, n),
    "burst": burst,
    "impulse at the border of two blocks": lambda n: np.eye(1, n, LENGTH)[0],
    "constant and a little noise": lambda n: 1.0 + 1e-3 * RNG.standard_normal(n),
}


@pytest.mark.parametrize("seconds", [0.7, pytest.param(30.0, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", SIGNALS)
def test_every_band_is_within_a_thousandth_of_a_decibel(kind: str, seconds: float) -> None:
    n = max(round(seconds * RATE), LENGTH + 10) if "border" in kind else round(seconds * RATE)
    samples = SIGNALS[kind](n)
    spectrum = collected(samples[None])
    for fraction in (1, 3, 24):
        index = bands.band_range(20.0, 3400.0, fraction)
        expected = one_transform(samples, RATE, bands.mid_frequencies(index, fraction), fraction)
        found = spectrum.band_mean_square(Bands.octaves(fraction, index))[0]
        audible = expected > 1e-12 * np.mean(samples**2)
        assert audible.sum() > 3
        error = 10 * np.log10(found[audible] / expected[audible])
        assert np.abs(error).max() < 0.001


@pytest.mark.long
def test_a_long_record_of_a_swept_tone() -> None:
    """Several blocks of the third stage: 340 s at 8 kHz."""
    n = round(340 * RATE)
    phase = 2 * np.pi * 15.0 * 340 / np.log(200.0) * np.exp(np.log(200.0) * np.arange(n) / n)
    samples = np.sin(phase)
    index = bands.band_range(20.0, 2500.0, 24)[::7]
    found = collected(samples[None], piece=1 << 17).band_mean_square(Bands.octaves(24, index))[0]
    expected = one_transform(samples, RATE, bands.mid_frequencies(index, 24), 24)
    assert np.abs(10 * np.log10(found / expected)).max() < 0.001


def test_the_total_is_that_of_the_samples() -> None:
    samples = 0.5 + RNG.standard_normal((3, 100000))
    spectrum = collected(samples)
    np.testing.assert_allclose(spectrum.mean_square, np.mean(samples**2, axis=1), rtol=1e-13)
    np.testing.assert_allclose(spectrum.mean, np.mean(samples, axis=1), rtol=1e-12)
    np.testing.assert_allclose(spectrum.mean_square - spectrum.mean**2, np.var(samples, axis=1), rtol=1e-12)


def test_a_weighting_behind_the_bands_is_that_of_the_tone() -> None:
    spectrum = collected(tone(100.0, 80000)[None])
    weights = power_weighting(spectrum.frequencies, "A")
    plain = spectrum.band_mean_square(Bands.octaves(3, [-10]))
    weighted = spectrum.band_mean_square(Bands.octaves(3, [-10]), weights)
    expected = 10 * np.log10(power_weighting(100.0, "A"))
    assert 10 * np.log10(weighted / plain)[0, 0] == pytest.approx(expected, abs=0.02)


def test_silence_is_nothing() -> None:
    spectrum = collected(np.zeros((1, 5000)))
    assert spectrum.mean_square[0] == 0.0
    assert (spectrum.band_mean_square(Bands.octaves(3, [0, 3])) == 0.0).all()


@pytest.mark.parametrize("counts", [[48], [48, 0], [64, 64, 40], [64, 64, 64, 40]])
def test_a_record_has_the_spectrum_of_its_correlation(counts: list[int]) -> None:
    length, n = 64, sum(counts)
    x, taken = np.random.default_rng(5).standard_normal((2, 6, n))
    taken[:, 64 : max(n - 40, 64)] = 0.0  # the middle of a long record is not faded
    first, ends = 0, []
    spectrum = LagSpectrum(6, length)
    for number, count in enumerate(counts):
        block, end = (part[:, first : first + count] for part in (x, taken))
        first += count
        half = number % 2
        lines, lines_end = (
            np.fft.rfft(np.pad(part, ((0, 0), (half * length, 2 * length - half * length - count))))
            for part in (block, end)
        )
        ends.append(spectrum.add(lines, lines_end if end.any() else None))
    found, last = spectrum.finish()
    for more, signal in ((0.0, x), (sum(e for e in [*ends, last] if e is not None), x - taken)):
        lags = np.stack([np.correlate(row, row, "full")[n - 1 :] for row in signal])
        lags = np.pad(lags, ((0, 0), (0, length + 1)))[:, : length + 1]
        lags *= falling_step(np.arange(length + 1.0), 0.75 * length, length)
        expected = np.fft.rfft(np.concatenate([lags, lags[:, -2:0:-1]], axis=1)).real
        np.testing.assert_allclose(found + more, expected, atol=1e-10)
