"""Tone tables: levels, phases over the vibrometer, distortion, flags."""

from dataclasses import replace

import numpy as np
import pytest

from specan.analysis.tone import Tone, ToneAccumulator
from specan.data.channel import Channel, PhaseCalibration
from specan.data.recording import ArraySource, Recording
from specan.errors import InputError, RequestError

RATE, N, F = 8000.0, 32000, 250.37
T = np.arange(N) / RATE
RNG = np.random.default_rng(23)


def tone(amplitude=1.0, phase_deg=0.0, f=F):
    return amplitude * np.cos(2 * np.pi * f * T + np.radians(phase_deg))


def recording(mics, vibrometer=None, generator=None, properties=None, **changes):
    common = {"sampling_rate": RATE, "n_samples": N}
    channels = [Channel(f"Mic {k + 1}", role="microphone", unit="Pa", **common) for k in range(len(mics))]
    samples = list(mics)
    for name, role, unit, x in (
        ("Vibrometer", "vibrometer", "m/s", vibrometer),
        ("Generator", "generator", "V", generator),
    ):
        if x is not None:
            channels.append(Channel(name, role=role, unit=unit, **common))
            samples.append(x)
    channels = [replace(c, **changes.get(c.name.replace(" ", ""), {})) for c in channels]
    return Recording("a.tdms", tuple(channels), ArraySource(samples), properties=properties or {})


def test_levels_and_phases_over_the_vibrometer():
    found = Tone()(recording([tone(2.0, 40.0), tone(0.5, -170.0)], tone(0.01, 30.0), tone(3.0, 77.0)))
    assert found.frequency_hz == pytest.approx(F, abs=1e-6)
    assert (found.reference, found.leader) == ("Vibrometer", "Generator")
    assert found.channels == ("Mic 1", "Mic 2", "Vibrometer", "Generator")
    np.testing.assert_allclose(found.phase_deg, [10.0, 160.0, 0.0, 47.0], atol=1e-4)
    np.testing.assert_allclose(found.tone_rms * np.sqrt(2), [2.0, 0.5, 0.01, 3.0], rtol=1e-6)
    np.testing.assert_allclose(found.magnitude, [200.0, 50.0, 1.0, 300.0], rtol=1e-6)
    assert found.magnitude_units[0] == "Pa/(m/s)"
    assert found.reference_rms == pytest.approx(0.01 / np.sqrt(2), rel=1e-6)
    assert all(f == () for f in found.flags)


def test_a_delayed_microphone_has_a_negative_phase():
    found = Tone()(recording([np.cos(2 * np.pi * F * (T - 2.5e-4))], tone()))
    assert found.phase_deg[0] == pytest.approx(-360 * F * 2.5e-4, abs=1e-4)


def test_reference_between_microphones():
    found = Tone(reference="Mic 1")(recording([tone(1, 20), tone(1, 50)], tone()))
    np.testing.assert_allclose(found.phase_deg, [0, 30, -20], atol=1e-4)


@pytest.mark.parametrize(("derivatives", "phase"), [(1, -90.0), (-1, 90.0)])
def test_displacement_and_acceleration_become_velocity(derivatives, phase):
    found = Tone()(recording([tone()], tone(), Vibrometer={"derivatives": derivatives, "unit": "m"}))
    assert found.phase_deg[0] == pytest.approx(phase, abs=1e-5)
    assert found.tone_rms[1] == pytest.approx((2 * np.pi * F) ** derivatives / np.sqrt(2), rel=1e-6)
    assert found.units[1] == "m/s"


def test_calibration_and_delay_enter_phase_and_uncertainty():
    leads = PhaseCalibration((1000.0,), (8.0,), (0.3,), model="constant")
    plain = recording([tone()], tone())
    corrected = recording(
        [tone()], tone(), Mic1={"phase": leads}, Vibrometer={"delay_s": 1e-4, "u_delay_s": 1e-5}
    )
    before, after = Tone()(plain), Tone()(corrected)
    shift = -8.0 - 360 * F * 1e-4
    assert after.phase_deg[0] - before.phase_deg[0] == pytest.approx(shift, abs=1e-6)
    common = np.hypot(leads.u_at(np.array([F]))[0], 360 * F * 1e-5)
    assert after.u_common_phase_deg[0] == pytest.approx(common, rel=1e-6)
    assert after.u_phase_deg[0] == pytest.approx(common, rel=1e-3)  # no noise
    assert after.u_phase_deg[1] == 0  # of the reference over itself


def test_total_harmonics_and_noise():
    x = tone(1.0) + tone(0.03, 10, 2 * F) + tone(0.04, 50, 3 * F) + 0.02 * RNG.standard_normal(N)
    found = Tone()(recording([x], tone()))
    assert found.thd_percent[0] == pytest.approx(5.0, abs=0.05)
    np.testing.assert_allclose(found.harmonics_rms[0, 1:3] * np.sqrt(2), [0.03, 0.04], atol=5e-4)
    assert found.noise_rms[0] == pytest.approx(0.02, rel=0.02)
    assert found.rms[0] == pytest.approx(np.std(x), rel=1e-3)
    assert found.harmonics_rms.shape == (2, 10)


def test_phase_error_is_covered():
    misses = 0
    for _ in range(40):
        x = tone(1.0, 25.0) + 0.3 * RNG.standard_normal(N)
        found = Tone(frequency_hz=F)(recording([x], tone() + 0.1 * RNG.standard_normal(N)))
        misses += abs(found.phase_deg[0] - 25.0) > 2 * found.u_phase_deg[0]
    assert misses <= 6  # 2 expected


def test_a_weak_tone_is_flagged():
    found = Tone()(recording([tone(1e-3) + RNG.standard_normal(N), 0 * T], tone()))
    assert found.flags[:2] == (("low-snr",), ("dead",))
    assert found.u_phase_deg[0] > 1


def test_without_a_vibrometer_there_is_no_phase():
    found = Tone()(recording([tone()], generator=tone()))
    assert found.reference is None
    assert np.isnan(found.phase_deg).all()
    assert found.flags[0] == ("no-reference",)
    assert found.tone_rms[0] == pytest.approx(np.sqrt(0.5), rel=1e-6)


def test_a_reference_without_the_tone_is_none():
    found = Tone()(recording([tone()], RNG.standard_normal(N), tone()))
    assert "no-reference" in found.flags[0]
    assert np.isnan(found.phase_deg).all()


def test_frequency_from_the_user_is_refined_nearby_only():
    both = tone(0.2) + tone(1.0, f=500.0)
    assert Tone(frequency_hz=251.0)(recording([both], both)).frequency_hz == pytest.approx(F, abs=1e-4)


def test_frequency_from_a_property():
    both = tone(0.3) + tone(1.0, f=500.0)
    content = {"Excitation": "sine", "ExcitationFrequency_Hz": 250.0}
    assert Tone()(recording([both], both, properties=content)).frequency_hz == pytest.approx(F, abs=1e-4)


def test_nothing_is_known_about_a_silent_recording():
    found = Tone(frequency_hz=100.0)(recording([0 * T], 0 * T))
    assert found.frequency_hz == 100.0
    assert found.flags == (("dead",), ("dead",))


def test_section_and_pieces():
    source = recording([np.where(T < 2, 5.0, 1.0) * tone(1.0, 33.0)], tone())
    found = Tone(start_s=2.0)(source)
    assert found.tone_rms[0] == pytest.approx(np.sqrt(0.5), rel=1e-4)
    accumulator = ToneAccumulator(source, Tone(start_s=2.0))
    for samples in source.blocks(accumulator.channels, 1234, accumulator.start, accumulator.stop):
        accumulator.add(samples)
    assert accumulator.result().phase_deg.tobytes() == found.phase_deg.tobytes()


def test_refusals():
    source = recording([tone()], tone())
    with pytest.raises(RequestError, match="half the sampling rate"):
        Tone(frequency_hz=4000.0)(source)
    with pytest.raises(InputError, match="two cycles"):
        Tone(frequency_hz=100.0, start_s=1.0, stop_s=1.01)(source)
    with pytest.raises(RequestError, match="no channel 'Mic 9'"):
        Tone(channels=("Mic 9",))(source)
    with pytest.raises(InputError, match="sampling rate"):
        Tone()(recording([tone()], Mic1={"sampling_rate": 0.0}))


@pytest.mark.parametrize(("seconds", "f"), [(0.2, F), (0.5, F), (1.0, 37.21)])
def test_intervals_of_short_tones_hold_the_truth(seconds, f):
    """Few blocks: Student's factor, by Monte Carlo. Eight recordings of 60 microphones with noise of their own."""
    rng, n, true = np.random.default_rng(12), round(seconds * RATE), np.radians(33.0)
    t, held = np.arange(n) / RATE, []
    for _ in range(8):
        turn = 2 * np.pi * (f * t + rng.uniform())
        mics = 2 * np.cos(turn + true) + 0.14 * rng.standard_normal((60, n))
        vibrometer = Channel("Vibrometer", role="vibrometer", unit="m/s", sampling_rate=RATE, n_samples=n)
        channels = [replace(vibrometer, name=f"Mic {k}", role="microphone", unit="Pa") for k in range(60)]
        source = ArraySource([*mics, np.cos(turn) + 0.01 * rng.standard_normal(n)])
        found = Tone(reference="Vibrometer")(Recording("a.tdms", (*channels, vibrometer), source))
        of_phase = np.abs(found.phase_deg[:60] - 33.0) < 1.96 * found.u_phase_deg[:60]
        of_size = np.abs(found.magnitude[:60] / 2 - 1) < 1.96 * found.u_magnitude_percent[:60] / 100
        held.append([np.mean(of_phase), np.mean(of_size)])
    assert np.all(np.mean(held, axis=0) > 0.92)
    assert np.all(np.mean(held, axis=0) < 0.985)
