"""Corrections of a channel in the frequency domain, and reading from a recording in memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from specan.data.channel import Channel, PhaseCalibration
from specan.data.recording import ArraySource, Recording
from specan.errors import RequestError

F = np.array([0.0, 100.0, 1000.0, 4000.0])


def degrees(factor):
    return np.degrees(np.angle(factor))


@given(delay=st.floats(-1e-4, 1e-4), frequency=st.floats(1.0, 4000.0))
def test_a_delay_is_taken_out(delay, frequency):
    """What comes late has a smaller phase under exp(+j w t); the correction gives it back."""
    late = np.exp(-2j * np.pi * frequency * delay)
    corrected = late * Channel("c", delay_s=delay).correction(np.array([frequency]))[0]
    assert corrected == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("unit", "derivatives", "turn"), [("m", 1, 90.0), ("m/s^2", -1, -90.0)])
def test_displacement_and_acceleration_become_velocity(unit, derivatives, turn):
    channel = Channel("Vibrometer", unit=unit, derivatives=derivatives)
    factor = channel.correction(F)
    assert channel.target_unit == "m/s"
    np.testing.assert_allclose(degrees(factor[1:]), turn)
    np.testing.assert_allclose(np.abs(factor[1:]), (2 * np.pi * F[1:]) ** derivatives)
    assert factor[0] == 0.0


def test_a_leading_channel_is_turned_back():
    phase = PhaseCalibration((1000.0,), (2.0,), (0.1,))
    np.testing.assert_allclose(degrees(Channel("c", phase=phase).correction(F)), [0.0, -0.2, -2.0, -8.0])
    constant = PhaseCalibration((1000.0,), (2.0,), (0.1,), "constant")
    np.testing.assert_allclose(degrees(Channel("c", phase=constant).correction(F)), -2.0)


def test_phases_between_tones_are_interpolated():
    phase = PhaseCalibration((250.0, 1000.0), (1.0, 2.0), (0.1, 0.2), "constant")
    assert phase.at(np.array([625.0]))[0] == pytest.approx(1.5)
    assert phase.at(np.array([2000.0]))[0] == pytest.approx(2.0)
    delay = PhaseCalibration((250.0, 1000.0), (1.0, 2.0), (0.1, 0.2))
    assert delay.at(np.array([250.0, 1000.0, 2000.0])) == pytest.approx([1.0, 2.0, 4.0])


@pytest.mark.parametrize("model", ["delay", "constant"])
def test_the_uncertainty_grows_with_the_distance_from_the_tone(model):
    phase = PhaseCalibration((1000.0,), (2.0,), (0.1,), model)
    at = phase.u_at(np.array([1000.0, 2000.0, 4000.0]))
    assert at[0] == pytest.approx(0.1)
    assert np.all(np.diff(at) > 0.0)


def test_delay_and_phase_add_up_in_the_uncertainty():
    channel = Channel("c", u_delay_s=1e-5, phase=PhaseCalibration((1000.0,), (0.0,), (0.3,)))
    assert channel.u_phase_deg(np.array([1000.0]))[0] == pytest.approx(np.hypot(3.6, 0.3))
    assert Channel("c", u_delay_s=1e-5).u_phase_deg(np.array([1000.0]))[0] == pytest.approx(3.6)


def recording():
    channels = tuple(
        Channel(f"Mic {k}", "g", gain=float(k), sampling_rate=100.0, n_samples=10) for k in (1, 2, 3)
    )
    return Recording("a", channels, ArraySource([np.full(10, 10.0 * k) for k in (1, 2, 3)]))


def test_gains_are_applied_in_the_order_asked_for():
    r = recording()
    assert r.read(r.select(["Mic 3", "g/Mic 1"]))[:, 0].tolist() == [10.0, 90.0]
    assert r.read([r.channel("g/Mic 3"), r.channel("Mic 1")])[:, 0].tolist() == [90.0, 10.0]


def test_what_is_not_there_is_named():
    r = recording()
    with pytest.raises(RequestError, match="did you mean 'Mic 1'"):
        r.channel("Mic1")
    with pytest.raises(RequestError, match="no channel"):
        r.select(["Vib*"])
    with pytest.raises(RequestError, match="has no channel 'Mic 9'"):
        r.read([Channel("Mic 9", sampling_rate=100.0, n_samples=10)])
    two = Recording("b", (*r.channels, Channel("Mic 1", "h")), r.source)
    with pytest.raises(RequestError, match="g/Mic 1, h/Mic 1"):
        two.channel("Mic 1")


def test_a_name_with_brackets_is_itself_before_it_is_a_pattern():
    odd = Recording("a", (Channel("Mic [1]"), Channel("Mic 1")), ArraySource([]))
    assert [c.name for c in odd.select(["Mic [1]"])] == ["Mic [1]", "Mic 1"]
    assert odd.channel("Mic [1]").name == "Mic [1]"


def _named(*names: str) -> Recording:
    channels = tuple(
        Channel(n.rpartition("/")[2], n.rpartition("/")[0], sampling_rate=8.0, n_samples=4) for n in names
    )
    return Recording("a.tdms", channels, ArraySource([np.zeros(4)] * len(names)))


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("mic 1", "Mic 1"),
        ("g/MIC 11", "Mic 11"),
        ("ai0", "cDAQ1Mod1/ai0"),
        ("cdaq1mod2/AI1", "cDAQ1Mod2/ai1"),
    ],
)
def test_a_name_in_other_letters_or_its_end_is_enough(said: str, meant: str) -> None:
    names = ("Mic 1", "Mic 11", "cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1", "cDAQ1Mod2/ai1")
    channels = tuple(Channel(n, "G", sampling_rate=8.0, n_samples=4) for n in names)
    recording = Recording("a.tdms", channels, ArraySource([np.zeros(4)] * len(names)))
    assert recording.channel(said).name == meant
    assert [c.name for c in recording.select([said])] == [meant]


def test_the_end_of_several_names_or_of_a_word_is_none() -> None:
    recording = _named("A/ai1", "B/xai1", "B/Mic 2", "B/Mic 11", "C/ai1")
    for said in ("ai1", "1", "2", "c 11", ""):
        with pytest.raises(RequestError):
            recording.channel(said)


def test_exact_names_come_first_and_patterns_may_be_in_other_letters() -> None:
    recording = _named("G/mic 1", "G/Mic 1", "G/Mic 2")
    assert [c.name for c in recording.select(["mic 1"])] == ["mic 1"]
    assert recording.channel("Mic 1").name == "Mic 1"
    assert [c.name for c in recording.select(["MIC *"])] == ["mic 1", "Mic 1", "Mic 2"]
    assert [c.name for c in recording.select(["Mic *"])] == ["Mic 1", "Mic 2"]
    assert [c.name for c in recording.select(["Mic 2", "MIC 1"])] == ["mic 1", "Mic 1", "Mic 2"]


def test_arrays_are_a_recording_in_si_units():
    one = Recording.from_arrays(
        {"Mic": [1.0, 2.0, 3.0], "Tacho": [0.0, 5.0]}, 10, units={"Mic": "mPa"}, roles={"Tacho": "tacho"}
    )
    mic, tacho = one.channels
    assert (mic.role, mic.unit, mic.n_samples, tacho.role, tacho.unit) == (
        "microphone",
        "Pa",
        3,
        "tacho",
        "1",
    )
    np.testing.assert_allclose(one.read([mic], 1), [[2e-3, 3e-3]])
    with pytest.raises(RequestError, match="one channel for each array"):
        Recording.from_arrays({"Mic": [[1.0, 2.0]]}, 10)
    with pytest.raises(RequestError, match=r"units is 'Pa'; expected a dict with a name for each channel"):
        Recording.from_arrays({"Mic": [1.0, 2.0]}, 10, units="Pa")


def test_samples_that_leave_the_range_of_numbers_make_no_warning() -> None:
    """A damaged file may hold any number; results flag what is not finite."""
    channel = Channel("Mic 1", unit="Pa", sampling_rate=8000.0, n_samples=2, gain=20.0)
    found = Recording("a.tdms", (channel,), ArraySource([np.array([1e308, 1.0])])).read("Mic 1")
    assert found.tolist() == [[np.inf, 20.0]]
