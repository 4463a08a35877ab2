"""``specan calibrate`` from outside."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import SpecanError
from specan.io.calibration_file import read_calibration
from specan.io.open import open_recording
from specan_cli.main import main
from truth.rig import Rig, box_rig, calibrator_take, noise_take, sine_take
from truth.rig_files import write_tdms

RATE = 8000.0


@pytest.fixture(scope="module")
def rig() -> Rig:
    return box_rig()


@pytest.fixture
def place(tmp_path: Path, rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Path:
    for number, mics in enumerate([(1, 2, 3), (1, 4, 5), (6, 7)]):
        write_tdms(tmp_path / f"{number}.tdms", rig, calibrator_take(rig, mics, 12000, RATE, 80 + number))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, ["calibrate", *map(str, arguments)], standalone_mode=False)
    if isinstance(result.exception, SpecanError):
        return result.exception.exit_code, result.stdout, str(result.exception)
    if result.exception is not None:
        raise result.exception
    return result.return_value or 0, result.stdout, result.stderr


def test_the_file_that_it_writes_calibrates_other_recordings(place: Path, rig: Rig) -> None:
    code, output, _ = run("0.tdms", "1.tdms", "-o", "c.toml")
    assert code == 0
    assert "Written to c.toml." in output
    calibration = read_calibration("c.toml")
    assert calibration.made_from == ("0.tdms", "1.tdms")
    # A microphone hears 94 dB again, and its phase error is gone at the tone.
    opened = open_recording("1.tdms", calibration="c.toml")
    rms = np.std(opened.read(opened.channels), axis=1)
    np.testing.assert_allclose(rms, 20e-6 * 10 ** (94 / 20), rtol=0.004)
    turn = np.degrees(np.angle(opened.channel("Mic 4").correction(np.array([1000.0]))))
    assert turn[0] == pytest.approx(-rig.phase_deg[3], abs=0.05)


def test_groups_without_a_shared_microphone_are_told(place: Path) -> None:
    code, _, messages = run("0.tdms", "2.tdms")
    assert code == 0
    assert "2 groups share no microphone (Mic 1 ... Mic 3; Mic 6 ... Mic 7)" in messages


def test_options_reach_the_evaluation(place: Path) -> None:
    arguments = [
        "0.tdms",
        "--level",
        "114",
        "--windows",
        "10",
        "--channel",
        "Mic [12]",
        "--phase-model",
        "constant",
    ]
    assert run(*arguments)[0] == 1  # 20 dB off the nominal sensitivity: failed
    calibration = read_calibration("calibration.toml")
    assert [c.channel for c in calibration.channels] == ["Mic 1", "Mic 2"]
    assert calibration.calibrator_level_dB == 114.0
    assert all(c.verdict == "failed" for c in calibration.channels)
    assert calibration.channels[0].phase.model == "constant"


def test_json_holds_what_was_found(place: Path) -> None:
    code, output, _ = run("0.tdms", "--json")
    assert code == 0
    found = json.loads(output)
    assert [c["channel"] for c in found["channels"]] == ["Mic 1", "Mic 2", "Mic 3"]
    assert found["channels"][1]["phase"]["group"] == "Mic 1"


def test_a_file_that_is_no_calibrator_costs_the_others_nothing(place: Path, rig: Rig) -> None:
    write_tdms(place / "noise.tdms", rig, noise_take(rig, 1.0, 9000, RATE, 2), with_excitation=False)
    code, _, messages = run("0.tdms", "noise.tdms", "gone.tdms")
    assert code == 1
    assert "Left out: noise.tdms: no channel has a dominant tone" in messages
    assert "gone.tdms does not exist" in messages
    assert read_calibration("calibration.toml").made_from == ("0.tdms",)


def test_in_a_directory_only_recordings_that_say_so_count(place: Path, rig: Rig) -> None:
    # A loudspeaker's tone on the microphones would pass for a calibrator's.
    tone = sine_take(rig, 1000.0, 1.0, 12000, RATE, 5)
    write_tdms(place / "tone.tdms", rig, tone)
    code, _, messages = run(".")
    assert code == 0
    assert "1 recording with another excitation not used" in messages
    assert read_calibration("calibration.toml").made_from == ("0.tdms", "1.tdms", "2.tdms")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["gone.tdms"], 3, "gone.tdms does not exist"),
        (["gone.tdms", "lost.tdms"], 3, "no file could be used"),
        (["0.tdms", "-o", "nowhere/c.toml"], 2, "the directory of nowhere/c.toml does not exist"),
        (["0.tdms", "--windows", "1"], 2, "'windows' is 1"),
        (["0.tdms", "--frequency", "-5"], 2, "'frequency_hz' is -5.0"),
        (["0.tdms", "--channel", "Mic 9"], 2, "has no channel 'Mic 9'"),
        (
            ["0.tdms", "--frequency", "3000"],
            3,
            "the tone is at 1000.02 Hz (Mic 3), and --frequency says 3000 Hz",
        ),
    ],
)
def test_what_cannot_be_calibrated(place: Path, arguments, code, message) -> None:
    found, _, messages = run(*arguments)
    assert found == code, messages
    assert message in messages
    assert not (place / "calibration.toml").exists()


def test_a_bad_microphone_is_failed_and_ends_with_exit_code_1(place: Path, rig: Rig) -> None:
    take = calibrator_take(rig, (1, 2), 12000, RATE, 90)
    volts = take.volts.copy()
    volts[1] *= 0.1
    write_tdms(place / "bad.tdms", rig, dataclasses.replace(take, volts=volts))
    code, output, _ = run("bad.tdms")
    assert code == 1
    assert "failed" in output
    first, second = read_calibration("calibration.toml").channels
    assert (first.verdict, second.verdict) == ("good", "failed")
