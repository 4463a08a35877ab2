"""IEC 61260-1:2014 through the public function: frequencies, class 1 with tones, effective bandwidth."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.octave import Octave, OctaveAccumulator
from specan.data.recording import ArraySource, Channel, Recording
from specan.divisions import FRACTIONS
from specan.dsp import bands
from specan.dsp.bands import BREAKPOINTS, breakpoint_ratio, class_1_limits

LOW, HIGH = 20.0, 20000.0
RATES = (51200.0, 102400.0)
# A tone is faded in and out over this, times the inverse of the narrowest bandwidth that it has to tell.
# Ended abruptly, its own spectrum would be wider than the limits.
FADE = 3.0
# Of fewer cycles it would be no tone.
CYCLES = 25
RELATIVE_WIDTH = {b: np.log(bands.OCTAVE_RATIO) / b for b in FRACTIONS}


def faded_tones(frequencies: np.ndarray, seconds: float, rate: float) -> Recording:
    n = round(seconds * rate)
    t = (np.arange(n) + 0.5) / rate
    fade = np.sqrt(2.0) * np.sin(np.pi * np.arange(n) / n) ** 2
    signals = [fade * np.sin(2 * np.pi * f * t) for f in frequencies]
    channels = tuple(Channel(f"{f:g} Hz", unit="Pa", sampling_rate=rate, n_samples=n) for f in frequencies)
    return Recording("tones", channels, ArraySource(signals))


def worst_excess(tones: np.ndarray, bandwidth: np.ndarray, rate: float, fractions: tuple[int, ...]) -> float:
    """By how much (dB, negative: margin) any band's attenuation of any tone leaves the class 1 limits."""
    worst = -np.inf
    # Tones of about one duration are one recording.
    step = 1.3
    wanted = np.maximum.reduce([2 * FADE / bandwidth, CYCLES / tones, np.full(tones.shape, 0.1)])
    duration = step ** np.ceil(np.log(wanted) / np.log(step))
    for seconds in np.unique(duration):
        chosen = tones[duration == seconds]
        for part in np.array_split(chosen, -(-chosen.size // 16)):
            source = faded_tones(part, seconds, rate)
            accumulator = OctaveAccumulator(source, Octave())
            samples = source.read(accumulator.channels)
            accumulator.add(samples)
            spectrum = accumulator.spectrum()
            own = 10 * np.log10(np.mean(samples**2, axis=1) / 4e-10)
            for fraction in fractions:
                found = OctaveAccumulator(source, Octave(fraction=fraction)).of_spectrum(spectrum)
                attenuation = own[:, None] - found.level_dB
                low, high = class_1_limits(part[:, None] / found.exact_hz, fraction)
                above = np.where(np.isinf(high), -np.inf, attenuation - np.minimum(high, 1e9))
                worst = max(worst, float(np.maximum(low - attenuation, above).max()))
    return worst


# Every fifth tone at one rate, every tenth at the other (all of them pass); a few of them without `long`.
@pytest.mark.parametrize(
    ("rate", "every"),
    [
        (51200.0, 29),
        pytest.param(51200.0, 5, marks=pytest.mark.long),
        pytest.param(102400.0, 10, marks=pytest.mark.long),
    ],
)
def test_every_band_is_class_1_at_mid_band_and_edges(rate: float, every: int) -> None:
    # The mid-band and edge frequencies of all fractions are multiples of 1/48 octave: one set of tones.
    index = bands.band_range(LOW, HIGH, 24)
    lower, upper = bands.band_edges(index, 24)
    tones = np.concatenate([bands.mid_frequencies(index, 24), lower, upper[-1:]])
    for fraction in FRACTIONS:
        places = np.concatenate([bands.mid_frequencies(bands.band_range(25.0, 19000.0, fraction), fraction)])
        assert np.abs(tones[:, None] / places - 1).min(axis=0).max() < 1e-12
    tones = tones[::every]
    assert worst_excess(tones, tones * RELATIVE_WIDTH[24], rate, FRACTIONS) < -0.2


@pytest.mark.parametrize("rate", [51200.0, pytest.param(102400.0, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "fraction",
    [pytest.param(b, marks=[] if b in (3, 24) else pytest.mark.long) for b in FRACTIONS],
)
def test_five_bands_are_class_1_at_every_breakpoint(fraction: int, rate: float) -> None:
    index = bands.band_range(LOW, HIGH, fraction)
    five = index[np.linspace(0, index.size - 1, 5).round().astype(int)]
    mid = bands.mid_frequencies(five, fraction)[:, None]
    ratio = breakpoint_ratio(BREAKPOINTS, fraction)
    tones = np.concatenate([mid * ratio, mid / ratio[1:]], axis=1)
    bandwidth = np.broadcast_to(mid * RELATIVE_WIDTH[fraction], tones.shape)
    measurable = tones < 0.49 * rate
    assert worst_excess(tones[measurable], bandwidth[measurable], rate, (fraction,)) < -0.2


@pytest.mark.parametrize("fraction", FRACTIONS)
@pytest.mark.parametrize("rate", RATES)
def test_the_effective_bandwidth_is_that_of_the_band(fraction: int, rate: float) -> None:
    # An impulse has the same energy in every hertz. The record is long, since its mean, 1 / n, is taken off.
    n = 16 * round(rate)
    impulse = np.zeros(n)
    impulse[n // 3] = 1.0
    channel = Channel("impulse", unit="Pa", sampling_rate=rate, n_samples=n)
    found = Octave(fraction=fraction, settling="counted")(
        Recording("impulse", (channel,), ArraySource([impulse]))
    )
    expected = 10 * np.log10((found.upper_hz - found.lower_hz) / (rate / 2) / n / 4e-10)
    # What a filter lets through above half the sampling rate is not there.
    low = found.upper_hz < 0.2 * rate
    assert np.abs(found.level_dB[0] - expected)[low].max() < 0.002
    assert np.abs(found.level_dB[0] - expected).max() < 0.12


@pytest.mark.parametrize("fraction", FRACTIONS)
def test_the_grid_is_that_of_two_other_libraries(fraction: int) -> None:
    from acoustics.standards import iec_61260_1_2014 as acoustics
    from pyfar.constants import fractional_octave_frequencies_exact

    index = bands.band_range(LOW, HIGH, fraction)
    mid = bands.mid_frequencies(index, fraction)
    np.testing.assert_allclose(mid, acoustics.exact_center_frequency(index, fraction), rtol=1e-12)
    for mine, theirs in zip(
        (mid, *bands.band_edges(index, fraction)),
        fractional_octave_frequencies_exact(fraction, (LOW, HIGH)),
        strict=True,
    ):
        np.testing.assert_allclose(mine, theirs, rtol=1e-12)


@pytest.mark.parametrize("fraction", [1, 3, 6, 12, 24])
def test_nominal_frequencies_are_those_of_python_acoustics(fraction: int) -> None:
    from acoustics.standards.iec_61260_1_2014 import nominal_center_frequency

    for index in bands.band_range(26.0, 19000.0, fraction):
        exact = float(bands.mid_frequencies(index, fraction))
        if fraction in (1, 3):
            theirs = float(nominal_center_frequency(exact, fraction))
        else:
            digits = 2 if int(f"{exact:e}"[0]) < 5 else 1
            theirs = round(exact, digits - int(np.floor(np.log10(exact))))
        assert bands.nominal_frequency(int(index), fraction) == pytest.approx(theirs, rel=1e-12)


def test_the_rounding_examples_of_annex_e() -> None:
    # E.3.4: 41,567 Hz is named 41,6 Hz; 8 785,2 Hz is named 8 800 Hz.
    for exact, nominal in ((41.567, 41.6), (8785.2, 8800.0)):
        index = bands.band_at(exact, 24)
        assert float(bands.mid_frequencies(index, 24)) == pytest.approx(exact, rel=2e-5)
        assert bands.nominal_frequency(index, 24) == nominal


def test_the_breakpoints_of_third_octaves_are_those_of_table_f1() -> None:
    table = {1 / 8: 1.02667, 1 / 4: 1.05575, 3 / 8: 1.08746, 1 / 2: 1.12202, 1: 1.29437, 2: 1.88173}
    table |= {3: 3.05365, 4: 5.39195}
    found = breakpoint_ratio(list(table), 3)
    np.testing.assert_allclose(found, list(table.values()), atol=6e-6)


def test_the_limits_at_the_breakpoints_are_those_of_pyfar() -> None:
    from pyfar.constants import fractional_octave_filter_tolerance

    lower, upper, frequency = fractional_octave_filter_tolerance(1000.0, 1, 1)
    minimum, maximum = class_1_limits(frequency / 1000.0, 1)
    inside = lower > -1000.0
    np.testing.assert_allclose(-upper, minimum, atol=1e-4)
    np.testing.assert_allclose(-lower[inside], maximum[inside], atol=1e-3)
    assert np.isinf(maximum[~inside]).all()


def test_levels_of_noise_are_those_of_two_other_libraries() -> None:
    import acoustics
    import pyfar

    rate, n = 48000, 240000
    samples = np.random.default_rng(0).standard_normal(n)
    channel = Channel("noise", unit="Pa", sampling_rate=float(rate), n_samples=n)
    found = Octave(fmin=250, fmax=8000, settling="counted")(
        Recording("noise", (channel,), ArraySource([samples]))
    )
    theirs = pyfar.dsp.filter.fractional_octave_bands(
        pyfar.Signal(samples, rate), num_fractions=3, frequency_range=(250, 8000)
    )
    difference = 10 * np.log10(np.mean(theirs.time**2, axis=-1).ravel() / 4e-10) - found.level_dB[0]
    # Filters of order 14 see other noise at the edges than filters of order 4; on average they agree.
    assert np.abs(difference).max() < 0.15
    assert abs(np.average(difference, weights=found.exact_hz)) < 0.01
    # python-acoustics takes the band edges as -3 dB frequencies of order 4: 0.112 dB more of white noise.
    for band in (0, 7, 15):
        passed = acoustics.signal.bandpass(samples, found.lower_hz[band], found.upper_hz[band], rate, order=8)
        level = 10 * np.log10(np.mean(passed**2) / 4e-10)
        assert level - found.level_dB[0, band] == pytest.approx(0.112, abs=0.02)
