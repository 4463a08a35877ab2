"""``specan batch`` from outside: what it takes, what it leaves, and how it says what is wrong."""

import dataclasses
import io
import json
import subprocess
import sys
import wave
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from nptdms import ChannelObject, GroupObject, TdmsWriter

from specan.errors import SpecanError
from specan_cli.main import main
from truth.rig import Rig, Take, box_rig, calibrator_take, noise_take, sine_take
from truth.rig_files import write_tdms

RATE = 8000.0
FEW = ("Mic 1", "Mic 2", "Mic 3", "Vibrometer", "Generator")


@pytest.fixture(scope="module")
def rig() -> Rig:
    return box_rig()


def sine(rig: Rig, frequency: float = 250.0, n: int = 4000) -> Take:
    return sine_take(rig, frequency, 1.0, n, RATE, 1).only(FEW)


def noise(rig: Rig, n: int = 9000) -> Take:
    return noise_take(rig, 1.0, n, RATE, 2).only(FEW)


def run(*arguments: object) -> tuple[int, str, str]:
    """Exit code, output and messages of a call, as the entry point turns them out."""
    result = CliRunner().invoke(main, ["batch", *map(str, arguments)], standalone_mode=False)
    fault = result.exception
    if isinstance(fault, SpecanError):
        return fault.exit_code, result.stdout, str(fault)
    if fault is not None:
        raise fault
    return result.return_value or 0, result.stdout, result.stderr


def table(path: Path) -> list[dict[str, str]]:
    lines = [x for x in path.read_text(encoding="utf-8").splitlines() if not x.startswith("#")]
    names = lines[0].split("\t")
    return [dict(zip(names, line.split("\t"), strict=True)) for line in lines[1:]]


def skipped(out: Path) -> dict[str, str]:
    return {row["file"]: row["reason"] for row in table(out / "skipped.txt") if not row["channel"]}


@pytest.fixture
def place(tmp_path: Path, rig: Rig) -> Path:
    """A directory with one good sine recording."""
    write_tdms(tmp_path / "in" / "good.tdms", rig, sine(rig))
    return tmp_path / "in"


# What each bad file is, and what its reason has to say.
BAD = {
    "text.tdms": (b"time;pressure\n0;1\n", "is a text file"),
    "pointer.tdms": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "Git-LFS pointer"),
    "empty.tdms": (b"", "is empty"),
    "index.tdms": (b"TDSh" + bytes(100), "is a TDMS index file"),
    "noise.wav": (b"RIFF\x10\x00\x00\x00WAVE", "noise.wav"),
}


def zipped() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a", "b")
    return file.getvalue()


BAD["archive.tdms"] = (zipped(), "is a zip archive")


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_named_and_costs_the_others_nothing(place: Path, tmp_path: Path, name: str) -> None:
    content, reason = BAD[name]
    (place / name).write_bytes(content)
    out = tmp_path / "out"
    code, _, messages = run(place, "-o", out)
    assert code == 1
    assert reason in skipped(out)[name]
    assert f"Failed: {name}: " in messages
    assert {row["file"] for row in table(out / "sine.txt")} == {"good.tdms"}
    assert str(tmp_path) not in (out / "skipped.txt").read_text()


def test_only_bad_files_give_exit_code_3(tmp_path: Path) -> None:
    (tmp_path / "a.tdms").write_bytes(b"nothing")
    assert run(tmp_path, "-o", tmp_path / "out")[0] == 3


def test_a_stray_index_file_is_no_input(place: Path, tmp_path: Path) -> None:
    (place / "other.tdms_index").write_bytes(b"TDSh")
    assert run(place, "-o", tmp_path / "out")[0] == 0
    assert skipped(tmp_path / "out") == {}


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["nowhere", "-o", "out"], 2, "the directory nowhere does not exist"),
        (["empty", "-o", "out"], 3, "holds no recording"),
        (["in", "-o", "in/good.tdms"], 2, "cannot be written to"),
        (["in", "-o", "in/good.tdms/below"], 2, "cannot be written to"),
        (["in", "-o", "out", "--settings", "none.toml"], 2, "none.toml does not exist"),
        (["in", "-o", "out", "--calibration", "none.toml"], 2, "none.toml does not exist"),
        (["in", "-o", "out", "--jobs", "0"], 2, "the number of processes is 0"),
        (["in", "-o", "out", "--lines", "1"], 2, "transfer_function.lines"),
    ],
)
def test_a_request_that_cannot_be_carried_out(
    place: Path, tmp_path: Path, monkeypatch, arguments, code, message
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    found, _, messages = run(*arguments)
    assert found == code
    assert message in messages
    assert not (tmp_path / "out").exists() or not any((tmp_path / "out").glob("*.txt"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[octave]\nfractoin = 3\n", "unknown key 'octave.fractoin'; did you mean 'fraction'?"),
        ("[octave]\nfraction = 5\n", "'octave.fraction' is 5"),
        ("lines = 5\n", "unknown key 'lines'"),
        ("[octave\n", "is not valid TOML"),
    ],
)
def test_settings_are_strict(place: Path, tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "s.toml").write_text(content)
    code, _, messages = run(place, "-o", tmp_path / "out", "--settings", tmp_path / "s.toml")
    assert code == 2
    assert message in messages
    assert not (tmp_path / "out").exists()


def test_settings_are_used_and_echoed_with_their_hash(place: Path, tmp_path: Path, rig: Rig) -> None:
    write_tdms(place / "noise.tdms", rig, noise(rig))
    (tmp_path / "s.toml").write_text("[octave]\nfraction = 1\n[transfer_function]\nlines = 100\n")
    outs = [tmp_path / "first", tmp_path / "second"]
    assert run(place, "-o", outs[0], "--settings", tmp_path / "s.toml")[0] == 0
    assert run(place, "-o", outs[1], "--settings", tmp_path / "s.toml", "--lines", "50")[0] == 0
    bands = [row["band_hz"] for row in table(outs[0] / "bands.txt") if row["channel"] == "Mic 1"]
    assert bands[:5] == ["16", "31.5", "63", "125", "250"]
    for out, lines in zip(outs, (100, 50), strict=True):
        mine = [row for row in table(out / "noise.txt") if row["channel"] == "Mic 2"]
        assert len(mine) == lines
    headers = [(out / "noise.txt").read_text().splitlines()[1] for out in outs]
    assert all(header.startswith("# settings ") for header in headers)
    assert headers[0].split()[2] != headers[1].split()[2]


def test_a_truncated_recording_gives_what_there_is(place: Path, tmp_path: Path, rig: Rig) -> None:
    cut = place / "cut.tdms"
    write_tdms(cut, rig, sine(rig, n=12000))
    cut.write_bytes(cut.read_bytes()[:-30_000])
    assert run(place, "-o", tmp_path / "out")[0] == 0
    rows = [row for row in table(tmp_path / "out" / "sine.txt") if row["file"] == "cut.tdms"]
    assert len(rows) == len(FEW) + 1
    assert all("truncated" in row["flags"].split() for row in rows)
    assert all(row["phase_deg"] for row in rows if row["channel"].startswith("Mic"))


def spoilt(rig: Rig, take: Take, spoil, channel: str = "Mic 2") -> Take:
    volts = take.volts.copy()
    volts[take.names.index(channel)] = spoil(volts[take.names.index(channel)])
    return dataclasses.replace(take, volts=volts)


def with_nan(volts: np.ndarray) -> np.ndarray:
    volts = volts.copy()
    volts[100] = np.nan
    return volts


@pytest.mark.parametrize(
    ("spoil", "flag"),
    [
        (np.zeros_like, "dead"),
        (lambda v: 10 * v / np.max(np.abs(v)) * 1.5, "clipped"),
        (with_nan, "nan"),
    ],
)
@pytest.mark.parametrize("make", [sine, noise])
def test_a_bad_channel_is_flagged_and_costs_the_others_nothing(
    tmp_path: Path, rig: Rig, spoil, flag: str, make
) -> None:
    samples = "float32" if flag == "nan" else "int32"
    name = "sine.txt" if make is sine else "noise.txt"
    write_tdms(tmp_path / "good" / "a.tdms", rig, make(rig), samples=samples)
    write_tdms(tmp_path / "bad" / "a.tdms", rig, spoilt(rig, make(rig), spoil), samples=samples)
    for kind in ("good", "bad"):
        assert run(tmp_path / kind, "-o", tmp_path / f"out_{kind}")[0] == 0
    good, bad = (table(tmp_path / f"out_{kind}" / name) for kind in ("good", "bad"))
    assert all(flag in row["flags"].split() for row in bad if row["channel"] == "Mic 2")
    assert any(row["channel"] == "Mic 2" for row in bad)
    others = ("Mic 1", "Mic 3", "Vibrometer", "Generator")
    assert [r for r in bad if r["channel"] in others] == [r for r in good if r["channel"] in others]


@pytest.mark.parametrize("make", [sine, noise])
def test_without_a_vibrometer_levels_remain(tmp_path: Path, rig: Rig, make) -> None:
    write_tdms(tmp_path / "in" / "a.tdms", rig, make(rig).only(("Mic 1", "Mic 2", "Generator")))
    out = tmp_path / "out"
    assert run(tmp_path / "in", "-o", out)[0] == 0
    if make is sine:
        rows = table(out / "sine.txt")
        assert all("no-reference" in row["flags"].split() for row in rows)
        assert all(row["rms"] and not row["phase_deg"] and not row["reference"] for row in rows)
    else:
        assert table(out / "noise.txt") == []
        assert {row["channel"] for row in table(out / "bands.txt")} == {"Mic 1", "Mic 2", "Generator"}
        assert "no transfer function" in skipped(out)["a.tdms"]
        assert "has no vibrometer channel" in skipped(out)["a.tdms"]


def test_a_dead_reference_gives_no_phases(tmp_path: Path, rig: Rig) -> None:
    take = spoilt(rig, sine(rig), np.zeros_like, "Vibrometer")
    write_tdms(tmp_path / "in" / "a.tdms", rig, take)
    assert run(tmp_path / "in", "-o", tmp_path / "out")[0] == 0
    rows = {row["channel"]: row for row in table(tmp_path / "out" / "sine.txt")}
    assert rows["Mic 1"]["phase_deg"] == ""
    assert "no-reference" in rows["Mic 1"]["flags"]
    assert "dead" in rows["Vibrometer"]["flags"]
    assert rows["Vibrometer"]["level_dB"] == ""


def test_phases_between_microphones(place: Path, tmp_path: Path) -> None:
    out = [tmp_path / "vibrometer", tmp_path / "microphone"]
    assert run(place, "-o", out[0])[0] == 0
    assert run(place, "-o", out[1], "--reference", "Mic 1")[0] == 0
    against, between = (
        {row["channel"]: row for row in table(o / "sine.txt") if row["file"] == "good.tdms"} for o in out
    )
    assert between["Mic 2"]["reference"] == "Mic 1"
    assert between["Mic 1"]["phase_deg"] == ""
    difference = float(against["Mic 2"]["phase_deg"]) - float(against["Mic 1"]["phase_deg"])
    assert float(between["Mic 2"]["phase_deg"]) == pytest.approx(difference, abs=0.02)


def test_a_reference_that_no_file_has_is_named(place: Path, tmp_path: Path) -> None:
    code, _, messages = run(place, "-o", tmp_path / "out", "--reference", "Mic 99")
    assert code == 3
    assert "has no channel 'Mic 99'" in messages


def test_a_file_without_a_sampling_rate(tmp_path: Path, place: Path) -> None:
    with TdmsWriter(str(place / "bare.tdms")) as writer:
        writer.write_segment([ChannelObject("g", "Mic 1", np.sin(np.arange(2000.0)))])
    out = tmp_path / "out"
    assert run(place, "-o", out)[0] == 1
    assert "no sampling rate for 'Mic 1'" in skipped(out)["bare.tdms"]
    assert run(place, "-o", out, "--sampling-rate", "2000")[0] == 0
    assert {row["file"] for row in table(out / "other.txt")} == {"bare.tdms"}


def test_contradicting_units_are_an_error_of_that_file(tmp_path: Path, place: Path) -> None:
    # The file says pascals; the calibration of the directory has mV/Pa.
    with TdmsWriter(str(place / "pascals.tdms")) as writer:
        properties = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "unit_string": "Pa"}
        writer.write_segment([ChannelObject("g", "Mic 1", np.sin(np.arange(2000.0)), properties)])
    (place / "calibration.toml").write_text(
        'schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = 50.0\nunit = "mV/Pa"\n'
    )
    out = tmp_path / "out"
    assert run(place, "-o", out)[0] == 1
    assert "'Mic 1' are in Pa" in skipped(out)["pascals.tdms"]
    assert "Mic 1" in {row["channel"] for row in table(out / "sine.txt")}


def test_a_spectrum_is_put_aside_without_failure(tmp_path: Path, place: Path) -> None:
    with TdmsWriter(str(place / "spectrum.tdms")) as writer:
        properties = {"wf_increment": 4.0, "wf_start_offset": 0.0, "NI_ExpXDimension": "f"}
        writer.write_segment([ChannelObject("g", "Power Spectrum", np.arange(1000.0), properties)])
    out = tmp_path / "out"
    assert run(place, "-o", out)[0] == 0
    (row,) = table(out / "skipped.txt")
    assert (row["file"], row["kind"]) == ("spectrum.tdms", "aside")


def test_calibrator_recordings_of_the_directory_are_used_and_put_aside(
    place: Path, tmp_path: Path, rig: Rig
) -> None:
    for number, mics in enumerate([(1, 2), (1, 3)]):
        take = calibrator_take(rig, mics, 12000, RATE, 60 + number)
        write_tdms(place / f"calibrator_{number}.tdms", rig, take)
    out = tmp_path / "out"
    assert run(place, "-o", out)[0] == 0
    assert set(skipped(out)) == {"calibrator_0.tdms", "calibrator_1.tdms"}
    assert all("used for the calibration" in reason for reason in skipped(out).values())
    truth = np.sqrt(np.mean(sine(rig).truth ** 2, axis=1))
    rows = {row["channel"]: row for row in table(out / "sine.txt")}
    for channel, rms in zip(FEW[:3], truth, strict=False):
        assert float(rows[channel]["rms"]) == pytest.approx(rms, rel=0.005)
    header = (out / "sine.txt").read_text()
    assert "# calibration: calibration.toml (sha256 " in header
    # A calibration that is given counts before the recordings.
    (tmp_path / "mine.toml").write_text(
        'schema = 1\n[[channel]]\nchannel = "Mic *"\nsensitivity = 25.0\nunit = "mV/Pa"\n'
    )
    assert run(place, "-o", tmp_path / "given", "--calibration", tmp_path / "mine.toml")[0] == 0
    given = {row["channel"]: row for row in table(tmp_path / "given" / "sine.txt")}
    ratio = float(given["Mic 2"]["rms"]) / float(rows["Mic 2"]["rms"])
    assert ratio == pytest.approx(1000 * rig.sensitivity_V_per_Pa[1] / 25.0, rel=0.005)
    assert "not used because a calibration was given" in skipped(tmp_path / "given")["calibrator_0.tdms"]


def test_the_nearest_calibration_file_counts(tmp_path: Path, rig: Rig) -> None:
    for folder, sensitivity in (("", 50.0), ("sub/", 100.0)):
        write_tdms(tmp_path / "in" / f"{folder}a.tdms", rig, sine(rig))
        (tmp_path / "in" / f"{folder}calibration.toml").write_text(
            f'schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = {sensitivity}\n'
        )
    write_tdms(tmp_path / "in" / "sub" / "deeper" / "a.tdms", rig, sine(rig))
    assert run(tmp_path / "in", "-o", tmp_path / "out")[0] == 0
    rows = [row for row in table(tmp_path / "out" / "sine.txt") if row["channel"] == "Mic 1"]
    rms = {row["file"]: float(row["rms"]) for row in rows if row["rms"]}
    assert rms["a.tdms"] == pytest.approx(2 * rms["sub/a.tdms"], rel=1e-5)
    assert rms["sub/deeper/a.tdms"] == rms["sub/a.tdms"]


def test_a_calibration_file_counts_before_calibrator_recordings(
    place: Path, tmp_path: Path, rig: Rig
) -> None:
    write_tdms(place / "calibrator.tdms", rig, calibrator_take(rig, (1, 2), 12000, RATE, 60))
    (place / "calibration.toml").write_text(
        'schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = 25.0\n'
    )
    assert run(place, "-o", tmp_path / "out")[0] == 0
    truth = np.sqrt(np.mean(sine(rig).truth[0] ** 2))
    (found, *_) = table(tmp_path / "out" / "sine.txt")
    assert float(found["rms"]) == pytest.approx(truth * 1000 * rig.sensitivity_V_per_Pa[0] / 25.0, rel=0.005)


def test_a_failed_calibrator_recording_costs_the_others_nothing(
    place: Path, tmp_path: Path, rig: Rig
) -> None:
    good = calibrator_take(rig, (1, 2), 12000, RATE, 60)
    silent = dataclasses.replace(good, volts=np.zeros_like(good.volts))
    write_tdms(place / "calibrator.tdms", rig, good)
    write_tdms(place / "silent.tdms", rig, silent)
    assert run(place, "-o", tmp_path / "out")[0] == 1
    assert "no calibrated channel has a signal" in skipped(tmp_path / "out")["silent.tdms"]
    assert (tmp_path / "out" / "calibration.toml").is_file()


@pytest.mark.parametrize("name", ["calibration.toml", "report.html"])
def test_what_somebody_wrote_into_the_output_directory_stays(
    name: str, place: Path, tmp_path: Path, rig: Rig
) -> None:
    write_tdms(place / "calibrator.tdms", rig, calibrator_take(rig, (1, 2), 12000, RATE, 60))
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("of somebody")
    code, _, said = run(place, "-o", out, "--report")
    assert code == 2
    assert f"{out / name} exists" in said
    assert (out / name).read_text() == "of somebody"
    (out / name).unlink()
    for _ in range(2):  # a batch replaces its own
        assert run(place, "-o", out, "--report")[0] == 0
    changed = (out / name).read_text(encoding="utf-8") + "# and more"
    (out / name).write_text(changed, encoding="utf-8")
    assert run(place, "-o", out, "--report")[0] == 2
    assert (out / name).read_text(encoding="utf-8") == changed


def test_several_directories_prefix_their_names(tmp_path: Path, rig: Rig) -> None:
    for name in ("monday", "tuesday"):
        write_tdms(tmp_path / name / "deep" / "a.tdms", rig, sine(rig))
    assert run(tmp_path / "monday", tmp_path / "tuesday", "-o", tmp_path / "out")[0] == 0
    files = [row["file"] for row in table(tmp_path / "out" / "sine.txt")]
    assert files == sorted(files)
    assert set(files) == {"monday/deep/a.tdms", "tuesday/deep/a.tdms"}


def test_wav_is_read_whatever_the_case_of_its_suffix(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with wave.open(str(tmp_path / "in" / "A.WAV"), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes((8000 * np.sin(np.arange(8000) * 0.3)).astype("<i2").tobytes())
    assert run(tmp_path / "in", "-o", tmp_path / "out")[0] == 0
    assert {row["file"] for row in table(tmp_path / "out" / "other.txt")} == {"A.WAV"}


def test_description_stands_in_the_header(tmp_path: Path, rig: Rig) -> None:
    write_tdms(tmp_path / "in" / "a.tdms", rig, sine(rig), description="Set 4,\nmicrophones moved")
    assert run(tmp_path / "in", "-o", tmp_path / "out")[0] == 0
    header = (tmp_path / "out" / "sine.txt").read_text().splitlines()
    assert "# file a.tdms: Description: Set 4, microphones moved" in header


def test_excitation_of_the_user_wins(place: Path, tmp_path: Path) -> None:
    assert run(place, "-o", tmp_path / "out", "--excitation", "noise", "--lines", "50")[0] == 0
    assert table(tmp_path / "out" / "sine.txt") == []
    assert table(tmp_path / "out" / "noise.txt") != []


def test_slow_channels_get_their_rms(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with TdmsWriter(str(tmp_path / "in" / "slow.tdms")) as writer:
        properties = {"wf_increment": 0.5, "wf_start_offset": 0.0, "unit_string": "V"}
        writer.write_segment([GroupObject("g"), ChannelObject("g", "x", np.tile([3.0, 5.0], 50), properties)])
    assert run(tmp_path / "in", "-o", tmp_path / "out")[0] == 0
    (row,) = table(tmp_path / "out" / "other.txt")
    assert (row["band_hz"], row["rms"], row["level_dB"]) == ("total-Z", "1", "0.000")
    assert "no band levels" in skipped(tmp_path / "out")["slow.tdms"]


def test_json_is_a_summary_and_nothing_else(place: Path, tmp_path: Path) -> None:
    (place / "bad.tdms").write_bytes(b"")
    code, output, _ = run(place, "-o", tmp_path / "out", "--json")
    found = json.loads(output)
    assert code == 1
    assert (found["done"], list(found["failed"])) == (1, ["bad.tdms"])
    assert len(found["settings_hash"]) == 12


def test_the_place_in_use_is_not_written_to(place: Path, tmp_path: Path) -> None:
    from specan.analysis.batch.inputs import claim

    with claim(tmp_path / "out", ()):
        other = subprocess.run(
            [sys.executable, "-m", "specan_cli", "batch", str(place), "-o", str(tmp_path / "out")],
            capture_output=True,
            text=True,
            check=False,
        )
    assert other.returncode == 2
    assert "another batch is writing to" in other.stderr
    assert run(place, "-o", tmp_path / "out")[0] == 0


def test_a_batch_leaves_its_tables_and_what_it_can_be_resumed_from(place: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / ".specan").mkdir(parents=True)
    (out / ".specan" / ".0123.result.part").write_text("of a batch that was killed")
    (out / ".specan" / "0123.result").write_text("of a recording that is gone")
    assert run(place, "-o", out)[0] == 0
    names = sorted(p.name for p in out.iterdir())
    assert names == [".specan", "bands.txt", "noise.txt", "other.txt", "sine.txt", "skipped.txt"]
    (kept,) = (out / ".specan").iterdir()
    assert kept.name != "0123.result"


@pytest.mark.parametrize("make", [sine, noise])
def test_a_group_at_another_rate_is_analysed_or_named(tmp_path: Path, rig: Rig, make) -> None:
    take = make(rig)
    path = tmp_path / "in" / "two_rates.tdms"
    write_tdms(path, rig, take)
    with TdmsWriter(str(path), mode="a") as writer:
        properties = {"wf_increment": 1 / 16000, "wf_start_offset": 0.0, "unit_string": "V"}
        spare = ChannelObject("Fast", "Spare", np.sin(np.arange(2.0 * take.volts.shape[1])), properties)
        writer.write_segment([GroupObject("Fast"), spare])
    out = tmp_path / "out"
    assert run(tmp_path / "in", "-o", out)[0] == 0
    if make is sine:
        assert {row["channel"] for row in table(out / "sine.txt")} == {*FEW, "energy-mean"}
        (row,) = table(out / "skipped.txt")
        assert (row["channel"], row["kind"]) == ("Fast/Spare", "aside")
        assert "16000 Hz, not at 8000 Hz" in row["reason"]
    else:
        assert {row["channel"] for row in table(out / "noise.txt")} == set(FEW[:3])
        assert {row["channel"] for row in table(out / "bands.txt")} == {*FEW, "Spare"}
        assert table(out / "skipped.txt") == []


def test_every_format_that_a_verb_reads_is_taken_by_a_batch(tmp_path: Path) -> None:
    """Files that hold no signal are listed, and are no failure."""
    from scipy.io import savemat

    place = tmp_path / "in"
    place.mkdir()
    time = np.arange(2000) / 1000.0
    signal = np.sin(2 * np.pi * 50 * time)
    rows = "".join(f"{t:.3f},{x:.6f}\n" for t, x in zip(time, signal))
    (place / "signal.csv").write_text(f"time [s],Mic [Pa]\n{rows}")
    (place / "table.csv").write_text("speed [rpm],torque [N m]\n" + "100,2\n" * 20)
    (place / "channels.csv").write_text("channel,role\nMic,microphone\n")
    savemat(place / "signal.mat", {"Mic": signal, "fs": 1000.0})
    savemat(place / "numbers.mat", {"gain": 2.0})
    code, _, said = run(place, "-o", tmp_path / "out")
    assert code == 0, said
    rows = [r for r in table(tmp_path / "out" / "other.txt") if r["band_hz"] == "total-Z"]
    assert {r["file"]: float(r["rms"]) for r in rows} == {
        name: pytest.approx(np.sqrt(0.5), rel=1e-3) for name in ("signal.csv", "signal.mat")
    }
    aside = {r["file"]: r["kind"] for r in table(tmp_path / "out" / "skipped.txt") if not r["channel"]}
    assert aside == {"table.csv": "aside", "numbers.mat": "aside"}
