"""``specan info``: what it shows, as a table and as JSON, and what it does with what it cannot read."""

import json
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import InputError, RequestError
from specan_cli.info import command
from specan_cli.main import main

sys.path.insert(0, str(Path(__file__).parent.parent / "io"))
import tdms_bytes as tb

RATE = 8000.0


def rig(path, *, cut=0, note="Loudspeaker in the corner"):
    """Two microphones, a vibrometer that gives displacement and a generator, 24 bits in int32."""
    t = np.arange(8000) / RATE
    channels = [("Mic 1", 0.5, "Pa", "mV/Pa", 50.0), ("Mic 2", 0.0, "Pa", "mV/Pa", 40.0)]
    channels += [("Vibrometer", 0.2, "m", "mm/V", 1.0), ("Generator", 1.0, "V", "", 0.0)]
    objects = [
        ("/", tb.NO_DATA, {}),
        (tb.path("Rig"), tb.NO_DATA, {"Description": note, "SamplingRate": RATE}),
    ]
    raw = []
    for name, volts, quantity, unit, sensitivity in channels:
        properties = {
            **tb.wave(RATE),
            **tb.linear(10 / 2**23),
            "QuantityUnit": quantity,
            "Sensor": f"no. {len(raw)}",
        }
        if unit:
            properties |= {"Sensitivity": sensitivity, "SensitivityUnit": unit}
        objects.append((tb.path("Rig", name), tb.plain("i4", 8000), properties))
        raw.append((volts * np.sin(2 * np.pi * 250 * t) * 2**23 / 10).astype("<i4"))
    content = tb.segment(objects, np.stack(raw).tobytes())
    path.write_bytes(content[: len(content) - cut])
    return path


def run(*arguments):
    return CliRunner().invoke(
        command, [str(a) for a in arguments], catch_exceptions=False, standalone_mode=False
    )


def test_at_a_glance(tmp_path):
    result = run(rig(tmp_path / "a.tdms"))
    assert result.return_value == 0
    for text in (
        "a.tdms: 4 channels, 1 s at 8000 Hz", "Excitation: sine at 250 Hz", "Description: Loudspeaker in the corner",
        "Rig: 4 channels, 8000 Hz, 8000 samples", "50 mV/Pa", "m (to m/s)", "microphone: the name of the channel",
        "8000 Hz: wf_increment 0.000125 s", "linear, 1.19209e-06 per count", "SamplingRate",
    ):  # fmt: skip
        assert text in result.output
    assert "RMS" not in result.output


def test_levels_on_request(tmp_path):
    result = run(rig(tmp_path / "a.tdms"), "--levels", "--json")
    one, two, _, generator = json.loads(result.output)["files"][0]["channels"]
    assert one["rms"] == pytest.approx(0.5 / 0.05 / np.sqrt(2), rel=1e-4)
    assert one["maximum"] == pytest.approx(10.0, rel=1e-4)
    assert two["flags"] == ["dead"]
    assert generator["rms"] == pytest.approx(np.sqrt(0.5), rel=1e-4)
    assert "RMS" in run(tmp_path / "a.tdms", "--levels").output


def test_json_holds_everything_and_nothing_else(tmp_path):
    (tmp_path / "channels.csv").write_text("channel,delay_s,u_delay_s\nVibrometer,1e-5,2e-6\n")
    path = rig(tmp_path / "a.tdms")
    content = json.loads(run(path, "--json").output)
    (file,) = content["files"]
    assert content["failures"] == []
    assert file["excitation"]["kind"] == "sine"
    assert file["groups"]["Rig"]["Description"] == "Loudspeaker in the corner"
    vibrometer = file["channels"][2]
    assert (vibrometer["delay_s"], vibrometer["derivatives"], vibrometer["unit"]) == (1e-5, 1, "m")
    assert vibrometer["decisions"]["role"] == "the name 'Vibrometer'"
    assert vibrometer["properties"]["Sensor"] == "no. 2"
    assert "rms" not in vibrometer
    assert "1e-05 +- 2e-06" in run(path).output


def test_a_calibration_is_shown(tmp_path):
    (tmp_path / "c.toml").write_text(
        'schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = 45.0\n'
        "tone_hz = [1000.0]\nphase_deg = [1.5]\nu_phase_deg = [0.1]\n"
    )
    path = rig(tmp_path / "a.tdms")
    assert "45 mV/Pa" in run(path, "--calibration", tmp_path / "c.toml").output
    content = json.loads(run(path, "--calibration", tmp_path / "c.toml", "--json").output)
    assert content["files"][0]["channels"][0]["phase"]["phase_deg"] == [1.5]
    assert content["files"][0]["channels"][1]["phase"] is None


def test_integrity(tmp_path):
    path = rig(tmp_path / "a.tdms")
    path.write_bytes(path.read_bytes() * 2)
    path.write_bytes(path.read_bytes()[:-10])
    (tmp_path / "a.tdms_index").write_bytes(b"TDSh" + bytes(40))  # of another file: it is not used
    assert "Flag: truncated" in run(path).output


def test_a_directory_and_a_file_that_is_none(tmp_path):
    rig(tmp_path / "good.tdms")
    (tmp_path / "bad.tdms").write_text("no recording")
    result = run(tmp_path, "--json")
    assert result.return_value == 1
    content = json.loads(result.stdout)
    assert [f["file"] for f in content["files"]] == ["good.tdms"]
    assert [f["file"] for f in content["failures"]] == ["bad.tdms"]
    assert "a text file" in content["failures"][0]["reason"]
    assert "bad.tdms is a text file" in result.stderr


def test_nothing_that_can_be_read(tmp_path):
    (tmp_path / "bad.tdms").write_text("no recording")
    (tmp_path / "worse.tdms").write_bytes(b"")
    with pytest.raises(InputError, match="a text file"):
        run(tmp_path / "bad.tdms")
    with pytest.raises(InputError, match="no file could be read"):
        run(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RequestError, match="holds no recording"):
        run(tmp_path / "empty")


def test_many_channels_and_properties_stay_short(tmp_path):
    n, path = 60, tmp_path / "a.tdms"
    root = {f"key {k}": k for k in range(50)}
    tb.write(path, [(f"ch {k}", np.zeros(300), {"wf_increment": 0.001}) for k in range(n)], root=root)
    short, whole = run(path).output, run(path, "--all").output
    assert "ch 0 ... ch 59 (60)" in short
    assert "... and 20 more (--all)" in short
    assert "ch 37" in whole
    assert "key 49" in whole
    assert len(short.splitlines()) < 60 < len(whole.splitlines())


def test_what_was_set_aside(tmp_path):
    path = tmp_path / "a.tdms"
    tb.write(path, [("c", np.zeros(300), {"wf_increment": 0.001}), ("one", np.zeros(1), {})])
    assert "it is a single number" in run(path).output
    assert json.loads(run(path, "--json").output)["files"][0]["set_aside"] == {
        "g/one": "it is a single number"
    }


def test_what_was_set_aside_for_one_reason_has_one_row(tmp_path):
    """Two channels are read and two ignored: the ignored are not "all" channels."""
    none = [(name, np.zeros(70), {}) for name in ("x", "y")]
    tb.write(tmp_path / "a.tdms", [(n, np.zeros(300), {"wf_increment": 0.001}) for n in "cd"] + none)
    shown = run(tmp_path / "a.tdms").output.split("Ignored\n")[1].split("\n\n")[0].splitlines()
    assert len([line for line in shown if not line.startswith(" ")]) == 2
    assert shown[1].split("  ")[0] == "g/x, g/y"


def test_time_stamps_of_properties_are_text(tmp_path):
    path = tmp_path / "a.tdms"
    when = np.datetime64("2012-03-14T09:30:00")
    tb.write(path, [("c", np.zeros(300), {"wf_increment": 0.001, "wf_start_time": when})])
    content = json.loads(run(path, "--json").output)
    assert content["files"][0]["channels"][0]["properties"]["wf_start_time"].startswith("2012-03-14T09:30:00")


@pytest.mark.parametrize(
    "words",
    [["info", "{}.tdms"], ["batch", "{}.tdms", "-o", "out"], ["inspect", "{}"], ["model", "new", "{}.py"]],
)
def test_a_name_too_long_for_the_file_system_is_no_fault_of_specan(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(main, [word.format("a" * 300) for word in words], standalone_mode=False)
    assert isinstance(found.exception, InputError | RequestError | click.ClickException)


def test_of_files_that_are_left_out_for_one_reason_it_is_said_once(tmp_path):
    rig(tmp_path / "good.tdms")
    for name in ("first.csv", "note.csv", "second.csv"):
        (tmp_path / name).write_text("no recording")
    first, *more = run(tmp_path).stderr.splitlines()
    assert first.startswith("Left out: first.csv is a text file")
    assert more == ["Left out for the same reason as first.csv: note.csv, second.csv."]


def test_of_several_files_only_columns_that_hold_something_are_shown(tmp_path):
    rig(tmp_path / "a.tdms")
    rig(tmp_path / "b.tdms")
    assert run(tmp_path).stdout.splitlines()[0].split() == [
        "file",
        "excitation",
        "tone",
        "channels",
        "s",
        "Hz",
    ]
    rig(tmp_path / "b.tdms", cut=400)
    head, _, cut = run(tmp_path).stdout.splitlines()[:3]
    assert head.split()[-1] == "flags"
    assert cut.split()[-1] == "truncated"
