"""The page fits the screen of a laptop, its units are apart, and it says which command gives the same."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("bokeh")

import specan
from specan.data.calibration import stated
from specan.inspect.opened import Opened, watched
from specan.inspect.plots import Plots
from specan.inspect.tab import text_of
from specan.inspect.tabs import TABS, FftTab, FrfTab, OctaveTab
from specan.inspect.view import View
from specan.io.open import open_recording
from specan.report.panels import Curve, Drawing, Panel
from specan_cli.main import main

ROOT = Path(__file__).parents[2]
NOISE = ROOT / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
MODEL = "Bokeh.documents[0].get_model_by_name"


@pytest.mark.parametrize(
    "view",
    [
        View().but(fraction=12, weighting="A", start=0.5, stop=2.0),
        View().but(averaging="fast", hold="max", fmin=100.0),
        View().but(tab="fft", lines=400, window="flat-top", averaging="exponential", reference="Mic 1"),
        View().but(tab="frf", lines=400, estimator="H3c", overlap=0.75, unwrap=True),
        View().but(tab="levels", weighting="A", averaging="slow"),
        View().but(tab="spectrogram", lines=200, of="Measurement/Mic 2"),
        View().but(tab="orders", speed_hz=25.125, turns=4, max_order=20.0, map=True),
        View().but(tab="info"),
    ],
    ids=lambda view: view.tab,
)
def test_the_command_of_a_view_runs_and_takes_its_settings(view, tmp_path):
    opened = Opened((open_recording(NOISE),))
    view = view.but(channel=("Measurement/Mic 1", "Measurement/Mic 2"))
    tab = next(kind for kind in TABS if kind.name == view.tab)
    (line,) = tab(opened, view, print).commands(view)
    program, *arguments = shlex.split(line)
    assert program == "specan"
    result = CliRunner().invoke(main, [*arguments, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    if view.tab == "octave":
        assert found["fraction"] == view.settings.get("fraction", 3)
        assert [c["channel"] for c in found["channels"]] == ["Mic 1", "Mic 2"]


@pytest.mark.parametrize("tab", [OctaveTab, FftTab, FrfTab], ids=lambda tab: tab.__name__)
def test_the_command_of_a_tab_gives_its_numbers_calibration_and_lines_included(tab, tmp_path):
    calibration = str(tmp_path / "calibration.toml")
    insertions = sorted(map(str, (ROOT / "sample_data/recordings/calibration").glob("*.tdms")))
    made = CliRunner().invoke(main, ["calibrate", *insertions, "-o", calibration], catch_exceptions=False)
    assert made.exit_code == 0
    recording = specan.read(NOISE, calibration=calibration)
    opened = Opened((watched(recording, NOISE),), ("--calibration", calibration))
    view = View(
        tab=tab.__name__.removesuffix("Tab").lower(), channel=("Measurement/Mic 1", "Measurement/Mic 2")
    )
    shown = tab(opened, view, lambda **_: None)
    found = shown.compute(view, lambda _: True)
    (line,) = shown.commands(view)
    done = CliRunner().invoke(main, [*shlex.split(line)[1:], "-o", "-"], catch_exceptions=False)
    shown = text_of(stated(found[0][1], recording)).decode()
    written, shown = (
        re.sub("(?m)^# settings: .*", "", text) for text in (done.stdout, shown)
    )  # defaults are None
    assert written == shown
    assert "calibration.toml" in done.stdout


def test_each_unit_has_a_figure_and_many_lines_have_few_colours():
    made = []
    plots = Plots(made.append, hertz=True)
    x = np.array([100.0, 200.0])
    many = tuple(Curve(f"Mic {k}", x, np.array([60.0 + k, 61.0 + k])) for k in range(12))
    pressure = Panel("Level / dB re 20 µPa", many)
    laser = Panel("Level / dB re 1 nm/s", (Curve("Laser", x, np.array([140.0, 141.0])),))
    drawing = Drawing("a", ("",), "Frequency / Hz", (pressure, laser), hertz=True)
    plots.draw(drawing)
    assert [p.sheet.yaxis[0].axis_label for p in made] == ["Level\n/ dB re 20 µPa", "Level\n/ dB re 1 nm/s"]
    assert made[0].sheet.x_range is made[1].sheet.x_range
    first, second = (plot.sheet.y_range for plot in made)
    assert first.end < 80 < 130 < second.start
    data = made[0].source.data
    coloured = [name for name, alpha in zip(data["name"], data["alpha"], strict=True) if alpha == 1.0]
    assert set(coloured) in ({"Mic 0", "Mic 11", "Mic 1"}, {"Mic 0", "Mic 11", "Mic 10"})
    used = {c for c, a in zip(data["colour"], data["alpha"], strict=True) if a == 1.0}
    assert len(used) == 3
    assert made[1].source.data["colour"][0] not in used
    plots.draw(replace(drawing, panels=(laser,)))
    assert plots.body.children == [plots.facts, made[0].sheet]


@pytest.mark.long
def test_dark_mode_and_the_command_of_a_tab(open_page, recording_page):
    page = open_page(f"{recording_page}?tab=fft")
    page.wait(lambda: page.script(f"return {MODEL}('status')?.text.includes('phase')"))
    page.press("dark")
    page.wait(lambda: page.script("return document.documentElement.classList.contains('dark')"))
    page.press("copy-command")
    page.wait(lambda: "specan fft" in page.text("status"))
    assert page.complaints == []


@pytest.fixture
def recording_page(serve) -> str:
    return serve(str(NOISE))
