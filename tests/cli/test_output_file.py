"""Files that are written: what they never replace, standard output, a reader that stops early."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from specan.errors import RequestError
from specan.io.output_file import check_output, is_recording, text_file, whole_file, written_by_specan
from truth.rig import box_rig, calibrator_take, noise_take
from truth.rig_files import write_tdms

RATE = 8000.0
READERS = ("octave", "fft", "frf", "rms")
VERBS = (
    *READERS,
    "calibrate",
    "export .csv",
    "export .wav",
    "export .parquet",
    "export .uff",
)


@pytest.fixture
def recording(tmp_path) -> Path:
    rig = box_rig()
    write_tdms(
        tmp_path / "a.tdms",
        rig,
        noise_take(rig, 1.0, 9000, RATE, 2).only(("Mic 1", "Vibrometer", "Generator")),
    )
    write_tdms(tmp_path / "c.tdms", rig, calibrator_take(rig, (1,), 40000, RATE, 3))
    return tmp_path / "a.tdms"


def specan(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "specan_cli", *map(str, arguments)], cwd=cwd, capture_output=True, check=False
    )


def call(verb: str, recording: Path, *arguments: object) -> tuple[int, str, str]:
    """Exit code, output and messages, in this process."""
    from click.testing import CliRunner

    from specan.errors import SpecanError
    from specan_cli.main import main

    name, *options = verb.split()
    options = [] if name == "export" else options
    source = recording.with_name("c.tdms") if name == "calibrate" else recording
    result = CliRunner().invoke(
        main, [name, str(source), *options, *map(str, arguments)], standalone_mode=False
    )
    if isinstance(result.exception, SpecanError):
        return result.exception.exit_code, result.stdout, str(result.exception)
    if result.exception is not None:
        raise result.exception
    return result.return_value or 0, result.stdout, result.stderr


def ending(verb: str) -> str:
    return {"calibrate": ".toml"}.get(verb, verb.partition(" ")[2] or ".txt")


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("verb", VERBS)
def test_a_recording_is_never_replaced(recording, tmp_path, verb) -> None:
    source = tmp_path / ("c.tdms" if verb == "calibrate" else "a.tdms")
    os.link(source, tmp_path / "hard.txt")
    (tmp_path / "soft.txt").symlink_to(source)
    (tmp_path / "other.wav").write_bytes(b"RF64\xff\xff\xff\xffWAVE" + bytes(100))
    for name in (source.name, "hard.txt", "soft.txt", "other.wav"):
        for extra in ((), ("--force",)):
            before = digest(tmp_path / name)
            code, _, message = call(verb, recording, "-o", tmp_path / name, *extra)
            assert code == 2, message
            assert name in message
            assert digest(tmp_path / name) == before


@pytest.mark.parametrize("verb", VERBS)
def test_a_file_of_another_program_needs_force_and_one_of_specan_does_not(recording, tmp_path, verb) -> None:
    target = tmp_path / f"mine{ending(verb)}"
    target.write_text("#!/bin/sh\nspecan batch . # specan 0.1 is what I use\n")
    code, _, message = call(verb, recording, "-o", target)
    assert code == 2
    assert "--force" in message
    assert target.read_text().startswith("#!/bin/sh")
    assert call(verb, recording, "-o", target, "--force")[0] == 0
    if verb != "export .wav":  # that is a recording now
        assert written_by_specan(target)
        assert call(verb, recording, "-o", target)[0] == 0


def test_calibration_and_channel_table_are_inputs_as_well(recording, tmp_path) -> None:
    assert call("calibrate", recording, "-o", tmp_path / "k.toml")[0] == 0
    before = digest(tmp_path / "k.toml")
    code, _, message = call(
        "rms", recording, "--calibration", tmp_path / "k.toml", "-o", tmp_path / "k.toml", "--force"
    )
    assert (code, digest(tmp_path / "k.toml")) == (2, before)
    assert "made from" in message


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_a_figure_is_known_again_and_a_photograph_is_not(recording, tmp_path, suffix) -> None:
    target = tmp_path / f"a.{suffix}"
    for _ in range(2):
        assert call("rms", recording, "--plot", target)[0] == 0
    assert written_by_specan(target)
    target.write_bytes(b"\x89PNG\r\n\x1a\n by another program")
    assert call("rms", recording, "--plot", target)[0] == 2


def test_a_page_is_known_again(tmp_path) -> None:
    from specan.report.html_page import page

    (tmp_path / "a.html").write_text(page("specan", []))
    assert written_by_specan(tmp_path / "a.html")


@pytest.mark.parametrize("verb", [v for v in VERBS if "export" not in v or "csv" in v])
def test_minus_is_standard_output_and_nothing_else_is_there(recording, tmp_path, verb) -> None:
    name = verb.split()[0]
    source = "c.tdms" if name == "calibrate" else "a.tdms"
    done = specan(name, source, "-o", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "-").exists()
    assert call(verb, recording, "-o", tmp_path / "same")[0] == 0
    assert done.stdout == (tmp_path / "same").read_bytes()


def test_standard_output_is_not_asked_for_twice(recording) -> None:
    code, _, message = call("rms", recording, "-o", "-", "--json")
    assert code == 2
    assert "twice" in message


@pytest.mark.parametrize("arguments", [("rms", "a.tdms"), ("export", "a.tdms", "-o", "-")])
def test_a_reader_that_stops_early_is_no_error(recording, tmp_path, arguments) -> None:
    reader, writer = os.pipe()
    os.close(reader)  # nobody reads
    done = subprocess.run(
        [sys.executable, "-m", "specan_cli", *arguments],
        cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, check=False,
    )  # fmt: skip
    os.close(writer)
    assert done.returncode == 141
    assert b"Error" not in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_device_is_written_to_and_not_replaced(recording) -> None:
    assert call("rms", recording, "-o", "/dev/null")[0] == 0
    assert not Path("/dev/null").is_file()


@pytest.mark.skipif(
    not Path("/dev/full").exists(), reason="left out: this system has no device that is always full"
)
@pytest.mark.parametrize("output", [("-o", "/dev/full"), ("-o", "-"), (), "several"])
def test_a_full_disk_is_said(recording, tmp_path, output) -> None:
    if output == "several":
        output = (shutil.copy(recording, tmp_path / "second.tdms"),)
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "specan_cli", "rms", str(recording), *output],
            cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert "Error: " in done.stderr
    assert re.search("No space left on device|the disk is full", done.stderr)
    assert "Internal error" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_a_link_is_written_through(recording, tmp_path) -> None:
    (tmp_path / "real.txt").write_bytes(b"")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    assert call("rms", recording, "-o", tmp_path / "link.txt")[0] == 0
    assert (tmp_path / "link.txt").is_symlink()
    assert len(pd.read_csv(tmp_path / "real.txt", sep="\t", comment="#")) == 3


def test_a_file_appears_as_a_whole_or_not_at_all(tmp_path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(ZeroDivisionError), whole_file(tmp_path / "a") as half:
        half.write_bytes(bytes(1 // 0))
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("a", b"old")]


def test_a_recording_that_comes_while_the_work_goes_on_is_kept(tmp_path) -> None:
    (tmp_path / "a").write_bytes(b"TDSm")
    assert is_recording(tmp_path / "a")
    with pytest.raises(RequestError, match="never replaced"), whole_file(tmp_path / "a") as half:
        half.write_bytes(b"new")
    assert (tmp_path / "a").read_bytes() == b"TDSm"


def test_a_place_that_is_not_there_is_no_file_to_lose(tmp_path) -> None:
    check_output(tmp_path / "none" / "a.txt")
    check_output(Path("x" * 300))
    with pytest.raises(RequestError, match="cannot be written"), text_file(tmp_path / ("x" * 300)):
        pass


def test_two_processes_with_one_target_do_not_mix(tmp_path, monkeypatch):
    from specan.io.output_file import whole_file

    path = tmp_path / "a.txt"
    (tmp_path / ".a.txt.4194305.part").write_text(
        "of a process that was killed"
    )  # above the largest number of Linux
    with whole_file(path) as first:
        first.write_text("first")
        monkeypatch.setattr(os, "getpid", os.getppid)
        with whole_file(path) as second:
            second.write_text("second")
        assert path.read_text() == "second"
        assert first.read_text() == "first"
    assert path.read_text() == "first"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("verb", ["octave", "fft --whole --fmax 50", "frf --lines 200", "rms"])
def test_the_ending_chooses_the_format(recording, tmp_path, verb):
    def written(ending: str) -> Path:
        path = tmp_path / f"out{ending}"
        for _ in range(1 if ending == ".xlsx" else 2):  # its own file is replaced
            assert call(verb, recording, "-o", path)[0] == 0
        return path

    text = pd.read_csv(written(".txt"), sep="\t", comment="#")
    assert len(text) > 1
    pd.testing.assert_frame_equal(pd.read_csv(written(".csv"), comment="#"), text)
    table = pd.read_parquet(written(".parquet"))
    pd.testing.assert_frame_equal(table, text, check_dtype=False)
    assert table.attrs["header"][0].endswith(verb.split()[0])
    pd.testing.assert_frame_equal(pd.read_excel(written(".xlsx")), text, check_dtype=False)
    found = json.loads(written(".json").read_text("utf-8"))
    assert [c["channel"] for c in found["channels"]] == list(dict.fromkeys(text["channel"]))


@pytest.mark.parametrize("ending", [".tdms", ".docx"])
def test_an_ending_of_another_format_is_refused(recording, tmp_path, ending):
    done = specan("rms", recording, "-o", f"new{ending}", cwd=tmp_path)
    assert done.returncode == 2
    assert b".txt, .tsv, .csv, .xlsx, .parquet, .json" in done.stderr
    assert not (tmp_path / f"new{ending}").exists()


def test_a_simulated_table_is_written_in_the_format_of_its_ending(tmp_path):
    rig = Path(__file__).parents[2] / "sample_data" / "worm_gear" / "rig.toml"
    for ending in (".csv", ".xlsx", ".parquet"):
        done = specan("simulate", "worm-gear", rig, "-o", f"table{ending}", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    as_text = pd.read_csv(tmp_path / "table.csv")
    for found in (pd.read_excel(tmp_path / "table.xlsx"), pd.read_parquet(tmp_path / "table.parquet")):
        pd.testing.assert_frame_equal(found, as_text, check_dtype=False, rtol=1e-5)
    done = specan("simulate", "worm-gear", rig, "-o", "table.tdms", cwd=tmp_path)
    assert done.returncode == 2
    assert b".xlsx" in done.stderr
    assert not (tmp_path / "table.tdms").exists()
