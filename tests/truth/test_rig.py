"""The simulated rig is compared with physics that is written down here once more."""

import dataclasses

import numpy as np
import pytest
from nptdms import TdmsFile

from specan.io.write_tdms import VOLTS_PER_COUNT
from truth.rig import (
    Rig,
    box_rig,
    calibrator_take,
    knock_take,
    noise_take,
    pressure_per_velocity,
    sine_take,
    velocity_per_volt,
)
from truth.rig_files import write_tdms

RATE = 8000.0


@pytest.fixture(scope="module")
def rig() -> Rig:
    return box_rig()


def test_without_reflections_the_field_is_that_of_a_small_piston(rig: Rig) -> None:
    free = dataclasses.replace(rig, reflection=0.0)
    f = np.array([63.0, 440.0])
    response = pressure_per_velocity(free, f)
    r = np.linalg.norm(rig.mic_position_m - np.array(rig.piston_centre_m), axis=1)
    for i, frequency in enumerate(f):
        # Volume acceleration over 2 pi r: half a sphere around a baffled source.
        source = 2 * np.pi * frequency * np.pi * 0.05**2
        np.testing.assert_allclose(np.abs(response[:, i]), 1.204 * source / (2 * np.pi * r), rtol=1e-12)
        late = np.angle(response[:, i] * np.exp(2j * np.pi * frequency * r / 343.2))
        np.testing.assert_allclose(late, np.pi / 2, atol=1e-9)


def test_a_floor_adds_the_mirror_image(rig: Rig) -> None:
    # The other walls are so far away that what they send back is a percent.
    hall = dataclasses.replace(
        rig,
        dims_m=(200.0, 200.0, 200.0),
        piston_centre_m=(0.0, 100.0, 0.3),
        mic_position_m=np.array([[0.4, 100.2, 0.5]]),
    )
    f = np.array([300.0])
    free = pressure_per_velocity(dataclasses.replace(hall, reflection=0.0), f)[0, 0]
    added = pressure_per_velocity(dataclasses.replace(hall, reflection=0.5), f)[0, 0] - free
    r, mirrored = np.hypot(np.hypot(0.4, 0.2), np.array([0.2, 0.8]))
    expected = 0.5 * free * r / mirrored * np.exp(-2j * np.pi * 300.0 * (mirrored - r) / 343.2)
    assert abs(added / expected - 1) < 0.03


def test_sine_holds_tone_and_second_harmonic(rig: Rig) -> None:
    take = sine_take(rig, 250.0, 1.0, 8000, RATE, 1)
    spectrum = np.fft.rfft(take.truth) / 4000
    ratio = spectrum[:24, 250] / spectrum[24, 250]
    np.testing.assert_allclose(ratio, pressure_per_velocity(rig, np.array([250.0]))[:, 0], rtol=1e-9)
    assert abs(spectrum[24, 500] / spectrum[24, 250]) == pytest.approx(0.004, rel=1e-9)
    expected = velocity_per_volt(rig, np.array([250.0]))[0]
    assert spectrum[24, 250] / spectrum[25, 250] == pytest.approx(expected, rel=1e-9)


def test_noise_follows_the_transfer_function_in_time(rig: Rig) -> None:
    # Not in blocks of the simulation's own length: a stretch from the middle, against a direct sum.
    take = noise_take(rig, 0.5, 16000, RATE, 2)
    assert np.sqrt(np.mean(take.truth[25] ** 2)) == pytest.approx(0.5, rel=0.02)
    window = np.hanning(8192)
    parts = [window * take.truth[:, s : s + 8192] for s in range(0, 7000, 1024)]
    spectra = np.fft.rfft(np.array(parts))
    cross = np.sum(spectra[:, :24] * spectra[:, 24:25].conj(), axis=0)
    estimate = cross / np.sum(np.abs(spectra[:, 24]) ** 2, axis=0)
    f = np.fft.rfftfreq(8192, 1 / RATE)
    band = (f > 80) & (f < 3200)
    truth = pressure_per_velocity(rig, f[band])
    # Where a microphone sits in a minimum the leakage of a window shows; half the lines do better.
    assert np.median(np.abs(estimate[:, band] / truth - 1)) < 0.01


def test_microphones_differ_as_promised(rig: Rig) -> None:
    assert rig.phase_deg[0] == 0.0
    assert 0.5 < np.ptp(rig.sensitivity_dB) <= 2.0
    assert 3.0 < np.ptp(rig.phase_deg) <= 6.0
    take = calibrator_take(rig, (1, 3, 9), 40000, RATE, 3)
    time = np.arange(40000) / RATE
    tone = 2 * np.mean(take.volts * np.exp(-2j * np.pi * 1000.02 * time), axis=1)
    pascals = np.sqrt(2) * 20e-6 * 10 ** (94 / 20)
    expected = rig.sensitivity_V_per_Pa[[0, 2, 8]] * pascals
    np.testing.assert_allclose(np.abs(tone), expected, rtol=0.005)
    lead = np.degrees(np.angle(tone / tone[0]))
    np.testing.assert_allclose(lead, rig.phase_deg[[0, 2, 8]], atol=0.06)


def test_knock_is_short(rig: Rig) -> None:
    take = knock_take(rig, 4.0, 8000, RATE, 5)
    assert np.max(np.abs(take.truth[25])) == pytest.approx(4.0, rel=1e-3)
    assert np.mean(np.abs(take.truth[25]) > 0.04) < 0.005


def test_the_same_seed_gives_the_same_samples(rig: Rig) -> None:
    first, second = (noise_take(rig, 0.5, 2000, RATE, 7).volts for _ in range(2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, noise_take(rig, 0.5, 2000, RATE, 8).volts)


@pytest.mark.parametrize(("samples", "within"), [("int32", 0.5), ("float32", 0.05)])
def test_file_holds_the_volts_in_segments_of_a_second(tmp_path, rig: Rig, samples, within) -> None:
    take = sine_take(rig, 250.0, 1.0, 12000, RATE, 1).only(("Mic 2", "Generator"))
    path = tmp_path / "take.tdms"
    write_tdms(path, rig, take, samples=samples, description="two channels")
    file = TdmsFile.read(path)
    group = file["Measurement"]
    assert group.properties["Description"] == "two channels"
    assert group.properties["ExcitationFrequency_Hz"] == 250.0
    for name, volts in zip(take.names, take.volts, strict=True):
        assert np.max(np.abs(group[name][:] - volts)) <= within * VOLTS_PER_COUNT * 1.001
    assert group["Mic 2"].properties["wf_samples"] == 8000  # one write, not the length
    assert path.read_bytes().count(b"TDSm") == 2
