"""At the terminal: lists of channels, formats by ending, decimal commas, pipes, one line for each file."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import specan
from specan.data.recording import Recording
from specan_cli.main import main

SAMPLES = Path(__file__).parents[2] / "sample_data" / "recordings"
KNOCK, NOISE = SAMPLES / "knock.tdms", SAMPLES / "noise" / "noise_24_microphones.tdms"


def run(*words: object) -> str:
    done = CliRunner().invoke(main, list(map(str, words)), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def channels(*words: object) -> list[str]:
    return [c["channel"] for c in json.loads(run("rms", KNOCK, *words, "--json", "-q"))["channels"]]


def test_a_list_of_channels_is_names_and_patterns_with_commas_between():
    assert channels("--channel", "Mic 1,Mic 8") == ["Mic 1", "Mic 8"]
    assert channels("--channel", "Vib*, Mic 2*") == ["Mic 22", "Vibrometer"]


def test_a_comma_in_the_name_of_a_channel_is_part_of_it():
    arrays = {"left, front": [0.0, 1.0], "left": [0.0, 2.0], "front": [0.0, 3.0]}
    recording = Recording.from_arrays(arrays, 8000)
    assert [c.name for c in recording.select(["left, front"])] == ["left, front"]
    assert [c.name for c in recording.select(["left,front"])] == ["left", "front"]


def test_decimal_commas_are_numbers_again_where_a_spreadsheet_reads_them(tmp_path):
    words = ("octave", KNOCK, "--channel", "Mic 1", "-o")
    run(*words, tmp_path / "point.csv")
    run(*words, tmp_path / "comma.csv", "--decimal", ",")
    run(*words, tmp_path / "comma.txt", "--decimal", ",")
    expected = pd.read_csv(tmp_path / "point.csv", comment="#")
    for name, separator in (("comma.csv", ";"), ("comma.txt", "\t")):
        found = pd.read_csv(tmp_path / name, sep=separator, decimal=",", comment="#", encoding="utf-8-sig")
        assert found.band_hz[2] == "31,5"
        for name in ("band_hz", "flags"):  # text, because of the totals
            found[name] = found[name].str.replace(",", ".")
        pd.testing.assert_frame_equal(found, expected)


def test_an_impulse_response_has_decimal_commas_too(tmp_path):
    words = ("impulse", NOISE, "--channel", "Mic 1", "-o")
    run(*words, tmp_path / "point.csv")
    run(*words, tmp_path / "comma.csv", "--decimal", ",")
    found = pd.read_csv(tmp_path / "comma.csv", sep=";", decimal=",", encoding="utf-8-sig")
    pd.testing.assert_frame_equal(found, pd.read_csv(tmp_path / "point.csv"))


def test_tables_of_a_batch_with_commas_give_the_same_numbers(tmp_path):
    made = [
        specan.batch(SAMPLES / "sine", tmp_path / sign, decimal=d) for sign, d in (("p", "."), ("c", ","))
    ]
    assert "\t125,3\t" in (tmp_path / "c" / "sine.txt").read_text("utf-8")
    pd.testing.assert_frame_equal(made[0].table("sine"), made[1].table("sine"))


def test_densities_as_universal_file_are_read_by_another_library(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    from scipy.signal import welch

    rate, rng = 4096.0, np.random.default_rng(3)
    samples = rng.normal(size=40960)
    found = specan.fft(
        Recording.from_arrays({"a": samples}, rate, units={"a": "m/s^2"}),
        scaling="psd",
        lines=400,
        detrend=False,
    )
    from specan.io.export_file import write_result

    write_result(found, tmp_path / "psd.uff")
    one = pyuff.UFF(str(tmp_path / "psd.uff")).read_sets()
    f, expected = welch(samples, rate, nperseg=1024, detrend=False)
    assert one["func_type"] == 9
    assert one["ordinate_axis_units_lab"].strip() == "(m/s^2)^2/Hz"
    shared = np.isin(f, one["x"])
    np.testing.assert_allclose(one["x"], f[shared])
    np.testing.assert_allclose(one["data"].real[1:], expected[shared][1:], rtol=1e-6)


def test_an_export_to_tdms_is_the_recording_again(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    run("export", KNOCK, "--channel", "Mic 1,Vib*", "-o", tmp_path / "again.tdms")
    first, again = specan.read(KNOCK), specan.read(tmp_path / "again.tdms", calibration="none")
    assert [(c.name, c.unit, c.sampling_rate) for c in again.channels] == [
        ("Mic 1", "Pa", 8000.0),
        ("Vibrometer", "m/s", 8000.0),
    ]
    np.testing.assert_array_equal(again.read(again.channels), first.read(first.select(["Mic 1", "Vib*"])))
    assert nptdms.TdmsFile.read(tmp_path / "again.tdms")["Measurement"]["Mic 1"].time_track()[1] == 1 / 8000


def test_the_ending_names_the_format_of_an_export_or_it_is_refused(tmp_path):
    done = CliRunner().invoke(main, ["export", str(KNOCK), "-o", str(tmp_path / "a.xyz")])
    assert "ends in .xyz" in str(done.exception)
    assert ".parquet" in str(done.exception)


def test_a_pipe_is_a_recording_and_a_picture_goes_into_one():
    command = [sys.executable, "-m", "specan_cli"]
    data = KNOCK.read_bytes()
    found = subprocess.run([*command, "rms", "-", "--json"], input=data, capture_output=True, check=True)
    assert len(json.loads(found.stdout)["channels"]) == 6
    drawn = subprocess.run([*command, "rms", "-", "--plot", "-"], input=data, capture_output=True, check=True)
    assert drawn.stdout.startswith(b"\x89PNG\r\n\x1a\n")
    assert drawn.stdout.endswith(b"IEND\xaeB`\x82")


def test_a_directory_is_a_line_for_each_recording(monkeypatch):
    monkeypatch.setenv("COLUMNS", "90")
    lines = run("info", SAMPLES).splitlines()
    assert len(lines) == 1 + len(list(SAMPLES.rglob("*.tdms"))) + 1
    assert lines[-1] == "Calibration: nominal sensitivities."
    (sine,) = [line.split() for line in lines if "sine_0250.7Hz" in line]
    assert sine[1:] == ["sine", "250.7", "26", "0.5", "8000"]


def test_tables_on_the_screen_have_decimal_commas():
    words = ("octave", KNOCK, "--channel", "Mic 1", "--fraction", 1)
    point, comma = (run(*words, *more).splitlines() for more in ((), ("--decimal", ",")))
    assert [a.split()[:3] for a in point if a.startswith("31.5")] == [["31.5", "45.36", "0.92"]]
    assert [a.split()[:3] for a in comma if a.startswith("31,5")] == [["31,5", "45,36", "0,92"]]
    assert comma[0] == point[0]


def test_flags_are_explained_and_channels_alike_share_a_warning():
    said = CliRunner().invoke(main, ["octave", str(SAMPLES.parent / "broken" / "truncated.tdms")])
    assert said.stderr.count("Warning:") == 1
    assert "Mic 1, Mic 8, Mic 15, Mic 22, Vibrometer, Generator: truncated" in said.stderr
    lines = run("octave", NOISE, "--channel", "Mic 1", "--fmax", "50").splitlines()
    assert [line for line in lines if line.startswith("low-BT: ")]
    assert not [line for line in lines if line.startswith("unsettled: ")]


def test_levels_of_many_channels_fit_the_terminal_with_no_name_broken(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = run("octave", NOISE).splitlines()
    table = [line for line in lines if line.startswith("Mic 7 ")]
    assert 2 <= len(table) <= 3
    assert max(map(len, lines[2:-2])) <= 80
    levels = specan.octave(NOISE, channels="Mic 7").level_dB[0]
    found = [float(x) for line in table for x in line.split()[2:]][: len(levels)]
    np.testing.assert_allclose(found, levels, atol=0.0051)


@pytest.mark.parametrize("verb", ["octave", "fft", "frf", "rms", "decay", "impulse", "info", "export"])
def test_every_verb_says_its_calibration_and_finds_the_file_beside(tmp_path, verb):
    run("calibrate", SAMPLES / "calibration", "-o", tmp_path / "calibration.toml")
    place = tmp_path / "n.tdms"
    place.write_bytes(NOISE.read_bytes())
    more = [] if verb in ("info",) else ["--channel", "Mic 3"]
    if verb in ("impulse", "export"):
        more += ["-o", tmp_path / "out.csv"]
    said = run(verb, place, *more)
    assert "Calibration: calibration.toml" in said
    nominal = run(verb, place, *more, "--calibration", "none")
    assert "Calibration: nominal sensitivities" in nominal
