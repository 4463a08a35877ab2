"""What goes wrong in a calibration costs only what it hits, and is said with its true reason."""

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pytest

from specan.analysis.calibration import calibrate
from specan.analysis.insertion import CalibrationSettings
from specan.data.calibration import Calibration, apply
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError
from specan.io.calibration_file import read_calibration, write_calibration

RATE, SECONDS, HZ = 8000.0, 2.0, 1000.02
TRUE = {f"Mic {m}": 50.0 * 10 ** ((m % 5 - 2) * 0.2 / 20) for m in range(1, 25)}
PHASE = {f"Mic {m}": 0.5 * (m % 7 - 3) for m in range(1, 25)}
STAR = [(1, 2, 3, 4, 5, 6), (1, 7, 8, 9, 10, 11), (1, 12, 13, 14, 15, 16)]


def insertion(
    label: str,
    mics: tuple[int, ...],
    *,
    level: float = 94.0,
    hz: float = HZ,
    stated: dict | None = None,
    nominal: float | None = 50.0,
    scale: float = 1.0,
) -> Recording:
    """A computed recording of the microphones in a calibrator."""
    names = [f"Mic {m}" for m in mics]
    rng = np.random.default_rng([len(label), *mics])
    time = np.arange(int(RATE * SECONDS)) / RATE
    pascals = np.sqrt(2) * 20e-6 * 10 ** (level / 20)
    volts = [
        scale * TRUE[n] / 1000 * pascals * np.cos(2 * np.pi * hz * time + np.radians(PHASE[n]))
        + 1e-5 * rng.standard_normal(time.size)
        for n in names
    ]
    unit, gain = ("V", 1.0) if nominal is None else ("Pa", 1000.0 / nominal)
    channels = tuple(
        Channel(n, "g", unit, "microphone", RATE, time.size, raw_unit="V", gain=gain) for n in names
    )
    properties = {"CalibratorLevel_dB": level, "CalibratorFrequency_Hz": hz} if stated is None else stated
    return Recording(label, channels, ArraySource(volts), group_properties={"g": properties})


def star() -> list[Recording]:
    return [insertion(f"i{k}", mics) for k, mics in enumerate(STAR)]


def spoil(recording: Recording, mic: str, change) -> None:
    samples = recording.source.samples[[c.name for c in recording.channels].index(mic)]
    samples[:] = change(samples)


def by_name(calibration: Calibration) -> dict:
    return {c.channel: c for c in calibration.channels}


def zeros_after(part: float):
    return lambda v: np.where(np.arange(v.size) < part * v.size, v, 0.0)


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (zeros_after(0.7), "doubtful"),
        (zeros_after(0.3), "failed"),
        (lambda v: np.where(np.arange(v.size) // 100 == 50, 0.0, v), "doubtful"),
        (lambda v: np.where(np.arange(v.size) < 12000, v, np.nan), "doubtful"),
        (lambda v: np.where(np.arange(v.size) < 12000, v, v / 50), "doubtful"),
        (lambda v: np.where(np.arange(v.size) < 12000, v, v[7999]), "doubtful"),
    ],
    ids=["unplugged", "unplugged early", "short gap", "nan", "faint", "held"],
)
@pytest.mark.parametrize("mic", ["Mic 9", "Mic 7"])
def test_a_drop_out_costs_only_the_channel_it_hits(tmp_path: Path, mic: str, change, verdict: str) -> None:
    sound = by_name(calibrate(star()))
    hit = star()
    spoil(hit[1], mic, change)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        calibration = calibrate(hit)
    write_calibration(calibration, tmp_path / "c.toml")
    assert read_calibration(tmp_path / "c.toml") == calibration
    for name, channel in by_name(calibration).items():
        if name != mic:
            assert channel == sound[name], name
            continue
        assert channel.verdict == verdict
        assert any("the tone is missing in" in reason for reason in channel.reasons)
        assert channel.sensitivity == pytest.approx(TRUE[name], rel=1e-3)
        assert channel.phase.phase_deg[0] == pytest.approx(PHASE[name] - PHASE["Mic 1"], abs=0.05)


def test_a_drop_out_of_the_shared_microphone_leaves_the_others_their_phases() -> None:
    hit = star()
    spoil(hit[1], "Mic 1", zeros_after(0.3))
    for name, channel in by_name(calibrate(hit)).items():
        assert channel.phase.phase_deg[0] == pytest.approx(PHASE[name] - PHASE["Mic 1"], abs=0.05)
        assert channel.sensitivity == pytest.approx(TRUE[name], rel=1e-3)
        assert channel.verdict == ("doubtful" if name == "Mic 1" else "good"), channel


@pytest.mark.parametrize(
    "change", [lambda v: v * 0, lambda v: v * np.nan, lambda v: v * 1e300], ids=["zeros", "nan", "overflow"]
)
@pytest.mark.parametrize("mic", [7, 9])
def test_a_channel_without_a_signal_is_left_out_and_named(mic: int, change) -> None:
    hit = star()
    spoil(hit[1], f"Mic {mic}", change)
    hit[1].group_properties["g"]["CalibratedChannels"] = "1,7,8,9,10,11"
    calibration = calibrate(hit)
    assert f"Mic {mic}" not in by_name(calibration)
    assert len(calibration.channels) == 15
    assert any(
        note.startswith(f"Mic {mic} ") and "in i1: not calibrated" in note for note in calibration.notes
    )


@pytest.mark.parametrize("top", [0.95, 0.9, 0.8, 0.5])
def test_a_clipped_tone_is_failed_without_a_full_scale_and_not_applied(top: float) -> None:
    hit = star()
    rail = top * np.abs(hit[1].source.samples[3]).max()
    spoil(hit[1], "Mic 9", lambda v: np.clip(v, -rail, rail))
    calibration = calibrate(hit)
    verdicts = {name: c.verdict for name, c in by_name(calibration).items()}
    assert verdicts.pop("Mic 9") == "failed"
    assert set(verdicts.values()) == {"good"}
    applied = apply(calibration, hit[1]).channel("Mic 9")
    assert applied.gain == hit[1].channel("Mic 9").gain
    assert "failed (clipped" in applied.decisions["calibration"]


def test_a_shared_microphone_that_is_clipped_once_is_calibrated_from_the_others() -> None:
    hit = star()
    rail = 0.6 * np.abs(hit[1].source.samples[0]).max()
    spoil(hit[1], "Mic 1", lambda v: np.clip(v, -rail, rail))
    found = by_name(calibrate(hit))
    assert found["Mic 1"].sensitivity == pytest.approx(TRUE["Mic 1"], rel=1e-3)
    assert found["Mic 1"].verdict == "doubtful"
    assert "clipped in i1" in found["Mic 1"].reasons[0]
    # Seven and nine kilohertz, folded back by sampling at 8 kHz, fall on the tone: its phase there is wrong.
    assert {found[f"Mic {m}"].phase.group for m in STAR[1][1:]} == {"Mic 7"}
    assert found["Mic 9"].phase.phase_deg[0] == pytest.approx(PHASE["Mic 9"] - PHASE["Mic 7"], abs=0.05)


@pytest.mark.parametrize("turned", ["Mic 1", "Mic 2"])
def test_an_inverted_microphone_is_named_and_corrected_at_every_frequency(
    tmp_path: Path, turned: str
) -> None:
    hit = star()
    for recording in hit:
        if turned in [c.name for c in recording.channels]:
            spoil(recording, turned, np.negative)
    calibration = calibrate(hit)
    write_calibration(calibration, tmp_path / "c.toml")
    calibration = read_calibration(tmp_path / "c.toml")
    found = by_name(calibration)
    assert [n for n, c in found.items() if c.verdict != "good"] == [turned]
    assert found[turned].reasons == ("polarity inverted: 180 degrees are corrected at all frequencies",)
    # In the same field at 250 Hz: what is left is the difference of the channels' delays, a quarter of that at 1 kHz.
    sign = {name: -1.0 if name == turned else 1.0 for name in found}
    f = np.array([250.0])
    left = {
        n: sign[n] * np.exp(1j * np.radians(PHASE[n] / 4)) * np.exp(-1j * np.radians(c.phase.at(f)[0]))
        for n, c in found.items()
    }
    angles = np.degrees([np.angle(v / left["Mic 3"]) for v in left.values()])
    np.testing.assert_allclose(angles, 0.0, atol=0.05)
    # The absolute sign is that of the majority.
    np.testing.assert_allclose([abs(np.degrees(np.angle(v))) for v in left.values()], 0.0, atol=1.0)
    assert max(c.phase.u_at(f)[0] for c in found.values()) < 1.0


def test_a_delay_of_half_a_period_known_at_two_tones_is_no_inversion() -> None:
    late = [insertion("a", (1, 2, 3)), insertion("b", (1, 2, 3), hz=250.0)]
    for recording, hz in zip(late, (HZ, 250.0), strict=True):
        time = np.arange(int(RATE * SECONDS)) / RATE
        recording.source.samples[1][:] = 0.07 * np.cos(2 * np.pi * hz * (time + 0.45e-3))
    second = calibrate(late).channels[1]
    assert not second.phase.inverted
    assert second.verdict == "doubtful"
    assert "neither a matched nor an inverted microphone" in second.reasons[-1]


@pytest.mark.parametrize(("level", "hz"), [(114.0, 250.0), (124.0, 250.1), (94.0, 250.0)])
def test_a_pistonphone_is_known_by_its_frequency_and_the_nominal_sensitivities(
    level: float, hz: float
) -> None:
    calibration = calibrate([insertion("p", (1, 2, 3), level=level, hz=hz, stated={})])
    assert calibration.calibrator_level_dB == level
    assert {c.verdict for c in calibration.channels} == {"good"}
    assert any(
        f"level {level:g} dB" in line and "by nominal" in line for line in calibration.calibrator_decided
    )


def test_a_pistonphone_without_anything_that_tells_its_level_is_asked_for() -> None:
    bare = insertion("p", (1, 2, 3), level=114.0, hz=250.0, stated={}, nominal=None, scale=0.25)
    with pytest.raises(
        InputError, match=r"pistonphone \(114 or 124 dB\), and its level is not stated.*--level 114"
    ):
        calibrate([bare])
    given = calibrate([bare], CalibrationSettings(level_dB=114.0))
    assert given.channels[0].sensitivity == pytest.approx(TRUE["Mic 1"] / 4, rel=1e-3)
    assert given.calibrator_decided[0] == "level 114 dB: as given"


def test_a_level_that_nothing_confirms_is_never_good() -> None:
    """12.5 mV/Pa and 114 dB taken for 94 dB give 125 mV/Pa, which some microphones have."""
    for scale in (1.0, 0.25):
        bare = insertion("p", (1, 2, 3), level=114.0, stated={}, nominal=None, scale=scale)
        calibration = calibrate([bare])
        assert all(c.verdict != "good" for c in calibration.channels)
        assert "level 94 dB: assumed, as no property states it" in calibration.calibrator_decided
    with_nominal = calibrate([insertion("p", (1, 2, 3), level=114.0, stated={})])
    assert {c.verdict for c in with_nominal.channels} == {"failed"}
    assert "by nominal sensitivities 114." in with_nominal.calibrator_decided[0]


def test_97_dB_taken_for_94_dB_is_not_good_where_nominal_sensitivities_exist() -> None:
    calibration = calibrate(
        [insertion("p", (1, 2, 3, 4, 5), level=97.0, stated={"CalibratorLevel_dB": 94.0})]
    )
    assert all(c.verdict != "good" for c in calibration.channels)
    assert all(any("97 dB instead of 94 dB" in r for r in c.reasons) for c in calibration.channels)


@pytest.mark.parametrize(("down", "verdict"), [(2.0, "good"), (6.5, "failed"), (20.0, "failed")])
@pytest.mark.parametrize("nominal", [50.0, None])
def test_a_microphone_far_from_its_neighbours_has_failed(
    down: float, verdict: str, nominal: float | None
) -> None:
    stated = {"CalibratorLevel_dB": 94.0, "CalibratedChannels": "1,2,3,4,5,6"}
    hit = insertion("a", (1, 2, 3, 4, 5, 6), stated=stated, nominal=nominal)
    spoil(hit, "Mic 2", lambda v: v * 10 ** (-down / 20))  # Mic 2 has the nominal sensitivity
    found = by_name(calibrate([hit]))
    assert found.pop("Mic 2").verdict == verdict
    assert {c.verdict for c in found.values()} == {"good"}


def test_a_microphone_that_is_not_seated_is_mentioned() -> None:
    hit = insertion("a", (1, 2, 3), stated={"CalibratorLevel_dB": 94.0})
    spoil(hit, "Mic 2", lambda v: v / 10)
    calibration = calibrate([hit])
    assert calibration.notes == (
        "Mic 2 shows the tone 20 dB below the loudest (not seated?) in a: not calibrated",
    )
    again = insertion("b", (1, 2), stated={"CalibratorLevel_dB": 94.0})
    assert calibrate([hit, again]).notes == ()  # another insertion has it


def test_a_tone_elsewhere_is_said_to_be_there() -> None:
    at_250 = insertion(
        "a", (1, 2), hz=250.0, stated={"CalibratorFrequency_Hz": 1000.0, "CalibratorLevel_dB": 94}
    )
    with pytest.raises(InputError, match=r"the tone is at 250 Hz .*CalibratorFrequency_Hz says 1000 Hz"):
        calibrate([at_250])
    named = {"CalibratedChannels": "1,2", "CalibratorLevel_dB": 94.0}
    for down in (0.0, 10 ** (-30 / 20)):  # silent, and outside the adapter
        wrong = insertion("a", (1, 2, 3, 4), stated=named)
        for mic in ("Mic 1", "Mic 2"):
            spoil(
                wrong, mic, lambda v, d=down: v * d + 1e-6 * np.random.default_rng(1).standard_normal(v.size)
            )
        with pytest.raises(
            InputError, match=r"CalibratedChannels names \(Mic 1, Mic 2\).*is on Mic 3, Mic 4"
        ):
            calibrate([wrong])


@pytest.mark.parametrize("written", ["94 dB", "94,0", 94])
def test_a_level_may_be_written_with_its_unit(written: object) -> None:
    assert (
        calibrate([insertion("a", (1, 2), stated={"CalibratorLevel_dB": written})]).calibrator_level_dB
        == 94.0
    )


def test_a_level_that_is_no_number_says_so() -> None:
    with pytest.raises(InputError, match="CalibratorLevel_dB is 'loud'"):
        calibrate([insertion("a", (1, 2), stated={"CalibratorLevel_dB": "loud"})])


def test_a_calibration_that_is_not_finite_cannot_be_made() -> None:
    channel = calibrate([insertion("a", (1, 2))]).channels[1]
    phase = dataclasses.replace(channel.phase, u_phase_deg=(float("nan"),))
    with pytest.raises(Exception, match="is not finite"):
        dataclasses.replace(channel, phase=phase)
