"""A browser and a running page, for those who have one."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--window-size=1400,1050",
)  # fmt: skip


@pytest.fixture(scope="session")
def new_browser(tmp_path_factory) -> Iterator[Callable]:
    """Start a browser with options of its own."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="left out: selenium is not installed")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip(
            "left out: no Chromium with its chromedriver on this machine (apt install chromium chromium-driver)"
        )
    from selenium.webdriver.chrome.service import Service

    running = []

    def start(*more: str):
        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        for option in (*OPTIONS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}", *more):
            options.add_argument(option)
        downloads = tmp_path_factory.mktemp("downloads")
        options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        driver = webdriver.Chrome(options=options, service=Service(DRIVER))
        driver.downloads = downloads
        running.append(driver)
        return driver

    yield start
    for driver in running:
        driver.quit()


@pytest.fixture(scope="session")
def browser(new_browser):
    return new_browser()


@pytest.fixture(scope="module")
def serve() -> Iterator[Callable[..., str]]:
    """Start ``specan inspect`` and return the address that it prints; the same again for the same arguments."""
    running = []

    @cache
    def start(*arguments: str) -> str:
        process = subprocess.Popen(
            [sys.executable, "-m", "specan_cli", "inspect", *arguments, "--no-browser"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        running.append(process)
        url = process.stdout.readline().strip()
        assert url.startswith("http://127.0.0.1:"), process.stderr.read()
        return url

    yield start
    for process in running:
        process.terminate()
        process.communicate(timeout=20)


# The page's widgets live in nested shadow roots; Bokeh's own document finds them by their name.
MODEL = "Bokeh.documents[0].get_model_by_name(arguments[0])"


PATIENCE = 30.0  # s, on a busy machine


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

    wait = staticmethod(wait_for)

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

        Select(self.element(name, "select")).select_by_visible_text(text)

    def type(self, name: str, text: str) -> None:
        from selenium.webdriver.common.keys import Keys

        self.element(name, "input").send_keys(Keys.CONTROL, "a", Keys.NULL, text, Keys.ENTER)

    def press(self, name: str) -> None:
        """Click, and again where the page was just moving under the mouse."""
        from selenium.common.exceptions import (
            ElementClickInterceptedException,
            StaleElementReferenceException,
        )

        def clicked() -> bool:
            try:
                button = self.element(name, "button")
                self.browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
                button.click()
            except (ElementClickInterceptedException, StaleElementReferenceException):
                return False
            return True

        wait_for(clicked)

    @property
    def complaints(self) -> list[str]:
        return [e["message"] for e in self.browser.get_log("browser") if e["level"] in ("SEVERE", "WARNING")]


@pytest.fixture
def open_page(browser) -> Callable[[str], Page]:
    """Open an address in the browser."""
    return lambda url: Page(browser, url)


@pytest.fixture
def open_page_in() -> Callable[..., Page]:
    """Open an address in a given browser."""
    return Page
