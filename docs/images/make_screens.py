"""Photographs the interactive page for the guide: the pictures ``inspect_*.png``.

Run ``python docs/images/make_screens.py GEAR_STUDY ROOM_STUDY`` where specan, selenium and Chromium with its driver are
installed. The studies are those of the README and of `docs/room.md`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlencode

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

HERE = Path(__file__).parent
NOISE = HERE.parents[1] / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
SIZE = {"width": 1366, "height": 768, "deviceScaleFactor": 1, "mobile": False}
MOST_S = 600.0
ALL = [
    ("channel", f"Measurement/{name}")
    for name in [*(f"Mic {k}" for k in range(1, 25)), "Vibrometer", "Generator"]
]
FRF = {"tab": "frf", "cursor": "500", "lines": "400", "estimator": "H3c"}


def browser() -> webdriver.Chrome:
    """A window without a screen, as large as that of a laptop."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for option in ("--headless=new", "--no-sandbox", "--hide-scrollbars", "--disable-gpu"):
        options.add_argument(option)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SIZE)
    return driver


def photograph(place: str, query: str, done: str, name: str) -> None:
    """Open a page, wait until a script says that it is done, and keep the picture."""
    server = subprocess.Popen(
        [sys.executable, "-m", "specan_cli", "inspect", place, "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
    )
    driver = browser()
    try:
        assert server.stdout is not None
        driver.get(server.stdout.readline().strip() + query)
        end = time.monotonic() + MOST_S
        while time.monotonic() < end and not driver.execute_script(
            f"const text = (n) => window.Bokeh?.documents[0]?.get_model_by_name(n)?.text ?? ''; return {done}"
        ):
            time.sleep(0.5)
        time.sleep(2.0)
        driver.save_screenshot(str(HERE / name))
    finally:
        driver.quit()
        server.terminate()
        server.wait()


def main() -> None:
    """All pictures."""
    gear, room = sys.argv[1:]
    calm = "!text('status').includes('...')"
    photograph(str(NOISE), "?" + urlencode(ALL), f"text('overall') && {calm}", "inspect_octave.png")
    photograph(
        str(NOISE),
        "?" + urlencode(FRF),
        f"text('readout').includes('coherence') && {calm}",
        "inspect_frf.png",
    )
    tried = "text('verdict') && text('status').includes('not accepted')"
    photograph(gear, "?tried=windage", tried, "inspect_study.png")
    photograph(room, "?tried=wall-impedance%40z1", tried, "inspect_room.png")


if __name__ == "__main__":
    main()
