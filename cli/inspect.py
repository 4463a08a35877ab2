"""``specan inspect``: a recording or a study on an interactive page."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import InputError, RequestError, library
from specan_cli.options import opening_options, opt
from specan_cli.output import say
from specan_cli.verb import given

if TYPE_CHECKING:
    from bokeh.document import Document


@click.command("inspect")
@click.argument("place", type=click.Path(path_type=Path), metavar="FILE|STUDY")
@opt("--overlay", Path, "A second recording, shown together with the first.", "FILE")
@opt("--address", None, "Network address of the page.", default="127.0.0.1", show_default=True)
@opt("--port", click.IntRange(0, 65535), "Port of the page.  [default: a free one]", "N", default=0)
@opt("--no-browser", bool, "Print the address only; do not open a browser.")
@opt(
    "--effect effects", Path, "For a study: add and trust a Python file with your own effects; repeatable.", "FILE",
    multiple=True,
)  # fmt: skip
@opening_options
def command(
    place: Path,
    overlay: Path | None,
    address: str,
    port: int,
    no_browser: bool,
    effects: tuple[Path, ...],
    **opening: Any,
) -> int:
    """Show a recording or a study in the browser.

    The page is served to this machine only and shows nothing else. Its address contains its settings. Ctrl-C
    ends it.

    \b
    specan inspect sample_data/recordings/knock.tdms
    specan inspect my_study
    """
    if place.is_dir():
        if overlay is not None:
            raise RequestError("a study has no --overlay", remedy="leave it out")
        fill = _study(place, effects)
    else:
        if effects:
            raise RequestError("--effect is for a study", remedy="leave it out")
        fill = _recording(place, overlay, opening)
    from specan.inspect.server import start_server

    server = start_server(fill, address, port)
    click.echo(server.url)
    if address not in ("127.0.0.1", "localhost", "::1"):
        say(f"Note: everybody who reaches {address} can look at this page.")
    if not no_browser and not webbrowser.open(server.first_url):
        say("No browser was found: open the address above in one.")
    say("Ctrl-C ends it.")
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        say("Ended.")
    finally:
        server.stop()
    return 0


def _recording(place: Path, overlay: Path | None, opening: dict[str, Any]) -> Callable[[Document], object]:
    from specan.api.recordings import read
    from specan.inspect.opened import Opened, watched

    library("bokeh", "inspect")
    from specan.inspect.recording_page import RecordingPage

    paths = [place] if overlay is None else [place, overlay]
    arguments = [
        text
        for name, value in given(**opening).items()
        for text in (f"--{name.replace('_', '-')}", str(value))
    ]
    opened = Opened(tuple(watched(read(path, **opening), path) for path in paths), tuple(arguments))
    if not opened.keys:
        raise InputError(f"{place} has no channel with samples and a sampling rate")

    return partial(RecordingPage, opened=opened)


def _study(place: Path, effects: tuple[Path, ...]) -> Callable[[Document], object]:
    from specan_cli.study import open_study

    study = open_study(place, effects)
    library("bokeh", "inspect")
    from specan.inspect.study_page import StudyPage
    from specan.inspect.trial import KeptStudy

    return partial(StudyPage, kept=KeptStudy(study))
