"""Parts of the page that need no browser."""

import html
import os
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan_cli.inspect import command

pytest.importorskip("bokeh")

from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.statistics import low_and_high
from specan.errors import InputError, RequestError
from specan.inspect.look import notice
from specan.inspect.opened import Opened, watched
from specan.inspect.plots import plain
from specan.inspect.server import start_server
from specan.inspect.tabs import OctaveTab
from specan.inspect.view import View
from specan.inspect.work import Superseded
from specan.report.html_page import table
from specan.report.waveform import DIRECT, STEP, Waveform, read_overviews

RATE = 8000.0
NOISE = np.random.default_rng(1)


def go_on(part: float) -> bool:
    return True


def recording(seconds: float = 4.0, count: int = 3, unit: str = "Pa") -> Recording:
    n = int(seconds * RATE)
    channels = tuple(
        Channel(f"Mic {k}", "G", unit=unit, role="microphone", sampling_rate=RATE, n_samples=n)
        for k in range(count)
    )
    return Recording("a.tdms", channels, ArraySource([NOISE.standard_normal(n) for _ in channels]))


class Counting:
    """A long recording that is made up as it is read, and knows how much was."""

    def __init__(self) -> None:
        self.read_samples = 0

    def read(self, indices, start, stop):
        self.read_samples += stop - start
        return np.sin(np.arange(start, stop) / 1000.0)[None].repeat(len(indices), axis=0)


def hour() -> tuple[Recording, Counting]:
    source = Counting()
    channel = Channel("Mic", "G", unit="Pa", sampling_rate=RATE, n_samples=int(3600 * RATE))
    return Recording("hour.tdms", (channel,), source), source


# --- settings in the address ----------------------------------------------------------------------


def test_a_view_comes_back_from_its_address():
    from urllib.parse import parse_qs

    view = View().but(tab="frf", channel=("G/Mic 1", "2:G/ä & b"), start=0.25, stop=1.5, estimator="H2",
                      overlap="0.75", harmonics=True, cursor=123.456, lines=800, unwrap=True)  # fmt: skip
    arguments = {k: [v.encode() for v in values] for k, values in parse_qs(view.query).items()}
    assert View.from_arguments(arguments) == view
    assert view.settings == {"estimator": "H2", "overlap": 0.75, "lines": 800, "unwrap": True}


@pytest.mark.parametrize(
    "query", [{"fraction": [b"5"]}, {"path": [b"/etc/passwd"]}, {"start": [b"3"], "stop": [b"2"]}]
)
def test_an_address_that_cannot_be_is_refused(query):
    with pytest.raises(RequestError):
        View.from_arguments(query)


# --- waveforms ------------------------------------------------------------------------------------


def test_decimation_keeps_every_extreme():
    samples = NOISE.standard_normal(10_007)
    samples[4321] = 99.0
    low, high = low_and_high(samples, 100)
    assert high.max() == 99.0
    assert low.min() == samples.min()


def test_a_short_part_is_drawn_sample_by_sample():
    one = recording()
    times, values = Waveform(one, one.channels[0]).part(0.1, 0.11, 1000)
    assert np.array_equal(values, one.source.samples[0][800:881])
    assert times[0] == pytest.approx(0.1)


def test_an_hour_is_read_once_and_then_pans_without_reading_it_again():
    one, source = hour()
    waveform = Waveform(one, one.channels[0])
    assert waveform.needs_overview(0.0, 3600.0)
    read_overviews([waveform], go_on)
    assert source.read_samples == one.channels[0].n_samples
    times, values = waveform.part(0.0, 3600.0, 1500)
    assert source.read_samples == one.channels[0].n_samples
    assert times.size == 3000
    assert values.min() == pytest.approx(-1, abs=1e-5)
    waveform.part(1000.0, 1010.0, 1500)
    assert source.read_samples - one.channels[0].n_samples <= 10 * RATE + 2


def test_what_is_not_read_yet_is_a_gap():
    one, _ = hour()
    waveform = Waveform(one, one.channels[0])
    waveform.read_on()
    _, values = waveform.part(0.0, 3600.0, 500)
    assert np.isfinite(values[0])
    assert np.isnan(values[-1])
    assert DIRECT > STEP


# --- band levels ----------------------------------------------------------------------------------


def octave_tab(one: Recording, **settings) -> tuple[OctaveTab, View]:
    opened = Opened((one,))
    view = View().but(channel=tuple(opened.keys), **settings)
    return OctaveTab(opened, view, lambda **changes: None), view


def test_band_levels_are_those_of_the_command():
    one = recording()
    tab, view = octave_tab(one, fraction=12, weighting="A")
    ((_, found),) = tab.compute(view, go_on)
    settings = Octave(fraction=12, weighting="A", channels=tuple(c.path for c in one.channels))
    assert found.level_dB.tolist() == settings(one).level_dB.tolist()
    tab.draw([(0, found)], view)
    assert tab.plots.first.source.data["name"] == ["Mic 0", "Mic 1", "Mic 2"]


def test_work_that_nobody_waits_for_ends():
    tab, view = octave_tab(recording(60.0, 1))
    with pytest.raises(Superseded):
        tab.compute(view, lambda part: False)


def test_a_weighting_is_for_sound_pressure():
    tab, view = octave_tab(recording(unit="m/s"), weighting="A")
    with pytest.raises(RequestError, match="Pa"):
        tab.compute(view, go_on)


def test_zeros_and_a_tenth_of_a_second():
    channel = Channel("Mic", "G", unit="Pa", sampling_rate=RATE, n_samples=800)
    tab, view = octave_tab(Recording("z.tdms", (channel,), ArraySource([np.zeros(800)])))
    ((_, found),) = tab.compute(view, go_on)
    assert found.flags == (("dead",),)
    assert np.isneginf(found.level_dB).all()
    tab.draw([(0, found)], view)
    assert low_and_high(np.zeros(800), 300)[0].max() == 0.0


# --- level against time ---------------------------------------------------------------------------


def test_the_level_against_time_is_that_of_the_verb():
    from specan.inspect.tabs import LevelsTab

    opened = Opened((recording(2.0, 2),))
    view = View().but(tab="levels", channel=("G/Mic 0", "G/Mic 1"), weighting="C", averaging="slow")
    tab = LevelsTab(opened, view, lambda **changes: None)
    found = tab.compute(view, go_on)
    tab.draw(found, view)
    interval = float(tab.plots.first.source.data["x"][0][2])
    whole = Octave(averaging="slow", interval_s=interval)(opened.recordings[0]).history
    for row, drawn in enumerate(tab.plots.first.source.data["y"]):
        np.testing.assert_allclose(drawn[1::2], whole.overall_dB["C"][row], atol=1e-9)
    assert "Mic 1" in tab.numbers.text


# --- safety ---------------------------------------------------------------------------------------


def test_names_are_text():
    bad = "<img src=x onerror=alert(1)>$$x$$"
    assert "<img" not in table([bad], [[bad]]) + notice(bad)
    assert html.escape(bad) in notice(bad)
    assert "$$" not in plain(bad)


def test_a_port_in_use_is_named():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(RequestError, match=f"port {port}"):
            start_server(lambda document: None, port=port)


def test_an_address_that_is_not_ours_is_named():
    with pytest.raises(RequestError, match="not an address of this machine"):
        start_server(lambda document: None, address="192.0.2.1")


def test_the_page_is_served_to_this_machine_alone_and_holds_no_outside_address():
    import asyncio
    import re
    import urllib.error
    import urllib.parse
    import urllib.request

    found = {}
    ready, asked = threading.Event(), threading.Event()

    def serve() -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        server = start_server(lambda document: None)
        found["url"], found["sockets"] = server.url, server._http._sockets.values()
        found["names"] = [s.getsockname()[0] for s in found["sockets"]]
        ready.set()

        def look() -> None:
            if asked.is_set():
                server.io_loop.stop()
            else:
                server.io_loop.call_later(0.05, look)

        look()
        server.io_loop.start()
        server.stop()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        assert ready.wait(10)
        assert found["names"] == ["127.0.0.1"]
        text = urllib.request.urlopen(found["url"], timeout=10).read().decode()
        sources = re.findall(r'(?:src|href)="([^"]+)"', text)
        assert sources
        own = urllib.parse.urlsplit(found["url"]).path
        assert all(s.startswith(f"{own}static/") for s in sources), sources
        for path in ("etc/passwd", "static/../../../etc/passwd", "a.tdms"):
            with pytest.raises(urllib.error.HTTPError):
                urllib.request.urlopen(found["url"] + path, timeout=10)
    finally:
        asked.set()
        thread.join(10)


# --- a file that changes --------------------------------------------------------------------------


def test_a_file_that_changes_or_vanishes_is_told(tmp_path: Path):
    path = tmp_path / "a.tdms"
    path.write_bytes(b"1")
    one = watched(recording(), path)
    assert one.read(one.channels, 0, 10).shape == (3, 10)
    os.utime(path, ns=(1, 1))
    with pytest.raises(InputError, match="changed"):
        one.read(one.channels, 0, 10)
    path.unlink()
    with pytest.raises(InputError, match="cannot be reached"):
        one.read(one.channels, 0, 10)


def test_channels_of_two_files_are_told_apart():
    opened = Opened((recording(), recording(2.0, 1)))
    assert "2:G/Mic 0" in opened.keys
    assert [c.number for c in opened.chosen(["G/Mic 1", "2:G/Mic 0"])] == [0, 1]
    assert opened.text(0, "Mic 0") != "Mic 0"


def test_the_command_refuses_what_does_not_go_together(tmp_path: Path):
    result = CliRunner().invoke(command, [str(tmp_path), "--overlay", "b.tdms"])
    assert isinstance(result.exception, RequestError)
    result = CliRunner().invoke(command, [str(tmp_path / "none.tdms"), "--no-browser"])
    assert isinstance(result.exception, (RequestError, InputError))


# --- what is not as one expects -------------------------------------------------------------------


def hour_of_silence_with_a_click(path: Path, rate: int = 8000) -> int:
    """A WAV file of an hour that takes hardly any room on the disk; the place of its only sample that is not zero."""
    count = 3600 * rate
    header = b"RIFF" + (36 + 2 * count).to_bytes(4, "little") + b"WAVEfmt " + (16).to_bytes(4, "little")
    header += b"".join(
        n.to_bytes(w, "little") for n, w in ((1, 2), (1, 2), (rate, 4), (2 * rate, 4), (2, 2), (16, 2))
    )
    header += b"data" + (2 * count).to_bytes(4, "little")
    place = count - rate // 3
    with path.open("wb") as file:
        file.write(header)
        file.seek(len(header) + 2 * place)
        file.write((-12345).to_bytes(2, "little", signed=True))
        file.truncate(len(header) + 2 * count)
    return place


def test_an_hour_from_the_disk_shows_its_only_click(tmp_path: Path):
    from specan.io.open import open_recording

    path = tmp_path / "hour.wav"
    place = hour_of_silence_with_a_click(path)
    try:
        one = open_recording(path)
        waveform = Waveform(one, one.channels[0])
        parts = []
        read_overviews([waveform], lambda part: parts.append(part) or True)
        assert parts[-1] == 1.0
        assert len(parts) > 10  # progress
        times, values = waveform.part(0.0, 3600.0, 1500)
        assert times[np.argmin(values)] == pytest.approx(place / 8000, abs=3600 / 1500)
        times, values = waveform.part(3599.0, 3600.0, 20_000)
        assert times[np.argmin(values)] == pytest.approx(place / 8000, abs=1e-9)
    finally:
        path.unlink()


def test_no_browser_is_told_and_the_page_is_served(tmp_path: Path):
    import subprocess
    import sys
    import urllib.request

    knock = Path(__file__).parents[2] / "sample_data" / "recordings" / "knock.tdms"
    bare = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")}
    process = subprocess.Popen(
        [sys.executable, "-m", "specan_cli", "inspect", str(knock)], env={**bare, "PATH": str(tmp_path)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        url = process.stdout.readline().strip()
        assert "No browser was found" in process.stderr.readline()
        assert b"bokeh" in urllib.request.urlopen(url, timeout=30).read().lower()
    finally:
        process.terminate()
        process.communicate(timeout=20)


def test_a_line_that_is_dragged_moves_the_cursor():
    moved: list[float] = []
    tab = OctaveTab(Opened([recording()]), View(), lambda **changes: moved.append(changes["cursor"]))
    figure = tab.figures[0]
    (line,) = figure.sheet.select({"name": "cursor-line"})
    assert line.editable
    figure.cursor(500.0, False)
    assert (line.location, moved) == (500.0, [])  # what the page shows is no drag
    line.location = 812.345678
    assert moved == [812.346]
