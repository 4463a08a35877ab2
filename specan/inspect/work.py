"""One job after the other beside the page; only the latest request is answered."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from bokeh.document import Document

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import SpecanError, reason_of

_TELL_S = 0.25


class Work:
    """A thread beside a document.

    Parameters
    ----------
    document : Document
        Whose lock is held when a result is shown.
    told : callable
        Shows the progress, a part of 1.
    failed : callable
        Shows what went wrong, a sentence.
    """

    def __init__(
        self, document: Document, told: Callable[[float], None], failed: Callable[[str], None]
    ) -> None:
        self._document, self._told, self._failed = document, told, failed
        self._thread = ThreadPoolExecutor(1)
        self._ticket = 0
        self._last = 0.0

    def ask(self, compute: Callable[[Tell], Any], show: Callable[[Any], None]) -> None:
        """Compute and show; whatever was asked before is forgotten."""
        self._ticket += 1
        self._thread.submit(self._do, self._ticket, compute, show)

    def close(self) -> None:
        """The page is gone."""
        self._ticket += 1
        self._thread.shutdown(wait=False, cancel_futures=True)

    def later(self, show: Callable[[], None]) -> None:
        """Run in the document, if the request that is at work is still the latest one."""
        ticket = self._ticket
        self._document.add_next_tick_callback(lambda: show() if ticket == self._ticket else None)

    def _do(self, ticket: int, compute: Callable[[Tell], Any], show: Callable[[Any], None]) -> None:
        def tell(part: float) -> bool:
            now = time.monotonic()
            if now - self._last > _TELL_S and ticket == self._ticket:
                self._last = now
                self.later(lambda: self._told(part))
            return ticket == self._ticket

        if ticket != self._ticket:
            return
        self._last = time.monotonic()
        try:
            found = compute(tell)
        except Superseded:
            return
        except Exception as fault:
            # The page must go on: what is unexpected is told there, and in full on the terminal.
            if not isinstance(fault, SpecanError):
                logging.getLogger(__name__).exception("internal error on the page")
            message = reason_of(fault)
            self.later(lambda: self._failed(message))
            return
        if ticket == self._ticket:
            self._document.add_next_tick_callback(lambda: show(found) if ticket == self._ticket else None)


Tell = Callable[[float], bool]  # hears the part done, says whether to go on


class Superseded(Exception):
    """Another request came before this one was done."""


def heard(recording: Recording, tell: Tell) -> Recording:
    """The same recording, which tells how much of a section an analysis has read, and ends it when told so.

    Raises
    ------
    Superseded
        On reading: `tell` said not to go on.
    """

    def watch(blocks: Iterator[Real], channels: Sequence[Channel], length: int) -> Iterator[Real]:
        done = 0
        for samples in blocks:
            yield samples
            done += samples.shape[1]
            if not tell(done / length):
                raise Superseded

    return replace(recording, watch=watch)
