"""What the constant part, slow drift and the cut at a record's ends do to levels: nothing, unless asked for."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from specan.analysis.batch.table_lines import band_lines
from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.band_energy import BandEnergyAccumulator
from specan.dsp.record_ends import Fade

RATE = 51200.0
RNG = np.random.default_rng(6)


def recording(*samples: np.ndarray, rate: float = RATE, unit: str = "Pa") -> Recording:
    channels = tuple(
        Channel(f"Mic {i}", unit=unit, sampling_rate=rate, n_samples=x.size) for i, x in enumerate(samples, 1)
    )
    return Recording("r", channels, ArraySource(list(samples)))


def noise(seconds: float, level_dB: float = 40.0, rate: float = RATE) -> np.ndarray:
    return 20e-6 * 10 ** (level_dB / 20) * RNG.standard_normal(round(seconds * rate))


def all_levels(samples: np.ndarray, **settings: object) -> np.ndarray:
    found = Octave(fraction=3, **settings)(recording(samples))
    return np.concatenate([found.level_dB[0], [values[0] for values in found.overall_dB.values()]])


@pytest.mark.parametrize(
    "settings",
    [{}, {"settling": "counted"}, {"averaging": "fast"}, {"averaging": "slow", "hold": "max", "fmin": 50}],
    ids=str,
)
def test_a_constant_part_moves_no_level(settings: dict[str, object]) -> None:
    """From a thousandth of the noise to 160 dB; 0.01 dB is asked for."""
    samples = noise(2.0)
    plain = all_levels(samples, **settings)
    assert np.isfinite(plain).all()
    for offset in (2e-6, 0.02, 1.0, -2000.0):
        assert all_levels(samples + offset, **settings) == pytest.approx(plain, abs=0.005)


def test_octave_rms_and_the_tables_of_a_batch_agree() -> None:
    samples = noise(4.0) + 3.0 + 0.01 * np.cos(2 * np.pi * 0.7 * np.arange(4 * RATE) / RATE)
    measured = recording(samples)
    found, single = Octave()(measured), Levels()(measured)
    for name in "ZABC":
        assert found.overall_dB[name][0] == pytest.approx(single.equivalent_dB[name][0], abs=1e-9)
    rows = [line.split("\t") for line in band_lines(found).splitlines()]
    printed = {row[2]: float(row[3]) for row in rows}
    assert printed["total-A"] == pytest.approx(single.equivalent_dB["A"][0], abs=0.001)


@pytest.mark.parametrize("phase", [0.0, 0.8, np.pi / 2, 4.0])
@pytest.mark.parametrize("seconds", [2.0, 10.0])
def test_a_slow_drift_does_not_lift_the_weighted_levels(phase: float, seconds: float) -> None:
    """0.5 Hz of 1 Pa below 37 dB(A) of noise: 57 dB above it, whatever its value where the record is cut."""
    samples = noise(seconds)
    drift = np.sin(2 * np.pi * 0.5 * np.arange(samples.size) / RATE + phase)
    plain, found = Levels()(recording(samples)), Levels()(recording(samples + drift))
    assert found.equivalent_dB["A"][0] == pytest.approx(plain.equivalent_dB["A"][0], abs=0.05)
    assert found.max_dB[0] == pytest.approx(plain.max_dB[0], abs=0.1)
    # The shorter the fade, the wider what it leaves of the drift: 0.25 s and 0.5 s here.
    fmin = 40 if seconds > 5 else 80
    bands = [Octave(fmin=fmin)(recording(x)).level_dB[0] for x in (samples, samples + drift)]
    assert bands[1] == pytest.approx(bands[0], abs=0.1)


def test_a_drift_is_not_measured_by_the_beginning_of_the_record() -> None:
    """A step of the constant part after the first block: the mean is that of the whole."""
    samples = np.where(np.arange(200000) < 100000, 0.0, 2.0) + 1e-3 * RNG.standard_normal(200000)
    found = Levels()(recording(samples, unit="V"))
    assert found.mean[0] == pytest.approx(1.0, abs=1e-4)
    assert found.rms[0] == pytest.approx(1.0, abs=1e-4)
    assert found.max_dB[0] == pytest.approx(0.0, abs=0.01)  # |+-1| about the mean


def test_quiet_bands_beside_a_strong_tone() -> None:
    """A tone of 100 dB, cut anywhere, over noise of 5 dB in a band: the ends are worth 10 dB and more."""
    t = np.arange(round(3.5 * RATE)) / RATE
    quiet = noise(3.5, 35.0)
    loud = quiet + 2.0 * np.sqrt(2) * np.cos(2 * np.pi * 2503.7 * t + 0.3)
    expected = Octave(fmin=40, fmax=315)(recording(quiet)).level_dB[0]
    for settling in ("left-out", "counted"):
        found = Octave(fmin=40, fmax=4000, settling=settling)(recording(loud))
        n = expected.size
        away = found.level_dB[0, :n] - expected
        other = found.other
        assert other is not None
        if settling == "left-out":
            assert np.abs(away).max() < 0.01
            assert other.level_dB[0, :n].max() > expected[0] + 10.0
        else:
            assert away.max() > 10.0
            assert other.level_dB[0, :n] == pytest.approx(expected, abs=0.01)
        assert np.array_equal(found.edges[0], np.abs(found.level_dB[0] - other.level_dB[0]) > 0.5)
        assert found.edges[0, :n].all()
        words = found.band_flags(0, 3)
        assert words[-2:] == ("edges", f"{other.name}={other.level_dB[0, 3]:.3f}")
        band = int(np.argmin(np.abs(found.exact_hz - 2500)))
        assert not found.edges[0, band]
        assert found.level_dB[0, band] == pytest.approx(100.0, abs=0.02)
        assert found.overall_flags(0, "A") == ()


def test_an_event_inside_the_record_keeps_its_energy() -> None:
    """Half a second of a tone in the middle of two: nothing at the ends, nothing to leave out."""
    t = np.arange(round(2 * RATE)) / RATE
    burst = np.where(np.abs(t - 1.0) < 0.25, np.sin(2 * np.pi * 1000 * t), 0.0)
    found = Octave(band=1000)(recording(burst))
    energy = 10 * np.log10(0.5 * 0.25 / 4e-10)
    assert found.level_dB[0, 0] == pytest.approx(energy, abs=0.03)
    assert found.overall_dB["Z"][0] == pytest.approx(energy, abs=0.001)
    assert not found.edges.any()


def test_stationary_noise_keeps_its_level_and_is_not_flagged() -> None:
    found = Octave(fmin=100)(recording(*(noise(3.0, 60.0) for _ in range(40))))
    assert found.other is not None
    mean = [10 * np.log10(np.mean(10 ** (x / 10), axis=0)) for x in (found.level_dB, found.other.level_dB)]
    assert mean[0] == pytest.approx(mean[1], abs=0.12)
    assert found.edges[:, 8:].sum() == 0


def test_the_spectrum_between_the_ends_is_that_of_the_faded_record() -> None:
    for rate, seconds in ((8000.0, 0.7), (8000.0, 21.0), (102400.0, 2.0)):
        n = round(rate * seconds)
        samples = RNG.standard_normal((2, n)) + 30 * np.cos(2 * np.pi * 1000 * np.arange(n) / rate)
        fade, index = Fade.of(n, rate), np.arange(-15, 3)
        both = BandEnergyAccumulator(2, rate, n)
        plain = BandEnergyAccumulator(2, rate)
        for first in range(0, n, 7777):
            both.add(samples[:, first : first + 7777])
            plain.add((samples * fade.weights(0, n))[:, first : first + 7777])
        found, faded = both.result(), plain.result()
        ratio = found.between_ends().band_mean_square(index, 3) / faded.band_mean_square(index, 3)
        np.testing.assert_allclose(ratio / ratio[:, :1], 1.0, rtol=1e-8)
        assert ratio[:, 0] == pytest.approx(found.mean_square / faded.mean_square, rel=2e-4)
        assert (ratio <= n / fade.averaged * (1 + 1e-9)).all()


MEASURED = os.environ.get("SPECAN_MEASUREMENTS", "")
MOTOR = Path(MEASURED) / "motor_octaves"


@pytest.mark.skipif(
    not (MEASURED and MOTOR.is_dir()), reason="SPECAN_MEASUREMENTS names no directory with motor_octaves"
)
def test_a_motor_beside_two_analysers() -> None:
    """3.5 s of the vibration of a motor: github.com/Eomys/MoSQITo, validations/sound_level_meter/noct_spectrum."""
    pyuff = pytest.importorskip("pyuff")
    start = str(MOTOR / "electric_motor_vibration_")
    samples = np.asarray(pyuff.UFF(start + "signal.uff").read_sets(0)["data"], dtype=float)
    dewesoft = 20 * np.log10(np.asarray(pyuff.UFF(start + "noct_dewe.uff").read_sets(0)["data"], dtype=float))
    table = Path(start + "3oct_oros.txt").read_text(encoding="latin-1").split("\n")[2:]
    oros = 20 * np.log10([float(line.split()[1]) for line in table if line.strip()])
    motor = recording(samples, unit="m/s^2")
    settings = {"fmin": 25, "velocity_reference": "1 nm/s"}
    counted = Octave(settling="counted", **settings)(motor)
    left_out = Octave(**settings)(motor)
    low, middle = counted.nominal_hz <= 250, counted.nominal_hz <= 800
    away = counted.level_dB[0] - 120.0 - dewesoft
    # Dewesoft keeps the constant part of the record, -0.5 m/s^2, which is taken off here: its cut at the ends is in one
    # result and not in the other. Like with like, with the constant kept, the two are within 0.12 dB.
    assert np.abs(away[low]).max() < 0.15
    plain = BandEnergyAccumulator(1, RATE)
    plain.add(samples[None])
    index = np.arange(-16, -16 + dewesoft.size)
    as_it_is = 10 * np.log10(plain.result().band_mean_square(index, 3)[0])
    assert np.abs(as_it_is - dewesoft)[low].max() < 0.12
    assert np.sqrt(np.mean(np.square(left_out.level_dB[0] - 120.0 - oros)[middle])) < 0.3
    assert left_out.edges[0, (left_out.nominal_hz >= 315) & middle].all()
