"""The page as a person uses it, in a real browser."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan_cli.analyses import fft, frf, octave, rms

pytest.importorskip("bokeh")

ROOT = Path(__file__).parents[2]
NOISE = ROOT / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
KNOCK = ROOT / "sample_data" / "recordings" / "knock.tdms"


def bands(*options: str) -> dict:
    result = CliRunner().invoke(octave, [str(NOISE), "--json", *options])
    return json.loads(result.stdout)


@pytest.mark.long
def test_a_band_level_is_that_of_the_command(browser, open_page, serve):
    page = open_page(serve(str(NOISE)))
    page.type("cursor", "1010")
    page.wait(lambda: "Mic 1 1000" in page.text("readout"))
    page.choose("fraction", "12")
    found = bands("--channel", "Mic 1", "--fraction", "12")
    inside = np.flatnonzero((np.array(found["lower_hz"]) <= 1010) & (np.array(found["upper_hz"]) > 1010))[0]
    level = f"{found['channels'][0]['level_dB'][inside]:.2f}"
    page.wait(lambda: f"Mic 1 {found['nominal_hz'][inside]:g} {level} dB" in page.text("readout"))
    page.choose("weighting", "A")
    weighted = bands("--channel", "Mic 1", "--fraction", "12", "--weighting", "A")["channels"][0]
    page.wait(lambda: f"{weighted['level_dB'][inside]:.2f} dB" in page.text("readout"))
    # The settings are in the address: sent on, it shows the same.
    page.wait(lambda: "fraction=12" in browser.current_url and "weighting=A" in browser.current_url)
    shown, address = page.text("readout"), browser.current_url
    again = open_page(address)
    page.wait(lambda: again.text("readout") == shown)
    assert page.complaints == []


@pytest.mark.long
def test_zoom_section_and_numbers(browser, open_page, serve):
    from selenium.webdriver.common.action_chains import ActionChains

    page = open_page(serve(str(NOISE)))
    page.wait(lambda: "97." in page.text("overall"))
    canvas = page.wait(lambda: page.script(
        "const seek = (v) => { if (v.model.type == 'Figure') return v.el; for (const c of v.child_views ?? []) {"
        " const f = seek(c); if (f) return f; } }; for (const v of Object.values(Bokeh.index).length ?"
        " Object.values(Bokeh.index) : [...Bokeh.index]) return seek(v)"))  # fmt: skip
    wide = canvas.size["width"]
    # Across the waveform with the mouse: the section.
    ActionChains(browser).move_to_element_with_offset(canvas, -wide // 5, 0).click_and_hold().move_by_offset(
        wide // 4, 10
    ).release().perform()
    page.wait(lambda: "start=" in browser.current_url and "stop=" in browser.current_url)
    start = float(re.search(r"start=([\d.]+)", browser.current_url)[1])
    stop = float(re.search(r"stop=([\d.]+)", browser.current_url)[1])
    assert 0.2 < start < stop < 3.3
    found = bands("--channel", "Mic 1", "--start", str(start), "--stop", str(stop))
    page.wait(lambda: f"Mic 1 {found['channels'][0]['overall_dB']['Z']:.2f}" in page.text("overall"))
    # The wheel zooms, and the part on screen is drawn anew.
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    ActionChains(browser).scroll_from_origin(ScrollOrigin.from_element(canvas), 0, -300).perform()
    page.wait(lambda: "low=" in browser.current_url or "high=" in browser.current_url)
    # Numbers as the command writes them.
    page.press("save-txt")
    name = "noise_24_microphones_octave.txt"
    saved = page.wait(lambda: next(iter(browser.downloads.glob(name)), None))
    expected = browser.downloads / "expected.txt"
    channels = [o for k in (1, 2, 3, 4) for o in ("--channel", f"Measurement/Mic {k}")]
    CliRunner().invoke(
        octave,
        [
            str(NOISE),
            *channels,
            "--start",
            str(start),
            "--stop",
            str(stop),
            "-o",
            str(expected),
        ],
    )
    assert saved.read_text() == expected.read_text()
    assert page.complaints == []


@pytest.mark.long
def test_every_tab_opens(browser, open_page, serve):
    url = serve(str(NOISE), "--overlay", str(KNOCK))
    page = open_page(url + "?tab=fft&cursor=500&reference=Mic+1")
    page.wait(lambda: "degrees" in page.text("readout"))
    page = open_page(url + "?tab=frf&cursor=500&lines=400")
    page.wait(lambda: "coherence" in page.text("readout"))
    page = open_page(url + "?tab=levels")
    page.wait(lambda: "knock" in page.text("levels"))
    page = open_page(url + "?tab=info")
    page.wait(lambda: "24-bit" in page.text("info"))
    page = open_page(url + "?tab=nonsense")
    page.wait(lambda: "nonsense" in page.text("status"))
    assert page.complaints == []


@pytest.mark.long
def test_a_recording_whose_names_are_markup_and_which_changes_and_vanishes(
    browser, open_page, serve, tmp_path
):
    file = tmp_path / "<img src=x onerror=document.title=1>.wav"
    wavfile.write(file, 8000, np.zeros(800, dtype=np.float32))
    page = open_page(serve(str(file)))
    page.wait(lambda: "dead" in page.text("status"))
    assert page.script("return document.querySelectorAll('img').length") == 0
    assert page.browser.title != "1"
    wavfile.write(file, 8000, np.ones(900, dtype=np.float32))
    page.type("start", "0.02")
    page.wait(lambda: "has changed" in page.text("status"))
    file.unlink()
    page.type("start", "0.03")
    page.wait(lambda: "cannot be reached" in page.text("status"))


@pytest.mark.long
@pytest.mark.parametrize("tab", ["octave", "fft", "frf", "levels", "spectrogram", "orders", "info"])
def test_a_tenth_of_a_second_of_zeros_beside_noise(open_page, silence, tab):
    """Every tab shows something, or says in a sentence what it would need."""
    page = open_page(f"{silence}?tab={tab}&cursor=1000" + ("&reference=0" if tab == "frf" else ""))
    page.wait(lambda: page.script("return Bokeh.documents[0].get_model_by_name('tabs') != null"))
    page.wait(
        lambda: page.text("status").strip() or page.text("readout").strip() or page.text("info").strip()
    )
    assert "does not know" not in page.text("status")
    assert page.complaints == []


@pytest.fixture(scope="module")
def silence(serve, tmp_path_factory) -> str:
    """A page of 0.1 s with a dead channel and one of noise."""
    noise = np.random.default_rng(1).standard_normal(800)
    place = tmp_path_factory.mktemp("silence") / "short.wav"
    wavfile.write(place, 8000, np.stack([0 * noise, noise], axis=1).astype(np.float32))
    return serve(str(place))


def saved_text(browser, page, name: str) -> str:
    """What the button hands to the downloads."""
    place = browser.downloads / name
    place.unlink(missing_ok=True)
    page.press("save-txt")
    page.wait(place.exists)
    return place.read_text()


def written(command, tmp_path, *arguments: str) -> str:
    """What the command writes with -o."""
    place = tmp_path / "expected.txt"
    result = CliRunner().invoke(command, [*arguments, "-o", str(place)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return place.read_text()


FOUR = [o for k in (1, 2, 3, 4) for o in ("--channel", f"Measurement/Mic {k}")]


@pytest.mark.long
def test_averaging_and_overlap_of_a_spectrum_are_those_of_the_command(browser, open_page, serve, tmp_path):
    page = open_page(serve(str(NOISE)) + "?tab=fft&lines=400&cursor=500")
    for name, text in (("exponential", "exponential"), ("max", "max hold"), ("min", "min hold")):
        page.choose("averaging", text)
        page.wait(lambda name=name: f"averaging={name}" in browser.current_url)
    page.type("overlap", "0.75")
    page.wait(lambda: "overlap=0.75" in browser.current_url and "dB" in page.text("readout"))
    expected = written(
        fft, tmp_path, str(NOISE), *FOUR, "--lines", "400", "--averaging", "min", "--overlap", "0.75"
    )
    page.wait(lambda: saved_text(browser, page, "noise_24_microphones_fft.txt") == expected)
    assert page.complaints == []


@pytest.mark.long
def test_the_generator_as_instrument_and_the_uncertainty_on_screen(browser, open_page, serve, tmp_path):
    page = open_page(serve(str(NOISE)) + "?tab=frf&lines=400&cursor=300")
    page.wait(lambda: "coherence" in page.text("readout"))
    bands = (
        "return [...Bokeh.documents[0]._all_models.values()].filter(m => m.name == 'bands'"
        " && (m.data.colour ?? m.data.get('colour')).length == 4).length"
    )
    page.wait(lambda: page.script(bands) == 2)  # of the magnitude and of the phase
    same = (
        "const of = (n) => [...Bokeh.documents[0]._all_models.values()].filter(m => m.name == n)"
        ".map(m => String([...(m.data.colour ?? m.data.get('colour'))]));"
        "const bands = of('bands').filter(c => c), lines = of('curves').filter(c => c);"
        "return bands.every(c => lines.includes(c))"
    )
    assert page.script(same)  # in the colours of the lines
    page.choose("estimator", "H3c")
    page.wait(lambda: "estimator=H3c" in browser.current_url)
    expected = written(frf, tmp_path, str(NOISE), *FOUR, "--lines", "400", "--estimator", "H3c")
    page.wait(lambda: saved_text(browser, page, "noise_24_microphones_frf.txt") == expected)
    uncertain = re.search(r"u ([\d.e-]+) %\s.*?u [\d.e-]+ degrees", page.text("readout"), re.DOTALL)
    assert uncertain, page.text("readout")
    assert 0 < float(uncertain[1]) < 50
    assert page.complaints == []


@pytest.mark.long
def test_levels_are_saved_as_the_command_writes_them(browser, open_page, serve, tmp_path):
    page = open_page(serve(str(NOISE)) + "?tab=levels&averaging=slow&weighting=A")
    page.wait(lambda: "Mic 4" in page.text("levels"))
    expected = written(rms, tmp_path, str(NOISE), *FOUR, "--averaging", "slow", "--weighting", "A")
    page.wait(lambda: saved_text(browser, page, "noise_24_microphones_levels.txt") == expected)
    assert page.complaints == []


@pytest.mark.long
def test_a_spectrogram_of_any_channel(browser, open_page, serve, tmp_path):
    page = open_page(serve(str(NOISE)) + "?tab=spectrogram&lines=200")
    page.choose("of", "Mic 17")
    page.wait(lambda: "of=Measurement%2FMic+17" in browser.current_url)
    options = ["--spectrogram", "--columns", "500", "--lines", "200", "--channel", "Measurement/Mic 17"]
    expected = written(fft, tmp_path, str(NOISE), *options)
    page.wait(lambda: saved_text(browser, page, "noise_24_microphones_spectrogram.txt") == expected)
    assert page.complaints == []


@pytest.mark.long
def test_the_cursor_shows_its_harmonics_and_both_files(open_page, serve):
    url = serve(str(NOISE), "--overlay", str(KNOCK))
    page = open_page(url + "?tab=fft&cursor=200&lines=400")
    page.wait(lambda: "Mic 1 · noise" in page.text("readout") and "Mic 1 · knock" in page.text("readout"))
    alone = page.text("readout").count("Mic 1 · knock")
    page.element("harmonics", "input").click()
    page.wait(lambda: page.text("readout").count("Mic 1 · knock") == 10 * alone)
    assert "2000" in page.text("readout")
    assert page.complaints == []


@pytest.mark.long
def test_pictures_are_saved(browser, open_page, serve):
    page = open_page(serve(str(NOISE)) + "?tab=levels")
    page.wait(lambda: "Mic 4" in page.text("levels"))
    for kind, begin in (("png", b"\x89PNG"), ("svg", b"<?xml")):
        page.press(f"save-{kind}")
        place = browser.downloads / f"noise_24_microphones_levels.{kind}"
        page.wait(lambda place=place: place.exists() and place.stat().st_size)
        assert place.read_bytes().startswith(begin)


PLACE = """
const lined = (v) => v.model.type == 'Figure' && v.model.center.some((r) => r.name == 'cursor-line' && r.visible);
const seek = (v) => { if (lined(v)) return v;
  for (const c of v.child_views ?? []) { const f = seek(c); if (f) return f; } };
const views = Object.values(Bokeh.index).length ? Object.values(Bokeh.index) : [...Bokeh.index];
const view = views.map(seek).find((v) => v), box = view.el.getBoundingClientRect();
return [box.left + view.frame.x_scale.compute(arguments[0]), box.top + box.height / 2];
"""


@pytest.mark.long
def test_the_cursor_line_is_dragged_with_the_mouse(browser, open_page, serve):
    from selenium.webdriver.common.action_chains import ActionChains

    page = open_page(serve(str(NOISE)) + "?cursor=500")
    page.wait(lambda: "Mic 1 500" in page.text("readout"))
    (x, y), (to, _) = (browser.execute_script(PLACE, hertz) for hertz in (500.0, 1000.0))
    chain = ActionChains(browser)
    chain.w3c_actions.pointer_action.move_to_location(int(x), int(y)).pointer_down().move_to_location(
        int(to), int(y)
    ).pointer_up()
    chain.perform()
    page.wait(lambda: "cursor=500" not in browser.current_url)
    cursor = float(re.search(r"cursor=([\d.]+)", browser.current_url)[1])
    assert cursor == pytest.approx(1000.0, rel=0.02)
    page.wait(lambda: "Mic 1 1000" in page.text("readout"))
    assert page.complaints == []
