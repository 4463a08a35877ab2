"""``specan export``: what other programs read is what the recording holds."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from specan.errors import SpecanError
from specan.io.open import open_recording
from specan_cli.main import main
from truth.rig import box_rig, sine_take
from truth.rig_files import write_tdms

RATE = 8000.0
N = 70_000  # more than one block


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rig = box_rig()
    path = tmp_path_factory.mktemp("export") / "sine.tdms"
    write_tdms(path, rig, sine_take(rig, 250.0, 1.0, N, RATE, 1).only(("Mic 1", "Vibrometer", "Generator")))
    return path


@pytest.fixture(scope="module")
def samples(recording: Path) -> np.ndarray:
    opened = open_recording(recording)
    return opened.read(opened.channels)


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["export", *map(str, arguments)], standalone_mode=False)
    if isinstance(result.exception, SpecanError):
        return result.exception.exit_code, str(result.exception)
    if result.exception is not None:
        raise result.exception
    return result.return_value or 0, result.output


@pytest.mark.parametrize(("decimal", "separator"), [(".", ","), (",", ";")])
def test_csv_holds_time_and_samples(recording, samples, tmp_path, decimal, separator) -> None:
    code, _ = run(recording, "-o", tmp_path / "a.csv", "--decimal", decimal)
    assert code == 0
    found = pd.read_csv(tmp_path / "a.csv", sep=separator, decimal=decimal, encoding="utf-8-sig")
    assert list(found.columns) == ["time_s", "Mic 1 [Pa]", "Vibrometer [m/s]", "Generator [V]"]
    assert len(found) == N
    np.testing.assert_allclose(found["time_s"], np.arange(N) / RATE, rtol=1e-8)
    np.testing.assert_allclose(found.iloc[:, 1:].to_numpy().T, samples, rtol=1e-8, atol=1e-15)
    assert (b"\xef\xbb\xbf" in (tmp_path / "a.csv").read_bytes()[:3]) == (decimal == ",")


def test_wav_holds_si_units(recording, samples, tmp_path) -> None:
    from scipy.io import wavfile

    assert run(recording, "-o", tmp_path / "a.wav")[0] == 0
    rate, found = wavfile.read(tmp_path / "a.wav")
    assert rate == RATE
    np.testing.assert_array_equal(found.T, samples.astype(np.float32))
    again = open_recording(tmp_path / "a.wav")
    np.testing.assert_array_equal(again.read(again.channels), samples.astype(np.float32))


def test_uff_holds_every_channel(recording, samples, tmp_path) -> None:
    import pyuff

    target = tmp_path / "a.uff"
    target.write_text("something that was there before")
    assert run(recording, "-o", target, "--force", "--start", "1", "--stop", "2")[0] == 0
    sets = pyuff.UFF(str(target)).read_sets()
    assert [s["id1"].strip() for s in sets] == ["Mic 1", "Vibrometer", "Generator"]
    for found, true in zip(sets, samples, strict=True):
        np.testing.assert_array_equal(found["data"], true[8000:16000])
        np.testing.assert_allclose(found["x"], np.arange(8000, 16000) / RATE, rtol=1e-6)
    assert [s["ordinate_spec_data_type"] for s in sets] == [15, 11, 1]
    assert [s["ordinate_axis_units_lab"].strip() for s in sets] == ["Pa", "m/s", "V"]


def test_parquet_holds_units(recording, samples, tmp_path) -> None:
    import pyarrow.parquet as parquet

    assert run(recording, "-o", tmp_path / "a.parquet")[0] == 0
    found = parquet.read_table(tmp_path / "a.parquet")
    assert found.column_names == ["time_s", "Mic 1", "Vibrometer", "Generator"]
    assert found.schema.field("Vibrometer").metadata == {
        b"unit": b"m/s", b"role": b"vibrometer", b"group": b"Measurement",
    }  # fmt: skip
    np.testing.assert_array_equal(np.stack([c.to_numpy() for c in found.columns[1:]]), samples)


def test_sensitivity_of_a_calibration_is_applied(recording, samples, tmp_path) -> None:
    (tmp_path / "c.toml").write_text('schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = 25.0\n')
    code, _ = run(
        recording,
        "-o",
        tmp_path / "a.wav",
        "--channel",
        "Mic *",
        "--calibration",
        tmp_path / "c.toml",
    )
    assert code == 0
    again = open_recording(tmp_path / "a.wav")
    np.testing.assert_allclose(again.read(again.channels)[0], 2 * samples[0], rtol=1e-6)


def test_json_says_what_was_written(recording, tmp_path) -> None:
    code, output = run(recording, "-o", tmp_path / "a.csv", "--channel", "Mic 1", "--json")
    assert code == 0
    assert json.loads(output)["channels"] == [{"name": "Mic 1", "unit": "Pa"}]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["nowhere.tdms", "-o", "b.csv"], 3, "does not exist"),
        (["{file}", "-o", "a.wav", "--decimal", ","], 2, "--decimal is for CSV"),
        (["{file}", "-o", "{file}"], 2, "is the recording itself"),
        (["{file}", "-o", "nowhere/a.csv"], 2, "does not exist"),
        (["{file}", "-o", "nowhere/a.uff"], 2, "does not exist"),
        (["{file}", "-o", "a.csv", "--channel", "Mic 9"], 2, "did you mean"),
        (["{file}", "-o", "a.csv", "--start", "100"], 2, "holds no sample"),
    ],
)
def test_what_cannot_be_exported(recording, tmp_path, monkeypatch, arguments, code, message) -> None:
    monkeypatch.chdir(tmp_path)
    found, text = run(*(a.format(file=recording) for a in arguments))
    assert found == code
    assert message in text
    assert list(tmp_path.iterdir()) == []


def test_a_rate_that_wav_cannot_say(tmp_path) -> None:
    from specan.data.recording import ArraySource, Channel, Recording
    from specan.errors import RequestError
    from specan.io.export_file import Excerpt, write_wav

    channel = Channel("a", unit="V", sampling_rate=1000.5, n_samples=10)
    recording = Recording("a.tdms", (channel,), ArraySource([np.zeros(10)]))
    with pytest.raises(RequestError, match="whole number of hertz"):
        write_wav(Excerpt(recording, (channel,), 0, 10), tmp_path / "a.wav")


def test_a_missing_library_is_named(recording, tmp_path, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pyuff", None)
    code, message = run(recording, "-o", tmp_path / "a.uff")
    assert code == 2
    assert 'pip install "specan[uff]"' in message


@pytest.mark.parametrize("seconds", ["nan", "inf", "-inf", "1e308", "-1e308"])
def test_a_section_that_is_no_time_is_refused(seconds, tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Time (s),Mic 1 (Pa)\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(200)))
    words = ["export", str(path), "-o", str(tmp_path / "out.csv"), f"--start={seconds}"]
    with pytest.raises(SpecanError, match="holds no sample"):
        CliRunner().invoke(main, words, catch_exceptions=False, standalone_mode=False)
