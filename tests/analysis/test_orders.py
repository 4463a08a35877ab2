"""Order analysis: signals that are known by angle, tachos with faults, requests that cannot be."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j0

from specan.analysis.orders import Orders
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError, RequestError

RATE = 25600.0
LINES = {
    1.0: (0.3, 20.0),
    63.0: (0.5, -100.0),
    66.0: (2.0, 45.0),
    66 + 66 / 21: (0.2, 170.0),
    198.0: (1.0, -30.0),
}


def turns(t: np.ndarray, speed: float, ramp: float, flutter: float = 0.0) -> np.ndarray:
    """Turns of a shaft whose speed rises and flutters twice a second."""
    return speed * t + 0.5 * ramp * t**2 + flutter * np.sin(2 * np.pi * 2 * t) / (4 * np.pi)


def crossing_times(speed: float, ramp: float, flutter: float, per_turn: int, duration: float) -> np.ndarray:
    """Instants of the pulses, by inverting the angle to the last digits."""
    fine = np.linspace(0, duration, 400_001)
    angle = turns(fine, speed, ramp, flutter)
    wanted = np.arange(1, int(angle[-1] * per_turn)) / per_turn
    t = np.interp(wanted, angle, fine)
    for _ in range(4):
        rate = speed + ramp * t + 0.5 * flutter * np.cos(4 * np.pi * t) * 2
        t = t - (turns(t, speed, ramp, flutter) - wanted) / rate
    return t


def tacho_signal(times: np.ndarray, n: int, width: float) -> np.ndarray:
    """A pulse of 5 V with edges of two samples at each instant, as an anti-aliased converter sees it."""
    at = np.arange(n) / RATE
    x = np.zeros(n)
    edge = 2.0 / RATE
    for time in times:
        first = max(0, int((time - 2 * edge) * RATE))
        last = min(n, int((time + width + 2 * edge) * RATE) + 2)
        t = at[first:last]
        x[first:last] += 5 * (
            np.clip((t - time) / edge + 0.5, 0, 1) - np.clip((t - time - width) / edge + 0.5, 0, 1)
        )
    return x


def recording(
    *,
    speed=8.0,
    ramp=0.0,
    flutter=0.0,
    per_turn=32,
    duration=20.0,
    jitter=0.0,
    faults=False,
    noise=0.0,
    seed=0,
) -> Recording:
    rng = np.random.default_rng(seed)
    n = int(duration * RATE)
    t = np.arange(n) / RATE
    pulses = crossing_times(speed, ramp, flutter, per_turn, duration)
    first = pulses[0]
    u = turns(t, speed, ramp, flutter) - turns(np.array([first]), speed, ramp, flutter)
    x = sum(a * np.cos(2 * np.pi * o * u + np.radians(p)) for o, (a, p) in LINES.items())
    x = x + noise * rng.standard_normal(n)
    pulses = pulses + jitter * rng.standard_normal(pulses.size)
    if faults:  # in every thousand one missing and one double
        gone = np.arange(300, pulses.size - 10, 1000)
        twice = np.arange(700, pulses.size - 10, 1000)
        extra = pulses[twice] + 0.35 * np.diff(pulses)[twice]
        pulses = np.sort(np.concatenate([np.delete(pulses, gone), extra]))
    width = 0.2 * np.median(np.diff(pulses))
    channels = (
        Channel("Acc 1", unit="m/s^2", role="accelerometer", sampling_rate=RATE, n_samples=n),
        Channel(
            "Tacho carrier", role="tacho", sampling_rate=RATE, n_samples=n,
            properties={"PulsesPerRevolution": per_turn},
        ),
    )  # fmt: skip
    return Recording("run.tdms", channels, ArraySource([x, tacho_signal(pulses, n, width)]))


def errors(found) -> tuple[np.ndarray, np.ndarray]:
    """Errors of amplitude (dB) and phase (degrees) against the truth."""
    truth = np.array([a * np.exp(1j * np.radians(p)) for a, p in LINES.values()])
    ratio = found.lines.amplitude[0] / truth
    return 20 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))


@pytest.mark.parametrize(
    "case",
    [
        {},
        pytest.param({"ramp": 0.2}, marks=pytest.mark.long),
        {"flutter": 0.08},
        {"per_turn": 1},
        pytest.param({"per_turn": 32, "jitter": 2e-5, "faults": True}, marks=pytest.mark.long),
        pytest.param({"per_turn": 60, "jitter": 1e-5, "faults": True, "ramp": 0.1}, marks=pytest.mark.long),
        {"per_turn": 32, "jitter": 1e-5, "faults": True, "flutter": 0.04, "noise": 0.01},
    ],
    ids=str,
)
def test_amplitudes_are_those_given_by_angle(case):
    """Within 0.05 dB and 0.5 degrees, with jitter and with one pulse missing and one double in a thousand."""
    found = Orders(orders=tuple(LINES))(recording(**case))
    level, phase = errors(found)
    assert np.abs(level).max() < 0.05
    # The phase of turn zero is that of the first pulse: what its jitter moves is common to all, in proportion to order.
    assert np.abs(phase).max() < 0.5
    if case.get("faults"):
        count = found.tacho.pulses
        assert found.tacho.missing == pytest.approx(count / 1000, abs=1)
        assert found.tacho.double == pytest.approx(count / 1000, abs=1)
        assert any("repaired" in note for note in found.notes)


def test_a_geared_tacho_gives_the_slower_shaft():
    made = recording(per_turn=30)  # 8 pulses a turn of a shaft that turns 3.75 times
    found = Orders(orders=tuple(LINES), pulses_per_turn=8.0, ratio=3.75)(made)
    level, phase = errors(found)
    assert np.abs(level).max() < 0.05
    assert np.abs(phase).max() < 0.5


def test_a_known_speed_needs_no_tacho():
    made = recording()
    found = Orders(orders=tuple(LINES), speed_hz=8.0)(made)
    assert np.abs(errors(found)[0]).max() < 0.01
    assert not any("not constant" in note for note in found.notes)


def test_a_stated_speed_that_drifts_is_told():
    found = Orders(speed_hz=8.0)(recording(ramp=0.02, duration=20.0))
    assert any("the speed is not constant as stated" in note for note in found.notes)


def low_but_told(found) -> np.ndarray:
    """Levels of the lines; what they lack is within two standard uncertainties as they are stated."""
    truth = np.array([a for a, _ in LINES.values()])
    size = np.abs(found.lines.amplitude[0])
    assert np.all(truth - size < 2 * found.lines.u[0] + 0.01 * truth)
    return 20 * np.log10(size / truth)


def test_a_stated_speed_that_does_not_fit_is_told_with_the_one_that_does():
    found = Orders(orders=tuple(LINES), speed_hz=8.002)(recording(duration=8.0))
    assert low_but_told(found)[2] < -3
    (note,) = (n for n in found.notes if "the speed is not 8.002 Hz" in n)
    assert float(note.partition("turns at ")[2].split()[0]) == pytest.approx(8.0, abs=2e-5)


@pytest.mark.parametrize(
    ("shaft", "said"),
    [({"speed_hz": 8.0}, "not constant as stated"), ({}, "Tacho carrier is not that of the vibration")],
)
def test_changes_of_the_speed_that_nothing_follows_are_told(shaft, said):
    """Three per cent twice a second: four pulses a period do not tell it from jitter, the lines do."""
    found = Orders(orders=tuple(LINES), **shaft)(recording(duration=8.0, per_turn=1, flutter=0.24))
    assert low_but_told(found)[-1] < -0.4
    assert any(said in note for note in found.notes)


@pytest.mark.parametrize("orders", [(66.0,), (63.0, 66.0), (1.0, 62.1, 64.35, 66.0)], ids=str)
@pytest.mark.parametrize("times", [0.5, 2.0])
def test_changes_that_one_pulse_a_turn_never_sees_are_in_the_uncertainty(orders, times):
    """An angle that departs by b sin(2 pi m turns) leaves J0(2 pi o b) of order o; it is zero at each pulse."""
    speed, peak = 10.0, 0.0012
    t = np.arange(int(6 * RATE)) / RATE
    angle = speed * t + peak * np.sin(2 * np.pi * times * speed * t)
    x = sum(np.cos(2 * np.pi * o * angle + o) for o in orders)
    x = x + 0.05 * np.random.default_rng(1).standard_normal(t.size)
    made = recording(duration=6.0, per_turn=1)
    pulses = tacho_signal(np.arange(1, int(6 * speed)) / speed, t.size, 0.02)
    found = Orders(orders=orders)(Recording("run.tdms", made.channels, ArraySource([x, pulses])))
    left = j0(2 * np.pi * np.array(orders) * peak)
    size = np.abs(found.lines.amplitude[0])
    assert size == pytest.approx(left, abs=0.02)
    assert found.lines.u[0][-1] == pytest.approx(1 - left[-1], rel=0.25)
    (note,) = (n for n in found.notes if "is not that of the vibration" in n)
    said = re.search(r"order (\S+) departs .* reads about (\S+) dB low", note)
    truth = -20 * np.log10(j0(2 * np.pi * float(said[1]) * peak))
    assert float(said[2]) == pytest.approx(truth, rel=0.25)


def test_a_tacho_that_stops_is_told_and_what_it_covers_is_analysed():
    made = recording(duration=8.0)
    x, pulses = made.source.samples
    half = x.size // 2
    silent = np.where(np.arange(x.size) < half, pulses, 0.0)
    broken = Recording("run.tdms", made.channels, ArraySource([x, silent]))
    found = Orders(orders=tuple(LINES))(broken)
    assert np.abs(errors(found)[0]).max() < 0.01
    assert found.turns == pytest.approx(30, abs=2)
    assert any(
        "no pulses from 3.996 to 8.000 s" in n and "analysed is 0.000 to 3.996 s" in n for n in found.notes
    )


def test_what_is_analysed_ends_with_the_record():
    """One pulse a turn of 0.1 s, the last one 5 ms before the end of 8 s."""
    t = np.arange(8 * 12800) / 12800
    turns = 10 * t + 0.05
    made = Recording.from_arrays(
        {"Acc": np.cos(2 * np.pi * 24 * turns), "Tacho": np.where(t > 4, (turns % 1 < 0.3) * 5.0, 0.0)}, 12800,
        units={"Acc": "m/s^2"}, roles={"Tacho": "tacho"},
    )  # fmt: skip
    notes = " ".join(Orders(orders=(24.0,), pulses_per_turn=1)(made).notes)
    assert float(re.search(r"analysed is \S+ to (\S+) s", notes)[1]) == pytest.approx(8.0, abs=1e-3)


@pytest.mark.parametrize("per_turn", [1, 32])
@pytest.mark.parametrize("stands", [(0.0, 1.0), (3.0, 6.0)], ids=["at the start", "for 3 s"])
def test_a_shaft_that_stands_still_is_told_and_what_follows_is_analysed(stands, per_turn):
    """The angle is the integral of a speed that is nothing while it stands, and 10 Hz one second before and after."""
    first, last = stands
    t = np.arange(int(14 * RATE)) / RATE
    speed = np.interp(t, [first - 1, first, last, last + 1], [10.0, 0.0, 0.0, 10.0])
    angle = np.concatenate([[0.0], np.cumsum(speed[1:] + speed[:-1]) / (2 * RATE)])
    x = sum(a * np.cos(2 * np.pi * o * angle) for o, (a, _) in LINES.items())
    wanted = np.arange(1, int(angle[-1] * per_turn)) / per_turn
    rising = np.concatenate([[True], np.diff(angle) > 0])
    pulses = tacho_signal(np.interp(wanted, angle[rising], t[rising]), t.size, 0.2 / (10 * per_turn))
    channels = tuple(
        replace(c, n_samples=t.size) for c in recording(per_turn=per_turn, duration=1.0).channels
    )
    found = Orders(orders=tuple(LINES))(Recording("run.tdms", channels, ArraySource([x, pulses])))
    assert low_but_told(found).min() > -0.1
    assert found.tacho.missing == 0
    (note,) = (n for n in found.notes if "stands still" in n)
    begins, ends = map(float, re.search(r"from (\S+) to (\S+) s", note).groups())
    assert (begins, ends) == pytest.approx(stands, abs=0.5)


def test_much_jitter_of_the_pulses_is_smoothed_or_told():
    assert low_but_told(Orders(orders=tuple(LINES))(recording(jitter=1e-4))).min() > -0.05


@pytest.mark.long
def test_a_drifting_speed_is_told_and_followed():
    found = Orders(max_order=80.0)(recording(ramp=0.2))
    assert any("the speed drifts between" in note for note in found.notes)
    assert found.speed_hz[-1] > found.speed_hz[0] + 2
    assert found.order[np.argmax(found.amplitude[0])] == 66.0
    each = found.map[:, 0, np.flatnonzero(found.order == 66.0)[0]]
    assert np.abs(20 * np.log10(each / 2.0)).max() < 0.05


@pytest.mark.long
def test_uncertainty_is_the_scatter_of_repetitions():
    """Monte Carlo: the stated standard uncertainty is that of repeated noise."""
    truth = np.array([a * np.exp(1j * np.radians(p)) for a, p in LINES.values()])
    base = recording(duration=4.0, per_turn=8)
    x, pulses = base.source.samples
    found = []
    for seed in range(24):
        noisy = x + 0.5 * np.random.default_rng(seed).standard_normal(x.size)
        made = Recording("run.tdms", base.channels, ArraySource([noisy, pulses]))
        found.append(Orders(orders=tuple(LINES))(made).lines)
    gap = np.stack([(one.amplitude[0] - truth) for one in found])
    real = np.sqrt(np.mean(np.abs(gap) ** 2, axis=0) / 2)
    stated = np.sqrt(np.mean([one.u[0] ** 2 for one in found], axis=0))
    assert np.all(np.abs(stated / real - 1) < 0.3)  # 24 complex repetitions tell 10 %, five lines


@pytest.mark.long
def test_the_synchronous_average_holds_what_repeats():
    found = Orders(max_order=210.0, average_turns=7)(recording(noise=0.5, duration=30.0))
    # all lines repeat after 7 turns
    power = sum(a**2 / 2 for a, _ in LINES.values())
    assert found.synchronous_rms[0] == pytest.approx(np.sqrt(power), rel=0.02)
    u = np.arange(found.average.shape[1]) / (found.average.shape[1] / 7)
    truth = sum(a * np.cos(2 * np.pi * o * u + np.radians(p)) for o, (a, p) in LINES.items())
    assert np.sqrt(np.mean((found.average[0] - truth) ** 2)) < 0.35


def test_orders_are_converted_between_quantities():
    found = Orders(orders=(66.0,), quantity="displacement")(recording())
    omega = 2 * np.pi * 66 * 8
    assert np.abs(found.lines.amplitude[0, 0]) == pytest.approx(2.0 / omega**2, rel=1e-3)
    assert abs((found.lines.phase_deg[0, 0] - (45.0 - 180.0) + 180) % 360 - 180) < 0.5
    line = int(np.flatnonzero(found.order == 66.0)[0])
    assert found.amplitude[0, line] == pytest.approx(2.0 / omega**2, rel=1e-2)
    assert found.units == ("m",)


def test_the_envelope_shows_the_rate_of_shocks():
    rng = np.random.default_rng(3)
    n = int(20 * RATE)
    x = 0.05 * rng.standard_normal(n)
    ring = np.exp(-np.arange(200) / 40) * np.sin(2 * np.pi * 4000 * np.arange(200) / RATE)
    for time in np.arange(0.1, 19.8, 1 / (8.25 * 2.0)):  # 8.25 shocks a turn at 2 Hz
        first = int(time * RATE)
        x[first : first + 200] += ring
    channel = Channel("Acc 1", unit="m/s^2", sampling_rate=RATE, n_samples=n)
    made = Recording("run.tdms", (channel,), ArraySource([x]))
    found = Orders(speed_hz=2.0, envelope_hz=(3000.0, 5000.0), max_order=100.0)(made)
    strongest = found.order[1:][np.argmax(found.amplitude[0, 1:])]
    assert abs(strongest - 8.25) <= 0.13  # lines lie an eighth apart


def refused(kind, made, **settings) -> str:
    with pytest.raises(kind) as fault:
        Orders(**settings)(made)
    return str(fault.value)


def test_bad_input_is_told_in_a_sentence():
    short = recording(duration=2.0, speed=0.3, per_turn=64)
    text = refused(InputError, short)
    assert "holds 0.5" in text
    assert "turns of the shaft" in text
    text = refused(RequestError, recording(speed=80.0, duration=4.0), mesh=66.0)
    assert "order 198" in text
    assert "a sampling rate of 25600 Hz" in text
    text = refused(InputError, recording(duration=1.0), orders=(66.0, 66.01))
    assert "cannot be distinguished" in text
    made = recording(duration=3.0)
    for samples in (np.zeros(made.channels[0].n_samples), np.random.default_rng(0).standard_normal(76800)):
        silent = Recording("run.tdms", made.channels, ArraySource([made.source.samples[0], samples]))
        assert "shows no pulses" in refused(InputError, silent)
    wild = crossing_times(8.0, 0.0, 0.0, 32, 3.0)
    wild = wild[np.random.default_rng(1).random(wild.size) > 0.2]
    broken = Recording(
        "run.tdms", made.channels, ArraySource([made.source.samples[0], tacho_signal(wild, 76800, 1e-3)])
    )
    assert "missing" in refused(InputError, broken)
    plain = Recording("run.tdms", made.channels[:1], ArraySource(made.source.samples[:1]))
    assert "has no tacho" in refused(RequestError, plain)
    assert "pulses" in refused(
        RequestError,
        Recording(
            "run.tdms",
            (made.channels[0], Channel("Tacho", role="tacho", sampling_rate=RATE, n_samples=76800)),
            made.source,
        ),
    )


def test_a_tacho_that_stops_is_told():
    whole = recording(duration=4.0)
    samples = [x.copy() for x in whole.source.samples]
    samples[1][int(2 * RATE) :] = 0.0
    found = Orders(orders=(1.0,))(Recording("run.tdms", whole.channels, ArraySource(samples)))
    (note,) = found.notes
    assert re.search(r"no pulses from (1\.99|2\.0)\d* to 4\.000 s.*analysed is 0\.000 to (1\.99|2\.0)", note)
    assert Orders(orders=(1.0,))(whole).notes == ()


def test_a_tacho_that_begins_later_is_aligned():
    """The same signals, the tacho cut off by 0.25 s: the orders have the same phases."""
    whole = recording(duration=4.0)
    late = int(0.25 * RATE)
    acc, tacho = whole.channels
    cut = replace(tacho, n_samples=tacho.n_samples - late, start_offset_s=late / RATE)
    samples = [whole.source.samples[0], whole.source.samples[1][late:]]
    found = Orders(orders=(1.0, 63.0))(Recording("run.tdms", (acc, cut), ArraySource(samples)))
    # 8 turns a second: 0.25 s are two turns, after which the shaft stands where it stood.
    truth = np.array([LINES[1.0][1], LINES[63.0][1]])
    np.testing.assert_allclose(found.lines.phase_deg[0], truth, atol=0.3)
    assert any("begin up to 0.25 s apart" in note for note in found.notes)


def test_an_order_without_a_line_between_two_strong_ones_says_nothing_of_the_angle():
    """Planets one after the other show 196 and 200, and not the mesh's order 198 between them."""
    t = np.arange(4 * int(RATE)) / RATE
    speed = 5.0
    x = np.cos(2 * np.pi * 196 * speed * t) + 1.2 * np.cos(2 * np.pi * 200 * speed * t + 1.0)
    x = x + 1e-3 * np.random.default_rng(2).standard_normal(t.size)
    made = recording(duration=4.0, per_turn=1)
    pulses = tacho_signal(np.arange(1, int(4 * speed)) / speed, t.size, 0.02)
    found = Orders(orders=(196.0, 198.0, 200.0))(
        Recording("run.tdms", made.channels, ArraySource([x, pulses]))
    )
    assert not any("angle" in note for note in found.notes)
    assert found.lines.u.max() < 1e-3
