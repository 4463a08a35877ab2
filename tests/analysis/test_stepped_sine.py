from dataclasses import replace

import numpy as np
import pytest

from specan.analysis.tone import Tone, join_stepped_sine, not_steps
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError

RATE, N = 8000.0, 16000
T = np.arange(N) / RATE
RNG = np.random.default_rng(2)


def step(f, label="", gain=1.0, reference="Vib", channels=("Mic 1",), noise=1e-3):
    """A microphone that sees gain * f / 100 times the velocity, 1 ms late."""
    common = {"sampling_rate": RATE, "n_samples": N}
    vib = np.cos(2 * np.pi * f * T)
    mics = [
        gain * f / 100 * np.cos(2 * np.pi * f * (T - 1e-3)) + noise * RNG.standard_normal(N) for _ in channels
    ]
    all_channels = (
        Channel(reference, role="vibrometer", unit="m/s", **common),
        *(Channel(name, role="microphone", unit="Pa", **common) for name in channels),
    )
    return Tone()(Recording(label or f"{f}.tdms", all_channels, ArraySource([vib, *mics])))


def test_lines_in_order_of_frequency():
    found = join_stepped_sine([step(f) for f in (400.0, 100.0, 250.0)], "sines")
    np.testing.assert_allclose(found.frequency_hz, [100, 250, 400], atol=1e-4)
    np.testing.assert_allclose(found.magnitude[0], [1, 2.5, 4], rtol=1e-3)
    np.testing.assert_allclose(found.phase_deg[0], [-36, -90, -144], atol=0.05)
    assert found.channels == ("Mic 1",)
    assert (found.units, found.reference_unit) == (("Pa/(m/s)",), "m/s")
    assert (found.estimator, found.line_correlation) == ("stepped sine", 0.0)
    assert np.isnan(found.coherence).all()


def test_repeats_are_averaged_and_their_scatter_counts():
    found = join_stepped_sine([step(100.0, "a", 1.0), step(100.0, "b", 1.2), step(200.0, "c")])
    assert found.response.shape == (1, 2)
    assert found.magnitude[0, 0] == pytest.approx(1.1, rel=1e-3)
    # two readings 0.2 apart: 0.1 in one of two components
    assert found.u_magnitude_percent[0, 0] == pytest.approx(100 * 0.1 / 1.1 / np.sqrt(2), rel=0.05)
    assert found.u_magnitude_percent[0, 1] < 0.1


def test_a_missing_channel_is_nan():
    found = join_stepped_sine([step(100.0, channels=("Mic 1", "Mic 2")), step(200.0)])
    assert found.channels == ("Mic 1", "Mic 2")
    assert np.isnan(found.response[1, 1])
    assert np.isfinite(found.response[1, 0])
    assert np.isfinite(found.unwrapped_phase_deg[0]).all()


def test_recordings_without_reference_are_noted():
    without = Tone(frequency_hz=300.0)(
        Recording(
            "x.tdms",
            (Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=RATE, n_samples=N),),
            ArraySource([np.cos(2 * np.pi * 300 * T)]),
        )
    )
    found = join_stepped_sine([step(100.0), without])
    assert len(found.frequency_hz) == 1
    assert "x.tdms" in found.notes[0]
    with pytest.raises(InputError, match="none has phases"):
        join_stepped_sine([without])


def test_references_have_to_agree():
    with pytest.raises(InputError, match="different references: Vib, Vib 2"):
        join_stepped_sine([step(100.0), step(200.0, reference="Vib 2")])


def found_in_the_signal(f, vib, label, scale=1.0):
    common = {"sampling_rate": RATE, "n_samples": N}
    channels = (
        Channel("Vib", role="vibrometer", unit="m/s", **common),
        Channel("Mic 1", role="microphone", unit="Pa", **common),
    )
    table = Tone(frequency_hz=f)(Recording(label, channels, ArraySource([scale * vib, scale * vib])))
    return replace(table, stated=False)


def test_what_is_no_step():
    square = found_in_the_signal(200.0, np.sign(np.cos(2 * np.pi * 200.3 * T)), "square")
    hum = found_in_the_signal(50.0, np.cos(2 * np.pi * 50.02 * T), "hum", 0.05)
    sines = [found_in_the_signal(f, np.cos(2 * np.pi * f * T), f"{f}") for f in (50.0, 110.0, 250.0)]
    left_out = not_steps([square, hum, *sines])
    assert set(left_out) == {"square", "hum"}
    assert "distorted" in left_out["square"]
    assert "mains" in left_out["hum"]
    assert not not_steps([replace(t, stated=True) for t in (square, hum, *sines)])
