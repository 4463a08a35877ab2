"""What the constant part, slow drift and the cut at a record's ends do to levels: nothing, unless asked for."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import bilinear_zpk, lfilter, resample, sosfilt, zpk2sos

from specan.analysis.batch.tables import band_lines
from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.section import slow_part
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.band_energy import BandEnergyAccumulator
from specan.dsp.bands import Bands, power_response
from specan.dsp.record_edges import Fade
from specan.dsp.weighting import weighting_level

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
        assert found.overall_dB[name][0] == pytest.approx(single.equivalent_dB[name][0], abs=1e-3)
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
    bands = [Octave(fmin=63)(recording(x)).level_dB[0] for x in (samples, samples + drift)]
    assert bands[1] == pytest.approx(bands[0], abs=0.25)  # of 50 dB


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
    expected = Octave(fmin=40, fmax=315, settling="left-out")(recording(quiet)).level_dB[0]
    for settling in ("left-out", "counted"):
        found = Octave(fmin=40, fmax=4000, settling=settling)(recording(loud))
        n = expected.size
        away = found.level_dB[0, :n] - expected
        other = found.other
        assert other is not None
        if settling == "left-out":
            assert np.abs(away).max() < 0.02
            assert other.level_dB[0, :n].max() > expected[0] + 10.0
        else:
            assert away.max() > 10.0
            assert other.level_dB[0, :n] == pytest.approx(expected, abs=0.02)
        assert np.array_equal(found.edges[0], np.abs(found.level_dB[0] - other.level_dB[0]) > 0.5)
        assert found.edges[0, :n].all()
        words = found.band_flags(0, 3)
        assert words[-2:] == ("edges", f"{other.name}={other.level_dB[0, 3]:.3f}")
        band = int(np.argmin(np.abs(found.exact_hz - 2500)))
        assert not found.edges[0, band]
        assert found.level_dB[0, band] == pytest.approx(100.0, abs=0.02)
        assert found.overall_flags(0, "A") == ()


POLES = {"A": (20.598997, 20.598997, 107.65265, 737.86223, 12194.217, 12194.217)}  # IEC 61672-1:2013, E.4.1
POLES["C"] = (20.598997, 20.598997, 12194.217, 12194.217)


def weighting_system(weighting: str) -> tuple[np.ndarray, np.ndarray, float]:
    zeros, poles = np.zeros(4 if weighting == "A" else 2), -2 * np.pi * np.array(POLES[weighting])
    at_1_khz = np.prod(2j * np.pi * 1000 - zeros) / np.prod(2j * np.pi * 1000 - poles)
    return zeros, poles, 1 / float(abs(at_1_khz))


def directly(samples: np.ndarray, weighting: str, rate: float) -> np.ndarray:
    """Behind the analogue poles, by a bilinear filter at eight times the rate."""
    if weighting == "Z":
        return samples
    fine = resample(samples, 8 * samples.size)
    sos = zpk2sos(*bilinear_zpk(*weighting_system(weighting), 8 * rate))
    return np.asarray(sosfilt(sos, fine)[::8])


def largest(y: np.ndarray, rate: float, averaging: str) -> float:
    """Of the running average, with the peak holder of Impulse behind it."""
    tau = {"fast": 0.125, "slow": 1.0, "impulse": 0.035}[averaging]
    keep = np.exp(-1 / (rate * tau))
    return float(lfilter([1 - keep], [1, -keep], np.square(y)).max())


@pytest.mark.parametrize("weighting", ["A", "C", "Z"])
@pytest.mark.parametrize(
    ("rate", "frequency"),
    [(8000.0, 125.0), (51200.0, 1000.0), pytest.param(204800.0, 3000.0, marks=pytest.mark.long)],
)
@pytest.mark.parametrize("place", [0.005, 0.05, 0.5, -0.005, -0.05, -0.5])
def test_a_burst_near_an_end_counts(weighting: str, rate: float, frequency: float, place: float) -> None:
    """Pieces of a long record, filtered as a whole by another program."""
    n, m = round(1.2 * rate), round(20e-3 * rate)
    whole = 6e-5 * np.random.default_rng(5).standard_normal(2 * n)
    first = n // 2
    start = first + round(place * rate) if place > 0 else first + n + round(place * rate) - m
    whole[start : start + m] += np.sin(2 * np.pi * frequency * np.arange(m) / rate) * np.hanning(m)
    y = directly(whole, weighting, rate)[first : first + n]
    cut = recording(whole[first : first + n], rate=rate)
    for averaging in ("fast", "slow"):
        found = Levels(averaging=averaging, weighting=weighting)(cut)
        assert found.max_dB[0] == pytest.approx(10 * np.log10(largest(y, rate, averaging) / 4e-10), abs=0.05)
    if weighting == "A":
        for averaging in ("slow", "impulse"):
            of_bands = Octave(averaging=averaging, hold="max", fmin=100)(cut).overall_dB["A"][0]
            assert of_bands == pytest.approx(10 * np.log10(largest(y, rate, averaging) / 4e-10), abs=0.05)
    equivalent = 10 * np.log10(np.mean(np.square(y)) / 4e-10)
    assert found.equivalent_dB[weighting][0] == pytest.approx(equivalent, abs=0.05)
    assert found.exposure_dB[weighting][0] == pytest.approx(equivalent + 10 * np.log10(1.2), abs=0.05)
    if weighting == "C":
        assert found.c_peak_dB[0] == pytest.approx(20 * np.log10(np.abs(y).max() / 2e-5), abs=0.1)
    assert Octave(band=500)(cut).overall_dB[weighting][0] == pytest.approx(equivalent, abs=0.05)
    held = Octave(band=500, averaging="impulse", hold="max")(cut).overall_dB[weighting][0]
    assert held == pytest.approx(10 * np.log10(largest(y, rate, "impulse") / 4e-10), abs=0.05)


@pytest.mark.parametrize("place", [0.01, 0.05])
def test_the_peak_of_a_low_event_that_begins_with_the_record_is_not_taken_for_the_cut(place: float) -> None:
    rate, n, m = 8000.0, 8000, 800
    start = n // 2 + round(place * rate)
    whole = 2e-5 * np.random.default_rng(3).standard_normal(2 * n)
    whole[start : start + m] += np.sin(2 * np.pi * 31.5 * np.arange(m) / rate) * np.hanning(m)
    y = directly(whole, "C", rate)[n // 2 : n // 2 + n]
    found = Levels()(recording(whole[n // 2 : n // 2 + n], rate=rate)).c_peak_dB[0]
    assert found == pytest.approx(20 * np.log10(np.abs(y).max() / 2e-5), abs=0.03)


@pytest.mark.parametrize(("hz", "seconds", "place"), [(39.4, 0.0178, 0.0134), (97.0, 0.008, 0.0061)])
def test_a_peak_of_a_slow_event_at_the_start_is_right_or_given_with_the_cut_as_well(
    hz, seconds, place
) -> None:
    """A piece of a long record with a constant part; truth by the analogue poles, in another program."""
    rate, n = 25600.0, 25600
    t = (np.arange(2 * n) - n // 2) / rate - place
    event = np.where(np.abs(t - seconds / 2) < seconds / 2, 1 - np.cos(2 * np.pi * t / seconds), 0.0)
    whole = 2e-5 * RNG.standard_normal(2 * n) + event * np.sin(2 * np.pi * hz * t + 5.4)
    y = directly(whole, "C", rate)[n // 2 : n // 2 + n]
    found = Levels()(recording(whole[n // 2 : n // 2 + n] + 0.2, rate=rate))
    counted = [float(w.split("=")[1]) for w in found.flags[0] if w.startswith("counted-C_peak")]
    away = np.abs(np.array([found.c_peak_dB[0], *counted]) - 20 * np.log10(np.abs(y).max() / 2e-5))
    assert away.min() < 0.1
    assert away[0] < 0.1 or counted


@pytest.mark.parametrize("frequency", [10.0, 16.0, 31.5])
@pytest.mark.parametrize("phase", [0.0, 1.2, 2.5])
def test_a_steady_low_tone_that_is_cut_is_a_steady_tone(frequency: float, phase: float) -> None:
    """94 dB of a cosine: the levels are those of the curves, the peaks 3.01 dB above."""
    rate = 8000.0
    tone = np.sqrt(2) * np.cos(2 * np.pi * frequency * np.arange(round(3 * rate)) / rate + phase)
    found = Levels()(recording(tone + 1e-6 * RNG.standard_normal(tone.size), rate=rate))
    true = {w: 93.979 + float(weighting_level(frequency, w)) for w in ("A", "C")}
    for weighting, expected in true.items():
        assert found.equivalent_dB[weighting][0] == pytest.approx(expected, abs=0.02)
    # The square of a tone ripples behind Fast: 10 lg(1 + 1 / (2 w tau)).
    ripple = 10 * np.log10(1 + 1 / (4 * np.pi * frequency * 0.125))
    assert found.max_dB[0] == pytest.approx(true["A"] + ripple, abs=0.05)
    assert found.c_peak_dB[0] == pytest.approx(true["C"] + 3.01, abs=0.03)
    totals = Octave(band=500)(recording(tone, rate=rate)).overall_dB
    assert totals["A"][0] == pytest.approx(true["A"], abs=0.1)


def test_levels_that_hang_on_the_cut_are_flagged_with_the_other_figure() -> None:
    """What filters at rest make of a cut cosine: by the analogue poles, in another program."""
    rate, seconds = 8000.0, 2.0
    tone = np.sqrt(2) * np.cos(2 * np.pi * 10.0 * np.arange(round(seconds * rate)) / rate)
    before = np.concatenate([np.zeros(4000), tone])
    y = directly(before, "A", rate)[4000:]
    words = Levels()(recording(tone, rate=rate)).flags[0]
    assert words[0] == "edges"
    counted = {word.split("=")[0]: float(word.split("=")[1]) for word in words[1:]}
    assert counted["counted-max"] == pytest.approx(10 * np.log10(largest(y, rate, "fast") / 4e-10), abs=0.1)
    equivalent = 10 * np.log10(np.mean(np.square(y)) / 4e-10)
    assert counted["counted-Leq_A"] == pytest.approx(equivalent, abs=0.05)
    # Between the samples of a step the two programs draw another line.
    peak = 20 * np.log10(np.abs(directly(before, "C", rate)).max() / 2e-5)
    assert counted["counted-C_peak"] == pytest.approx(peak, abs=0.6)
    # Of bands a part of the cut is taken for a drift, and what rings after the end counts.
    totals = Octave(band=500)(recording(tone, rate=rate)).overall_flags(0, "A")
    assert totals[0] == "edges"
    assert float(totals[1].removeprefix("counted=")) == pytest.approx(equivalent, abs=3.1)
    held = Octave(band=500, averaging="fast", hold="max")(recording(tone, rate=rate)).overall_flags(0, "A")
    assert held == ("edges", f"counted={counted['counted-max']:.3f}")


@pytest.mark.parametrize("frequency", [100.0, 1000.0])
def test_a_level_that_does_not_is_not_flagged(frequency: float) -> None:
    tone = np.cos(2 * np.pi * frequency * np.arange(round(2 * RATE)) / RATE)
    for samples in (tone, noise(2.0, 60.0), noise(2.0, 60.0) + 1.0):
        assert Levels()(recording(samples)).flags == ((),)


def test_an_event_inside_the_record_keeps_its_energy() -> None:
    """Half a second of a tone in the middle of two: nothing at the ends, nothing to leave out."""
    t = np.arange(round(2 * RATE)) / RATE
    burst = np.where(np.abs(t - 1.0) < 0.25, np.sin(2 * np.pi * 1000 * t), 0.0)
    found = Octave(band=1000)(recording(burst))
    energy = 10 * np.log10(0.5 * 0.25 / 4e-10)
    assert found.level_dB[0, 0] == pytest.approx(energy, abs=0.03)
    assert found.overall_dB["Z"][0] == pytest.approx(energy, abs=0.001)
    assert not found.edges.any()


@pytest.mark.long
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
        plain = BandEnergyAccumulator(2, rate, n)
        for first in range(0, n, 7777):
            both.add(samples[:, first : first + 7777])
            plain.add((samples * fade.weights(0, n))[:, first : first + 7777])
        found, faded = both.result(), plain.result()
        ratio = found.between_ends().band_mean_square(Bands.octaves(3, index)) / faded.band_mean_square(
            Bands.octaves(3, index)
        )
        np.testing.assert_allclose(ratio / ratio[:, :1], 1.0, rtol=1e-8)
        assert ratio[:, 0] == pytest.approx(found.mean_square / faded.mean_square, rel=1e-3)
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
    counted, left_out = (Octave(settling=name, **settings)(motor) for name in ("counted", "left-out"))
    low, middle = counted.nominal_hz <= 250, counted.nominal_hz <= 800
    # Dewesoft filters the record as it is. With all of it in, the two agree.
    plain = BandEnergyAccumulator(1, RATE, samples.size)
    plain.add(samples[None])
    index = np.arange(-16, -16 + dewesoft.size)
    as_it_is = 10 * np.log10(plain.result().band_mean_square(Bands.octaves(3, index))[0])
    assert np.abs(as_it_is - dewesoft)[low].max() < 0.12
    # specan takes off the constant part and, at the ends, what is slower than the lowest band; their cut is in the
    # levels of Dewesoft. How much that is, and the level without it, a transform of the padded record says.
    slow = slow_part(motor, motor.channels, 0, samples.size, float(counted.lower_hz[0]))
    direct = _levels_by_one_transform(slow.off(samples[None], 0)[0], index)
    cut = np.abs(direct - _levels_by_one_transform(samples, index))[low].max()
    away = counted.level_dB[0] - 120.0
    np.testing.assert_allclose(away[low], direct[low], atol=0.01)
    assert cut < 0.15
    assert np.abs(away - dewesoft)[low].max() < 0.12 + cut
    assert np.sqrt(np.mean(np.square(left_out.level_dB[0] - 120.0 - oros)[middle])) < 0.3
    assert left_out.edges[0, (left_out.nominal_hz >= 315) & middle].all()


def _levels_by_one_transform(samples: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Third-octave levels of the whole energy, by the power response of each filter on a padded transform."""
    points = 1 << 21
    power = 2.0 * np.abs(np.fft.rfft(samples, points)) ** 2 / points / samples.size
    hertz = np.fft.rfftfreq(points, 1 / RATE)[1:]
    parts = [power_response(np.log(hertz / band.mid), 3) @ power[1:] for band in Bands.octaves(3, index)]
    return np.asarray(10 * np.log10(parts))


@pytest.mark.parametrize("begin", [0.002, 0.915])
def test_an_event_at_an_end_of_a_record_too_short_for_its_bands_is_flagged_with_both_figures(
    begin: float,
) -> None:
    """1/24 octaves at 30 Hz are 0.9 Hz wide, a record of 1 s shows 1 Hz. Truth: the event within 41 s."""
    rate, n = 8000.0, 640
    event = np.hanning(n) * np.sin(2 * np.pi * 30.0 * (np.arange(n) - (n - 1) / 2) / rate)
    short, long = np.zeros((2, 8000)), np.zeros(41 * 8000)
    for row, at in zip(short, (begin, 0.45)):
        row[int(at * rate) : int(at * rate) + n] = event
    long[160000:168000] = short[0]
    settings = {"fraction": 24, "fmin": 25, "fmax": 35}
    found = Octave(**settings)(recording(*short, rate=rate))
    truth = Octave(**settings)(recording(long, rate=rate)).level_dB[0] + 10 * np.log10(41)
    assert found.level_dB[0] == pytest.approx(truth, abs=0.15)
    for band in range(len(truth)):
        *_, flag, other = found.band_flags(0, band)
        assert flag == "edges"
        assert float(other.removeprefix("left-out=")) < truth[band] - 5
        assert "edges" not in found.band_flags(1, band)


LONG = [(rate, 1.0) for rate in (10000.0, 25000.0, 50000.0, 100000.0)]
# A tone and the decay of its cut are seen little.
SHORT = [(51200.0, 0.17), (51200.0, 0.1), (1e6, 0.3)]


@pytest.mark.parametrize(("rate", "seconds"), [*LONG, *SHORT])
@pytest.mark.parametrize("hz", [250.0, 500.0, 1000.0])
def test_a_tone_that_goes_through_the_record_has_its_own_peak(hz, rate, seconds):
    """C weighs these by less than 0.01 dB (IEC 61672-1:2013, formula E.1): the peak is that of the sine."""
    tone = 0.2 * np.sqrt(2) * np.sin(2 * np.pi * hz * np.arange(int(rate * seconds)) / rate)
    found = Levels()(recording(tone, rate=rate))
    assert found.c_peak_dB[0] == pytest.approx(20 * np.log10(0.2 * np.sqrt(2) / 2e-5), abs=0.04)
