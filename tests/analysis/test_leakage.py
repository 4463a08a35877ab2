"""Transfer functions of responses that outlast a block: the number of lines, the flag, and what the interval holds.

Truths are the discrete Fourier transforms of the impulse responses that the signals were convolved with.
"""

import numpy as np
import pytest
from scipy.signal import fftconvolve

from specan.analysis.batch.settings import BatchSettings
from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import ArraySource, Channel, Recording

RATE = 12800.0


def recording(signals, roles=("vibrometer", "microphone"), rate=RATE):
    units = {"vibrometer": "m/s", "microphone": "Pa", "generator": "V"}
    channels = tuple(
        Channel(f"{role} {k}", role=role, unit=units[role], sampling_rate=rate, n_samples=len(signals[0]))
        for k, role in enumerate(roles)
    )
    return Recording("a.tdms", channels, ArraySource(list(signals)))


def driven(impulse, seconds=30.0, seed=1, noise=0.01, rate=RATE):
    """White noise, and what the impulse response makes of it with noise of its own; steady from the first sample."""
    rng, n = np.random.default_rng(seed), int(seconds * rate)
    x = rng.standard_normal(n + len(impulse))
    y = fftconvolve(x, impulse)[len(impulse) : len(impulse) + n]
    return x[len(impulse) :], y + noise * np.std(y) * rng.standard_normal(n)


def room(t60_s, seed=2, rate=RATE):
    """Decaying noise: a diffuse reverberant field."""
    n = int(1.2 * t60_s * rate)
    decay = np.exp(-np.log(1e3) * np.arange(n) / rate / t60_s)
    return np.random.default_rng(seed).standard_normal(n) * decay


def truth(impulse, found, rate=RATE):
    n = round(rate / found.frequency_hz[0])
    whole = np.zeros(-(-len(impulse) // n) * n)
    whole[: len(impulse)] = impulse
    return np.fft.rfft(whole.reshape(-1, n).sum(axis=0))[1 : len(found.frequency_hz) + 1]


def held(found, true, row=0):
    """Share of the lines whose 95 % intervals hold the truth, of magnitude and of phase."""
    u = found.u_magnitude_percent[row] / 100 * found.magnitude[row]
    magnitude = np.abs(found.magnitude[row] - np.abs(true)) < 1.96 * u
    turned = np.degrees(np.abs(np.angle(found.response[row] / true)))
    return magnitude, turned < 1.96 * found.u_phase_deg[row]


@pytest.mark.parametrize(("t60_s", "lines"), [(0.1, 3200), (0.3, 12800), (1.0, 51200), (2.0, 51200)])
def test_lines_are_chosen_by_the_response_and_the_interval_holds_the_truth(t60_s, lines):
    """A block of four reverberation times loses 1 %: 32 (tau / block)^2 with tau = T60 / 13.8 for a Hann window."""
    impulse = room(t60_s)
    found = TransferFunction()(recording(driven(impulse)))
    true = truth(impulse, found)
    for inside in held(found, true):
        assert np.mean(inside) > 0.9
    assert len(found.frequency_hz) in (lines // 2, lines, 2 * lines)
    block = 2.56 * len(found.frequency_hz) / RATE
    assert (
        block > 2 * t60_s or found.n_effective < 16
    )  # as many averages as may be left, or fewer than twice that
    error = np.sqrt(np.mean(np.abs(found.response[0] - true) ** 2) / np.mean(np.abs(true) ** 2))
    assert error < 0.06


@pytest.mark.parametrize("t60_s", [0.3, 1.0])
def test_a_block_that_is_too_short_is_flagged_with_its_size_and_the_way_out(t60_s):
    impulse = room(t60_s)
    settings = TransferFunction(lines=400)
    found = settings(recording(driven(impulse)))
    true = truth(impulse, found)
    assert "leakage" in found.flags[0]
    error = np.abs(found.response[0] - true)
    size = np.sqrt(2) * found.u_leakage_percent[0] / 100 * found.magnitude[0]
    assert np.sqrt(np.mean(size**2)) == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.35)
    for inside in held(found, true):
        assert np.mean(inside) > 0.85
    (note,) = [n for n in found.notes if n.startswith("leakage")]
    assert "--lines" in note
    proposed = int(note.split("--lines ")[1].split()[0])
    better = TransferFunction(lines=proposed)(recording(driven(impulse)))
    assert "leakage" not in better.flags[0]


def test_a_short_response_keeps_3200_lines_and_no_flag():
    impulse = np.array([0.5, 1.0, 0.3, -0.2])
    found = TransferFunction()(recording(driven(impulse)))
    assert len(found.frequency_hz) == 3200
    assert found.flags == ((),)
    assert not any("lines" in note or "leakage" in note for note in found.notes)
    assert np.median(found.u_leakage_percent) < 0.1
    for inside in held(found, truth(impulse, found)):
        assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


def swept(kind, impulse, seconds, before=0.5):
    """A sweep from 20 Hz to 0.45 of the rate between silences, and what the impulse response makes of it."""
    rng, t, low, high = np.random.default_rng(5), np.arange(int(seconds * RATE)) / RATE, 20.0, 0.45 * RATE
    cycles = low * t + (high - low) * t**2 / (2 * seconds)
    if kind == "exponential":
        pace = np.log(high / low) / seconds
        cycles = low / pace * np.expm1(t * pace)
    edge = np.minimum(1.0, np.minimum(t, t[::-1]) / 0.01)
    x = np.pad(np.sin(2 * np.pi * cycles) * edge, (int(before * RATE), int(RATE)))
    y = fftconvolve(x, impulse)[: len(x)]
    return [s + share * np.std(s) * rng.standard_normal(len(s)) for s, share in ((x, 1e-4), (y, 1e-3))]


@pytest.mark.parametrize("kind", ["exponential", "linear"])
@pytest.mark.parametrize(
    ("seconds", "t60_s", "lines", "before"),
    [(10.0, 0.0, 3200, 0.5), (60.0, 0.0, 3200, 0.5), (10.0, 0.2, 6400, 25.0), (40.0, 1.0, 12800, 0.5)],
)
def test_of_a_sweep_the_interval_holds_the_truth_and_is_not_far_above_it(kind, seconds, t60_s, lines, before):
    """Each line is driven for a moment only, maybe after the first blocks that are looked at."""
    impulse = room(t60_s) / np.sqrt(1 + 100 * t60_s) if t60_s else np.array([0.5, 1.0, 0.3, -0.2])
    found = TransferFunction()(recording(swept(kind, impulse, seconds, before)))
    assert len(found.frequency_hz) in (lines // 2, lines, 2 * lines)
    true, driven = truth(impulse, found), slice(*np.searchsorted(found.frequency_hz, [50.0, 4500.0]))
    for inside in held(found, true):
        assert np.mean(inside[driven]) > 0.92
    error = np.abs(found.response[0] / true - 1)[driven]
    assert np.median(found.u_magnitude_percent[0, driven]) < 300 * np.median(error)
    assert "leakage" not in found.flags[0]
    assert np.mean(found.line_flags["leakage"][0, driven]) < 0.15
    assert any("75 %" in note for note in found.notes)
    # Blocks of 2.56 s reach over the half second before the sweep.
    assert lines == 12800 or not any("ends of the section" in note for note in found.notes)


@pytest.mark.parametrize("kind", ["exponential", "linear"])
@pytest.mark.parametrize("ends", [(RATE // 2, -RATE), (RATE, -2 * RATE)], ids=["fills it", "runs on"])
def test_a_sweep_that_fills_its_record_is_right_and_one_that_runs_on_is_flagged(kind, ends):
    """The record ends with the sweep, or half a second within its beginning and a second within its end."""
    impulse = room(0.2) / np.sqrt(21)
    found = TransferFunction()(
        recording([s[int(ends[0]) : int(ends[1])] for s in swept(kind, impulse, 10.0)])
    )
    driven = slice(*np.searchsorted(found.frequency_hz, [30.0, 0.44 * RATE]))
    away = np.abs(found.magnitude[0] / np.abs(truth(impulse, found)) - 1)[driven]
    assert np.mean(away < 2 * found.u_magnitude_percent[0, driven] / 100) > 0.99
    assert any("record silence before and after a sweep" in note for note in found.notes)
    if ends[0] < RATE:
        assert np.median(away) < 0.005
        assert np.quantile(away, 0.99) < 0.05
    else:
        assert away.max() > 1.0
        assert np.mean(found.line_flags["leakage"][0, driven][away > 0.2]) > 0.9


def test_an_overlap_that_is_asked_for_stays():
    signals = swept("linear", np.array([1.0, 0.5]), 10.0)
    assert TransferFunction(overlap=0.5)(recording(signals)).settings["overlap"] == 0.5
    assert TransferFunction()(recording(driven(np.array([1.0])))).settings["overlap"] == 0.5


@pytest.mark.parametrize("late", [0.4, 0.7])
def test_an_echo_is_leakage_also_beyond_half_a_block(late):
    """H1 of an echo a at lag x has a rho(x) of it: what is lost is a (1 - rho(x))."""
    block = 1024
    impulse = np.zeros(int(late * block) + 1)
    impulse[0], impulse[-1] = 1.0, 0.5
    found = TransferFunction(lines=400)(recording(driven(impulse)))
    assert "leakage" in found.flags[0]
    rho = (1 - late) * (2 + np.cos(2 * np.pi * late)) / 3 + np.sin(2 * np.pi * late) / (2 * np.pi)
    size = np.sqrt(2) * found.u_leakage_percent[0] / 100 * found.magnitude[0]
    assert np.sqrt(np.mean(size**2)) == pytest.approx(0.5 * (1 - rho), rel=0.2)
    assert np.mean(held(found, truth(impulse, found))[0]) > 0.9
    free = TransferFunction()(recording(driven(impulse)))
    assert np.mean(held(free, truth(impulse, free))[0]) > 0.9
    assert "leakage" not in free.flags[0]


def test_a_resonance_narrower_than_a_line_is_flagged_at_its_peak():
    """Damping ratio 0.005 at 500 Hz: 5 Hz wide, lines of 12.5 Hz."""
    omega, zeta = 2 * np.pi * 500.0 / RATE, 0.005
    n = np.arange(12 * int(1 / (zeta * omega)))
    impulse = np.exp(-zeta * omega * n) * np.sin(omega * n)
    found = TransferFunction(lines=400)(recording(driven(impulse)))
    peak = int(np.argmin(np.abs(found.frequency_hz - 500.0)))
    true = abs(truth(impulse, found)[peak])
    assert found.magnitude[0, peak] < 0.8 * true
    assert found.line_flags["leakage"][0, peak]
    u = found.u_magnitude_percent[0, peak] / 100 * found.magnitude[0, peak]
    assert true - found.magnitude[0, peak] < 3 * u  # all of it in the magnitude, which u gives half
    free = TransferFunction()(recording(driven(impulse)))
    assert len(free.frequency_hz) > 3200 or free.u_leakage_percent[0].max() < 5
    line = int(np.argmin(np.abs(free.frequency_hz - 500.0)))
    assert free.magnitude[0, line] == pytest.approx(abs(truth(impulse, free)[line]), rel=0.1)


@pytest.mark.parametrize("late", [511, 513, 800, 2500, -700])
def test_a_delay_of_half_a_block_and_more_is_aligned_the_right_way(late):
    rng = np.random.default_rng(3)
    x = rng.standard_normal(int(10 * RATE) + 6000)
    v, p = x[3000:-3000], 2 * x[3000 - late : len(x) - 3000 - late]
    found = TransferFunction(lines=400)(recording([v, p]))
    assert found.delay_s[0] == pytest.approx(late / RATE)
    turned = found.response[0] * np.exp(2j * np.pi * found.frequency_hz * late / RATE)
    np.testing.assert_allclose(turned, 2, atol=1e-6)


def test_a_noisy_vibrometer_beside_a_generator_brings_h3c_into_the_notes():
    """Noise of a tenth of the vibrometer's power: H1 is low by 1 / 1.1, H3c is not."""
    rng, n = np.random.default_rng(4), int(20 * RATE)
    drive = rng.standard_normal(n)
    signals = [drive + np.sqrt(0.1) * rng.standard_normal(n), 3 * drive + 0.1 * rng.standard_normal(n), drive]
    three = recording(signals, ("vibrometer", "microphone", "generator"))
    h1, h3c = TransferFunction()(three), TransferFunction(estimator="H3c")(three)
    assert np.mean(h1.magnitude) == pytest.approx(3 / 1.1, rel=0.01)
    assert np.mean(h3c.magnitude) == pytest.approx(3, rel=0.01)
    (note,) = [text for text in h1.notes if "H3c" in text]
    assert float(note.split()[0]) == pytest.approx(100 * 0.1 / 1.1, rel=0.15)
    assert not any("H3c" in text for text in h3c.notes)
    clean = recording([drive, *signals[1:]], ("vibrometer", "microphone", "generator"))
    assert not any("H3c" in text for text in TransferFunction()(clean).notes)


@pytest.mark.parametrize(("seconds", "lines"), [(0.2, None), (0.2, 400), (0.5, None), (0.5, 1600)])
def test_intervals_of_short_records_hold_the_truth(seconds, lines):
    impulse, rate = np.array([1.0, 0.5, -0.3]), 51200.0
    inside = []
    for seed in range(25):
        source = recording(driven(impulse, seconds, seed, noise=0.3, rate=rate), rate=rate)
        found = TransferFunction(lines=lines)(source)
        inside.append([np.mean(part) for part in held(found, truth(impulse, found, rate))])
        assert np.all(found.degrees_of_freedom > 0)
    assert np.all(np.mean(inside, axis=0) > 0.92)


def test_a_batch_keeps_3200_lines():
    assert BatchSettings().transfer_function.lines == 3200
    assert (
        BatchSettings(transfer_function=TransferFunction(window="flat-top")).transfer_function.lines == 3200
    )
    assert BatchSettings(transfer_function=TransferFunction(lines=800)).transfer_function.lines == 800
