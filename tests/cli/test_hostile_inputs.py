"""Odd things in a directory of recordings: each is in a table, and the good recording has its result."""

import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from nptdms import ChannelObject, TdmsWriter

from specan.analysis.batch.run import run_batch
from specan.errors import RequestError, SpecanError
from specan.io.channel_table import read_channel_table
from specan.io.open import open_recording
from specan_cli.main import main
from truth.rig import box_rig, noise_take
from truth.rig_files import write_tdms

RIG = str(Path(__file__).parents[2] / "sample_data" / "worm_gear" / "rig.toml")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="names and pipes of POSIX")


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    rig = box_rig()
    write_tdms(
        tmp_path / "in" / "good.tdms",
        rig,
        noise_take(rig, 1.0, 9000, 8000.0, 2).only(("Mic 1", "Vibrometer")),
    )
    return tmp_path / "in"


def outcome(directory: str = "in") -> dict[str, tuple[str, str]]:
    report = run_batch([Path(directory)], Path("out"), jobs=1)
    found = {r.label: (r.kind, r.reason) for r in report.results}
    assert next(kind for label, (kind, _) in found.items() if label.endswith("good.tdms")) == "done"
    listed = Path("out/skipped.txt").read_text(encoding="utf-8")
    assert all(
        r.label.encode("utf-8", "backslashreplace").decode() in listed for r in report.of_kind("failed")
    )
    return found


def test_damaged_headers_pipes_and_foreign_names(place) -> None:
    good = (place / "good.tdms").read_bytes()
    (place / "next.tdms").write_bytes(good + b"TDSm" + struct.pack("<IIQQ", 0xE, 4713, 1 << 20, 1 << 62))
    (place / "length.tdms").write_bytes(good[:20] + struct.pack("<Q", 1 << 62) + good[28:])
    os.mkfifo(place / "pipe.tdms")
    (place / "zero.tdms").symlink_to("/dev/zero")
    Path(os.fsdecode(os.fsencode(place) + b"/bad\xff.tdms")).write_bytes(good[:5000])
    found = outcome()
    assert "a pipe" in found["pipe.tdms"][1]
    assert "a device" in found["zero.tdms"][1]
    assert {"bad\udcff.tdms", "next.tdms", "length.tdms"} <= set(found)


def test_a_directory_that_cannot_be_read_is_told(place, monkeypatch) -> None:
    (place / "closed").mkdir()
    real = os.scandir

    def scandir(path="."):
        if os.fspath(path).endswith("closed"):
            raise PermissionError(13, "Permission denied", os.fspath(path))
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    kind, reason = outcome()["closed"]
    assert kind == "failed"
    assert "cannot be read (Permission denied)" in reason


@pytest.mark.parametrize("directory", ["in", "."])
def test_reasons_do_not_depend_on_the_name_of_the_directory(place, directory) -> None:
    with TdmsWriter(str(place / "norate.tdms")) as writer:
        writer.write_segment([ChannelObject("g", "Mic 1", np.zeros(100), {"wf_increment": 0.0})])
    found = outcome(directory)
    reason = next(reason for label, (_, reason) in found.items() if label.endswith("norate.tdms"))
    assert "no sampling rate for 'Mic 1' (wf_increment is 0.0;" in reason
    assert "--sampling-rate HZ" in reason


def test_absurd_numbers_are_refused(tmp_path) -> None:
    with TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment([ChannelObject("g", "a", np.zeros(100), {"wf_increment": 5e-324, "fs": 1000.0})])
    assert open_recording(tmp_path / "a.tdms").channels[0].sampling_rate == 1000.0
    table = tmp_path / "channels.toml"
    for line in (
        "gain = 0.0", "sampling_rate_hz = 1e300", "delay_s = 1e9", "u_sensitivity_percent = 1e6",
        'sensitivity = 1e-300\nsensitivity_unit = "mV/Pa"',
    ):  # fmt: skip
        table.write_text(f'[[channel]]\nchannel = "a"\nunit = "Pa"\n{line}\n')
        with pytest.raises(RequestError, match=line.split(" ")[0]):
            read_channel_table(table)


@pytest.mark.parametrize(
    "words",
    [
        ["batch", "in", "-o", "out", "--settings", "pipe"],
        ["batch", "in", "-o", "out", "--channel-table", "pipe"],
        ["octave", "in/good.tdms", "--channel-table", "pipe.csv"],
        ["octave", "in/good.tdms", "--calibration", "pipe"],
        ["octave", "in/good.tdms", "--limit", "pipe"],
        ["octave", "pipe"],
        ["study", "new", "s", "--model", "worm-gear", "--rig", "pipe", "--measurement", "pipe.csv"],
        ["study", "new", "s", "--model", "worm-gear", "--rig", RIG, "--measurement", "pipe.csv"],
        ["model", "check", "pipe.py"],
    ],
)
def test_a_pipe_is_refused_where_a_file_is_asked_for(place, words) -> None:
    for name in ("pipe", "pipe.csv", "pipe.py"):
        os.mkfifo(place.parent / name)
    found = CliRunner().invoke(main, words, standalone_mode=False).exception
    assert isinstance(found, SpecanError), found
    assert "is a pipe" in str(found)
