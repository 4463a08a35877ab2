"""``--plot`` of every verb that has results: a picture in the format that was asked for, and nothing else changed."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.data.recording import ArraySource, Channel, Recording
from specan.report.figures_waveforms import MOST_CHANNELS, figure_waveforms
from specan_cli.main import main

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_data" / "recordings"
NOISE, KNOCK = str(SAMPLES / "noise" / "noise_24_microphones.tdms"), str(SAMPLES / "knock.tdms")
SINE = str(SAMPLES / "sine" / "sine_0125.3Hz.tdms")
TONES = sorted(map(str, (SAMPLES / "calibration").glob("*.tdms")))
GEAR = ROOT / "sample_data" / "worm_gear"
BEGINS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


def draw(kind: str, tmp_path: Path, *arguments: str) -> bytes:
    target = tmp_path / f"figure.{kind}"
    result = CliRunner().invoke(main, [*arguments, "--plot", str(target)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert target.read_bytes().startswith(BEGINS[kind])
    return target.read_bytes()


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        ("png", ["info", KNOCK]),
        ("svg", ["octave", KNOCK]),
        ("pdf", ["octave", KNOCK, "--averaging", "fast", "--history"]),
        ("png", ["fft", KNOCK, "--reference", "Mic 1", "--lines", "200"]),
        ("svg", ["fft", KNOCK, "--spectrogram", "--lines", "50", "--channel", "Mic 1"]),
        ("pdf", ["frf", NOISE, "--channel", "Mic 1", "--estimator", "H3c", "--lines", "200"]),
        ("svg", ["rms", KNOCK]),
        ("png", ["tones", SINE]),
        ("png", ["calibrate", *TONES, "-o", "calibration.toml"]),
        ("svg", ["export", KNOCK, "-o", "knock.wav"]),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_recordings_are_drawn(kind, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    draw(kind, tmp_path, *arguments)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_a_picture_holds_no_clock_time(kind, tmp_path):
    first = draw(kind, tmp_path, "info", KNOCK)
    assert first == draw(kind, tmp_path, "info", KNOCK)


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("gear")
    for name in ("rig.toml", "table_8_loaded.csv"):
        shutil.copy(GEAR / name, place)
    begin = ["study", "new", str(place / "s"), "--model", "worm-gear", "--rig", str(place / "rig.toml")]
    begin += ["--measurement", str(place / "table_8_loaded.csv")]
    CliRunner().invoke(main, begin, catch_exceptions=False)
    return place / "s"


@pytest.mark.parametrize(("kind", "verb"), [("png", "compare"), ("svg", "history")])
def test_studies_are_drawn(kind, verb, study, tmp_path):
    draw(kind, tmp_path, "study", verb, str(study))


@pytest.mark.long
def test_a_changed_model_is_drawn(study, tmp_path):
    shutil.copytree(study.parent, tmp_path / "own")
    one = str(tmp_path / "own" / "s")
    first = draw("svg", tmp_path, "study", "add", one, "load-dependent-friction")
    assert draw("svg", tmp_path, "study", "drop", one, "load-dependent-friction") != first


@pytest.mark.parametrize("name", ["figure.bmp", "missing/figure.png"])
def test_a_name_that_cannot_be_is_told_before_the_work(name, tmp_path, monkeypatch):
    monkeypatch.setattr("specan.io.open.open_recording", None)
    result = CliRunner().invoke(main, ["rms", KNOCK, "--plot", str(tmp_path / name)])
    assert "figure" in str(result.exception)
    assert result.exception.exit_code == 2


def test_one_recording_is_drawn_not_several(tmp_path):
    result = CliRunner().invoke(main, ["info", KNOCK, NOISE, "--plot", str(tmp_path / "a.png")])
    assert "one recording" in str(result.exception)


# --- waveforms ------------------------------------------------------------------------------------


def made_up(n: int, count: int = 1) -> tuple[Recording, np.ndarray]:
    samples = np.random.default_rng(1).standard_normal((count, n))
    channels = tuple(
        Channel(f"Mic {k}", "G", unit="Pa", sampling_rate=1000.0, n_samples=n) for k in range(count)
    )
    return Recording("a.tdms", channels, ArraySource(list(samples))), samples


def test_no_extreme_of_a_long_waveform_is_lost():
    one, samples = made_up(200_003)
    samples[0, 150_001] = 77.0
    axes = figure_waveforms(one).axes[0]
    assert axes.dataLim.y1 == 77.0
    assert axes.dataLim.y0 == samples.min()
    assert axes.dataLim.x1 == pytest.approx(200.003, abs=0.3)


def test_the_section_alone_is_drawn():
    one, samples = made_up(5000)
    axes = figure_waveforms(one, one.channels, 1.0, 1.5).axes[0]
    assert (axes.dataLim.x0, axes.dataLim.x1) == (1.0, 1.499)
    assert axes.dataLim.y1 == samples[0, 1000:1500].max()


def test_more_channels_than_a_page_holds_are_counted(heading_text):
    one, _ = made_up(100, MOST_CHANNELS + 5)
    figure = figure_waveforms(one)
    assert len(figure.axes) == MOST_CHANNELS
    assert f"{MOST_CHANNELS} of {MOST_CHANNELS + 5}" in heading_text(figure)


def test_only_conditions_that_the_tables_record_are_proposed(study):
    from specan.study.design.operating_points import operating_grid
    from specan.study.study import Study

    opened = Study(study)
    recorded = set(opened.problem.observations[0].conditions)
    assert set(opened.model.rig.limits) - recorded  # the rig states limits of the oil temperature as well
    grid = operating_grid(opened.problem)
    assert grid is not None
    assert set(grid) <= recorded
