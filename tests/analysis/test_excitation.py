"""Sine, noise or neither: from the user, the properties, the generator, the vibrometer."""

import numpy as np
import pytest
from scipy import signal

from specan.analysis.excitation import recognise
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.sine_fit import fit_sine
from specan.errors import RequestError

RATE, DURATION = 8000.0, 8.0
T = np.arange(int(RATE * DURATION)) / RATE
NOISE = np.random.default_rng(11).standard_normal(len(T))
TONE = np.sin(2 * np.pi * 250.3 * T)


def recording(vibrometer, generator=None, **properties):
    samples, channels = [vibrometer], [Channel("Vibrometer", role="vibrometer", unit="m/s")]
    if generator is not None:
        samples.append(generator)
        channels.append(Channel("Generator", role="generator", unit="V"))
    whole = tuple(
        Channel(c.name, role=c.role, unit=c.unit, sampling_rate=RATE, n_samples=len(x))
        for c, x in zip(channels, samples)
    )
    return Recording("a.tdms", whole, ArraySource(samples), **properties)


def band(low, high):
    return signal.sosfilt(signal.butter(4, [low, high], "band", fs=RATE, output="sos"), NOISE)


def pink():
    spectrum = np.fft.rfft(NOISE)
    return np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1.0)), len(NOISE))


SINES = {
    "clean": TONE,
    "distorted": TONE + 0.5 * np.sin(2 * np.pi * 750.9 * T + 1),
    "noisy": TONE + 0.7 * NOISE,
    "drifting": TONE + 5 * np.cumsum(NOISE) / np.sqrt(len(T)),
    "started late": np.where(T > 1.1, TONE, 1e-4 * NOISE),
    "ended early": np.where(T < 6.5, TONE, 0.0),
}


@pytest.mark.parametrize("frequency", [500.0, 800.0, 1000.0])
def test_hum_beside_a_tone_that_divides_half_the_rate(frequency):
    """Its harmonic at rate/2 is one function, not two: fitted a little below, it would hold anything."""
    for noise in (1e-4, 1e-3, 3e-2):
        hum = 0.05 * np.sin(2 * np.pi * 50 * T + 1)
        found = recognise(recording(np.sin(2 * np.pi * frequency * T) + hum + noise * NOISE))
        assert (found.kind, found.frequency_hz) == ("sine", pytest.approx(frequency, abs=0.01))
    slightly_low = fit_sine(np.sin(2 * np.pi * frequency * T) + 1e-3 * NOISE, RATE, frequency - 1e-5, 10)
    assert np.abs(slightly_low.phasors[1:]).max() < 1e-3


@pytest.mark.parametrize("name", SINES)
def test_sine(name):
    found = recognise(recording(SINES[name]))
    assert (found.kind, found.frequency_hz) == ("sine", pytest.approx(250.3, abs=0.01))
    assert "vibrometer channel 'Vibrometer'" in found.reason


@pytest.mark.parametrize(
    "samples",
    [NOISE, pink(), band(700, 1400), band(89, 112), np.sign(NOISE), NOISE + 0.2 * np.sin(2 * np.pi * 50 * T)],
    ids=["white", "pink", "octave", "third octave", "binary", "with hum"],
)
def test_noise(samples):
    assert recognise(recording(samples)).kind == "noise"


@pytest.mark.parametrize(
    ("samples", "word"),
    [
        (signal.chirp(T, 500, DURATION, 501), "varies"),
        (1e200 * np.sin(T), "too large"),
        (np.full_like(T, np.nan), "not finite"),
        (np.zeros_like(T), "silent"),
        (np.full_like(T, 3.3), "silent"),
        (NOISE * np.where(T > 4, np.exp((4 - T) / 0.02), 1e-5), "transient"),
        (0.55 * TONE + NOISE, "too much for noise"),
        (TONE[:200], "too short"),
        (TONE + np.sin(2 * np.pi * 251.3 * T), "narrow band"),
        (TONE + np.sin(2 * np.pi * 300.3 * T), "several tones"),
        ((1 + np.sin(2 * np.pi * 7 * T)) * TONE, "several tones"),
        (np.sin(2 * np.pi * 250 * T + 5 * np.sin(2 * np.pi * 3 * T)), "varies"),
        (np.sign(TONE), "square"),
        (1.0 * (T % 0.5 < 0.01), "channel"),
        (1.0 * (T % 0.02 < 0.002), "several tones"),
        (np.sin(2 * np.pi * 2 * T), "channel"),
    ],
    ids=[
        "slow sweep",
        "overflow",
        "not numbers",
        "zeros",
        "constant",
        "impulse",
        "mixture",
        "short",
        "beat",
        "two tones",
        "AM",
        "FM",
        "square wave",
        "slow pulses",
        "fast pulses",
        "a few periods",
    ],
)
def test_neither(samples, word):
    found = recognise(recording(samples))
    assert (found.kind, found.frequency_hz) == ("unknown", None)
    assert word in found.reason


def test_values_whose_squares_are_too_large_are_no_excitation_and_make_no_warning():
    assert recognise(recording(1e200 * TONE)).kind == "unknown"


def test_generator_before_vibrometer():
    found = recognise(recording(NOISE, generator=TONE))
    assert found.kind == "sine"
    assert "generator" in found.reason


def test_idle_generator_is_passed_over():
    assert recognise(recording(TONE, generator=1e-5 * NOISE)).kind == "sine"


def test_property_before_channel_and_contradiction_is_said():
    found = recognise(recording(TONE, properties={"Excitation": "gaussian noise"}))
    assert found.kind == "noise"
    assert "contradicted" in found.reason
    assert "250.3 Hz" in found.reason


def test_property_of_a_group_with_frequency():
    group = {"rig": {"Excitation": "sine", "ExcitationFrequency_Hz": "250"}}
    found = recognise(recording(TONE, group_properties=group))
    assert found.frequency_hz == pytest.approx(250.3, abs=1e-6)  # measured, being within 1 %
    assert "contradicted" not in found.reason
    found = recognise(recording(NOISE, group_properties=group))
    assert (found.kind, found.frequency_hz) == ("sine", 250.0)
    assert "contradicted" in found.reason


def test_stated_frequency_wins_over_another_tone():
    found = recognise(recording(TONE, properties={"Excitation": "sine", "ExcitationFrequency_Hz": 500.0}))
    assert found.frequency_hz == 500.0
    assert "contradicted" in found.reason


def test_calibrator_by_property():
    content = {"Excitation": "calibrator", "CalibratorFrequency_Hz": 1000.0}
    found = recognise(recording(0 * TONE, group_properties={"g": content}))
    assert (found.kind, found.frequency_hz) == ("calibrator", 1000.0)


@pytest.mark.parametrize(("text", "kind"), [("Swept sine", "sweep"), ("stepped sine", "stepped-sine")])
def test_sweep_and_steps_by_property(text, kind):
    found = recognise(recording(NOISE, properties={"Excitation": text}))
    assert (found.kind, found.stated) == (kind, True)
    assert "contradicted" in found.reason


@pytest.mark.parametrize(
    "frequency",
    [
        20 * 150 ** (T / DURATION),
        np.linspace(20, 60, len(T)),
        np.linspace(3000, 50, len(T)),
    ],
    ids=["logarithmic", "slow", "falling"],
)
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_sweep(frequency, noise):
    found = recognise(recording(np.sin(2 * np.pi * np.cumsum(frequency) / RATE) + noise * NOISE))
    assert (found.kind, found.frequency_hz, found.stated) == ("sweep", None, False)


@pytest.mark.parametrize("dwell", [0.2, 0.3, 1.0, 4.0])
def test_steps(dwell):
    frequency = 200 * 1.2 ** (T // dwell)
    found = recognise(recording(np.sin(2 * np.pi * np.cumsum(np.minimum(frequency, 3000)) / RATE)))
    assert (found.kind, found.frequency_hz) == ("stepped-sine", None)


@pytest.mark.parametrize("seconds", [2.0, 5.0, 5.9, 6.1, 8.0])
def test_the_length_does_not_decide(seconds):
    n = int(seconds * RATE)
    for samples, kind in (
        (TONE, "sine"),
        (NOISE, "noise"),
        (TONE + np.sin(2 * np.pi * 300.3 * T), "unknown"),
    ):
        assert recognise(recording(samples[:n])).kind == kind


def test_user_before_property():
    content = {"Excitation": "sine", "ExcitationFrequency_Hz": 250.0}
    found = recognise(recording(TONE, properties=content), said="noise")
    assert (found.kind, found.frequency_hz) == ("noise", None)
    assert "user" in found.reason
    assert "contradicted" in found.reason


def test_user_says_something_else():
    with pytest.raises(RequestError, match="sine or noise"):
        recognise(recording(TONE), said="nois")


def test_no_channel_to_ask():
    channel = Channel("Mic 1", role="microphone", sampling_rate=RATE, n_samples=len(T))
    found = recognise(Recording("a.tdms", (channel,), ArraySource([TONE])))
    assert found.kind == "unknown"
    assert "no generator or vibrometer" in found.reason


def test_looks_at_a_few_seconds_only():
    class Counting(ArraySource):
        read_samples = 0

        def read(self, indices, start, stop):
            Counting.read_samples += stop - start
            return super().read(indices, start, stop)

    long = Recording("a.tdms", recording(np.tile(TONE, 5)).channels, Counting([np.tile(TONE, 5)]))
    recognise(long)
    assert Counting.read_samples <= 6 * RATE
