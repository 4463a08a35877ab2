"""Calibration against the simulated rig, whose sensitivities and phases are known."""

import dataclasses
import re

import numpy as np
import pytest

from specan.analysis.calibration import calibrate, natural
from specan.analysis.insertion import CalibrationSettings, evaluate_insertion
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError
from truth.rig import Rig, Take, box_rig, calibrator_take

RATE = 8000.0
INSERTIONS = [(1, 2, 3, 4), (1, 5, 6, 7), (1, 8, 9, 10)]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return box_rig()


def recording(take: Take, label: str, *, properties: dict | None = None, **channel) -> Recording:
    """The take as a recording in volts with the nominal 50 mV/Pa."""
    given = {"unit": "Pa", "raw_unit": "V", "gain": 20.0, "role": "microphone"} | channel
    n = take.volts.shape[1]
    channels = tuple(
        Channel(name, "Measurement", sampling_rate=take.sampling_rate, n_samples=n, **given)
        for name in take.names
    )
    stated = take.properties if properties is None else properties
    return Recording(label, channels, ArraySource(list(take.volts)), group_properties={"Measurement": stated})


def insertions(rig: Rig, groups=INSERTIONS, n: int = 12000) -> list[Recording]:
    return [
        recording(calibrator_take(rig, mics, n, RATE, 50 + i), f"insertion_{i}.tdms")
        for i, mics in enumerate(groups)
    ]


def test_sensitivities_and_phases_are_those_of_the_rig(rig: Rig) -> None:
    calibration = calibrate(insertions(rig))
    assert [c.channel for c in calibration.channels] == [f"Mic {m}" for m in range(1, 11)]
    true = 1000 * rig.sensitivity_V_per_Pa[:10]
    found = np.array([c.sensitivity for c in calibration.channels])
    # An insertion repeats to 0.01 dB = 0.12 %.
    np.testing.assert_allclose(found, true, rtol=0.004)
    phases = np.array([c.phase.phase_deg[0] for c in calibration.channels])
    np.testing.assert_allclose(phases, rig.phase_deg[:10], atol=0.06)
    assert phases[0] == 0.0
    assert {c.phase.group for c in calibration.channels} == {"Mic 1"}
    assert calibration.calibrator_frequency_hz == pytest.approx(1000.02, abs=0.005)
    assert calibration.notes == ()
    assert {c.verdict for c in calibration.channels} == {"good"}


def test_a_chain_leads_through_microphones_other_than_the_first(rig: Rig) -> None:
    # 1 - 4 - 7: no insertion holds microphones 1 and 9.
    calibration = calibrate(insertions(rig, [(1, 2, 4), (4, 5, 7), (7, 8, 9)]))
    phases = {c.channel: c.phase for c in calibration.channels}
    assert phases["Mic 9"].group == "Mic 1"
    assert phases["Mic 9"].phase_deg[0] == pytest.approx(rig.phase_deg[8], abs=0.1)
    assert (
        phases["Mic 9"].u_phase_deg[0] > phases["Mic 5"].u_phase_deg[0] > phases["Mic 2"].u_phase_deg[0] > 0
    )


def test_a_chain_may_pass_180_degrees(rig: Rig) -> None:
    # Wires swapped, filters of another make: 0, 150, -150, 100 degrees.
    wide = dataclasses.replace(rig, phase_deg=np.array([0.0, 150.0, -150.0, 100.0, *np.zeros(20)]))
    calibration = calibrate(insertions(wide, [(1, 2), (2, 3), (3, 4), (2, 4)]))
    phases = [c.phase.phase_deg[0] for c in calibration.channels]
    np.testing.assert_allclose(phases, wide.phase_deg[:4], atol=0.1)


def test_groups_without_a_shared_microphone_are_not_chained(rig: Rig) -> None:
    calibration = calibrate(insertions(rig, [(1, 2, 3), (4, 5, 6)]))
    phases = {c.channel: c.phase for c in calibration.channels}
    assert phases["Mic 2"].group == "Mic 1"
    assert phases["Mic 5"].group == "Mic 4"
    assert phases["Mic 4"].phase_deg == (0.0,)
    assert phases["Mic 5"].phase_deg[0] == pytest.approx(rig.phase_deg[4] - rig.phase_deg[3], abs=0.05)
    assert len(calibration.notes) == 1
    assert "2 groups share no microphone (Mic 1 ... Mic 3; Mic 4 ... Mic 6)" in calibration.notes[0]


def test_order_of_the_recordings_does_not_matter(rig: Rig) -> None:
    recordings = insertions(rig)
    assert calibrate(recordings) == calibrate(recordings[::-1])


def test_phase_mean_is_circular(rig: Rig) -> None:
    # The second channel has its wires swapped: its phase scatters about 180 degrees.
    take = calibrator_take(dataclasses.replace(rig, phase_deg=np.zeros(24)), (1, 2), 12000, RATE, 1)
    take.volts[1] *= -1
    heard = evaluate_insertion(recording(take, "swapped.tdms")).heard[1]
    assert abs(heard.phase_deg) == pytest.approx(180.0, abs=0.05)
    assert heard.u_phase_deg < 0.1


def test_several_tones_are_kept_side_by_side(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2, 3), 12000, RATE, 1)
    time = np.arange(12000) / RATE
    low = (
        np.array([1.0, 1.0, 1.0])[:, None]
        * 0.07
        * np.cos(2 * np.pi * 250.0 * time + np.radians(np.array([[0.0], [0.4], [-0.9]])))
    )
    second = dataclasses.replace(take, volts=low, properties={"CalibratorFrequency_Hz": 250.0})
    calibration = calibrate([recording(take, "a.tdms"), recording(second, "b.tdms")])
    phase = calibration.channels[2].phase
    assert phase.frequency_hz == (pytest.approx(250.0, abs=1e-3), pytest.approx(1000.02, abs=0.01))
    assert phase.phase_deg == (pytest.approx(-0.9, abs=1e-6), pytest.approx(rig.phase_deg[2], abs=0.05))
    assert calibration.calibrator_frequency_hz is None


def test_level_comes_from_the_setting_before_the_property(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2), 12000, RATE, 1, level_dB=114.0)
    first = calibrate([recording(take, "a.tdms")]).channels[0].sensitivity
    assert first == pytest.approx(1000 * rig.sensitivity_V_per_Pa[0], rel=0.004)
    louder = calibrate([recording(take, "a.tdms")], CalibrationSettings(level_dB=94.0)).channels[0]
    assert louder.sensitivity == pytest.approx(10 * first, rel=1e-6)
    bare = calibrate([recording(take, "a.tdms", properties={})]).channels[0]
    assert bare.sensitivity == pytest.approx(10 * first, rel=1e-6)  # 94 dB where nothing says


def test_without_properties_the_microphones_that_hear_the_tone_are_found(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2, 3, 4), 12000, RATE, 1)
    take.volts[2] *= 10 ** (-30 / 20)  # outside the adapter
    take.volts[3] = 0.0
    insertion = evaluate_insertion(recording(take, "a.tdms", properties={}))
    assert [h.channel for h in insertion.heard] == ["Mic 1", "Mic 2"]
    (out,) = insertion.left_out
    assert out.channel == "Mic 3"
    assert re.fullmatch(r"shows the tone (29|30|31) dB below the loudest \(not seated\?\)", out.why)


def test_numbers_in_calibrated_channels_are_numbers_of_microphones(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 7, 12), 12000, RATE, 1)
    chosen = recording(take, "a.tdms", properties={"CalibratedChannels": "1, 12"})
    assert [h.channel for h in evaluate_insertion(chosen).heard] == ["Mic 1", "Mic 12"]
    wrong = recording(take, "a.tdms", properties={"CalibratedChannels": "1,99"})
    with pytest.raises(InputError, match="CalibratedChannels names '99'"):
        evaluate_insertion(wrong)


@pytest.mark.parametrize(
    ("spoil", "verdict", "reason"),
    [
        (lambda v: v * 10 ** (-5 / 20), "doubtful", "dB from the nominal sensitivity"),
        (lambda v: v * 10 ** (-15 / 20), "failed", "dB from the nominal sensitivity"),
        (lambda v: v + 0.1 * np.std(v) * np.sin(np.arange(v.size)), "doubtful", "noise and distortion"),
        (lambda v: v * np.linspace(0.985, 1.015, v.size), "doubtful", "drifts by +3.0"),
        (lambda v: v * np.where(np.arange(v.size) // 600 % 2, 1.0, 1.03), "doubtful", "windows scatter"),
    ],
)
def test_a_verdict_names_what_is_wrong(rig: Rig, spoil, verdict, reason) -> None:
    take = calibrator_take(rig, (1, 2), 12000, RATE, 1)
    take.volts[1] = spoil(take.volts[1])
    first, second = calibrate([recording(take, "a.tdms")]).channels
    assert first.verdict == "good"
    assert second.verdict == verdict
    assert any(reason in text for text in second.reasons), second.reasons


def test_clipping_fails_a_channel(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2), 12000, RATE, 1)
    rail = 0.999 * np.max(take.volts[1])
    take.volts[1] = np.clip(take.volts[1], -rail, rail)
    clipped = recording(take, "a.tdms")
    channels = (clipped.channels[0], dataclasses.replace(clipped.channels[1], full_scale=20.0 * rail))
    _, second = calibrate([dataclasses.replace(clipped, channels=channels)]).channels
    assert second.verdict == "failed"
    assert "clipped: stays at its largest value" in second.reasons


def test_insertions_that_contradict_each_other_are_doubted(rig: Rig) -> None:
    first, second = insertions(rig, [(1, 2), (1, 2)])
    second.source.samples[1][:] *= 10 ** (0.5 / 20)
    channel = calibrate([first, second]).channels[1]
    assert channel.verdict == "doubtful"
    assert any(re.search(r"insertions differ by 0\.(49|5\d) dB", reason) for reason in channel.reasons)
    assert channel.u_sensitivity_percent > 2.0


def test_a_silent_channel_is_named(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2, 3), 12000, RATE, 1)
    take.volts[1] = 0.0
    calibration = calibrate([recording(take, "a.tdms")])
    assert [c.channel for c in calibration.channels] == ["Mic 1", "Mic 3"]
    assert calibration.notes == ("Mic 2 gives no signal in a.tdms: not calibrated",)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"role": "generator"}, "has no microphone channel"),
        ({"raw_unit": "Pa"}, "are in Pa; expected volts"),
    ],
)
def test_what_is_no_calibration_says_so(rig: Rig, change, message) -> None:
    take = calibrator_take(rig, (1, 2), 12000, RATE, 1)
    with pytest.raises(InputError, match=message):
        calibrate([recording(take, "a.tdms", **change)])


def test_noise_is_no_calibrator() -> None:
    rng = np.random.default_rng(1)
    take = Take(("Mic 1",), RATE, np.zeros((1, 12000)), rng.standard_normal((1, 12000)), {})
    with pytest.raises(InputError, match="no channel has a dominant tone"):
        evaluate_insertion(recording(take, "noise.tdms"))


def test_a_recording_too_short_says_so(rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2), 400, RATE, 1)
    with pytest.raises(InputError, match="is shorter than 200 cycles"):
        evaluate_insertion(recording(take, "short.tdms"))


def test_names_sort_as_people_count() -> None:
    assert sorted(["Mic 10", "Mic 2", "Mic 1"], key=natural) == ["Mic 1", "Mic 2", "Mic 10"]
