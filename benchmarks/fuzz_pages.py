"""Odd settings in the addresses of pages, and odd choices on them, without a browser.

    python benchmarks/fuzz_pages.py --values 6 --seed 1

Every field of the address of a recording's page and of a study's gets values that nobody means, by the address and by a
choice; numbers, command and figure are then asked for. A page must show a result or a sentence: an error of its own, or
one that leaves the page, is a fault.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import fuzz_commands
import numpy as np

FILES = ("noise.tdms", "timed.tdms", "a.csv", "a.mat", "pcm24.wav", "calibrator.tdms")


class AtOnce:
    """Jobs beside a page, done when they are asked for."""

    def __init__(self, workers: int) -> None:
        """As of a pool of threads."""

    def submit(self, job: Callable[..., None], *arguments: Any) -> None:
        """Do it."""
        job(*arguments)

    def shutdown(self, **_: Any) -> None:
        """As of a pool of threads."""


class Errors(logging.Handler):
    """Errors that a page tells the terminal."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep what was raised."""
        self.seen.append(f"{record.getMessage()}: {record.exc_info[1]!r}" if record.exc_info else record.msg)


def opened(fill: Callable[[Any], Any], arguments: dict[str, list[bytes]]) -> Any:
    """A page for an address."""
    from bokeh.document import Document

    document = Document()
    document._session_context = lambda: SimpleNamespace(request=SimpleNamespace(arguments=arguments))
    page = fill(document)
    settle(page)
    return page


def settle(page: Any) -> None:
    """Everything that the page has put off."""
    for _ in range(50):
        waiting = list(page.document.session_callbacks)
        if not waiting:
            return
        for one in waiting:
            one.callback()  # which takes itself off the list


def pressed(page: Any, asked: Callable[[], None]) -> None:
    """Something that is done on a page."""
    asked()
    settle(page)


def of_page(
    fill: Callable[[Any], Any], arguments: dict[str, list[bytes]], chosen: dict[str, Any], drawn: bool = False
) -> list[str]:
    """What is wrong with a page that is opened at an address, and asked for everything."""
    errors, logger = Errors(), logging.getLogger("specan.inspect.work")
    logger.addHandler(errors)
    logger.propagate = False
    try:
        with mock.patch("specan.inspect.work.ThreadPoolExecutor", AtOnce), np.errstate(all="ignore"):
            page = opened(fill, arguments)
            if chosen:
                pressed(page, lambda: page.change(**chosen))
            for asked in (page._numbers, page._command, *([partial(page._save, "svg")] if drawn else [])):
                pressed(page, partial(page._pressed, asked))
    except Exception as fault:
        errors.seen.append(repr(fault))
    finally:
        logger.removeHandler(errors)
    return [f"{arguments} {chosen}: {text}"[:300] for text in errors.seen]


def recordings(place: Path, values: int, rng: np.random.Generator) -> Iterator[str]:
    """What is wrong with pages of recordings."""
    import specan
    from specan.inspect.opened import Opened, watched
    from specan.inspect.recording_page import RecordingPage
    from specan.inspect.view import OF_TABS, View

    tabs = list(OF_TABS)
    common = [(field, tabs) for field in View.model_fields if field != "settings"]
    own = [(field, [tab]) for tab, kind in OF_TABS.items() for field in kind.model_fields]
    for name in FILES:
        files = Opened((watched(specan.read(place / name), place / name),), ())
        fill = partial(RecordingPage, opened=files)
        keys = list(files.keys)
        for field, places in (*common, *own):
            for k in rng.permutation(len(fuzz_commands.ODD))[:values]:
                tab, odd = places[int(rng.integers(len(places)))], fuzz_commands.ODD[k]
                address = {"tab": [tab.encode()], field: [odd.encode()]}
                if tab == "orders" and field != "speed_hz":
                    address.setdefault("speed_hz", [b"10"])
                yield from (f"{name}: {text}" for text in of_page(fill, address, {}))
                change = {field: (odd,) if field == "channel" else odd}
                if field in ("reference", "tacho", "of", "instrument"):
                    change = {field: keys[int(rng.integers(len(keys)))]}
                yield from (f"{name}: {text}" for text in of_page(fill, {"tab": [tab.encode()]}, change))
        for tab in tabs:
            both = {"cursor": 100.0 * 10.0 ** float(rng.uniform(-3, 3)), "harmonics": True}
            yield from (f"{name}: {text}" for text in of_page(fill, {"tab": [tab.encode()]}, both, True))


def studies(place: Path) -> Iterator[str]:
    """What is wrong with the page of a study."""
    from specan.inspect.study_page import StudyPage
    from specan.inspect.trial import KeptStudy
    from specan_cli.study import open_study

    for words in ({}, {"tried": [b"stiffening"]}, {"microphone": [b"0/x"]}):
        fill = partial(StudyPage, kept=KeptStudy(open_study(place / "s", ())))
        yield from of_page(fill, words, {}, True)
    for odd in fuzz_commands.ODD:
        for field in ("tried", "microphone", "x"):
            fill = partial(StudyPage, kept=KeptStudy(open_study(place / "s", ())))
            yield from of_page(fill, {field: [odd.encode()]}, {})


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--values", type=int, default=4, help="odd values for each field")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        with contextlib.chdir(place):
            fuzz_commands.made(place)
        rng = np.random.default_rng(chosen.seed)
        for found in (recordings(place, chosen.values, rng), studies(place)):
            for text in found:
                wrong += 1
                print(text, flush=True)
    print(f"{wrong} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
