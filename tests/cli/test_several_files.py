"""Several recordings a call, options in groups, how much is said, and the sample data of an installed package."""

import ast
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError, RequestError
from specan_cli.demo import SAMPLES, copy_samples, sample_place
from specan_cli.main import VERBS, main

ROOT = Path(__file__).parents[2]
KNOCK = ROOT / "sample_data" / "recordings" / "knock.tdms"
SINES = ROOT / "sample_data" / "recordings" / "sine"
BROKEN = ROOT / "sample_data" / "broken" / "no_recording.tdms"


def run(*words: object, code: int = 0):
    found = CliRunner().invoke(main, [str(w) for w in words], standalone_mode=False)
    assert found.exception is None, found.exception
    assert (found.return_value or 0) == code
    return found


@pytest.mark.parametrize("verb", ["octave", "fft", "frf", "rms"])
def test_several_files_give_what_each_gives_alone(verb):
    words = ["--channel", "mic 1"]
    both = json.loads(run(verb, KNOCK, SINES / "sine_0500.0Hz.tdms", *words, "--json").stdout)
    assert both["failures"] == []
    for path, found in zip((KNOCK, SINES / "sine_0500.0Hz.tdms"), both["files"], strict=True):
        assert found.pop("path") == str(path)
        assert found == json.loads(run(verb, path, *words, "--json").stdout)


def test_one_bad_file_costs_only_itself():
    found = run("rms", KNOCK, BROKEN, "--json", code=1)
    content = json.loads(found.stdout)
    assert [f["file"] for f in content["files"]] == ["knock.tdms"]
    assert [f["file"] for f in content["failures"]] == [str(BROKEN)]
    assert "Left out" in found.stderr
    with pytest.raises(InputError):
        CliRunner().invoke(
            main, ["rms", str(BROKEN), "nothing.wav"], standalone_mode=False, catch_exceptions=False
        )


def test_a_directory_stands_for_its_recordings_and_one_output_is_for_one_file(tmp_path):
    content = json.loads(run("rms", SINES, "--channel", "Mic 1", "--json").stdout)
    assert [f["file"] for f in content["files"]] == sorted(p.name for p in SINES.glob("*.tdms"))
    for option in ("-o", "--plot"):
        with pytest.raises(RequestError, match="one recording, and there are 4"):
            CliRunner().invoke(
                main,
                ["rms", str(SINES), option, str(tmp_path / "x.png")],
                standalone_mode=False,
                catch_exceptions=False,
            )
    (tmp_path / "empty").mkdir()
    with pytest.raises(RequestError, match="holds no recording"):
        CliRunner().invoke(
            main, ["rms", str(tmp_path / "empty")], standalone_mode=False, catch_exceptions=False
        )


def test_quiet_leaves_notes_out_and_verbose_says_what_is_read():
    words = ["octave", KNOCK, "--weighting", "A"]
    usual, quiet, verbose = (run(*words, *more) for more in ((), ("-q",), ("-v",)))
    assert "Note:" in usual.stderr
    assert "Note:" not in quiet.stderr
    assert usual.stdout == quiet.stdout == verbose.stdout
    assert "Reading knock.tdms: 4 channels, 8000 samples at 8000 Hz." in verbose.stderr
    assert verbose.stderr.count("Reading ") == 1  # of two passes: one for the mean
    assert "octave: " in verbose.stderr
    assert "s of processor time" in verbose.stderr


@pytest.mark.parametrize(
    ("model", "file"), [("worm-gear", "made.csv"), ("planetary-gear", "made.csv"), ("room", "made.tdms")]
)
def test_a_quiet_simulation_says_nothing_on_standard_error(model, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(run("model", "rig", model).stdout, encoding="utf-8")
    words = ["simulate", model, "rig.toml", "-o", file]
    usual = run(*words)
    Path(file).unlink()
    quiet = run(*words, "-q")
    assert f"written to {file}" in usual.stderr
    assert quiet.stderr == ""
    assert quiet.stdout == usual.stdout


def test_many_options_stand_in_groups():
    said = run("octave", "--help").output
    places = [
        said.index(f"{g}:\n") for g in ("What is analysed", "How it is analysed", "How it is read", "Output")
    ]
    assert places == sorted(places)
    assert said.index("--fraction [") > places[1]
    assert said.index("--calibration PATH") > places[2]
    for verb in VERBS:  # every option of every verb is there, once
        command = main.get_command(None, verb)
        text = CliRunner().invoke(main, [verb, "--help"]).output
        for parameter in command.params:
            if parameter.param_type_name == "option" and not parameter.hidden:
                assert max(parameter.opts, key=len) in text, parameter


def test_accelerometers_are_responses(tmp_path):
    random, n = np.random.default_rng(2), 40_000
    force = random.standard_normal(n)
    kinds = (("F", "force", "N", 1.0), ("Acc 1", "accelerometer", "m/s^2", 3.0), ("Mic 1", "microphone", "Pa", 2.0),
             ("Torque", "torque", "N*m", 1.0))  # fmt: skip
    channels = tuple(
        Channel(name, unit=unit, role=role, sampling_rate=8000.0, n_samples=n)
        for name, role, unit, _ in kinds
    )
    from specan.analysis.transfer_function import TransferFunction

    recording = Recording("a", channels, ArraySource([k[3] * force for k in kinds]))
    found = TransferFunction(reference="F", lines=100)(recording)
    assert found.channels == ("Acc 1", "Mic 1")
    assert found.units == ("m/s^2/N", "Pa/N")
    np.testing.assert_allclose(found.magnitude, [[3.0] * 100, [2.0] * 100], rtol=1e-9)


def test_a_batch_takes_fraction_and_weighting(tmp_path):
    noise = tmp_path / "in"
    noise.mkdir()
    (noise / "n.tdms").write_bytes((SINES.parent / "noise" / "noise_4_microphones_float32.tdms").read_bytes())
    run("batch", noise, "-o", tmp_path / "out", "--fraction", "1", "--weighting", "a", "--lines", "100", "-q")
    rows = (tmp_path / "out" / "bands.txt").read_text(encoding="utf-8").splitlines()
    cells = [row.split("\t") for row in rows if not row.startswith("#")]
    alone = json.loads(
        run("octave", noise / "n.tdms", "--fraction", "1", "--weighting", "A", "--json").stdout
    )
    mic = alone["channels"][0]
    found = [float(c[3]) for c in cells[1:] if c[1] == mic["channel"] and c[2].replace(".", "").isdigit()]
    np.testing.assert_allclose(found, mic["level_dB"], atol=6e-4)


def test_the_demo_writes_what_the_examples_name(tmp_path):
    said = run("demo", tmp_path / "sample_data").output
    assert "files written" in said
    assert "holds the sample data already" in run("demo", tmp_path / "sample_data").output
    knock = tmp_path / "sample_data" / "recordings" / "knock.tdms"
    assert knock.read_bytes() == KNOCK.read_bytes()
    named = set()
    for path in (ROOT / "cli").glob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines():
            named |= {w.strip("\"'`,.\\") for w in line.split() if w.startswith("sample_data/")}
    assert len(named) > 5
    assert [n for n in named if not (tmp_path / n).exists()] == []
    knock.write_bytes(b"mine")
    copy_samples(tmp_path / "sample_data")
    assert knock.read_bytes() == b"mine"
    assert sample_place().name == "sample_data"


def test_the_demo_leaves_out_what_python_compiled(tmp_path, monkeypatch):
    source = shutil.copytree(ROOT / "sample_data" / "worm_gear", tmp_path / "source" / "worm_gear").parent
    (source / "worm_gear" / "study" / "__pycache__").mkdir(exist_ok=True)
    (source / "worm_gear" / "study" / "__pycache__" / "make_studies.pyc").write_bytes(b"")
    monkeypatch.setattr("specan_cli.demo.sample_place", lambda: source)
    assert copy_samples(tmp_path / "out") > 5
    assert list(tmp_path.glob("out/**/__pycache__")) == []


def test_the_package_is_built_with_the_sample_data():
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    names: dict = {}
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "samples")
    exec(
        compile(ast.Module([function], []), "setup.py", "exec"),
        {"ast": ast, "Path": Path, "__file__": str(ROOT / "x")},
        names,
    )
    assert tuple(names["samples"]()) == SAMPLES
    assert all(any((ROOT / "sample_data").glob(pattern)) for pattern in SAMPLES)
