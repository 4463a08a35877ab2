"""`import specan`: cheap, complete, and the same numbers and names as the command line."""

import io
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import specan
from specan.data.recording import ArraySource, Channel
from specan.errors import RequestError
from specan.report.figures import FIGURES
from specan_cli.main import main

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_data" / "recordings"
RATE, SECONDS = 8000.0, 4.0
ANALYSES = {
    "octave": "specan.analysis.octave:Octave",
    "fft": "specan.analysis.spectrum:FourierSpectrum",
    "spectrogram": "specan.analysis.spectrum:SpectrogramSettings",
    "frf": "specan.analysis.transfer_function:TransferFunction",
    "rms": "specan.analysis.levels:Levels",
    "tones": "specan.analysis.tone:Tone",
    "orders": "specan.analysis.orders:Orders",
    "calibrate": "specan.analysis.insertion:CalibrationSettings",
    "batch": "specan.analysis.batch.settings:BatchSettings",
}

SPRING = ROOT / "tests" / "own_model" / "spring.py"


def recording(names=("Mic 1", "Vibro"), groups=("", ""), **signals) -> specan.Recording:
    """A tone of 1 Pa RMS at 1 kHz over a velocity of 0.1 m/s, 90 degrees ahead of it."""
    n = int(SECONDS * RATE)
    phase = 2 * np.pi * 1000 * np.arange(n) / RATE
    samples = [np.sqrt(2) * np.cos(phase), -0.1 * np.sqrt(2) * np.sin(phase)]
    kinds = (("microphone", "Pa"), ("vibrometer", "m/s"))
    channels = tuple(
        Channel(name, group, unit=unit, role=role, sampling_rate=RATE, n_samples=n)
        for name, group, (role, unit) in zip(names, groups, kinds)
    )
    return specan.Recording("tone.wav", channels, ArraySource(samples))


def test_the_import_is_cheap_and_loads_nothing_heavy():
    code = (
        "import sys, time; begun = time.process_time(); import specan; spent = time.process_time() - begun; "
        "dir(specan); print(spent, [m for m in ('numpy', 'scipy', 'pandas', 'matplotlib', 'acoustics', 'pydantic') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    spent, heavy = done.stdout.strip().split(" ", 1)
    assert heavy == "[]"
    assert float(spent) < 0.1


def test_every_name_is_there_and_has_a_docstring():
    names = set(dir(specan)) - {"__version__"}
    assert names == set(specan.__all__)
    assert all(getattr(specan, name).__doc__ for name in names)
    with pytest.raises(AttributeError, match="octaves"):
        _ = specan.octaves


@pytest.mark.parametrize("name", ANALYSES)
def test_the_docstring_names_every_setting(name):
    module, _, kind = ANALYSES[name].partition(":")
    settings = getattr(__import__(module, fromlist=[kind]), kind)
    function = getattr(specan, name)
    said = function.__doc__ + " ".join(f"``{a}``" for a in function.__code__.co_varnames)
    assert [s for s in settings.model_fields if f"``{s}``" not in said] == []


def test_a_tone_has_the_level_that_it_has():
    """94 dB are 1 Pa (20 lg (1 / 20e-6) = 93.979)."""
    r = recording()
    bands = specan.octave(r, 1, channels="Mic 1").to_dataframe().set_index("nominal_hz")
    assert bands.loc[1000, "level_dB"] == pytest.approx(93.979, abs=0.02)
    levels = specan.rms(r).to_dataframe().set_index("channel")
    assert levels.loc["Mic 1", "rms"] == pytest.approx(1.0, abs=1e-6)
    assert levels.loc["Mic 1", "Leq_Z_dB"] == pytest.approx(93.979, abs=0.02)
    lines = specan.fft(r, lines=100).to_dataframe().set_index(["channel", "frequency_hz"])
    assert lines.loc[("Mic 1", 1000.0), "amplitude"] == pytest.approx(np.sqrt(2), rel=1e-6)
    tone = specan.tones(r).to_dataframe().set_index("channel")
    assert tone.loc["Mic 1", "phase_deg"] == pytest.approx(-90.0, abs=1e-3)
    assert tone.loc["Mic 1", "magnitude_re_reference"] == pytest.approx(10.0, rel=1e-6)


def test_a_transfer_function_is_the_planted_one():
    random = np.random.default_rng(1)
    v = random.standard_normal(40_000)
    channels = tuple(
        Channel(name, unit=unit, role=role, sampling_rate=RATE, n_samples=v.size)
        for name, role, unit in (("Vib", "vibrometer", "m/s"), ("Mic 1", "microphone", "Pa"))
    )
    found = specan.frf(specan.Recording("n", channels, ArraySource([v, -5 * v])), lines=100)
    frame = found.to_dataframe()
    assert len(frame) == 100
    np.testing.assert_allclose(frame["magnitude"], 5.0, rtol=1e-9)
    np.testing.assert_allclose(np.abs(frame["phase_deg"]), 180.0, atol=1e-6)


def test_a_path_does_for_a_recording_and_settings_are_checked():
    path = SAMPLES / "knock.tdms"
    one, other = (
        specan.octave(str(path), channels="Mic 1"),
        specan.octave(specan.read(path), channels=["Mic 1"]),
    )
    np.testing.assert_array_equal(one.level_dB, other.level_dB)
    with pytest.raises(RequestError, match=r"specan\.octave: unknown key 'wieghting'.*weighting"):
        specan.octave(path, wieghting="A")


@pytest.mark.parametrize(
    ("verb", "analysis", "options", "settings"),
    [
        ("octave", "octave", ["--fraction", "1"], {"fraction": 1}),
        ("fft", "fft", ["--lines", "50"], {"lines": 50}),
        ("frf", "frf", ["--lines", "50", "--reference", "Mic 1"], {"lines": 50, "reference": "Mic 1"}),
        ("rms", "rms", [], {}),
    ],
)
def test_frames_have_the_columns_and_numbers_of_the_text_tables(verb, analysis, options, settings, tmp_path):
    path = SAMPLES / "knock.tdms"
    done = CliRunner().invoke(main, [verb, str(path), *options, "-o", str(tmp_path / "t.txt")])
    assert done.exit_code == 0, done.output
    lines = (tmp_path / "t.txt").read_text(encoding="utf-8").splitlines()
    text = pd.read_csv(io.StringIO("\n".join(x for x in lines if not x.startswith("#"))), sep="\t")
    if verb == "octave":  # there the overall levels are below the bands
        text = text[pd.to_numeric(text["band_hz"], errors="coerce").notna()]
    frame = getattr(specan, analysis)(path, **settings).to_dataframe()
    common = [
        c
        for c in text.columns
        if c in frame.columns and c not in ("flags", "group", "level_reference", "unit")
    ]
    assert {"channel"} < set(common)
    assert any(c in common for c in ("level_dB", "magnitude"))
    for column in common:
        if column == "channel":
            assert text[column].tolist() == frame[column].tolist()
        else:
            np.testing.assert_allclose(
                pd.to_numeric(text[column]),
                frame[column],
                rtol=6e-3,
                atol=2e-2,
                equal_nan=True,  # three digits
            )


def results() -> list:
    r = recording()
    noise = SAMPLES / "noise" / "noise_4_microphones_float32.tdms"
    return [
        r, specan.octave(r), specan.fft(r), specan.spectrogram(r), specan.rms(r), specan.tones(r),
        specan.orders(r, speed_hz=20.0), specan.frf(noise, lines=100),
        specan.calibrate(SAMPLES / "calibration" / "insertion_1.tdms"),
    ]  # fmt: skip


def test_results_are_short_on_the_screen_and_can_be_drawn():
    for found in results():
        name = type(found).__name__
        assert repr(found).startswith(f"<{name}: ")
        assert len(repr(found)) < 200
        assert name in found._repr_html_()
        assert len(found._repr_html_()) < 10_000
        if name in FIGURES:
            assert found.plot().axes
    with pytest.raises(RequestError, match="no figure of a dict"):
        specan.plot({})


@pytest.mark.parametrize(
    ("verb", "options", "settings"),
    [
        ("octave", ["--averaging", "fast", "--percentile", "10"], {"averaging": "fast", "percentiles": 10.0}),
        ("fft", ["--lines", "50", "--reference", "Mic 1"], {"lines": 50, "reference": "Mic 1"}),
        ("frf", ["--lines", "50", "--reference", "Mic 1"], {"lines": 50, "reference": "Mic 1"}),
        ("rms", [], {}),
        ("decay", ["--fmax", "2000"], {"fmax": 2000}),
        ("orders", ["--speed", "10"], {"speed_hz": 10}),
    ],
)
def test_json_is_that_of_the_verb(verb, options, settings):
    path = SAMPLES / "knock.tdms"
    done = CliRunner().invoke(main, [verb, str(path), *options, "--json"])
    assert json.loads(done.stdout) == getattr(specan, verb)(path, **settings).to_dict()


def test_json_of_a_recording_is_that_of_info():
    path = SAMPLES / "knock.tdms"
    done = CliRunner().invoke(main, ["info", str(path), "--json"])
    said = json.loads(done.stdout)["files"][0]
    assert {k: v for k, v in said.items() if k not in ("size_bytes", "excitation")} == specan.read(
        path
    ).to_dict()


def test_a_model_is_built_from_a_rig_file_its_content_or_the_example(tmp_path):
    with (ROOT / "sample_data/worm_gear/rig.toml").open("rb") as file:
        said = tomllib.load(file)
    by_path = specan.load_model("worm-gear", str(ROOT / "sample_data/worm_gear/rig.toml"))
    assert by_path.settings == specan.load_model("worm-gear", said).settings
    assert specan.load_model("room").name == "room"


@pytest.mark.parametrize("wrong", [3, ["a.tdms"], None])
def test_what_is_no_recording_is_said(wrong):
    with pytest.raises(RequestError, match="expected a Recording or the path of one file, found: "):
        specan.rms(wrong)


@pytest.mark.parametrize(("model", "measured", "said"), [
    (3, "t.csv", "3 is not a model"), ("worm-gear", 3, "the measured data are of type int"),
    ("worm-gear", None, "the measured data are of type NoneType"),
])  # fmt: skip
def test_what_is_no_study_is_said(model, measured, said, tmp_path):
    with pytest.raises(RequestError, match=said):
        specan.Study.new(tmp_path / "study", model, measured)


def test_views_are_those_of_the_options():
    levels = specan.octave(recording(), averaging="fast")
    assert [a.get_xlabel() for a in levels.plot(view="history").axes[:2]] == ["", "Time / s"]
    assert specan.orders(recording(), speed_hz=20.0).plot(view="map").axes
    responses = specan.impulse(SAMPLES / "noise" / "noise_4_microphones_float32.tdms")
    drawn = responses.plot().axes[0].lines
    highest = [max(line.get_ydata()) for line in drawn]
    assert highest == pytest.approx(20 * np.log10(np.abs(responses.samples).max(axis=1)))
    with pytest.raises(RequestError, match="no figure of a BandLevels map"):
        levels.plot(view="map")


def test_a_figure_is_saved_where_one_says(tmp_path):
    specan.plot(specan.octave(recording()), tmp_path / "bands.png")
    assert (tmp_path / "bands.png").read_bytes().startswith(b"\x89PNG")


def test_names_in_a_notebook_are_text():
    html = specan.rms(recording(names=("<b>1</b>", "Vibro")))._repr_html_()
    assert "<b>1</b>" not in html
    assert "&lt;b&gt;1&lt;/b&gt;" in html


def test_two_channels_of_one_name_keep_their_group():
    frame = specan.rms(recording(names=("ai0", "ai0"), groups=("A", "B"))).to_dataframe()
    assert frame["channel"].tolist() == ["A/ai0", "B/ai0"]


def test_samples_are_a_frame_over_time():
    frame = recording().to_dataframe("Mic 1", start_s=0.5, stop_s=0.5 + 8 / RATE)
    assert frame.index.name == "time_s"
    np.testing.assert_allclose(frame.index, 0.5 + np.arange(8) / RATE)
    np.testing.assert_allclose(frame["Mic 1"], np.sqrt(2) * np.cos(np.pi / 4 * np.arange(8)), atol=1e-9)


def test_a_data_set_has_the_dimensions():
    pytest.importorskip("xarray")
    found = specan.octave(recording(), 3).to_xarray()
    assert float(found["level_dB"].sel(channel="Mic 1", nominal_hz=1000)) == pytest.approx(93.979, abs=0.02)
    assert recording().to_xarray()["Mic 1"].sizes == {"time_s": int(SECONDS * RATE)}
    assert [recording()[0], recording()["Mic 1"]] == [next(iter(recording()))] * 2


def test_a_batch_gives_its_tables(tmp_path):
    done = specan.batch(SAMPLES / "sine", tmp_path / "out", octave={"fraction": 1})
    assert repr(done).startswith("<BatchReport: 4 analysed")
    assert set(done.to_dataframe()["kind"]) == {"done"}
    sine = done.table("sine")
    assert sine["frequency_hz"].nunique() == 4
    assert "level_dB" in sine
    with pytest.raises(RequestError, match="no table"):
        done.table("sines")


def printed(*words):
    """What a verb prints as JSON."""
    return json.loads(CliRunner().invoke(main, [*words, "--json"]).stdout)


def drawn(study, path):
    study.plot(path)
    return path.read_bytes()


@pytest.mark.long
def test_a_study_does_what_the_verbs_do(tmp_path, monkeypatch):
    """The stretched spring of the tests of own models: its missing effect is known."""
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    (tmp_path / "rig.toml").write_text(
        "[limits]\npull_N = [5, 60]\nroom_C = [10, 40]\n[uncertainty]\nstretch_mm = 0.2\n", encoding="utf-8"
    )
    random, lines = np.random.default_rng(3), ["pull_N,room_C,stretch_mm,repeat"]
    for repeat in (1, 2, 3):
        for pull in np.linspace(5, 60, 12):
            for room in (15.0, 35.0):
                x = pull / 500.0 + 2e-3 * np.sqrt(pull / 30) + 8e-3 * (pull / 60) ** 3
                lines.append(f"{pull:g},{room:g},{1e3 * x + 0.2 * random.standard_normal():.4f},{repeat}")
    (tmp_path / "spring.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    study = specan.Study.new(
        tmp_path / "s", SPRING, tmp_path / "spring.csv",
        rig=tmp_path / "rig.toml", hold_out="pull=30",
    )  # fmt: skip
    with pytest.raises(RequestError, match="the measured data are of type dict"):
        specan.Study.new(tmp_path / "t", SPRING, [{"pull_N": 5}])
    assert study.assumptions
    assert "opening" not in study.effects
    before = study.compare()
    assert {"parameter", "value", "low", "high", "unit"} < set(before.to_dataframe())
    assert before.to_dict() == printed("study", "compare", str(tmp_path / "s"))
    before.plot(path=tmp_path / "before.svg")
    assert (tmp_path / "before.svg").read_bytes() == drawn(study, tmp_path / "study.svg")
    verdict = specan.diagnose(tmp_path / "s")
    assert verdict.verdict == "effect"
    assert verdict.to_dataframe()["effects"][0] == "opening"
    assert study.diagnose().to_dict() == verdict.to_dict()
    assert study.next().to_dataframe().columns.tolist() == ["place", "text"]
    assert study.next().to_dict() == printed("study", "next", str(tmp_path / "s"))
    change = study.add("opening", because="asked for")
    frame = change.to_dataframe().set_index("data")
    assert frame.loc["held-out", "after"] < frame.loc["held-out", "before"]
    assert "opening" in study.effects  # the object follows its directory
    assert study.compare().fit.reduced_chi2 < before.fit.reduced_chi2
    assert study.report(tmp_path / "r.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    study.plot(tmp_path / "compare.svg")
    study.drop("opening")
    assert study.history().to_dataframe()["action"].tolist() == ["new", "add", "drop"]
    shown = printed("study", "history", str(tmp_path / "s"))
    assert [s["step"] for s in shown] == study.history().to_dataframe()["step"].tolist()
    for found in (study, before, verdict, change, study.history()):
        assert len(repr(found)) < 400
        assert len(found._repr_html_()) < 10_000
    with pytest.raises(RequestError, match="holds no study"):
        specan.Study(tmp_path)


def test_python_m_specan_is_specan():
    done = subprocess.run(
        [sys.executable, "-m", "specan", "--version"], capture_output=True, text=True, check=True
    )
    assert specan.__version__ in done.stdout
