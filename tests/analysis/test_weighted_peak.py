"""C-weighted peak and exposure levels: analogue filter by another program, and the differences of IEC 61672-1."""

import numpy as np
import pytest
from scipy.signal import ZerosPolesGain, bilinear_zpk, resample, sosfilt, zpk2sos

from specan.analysis.levels import Levels
from specan.data.recording import ArraySource, Channel, Recording

RATE = 51200.0
# IEC 61672-1:2013, table 5: cycles, frequency in Hz, C peak level minus steady C level, tolerance of class 1 in dB.
BURSTS = [(1.0, 31.5, 2.5, 2.0), (1.0, 500.0, 3.5, 1.0), (1.0, 8000.0, 3.4, 2.0), (0.5, 500.0, 2.4, 1.0)]


def burst(cycles: float, frequency: float, sign: float, rate: float = RATE, start: float = 0.3) -> np.ndarray:
    t = np.arange(int(rate)) / rate - start
    return sign * np.where((t >= 0) & (t < cycles / frequency), np.sin(2 * np.pi * frequency * t), 0.0)


def c_weighting() -> ZerosPolesGain:
    low, high = 2 * np.pi * 20.598997, 2 * np.pi * 12194.217  # IEC 61672-1:2013, E.4.1
    system = ZerosPolesGain([0, 0], [-low, -low, -high, -high], 1.0)
    at_1_khz = np.prod([2j * np.pi * 1000 - z for z in system.zeros]) / np.prod(
        [2j * np.pi * 1000 - p for p in system.poles]
    )
    return ZerosPolesGain(system.zeros, system.poles, 1 / abs(at_1_khz))


def of(samples: np.ndarray, rate: float = RATE) -> float:
    mic = Channel("Mic 1", unit="Pa", sampling_rate=rate, n_samples=samples.size)
    return float(2e-5 * 10 ** (Levels()(Recording("r", (mic,), ArraySource([samples]))).c_peak_dB[0] / 20))


@pytest.mark.parametrize(("cycles", "frequency", "difference", "tolerance"), BURSTS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bursts_read_as_the_standard_says(cycles, frequency, difference, tolerance, sign) -> None:
    found = of(burst(cycles, frequency, sign))
    system = c_weighting()
    steady = abs(
        np.prod([2j * np.pi * frequency - z for z in system.zeros])
        / np.prod([2j * np.pi * frequency - p for p in system.poles])
        * system.gain
    ) / np.sqrt(2)
    assert 20 * np.log10(found / steady) == pytest.approx(difference, abs=0.5 * tolerance)
    fine = 16 * RATE
    samples = burst(cycles, frequency, sign, fine)
    y = sosfilt(zpk2sos(*bilinear_zpk(system.zeros, system.poles, system.gain, fine)), samples)
    # At 8 kHz the sampled burst is band-limited.
    assert 20 * np.log10(found / np.abs(y).max()) == pytest.approx(0, abs=0.05 if frequency < 1000 else 0.4)


@pytest.mark.parametrize("place", [100, 20000, 32767, 40000, 51190])
def test_a_peak_counts_wherever_blocks_end(place: int) -> None:
    samples = np.zeros(51200)
    samples[place] = 1.0
    alone = np.zeros(51200)
    alone[5000] = 1.0
    # The first sample of the response; its later ones are smaller. Near an end fewer samples tell what is between.
    assert of(samples) == pytest.approx(of(alone), rel=6e-3)


@pytest.mark.parametrize("rate", [8000.0, 12800.0, 25600.0, 48000.0])
@pytest.mark.parametrize("begin", [0.0512, 0.9433])
def test_the_peak_of_a_tone_switched_on_is_that_of_the_analogue_filter_between_samples(rate, begin) -> None:
    """Samples at eight times the rate of what has nothing above half the rate, behind the analogue poles."""
    samples = 1e-5 * np.random.default_rng(4).standard_normal(int(rate))
    t = np.arange(int(rate)) / rate - begin
    samples += np.where((t >= 0) & (t < 4.2e-3), 0.3 * np.sin(2 * np.pi * 0.05 * rate * t + 1.0), 0.0)
    system = c_weighting()
    fine = resample(samples, 8 * samples.size)
    y = sosfilt(zpk2sos(*bilinear_zpk(system.zeros, system.poles, system.gain, 8 * rate)), fine)
    assert 20 * np.log10(of(samples, rate) / np.abs(y).max()) == pytest.approx(0, abs=0.05)


def test_between_samples_the_peak_is_that_of_the_sine() -> None:
    t = np.arange(51200) / RATE
    for phase in (0.0, 0.3, 0.6):
        found = of(np.sin(2 * np.pi * 6400 * t + phase) * np.minimum(1, t / 0.2))
        steady = of(np.sin(2 * np.pi * 6401.7 * t) * np.minimum(1, t / 0.2))
        assert 20 * np.log10(found / steady) == pytest.approx(0, abs=0.1)


def test_exposure_levels_are_those_of_energy() -> None:
    # ISO 1996-1: L_E = L_eq + 10 lg(T / 1 s); 94 dB for 4 s.
    t = np.arange(int(4 * RATE)) / RATE
    mic = Channel("Mic 1", unit="Pa", role="microphone", sampling_rate=RATE, n_samples=t.size)
    other = Channel("Vib", unit="m/s", role="vibrometer", sampling_rate=RATE, n_samples=t.size)
    samples = np.sqrt(2) * np.sin(2 * np.pi * 1000 * t)
    found = Levels()(Recording("a.tdms", (mic, other), ArraySource([samples, samples])))
    expected = 20 * np.log10(1 / 20e-6) + 10 * np.log10(4)
    assert [found.exposure_dB[w][0] for w in "ACZ"] == pytest.approx([expected] * 3, abs=0.01)
    assert found.c_peak_dB[0] == pytest.approx(20 * np.log10(np.sqrt(2) / 20e-6), abs=0.02)
    assert np.isnan(found.c_peak_dB[1])
