"""The page as a person uses it, in a real browser."""

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

from specan_cli.octave import command as octave
from specan_cli.study_history import command as study_history
from specan_cli.study_new import command as study_new

pytest.importorskip("bokeh")

ROOT = Path(__file__).parents[2]
NOISE = ROOT / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
GEAR = ROOT / "sample_data" / "worm_gear"
PATIENCE = 30.0  # s, on a busy machine

# The page's widgets live in nested shadow roots; Bokeh's own document finds them by their name.
MODEL = "Bokeh.documents[0].get_model_by_name(arguments[0])"


def wait_for(what, patience: float = PATIENCE):
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = what()
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"waited {patience} s in vain")


class Page:
    """One open page."""

    def __init__(self, browser, url: str) -> None:
        self.browser = browser
        browser.get("about:blank")
        browser.get_log("browser")  # of pages before
        browser.get(url)
        wait_for(
            lambda: self.script(
                "return !!(window.Bokeh && Bokeh.documents.length && Bokeh.documents[0].roots().length)"
            )
        )

    def script(self, code: str, *arguments):
        return self.browser.execute_script(code, *arguments)

    def text(self, name: str) -> str:
        markup = self.script(f"const m = {MODEL}; return m ? m.text : ''", name) or ""
        return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", markup))

    def element(self, name: str, tag: str):
        """The HTML element of a widget."""
        return wait_for(
            lambda: self.script(
                "const id = " + MODEL + "?.id; const tag = arguments[1];"
                "const seek = (views) => { for (const v of views) { if (v.model.id == id) return v.el;"
                " const f = seek(v.child_views ?? []); if (f) return f; } };"
                "const el = seek(Object.values(Bokeh.index).length ? Object.values(Bokeh.index)"
                " : [...Bokeh.index]); return el?.shadowRoot.querySelector(tag)",
                name,
                tag,
            )
        )

    def choose(self, name: str, text: str) -> None:
        from selenium.webdriver.support.ui import Select

        Select(self.element(name, "select")).select_by_value(text)

    def type(self, name: str, text: str) -> None:
        from selenium.webdriver.common.keys import Keys

        self.element(name, "input").send_keys(Keys.CONTROL, "a")
        self.element(name, "input").send_keys(text, Keys.ENTER)

    def press(self, name: str) -> None:
        self.element(name, "button").click()

    @property
    def complaints(self) -> list[str]:
        return [e["message"] for e in self.browser.get_log("browser") if e["level"] in ("SEVERE", "WARNING")]


def bands(*options: str) -> dict:
    result = CliRunner().invoke(octave, [str(NOISE), "--json", *options])
    return json.loads(result.stdout)


def test_a_band_level_is_that_of_the_command(browser, serve):
    page = Page(browser, serve(str(NOISE)))
    page.type("cursor", "1010")
    wait_for(lambda: "Mic 1 1000" in page.text("readout"))
    page.choose("fraction", "12")
    found = bands("--channel", "Mic 1", "--fraction", "12")
    inside = np.flatnonzero((np.array(found["lower_hz"]) <= 1010) & (np.array(found["upper_hz"]) > 1010))[0]
    level = f"{found['channels'][0]['level_dB'][inside]:.2f}"
    wait_for(lambda: f"Mic 1 {found['nominal_hz'][inside]:g} {level} dB" in page.text("readout"))
    page.choose("weighting", "A")
    weighted = bands("--channel", "Mic 1", "--fraction", "12", "--weighting", "A")["channels"][0]
    wait_for(lambda: f"{weighted['level_dB'][inside]:.2f} dB" in page.text("readout"))
    # The settings stand in the address: sent on, it shows the same.
    wait_for(lambda: "fraction=12" in browser.current_url and "weighting=A" in browser.current_url)
    shown, address = page.text("readout"), browser.current_url
    again = Page(browser, address)
    wait_for(lambda: again.text("readout") == shown)
    assert page.complaints == []


def test_zoom_section_and_numbers(browser, serve):
    from selenium.webdriver.common.action_chains import ActionChains

    page = Page(browser, serve(str(NOISE)))
    wait_for(lambda: "97." in page.text("overall"))
    canvas = wait_for(lambda: page.script(
        "const seek = (v) => { if (v.model.type == 'Figure') return v.el; for (const c of v.child_views ?? []) {"
        " const f = seek(c); if (f) return f; } }; for (const v of Object.values(Bokeh.index).length ?"
        " Object.values(Bokeh.index) : [...Bokeh.index]) return seek(v)"))  # fmt: skip
    wide = canvas.size["width"]
    # Across the waveform with the mouse: the section.
    ActionChains(browser).move_to_element_with_offset(canvas, -wide // 5, 0).click_and_hold().move_by_offset(
        wide // 4, 10
    ).release().perform()
    wait_for(lambda: "start=" in browser.current_url and "stop=" in browser.current_url)
    start = float(re.search(r"start=([\d.]+)", browser.current_url)[1])
    stop = float(re.search(r"stop=([\d.]+)", browser.current_url)[1])
    assert 0.2 < start < stop < 3.3
    found = bands("--channel", "Mic 1", "--start", str(start), "--stop", str(stop))
    wait_for(lambda: f"Mic 1 {found['channels'][0]['overall_dB']['Z']:.2f}" in page.text("overall"))
    # The wheel zooms, and the part on screen is drawn anew.
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    ActionChains(browser).scroll_from_origin(ScrollOrigin.from_element(canvas), 0, -300).perform()
    wait_for(lambda: "low=" in browser.current_url or "high=" in browser.current_url)
    # Numbers as the command writes them.
    page.press("save-txt")
    name = "noise_24_microphones_octave.txt"
    saved = wait_for(lambda: next(iter(browser.downloads.glob(name)), None))
    expected = browser.downloads / "expected.txt"
    channels = [o for k in (1, 2, 3, 4) for o in ("--channel", f"Measurement/Mic {k}")]
    CliRunner().invoke(
        octave,
        [
            str(NOISE),
            *channels,
            "--fmin",
            "20",
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


def test_every_tab_opens(browser, serve):
    url = serve(str(NOISE), "--overlay", str(ROOT / "sample_data/recordings/knock.tdms"))
    page = Page(browser, url + "?tab=fft&cursor=500&reference=Mic+1")
    wait_for(lambda: "degrees" in page.text("readout"))
    page = Page(browser, url + "?tab=frf&cursor=500&lines=400")
    wait_for(lambda: "coherence" in page.text("readout"))
    page = Page(browser, url + "?tab=levels")
    wait_for(lambda: "knock" in page.text("levels"))
    page = Page(browser, url + "?tab=info")
    wait_for(lambda: "24-bit" in page.text("info"))
    page = Page(browser, url + "?tab=nonsense")
    wait_for(lambda: "nonsense" in page.text("status"))
    assert page.complaints == []


def test_a_recording_whose_names_are_markup_and_which_vanishes(browser, serve, tmp_path):
    file = tmp_path / "<img src=x onerror=document.title=1>.wav"
    wavfile.write(file, 8000, np.zeros(800, dtype=np.float32))
    page = Page(browser, serve(str(file)))
    wait_for(lambda: "dead" in page.text("status"))
    assert page.script("return document.querySelectorAll('img').length") == 0
    assert page.browser.title != "1"
    file.unlink()
    page.type("start", "0.02")
    wait_for(lambda: "cannot be reached" in page.text("status"))


def test_an_effect_is_tried_accepted_and_in_the_history(browser, serve, tmp_path):
    study = tmp_path / "gear"
    arguments = [
        "--model",
        "worm-gear",
        "--rig",
        str(GEAR / "rig.toml"),
        "--measurement",
        str(GEAR / "table_8_loaded.csv"),
    ]
    assert CliRunner().invoke(study_new, [str(study), *arguments]).exit_code == 0
    before = (study / "history.jsonl").read_text()
    page = Page(browser, serve(str(study)))
    wait_for(lambda: "efficiency" in page.text("trial"))
    shown = page.text("trial")
    page.press("try-seal-drag")
    wait_for(lambda: "tried, not accepted" in page.text("status"))
    assert page.text("trial") != shown
    assert (study / "history.jsonl").read_text() == before  # nothing is written by trying
    page.type("because", "it leaks")
    page.press("accept")
    wait_for(lambda: "it leaks" in page.text("history"))
    steps = json.loads(CliRunner().invoke(study_history, [str(study), "--json"]).stdout)
    assert (steps[-1]["action"], steps[-1]["effect"], steps[-1]["because"]) == (
        "add",
        "seal-drag",
        "it leaks",
    )
    assert f"{steps[-1]['fit_error']['value']:.4g}" in page.text("history")
    assert page.complaints == []
