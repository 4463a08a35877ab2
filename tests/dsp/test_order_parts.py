"""Pulses, angular resampling, envelopes, derivatives: against closed forms."""

import numpy as np
import pytest
from scipy.special import j0

from specan.data.channel import Channel
from specan.dsp.envelope import band_kurtosis, envelope
from specan.dsp.order_lines import (
    PASS,
    AngularResampler,
    common_period,
    departure,
    fit_lines,
    samples_per_turn,
)
from specan.dsp.tacho import pulse_times, repair, shaft_angle
from specan.errors import InputError, RequestError


@pytest.mark.parametrize("seed", range(8))
def test_faults_are_found_wherever_they_are(seed):
    rng = np.random.default_rng(seed)
    true = np.cumsum(0.01 * (1 + 0.3 * np.sin(np.arange(2000) / 150)))
    true += 1e-4 * rng.standard_normal(true.size)
    place = np.sort(rng.choice(np.arange(20, 1980, 25), 6, replace=False))
    gone, twice = place[::2], place[1::2]
    extra = true[twice] + rng.uniform(0.05, 0.4, 3) * (true[twice + 1] - true[twice])
    found = repair(np.sort(np.concatenate([np.delete(true, gone), extra])))
    assert (found.missing, found.double) == (3, 3)
    assert found.number[-1] == 1999
    assert np.array_equal(found.time, np.delete(true, gone))
    assert np.array_equal(found.number, np.delete(np.arange(2000), gone))


@pytest.mark.parametrize("per_turn", [1, 32])
def test_a_standstill_is_no_missing_pulse(per_turn):
    """A shaft that slows down evenly, stands for 3 s and starts again: angle a t^2 / 2 to either side."""
    root = np.sqrt(2 * np.arange(1, 51 * per_turn) / per_turn / 4.0)
    before, after = 5.0 - root[::-1], 8.0 + root
    found = repair(np.concatenate([before, after]))
    assert (found.missing, found.double) == (0, 0)
    ((begin, end),) = found.silent
    assert begin == pytest.approx(5.0, abs=1.2)
    assert end == pytest.approx(8.0, abs=1.2)
    assert found.time[-1] <= 5.0 < 8.0 < repair(np.concatenate([before, after]), start=6.0).time[0]
    at_once = repair(np.concatenate([np.arange(100) / per_turn, 3.0 + np.arange(100, 300) / per_turn]))
    assert (at_once.missing, at_once.time.size, len(at_once.silent)) == (
        (0, 200, 1) if per_turn > 4 else (3, 300, 0)
    )


def test_an_interval_that_pulses_are_missing_from_is_counted_at_low_speed_too():
    """A speed with a minimum has ever longer intervals, of which none is a multiple of its neighbours."""
    turn = np.arange(400)
    times = np.cumsum(1 / (1.05 - np.exp(-0.5 * ((turn - 200) / 12) ** 2)))
    assert repair(times).missing == 0
    assert repair(np.delete(times, [100, 300, 301])).missing == 3


def averaged_pulses(period, count=3000):
    """A square wave as a converter sees it that averages over each sampling interval; pulses at whole periods."""

    def area(x):  # of the wave from 0 to x
        return np.floor(x / period) * period / 2 + np.minimum(x % period, period / 2)

    n = np.arange(count)
    return area(n + 0.5) - area(n - 0.5)


def test_a_tacho_too_fast_for_the_sampling_rate_is_told_from_one_without_pulses():
    """Four samples a pulse behind an ideal low-pass: of a square wave its first harmonic is left, at four phases."""
    t = np.arange(10240) / 2560
    with pytest.raises(
        InputError, match=r"has 640 pulses per second, too many for 2560 .* sample at 38[34]. Hz"
    ):
        pulse_times(np.sin(2 * np.pi * 640 * t + 0.1), 2560.0)
    assert np.diff(pulse_times(np.sin(2 * np.pi * 400 * t + 0.1), 2560.0)) == pytest.approx(1 / 400, rel=0.05)
    with pytest.raises(InputError, match="not have two levels"):
        pulse_times(np.full(10240, 5.0), 2560.0)


@pytest.mark.parametrize("period", [12.048, 18.957, 400.31])
def test_instants_of_steep_edges_do_not_beat_with_the_sampling_rate(period):
    """By linear interpolation they erred by up to 0.09 samples, so that lines appeared beside those of a gear."""
    times = pulse_times(averaged_pulses(period), 1.0)
    assert times == pytest.approx(period * np.arange(1, times.size + 1), abs=1e-9)


def test_instants_of_slow_edges_are_interpolated():
    """A sine's: the middle of its two levels is its zero; a chord errs by (pi / period)^2 / 24 of a period."""
    period = 12.1
    times = pulse_times(np.sin(2 * np.pi * np.arange(3000) / period), 1.0)
    off = times - period * np.rint(times / period)
    assert np.ptp(off) < 0.01


def test_smoothing_takes_jitter_and_leaves_the_speed():
    rng = np.random.default_rng(5)
    n = np.arange(6400)
    true = n / 256 + 2e-3 * np.sin(2 * np.pi * n / 1600)
    pulses = repair(true + 2e-5 * rng.standard_normal(n.size))
    found = shaft_angle(pulses, 32.0)
    gap = found.time - true
    assert np.sqrt(np.mean(gap**2)) < 6e-6
    assert found.jitter_s == pytest.approx(2e-5, rel=0.05)


@pytest.mark.parametrize("count", range(4, 20))
def test_a_handful_of_pulses_gives_the_angle(count):
    """A shaft at 20 Hz: as many coefficients as pulses are no smoothing, and more cannot be found."""
    found = shaft_angle(repair(np.arange(count) / 20), 1.0)
    assert found.at(np.array([0.07])) == pytest.approx(1.4, abs=1e-6)


@pytest.mark.parametrize("speed", [0.4, 4.0, 39.0])
def test_every_order_of_the_band_passes_unchanged_and_what_lies_above_does_not_come_back(speed):
    rate, top = 10000.0, 100.0
    per_turn = samples_per_turn(top)
    assert per_turn >= PASS * top
    at = np.arange(30000) / rate
    for order in (0.0, 1.0, 37.3, 99.0):
        y = resampled(np.cos(2 * np.pi * order * speed * at + 0.3), speed / rate, per_turn)
        u = y[0]
        assert np.abs(y[1] - np.cos(2 * np.pi * order * u + 0.3)).max() < 2e-3
    high = (per_turn - 40.0) * speed  # would come back as order 40
    if high < rate / 2:
        y = resampled(np.cos(2 * np.pi * high * at), speed / rate, per_turn)
        assert np.abs(y[1]).max() < 3e-4


def resampled(x, step, per_turn):
    count = int((len(x) * step - 1.0) * per_turn) if step * len(x) > 1.5 else 0
    margin = max(0.2, 30 * step)
    count = int((len(x) * step - 2 * margin) * per_turn)
    made = AngularResampler(lambda n: step * n, per_turn, first_turn=margin, count=count)
    parts = [made.add(part[None]) for part in np.array_split(x, 7)]
    y = np.concatenate(parts, axis=1)[0]
    assert y.size == count
    return margin + np.arange(count) / per_turn, y


def test_lines_that_are_no_multiple_of_the_record_do_not_disturb_each_other():
    u = np.arange(128 * 23) / 128
    orders = [2.75, 8.25, 31.4159]
    x = sum(a * np.cos(2 * np.pi * o * u + p) for a, o, p in zip((1.0, 1e-3, 0.1), orders, (0.1, -2.0, 3.0)))
    found = fit_lines(x[None], 128, orders)
    assert np.allclose(np.abs(found.amplitude[0]), (1.0, 1e-3, 0.1), rtol=1e-9)
    assert np.allclose(np.angle(found.amplitude[0]), (0.1, -2.0, 3.0), atol=1e-9)


def test_a_small_loss_that_no_other_speed_mends_is_not_steady():
    """J0(b) of a line is left where its phase swings by b: 0.07 dB of the first order, 30 dB of the 66th."""
    u = np.arange(64 * 600) / 64
    found = departure(np.cos(2 * np.pi * u + 0.1765 * np.sin(2 * np.pi * 0.17 * u)), 64, 1.0, 66.0)
    assert found.loss_dB == pytest.approx(-20 * np.log10(j0(0.1765)), rel=0.1)
    assert not found.steady


@pytest.mark.parametrize("gap", [1 / 12, 1 / 24, 1 / 40])
def test_a_strong_line_that_is_not_asked_for_is_no_line_beside_it(gap):
    """A loud order between those given: where it leaks into them, their uncertainty says so."""
    per_turn, turns = 512, 48
    u = np.arange(per_turn * turns) / per_turn
    orders = np.round(197 + gap * np.array([0, 1, 5, 9]), 9)  # four, two, 1.2 line widths, but for rounding
    samples = np.cos(2 * np.pi * 203.011 * u) + 1e-6 * np.random.default_rng(5).standard_normal(u.size)
    found = fit_lines(samples[None], per_turn, orders)
    assert np.all(np.abs(found.amplitude) < 6 * found.u)
    if gap * turns > 1.5:
        # A Hann window falls with the third power of 288 widths.
        assert np.all(np.abs(found.amplitude) < 1e-6)


def test_periods_of_the_article():
    """24/66/21: the sun's pattern repeats after 4 turns of the carrier, the planet's after 7, both after 28."""
    assert common_period([66 + 2.75]) == 4
    assert common_period([66 + 66 / 21]) == 7
    assert common_period([66 - 2.75, 66 + 66 / 21]) == 28
    assert common_period([65.0, 66.0, 67.0]) == 1


def test_orders_too_close_are_refused():
    with pytest.raises(InputError, match="cannot be distinguished in 5 turns"):
        fit_lines(np.zeros((1, 64 * 5)), 64, [3.0, 3.1])


def test_envelope_of_a_modulated_carrier_and_kurtosis_of_known_signals():
    t = np.arange(16000) / 16000
    carrier = np.cos(2 * np.pi * 3000 * t + 0.4)
    found = envelope(
        (1 + 0.3 * np.sin(2 * np.pi * 11 * t)) * carrier + np.cos(2 * np.pi * 500 * t), 16000.0, 2500, 3500
    )
    assert np.allclose(found, 1 + 0.3 * np.sin(2 * np.pi * 11 * t), atol=1e-9)
    noise = np.random.default_rng(0).standard_normal(400_000)
    assert band_kurtosis(noise, 16000.0, [(500.0, 4000.0)])[0] == pytest.approx(3.0, abs=0.05)
    with pytest.raises(RequestError, match="cannot be cut"):
        envelope(noise, 16000.0, 5000.0, 9000.0)


@pytest.mark.parametrize(("times", "factor"), [(1, 1j), (2, -1), (-1, -1j), (-2, -1)])
def test_motion_is_converted_exactly(times, factor):
    t = np.arange(8000) / 8000
    omega = 2 * np.pi * 64
    spectrum = np.fft.rfft(np.cos(omega * t))
    found = np.fft.irfft(
        spectrum * Channel("a", derivatives=times).correction(np.fft.rfftfreq(8000, 1 / 8000)), 8000
    )
    truth = (factor * omega**times * np.exp(1j * omega * t)).real
    assert np.allclose(found, truth, atol=1e-9 * omega**times)


def test_an_integration_leaves_out_the_mean():
    assert Channel("a", derivatives=-1).correction(np.array([0.0])) == 0
