"""Independent parts of a computation in several processes.

The others are copies of this one: they have everything that was worked out before, and send home what they return. So
a part may rest on anything, but must change nothing. Only Linux copies a process cheaply and safely; elsewhere, and in
a process with threads (a lock that another thread holds would never be given back), the parts are done here.

What is computed does not depend on the number of processes: what models keep to be faster is forgotten before every
part, because a product of matrices depends in its last digits on what is multiplied together.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any, Protocol, TypeVar

from specan.errors import SpecanError
from specan.models.kept import forget

Item = TypeVar("Item")
Result = TypeVar("Result")
Outcomes = dict[int, tuple[SpecanError | None, Any]]

_JOBS: ContextVar[int] = ContextVar("jobs", default=1)


class Progress(Protocol):
    """What is being done, and the share of the whole that is over before it."""

    def __call__(self, text: str, share: float | None = None) -> None:
        """Tell."""


def unheard(text: str, share: float | None = None) -> None:
    """A progress that nobody is told of."""


@contextmanager
def working(jobs: int) -> Iterator[None]:
    """Let `each` use so many processes."""
    before = _JOBS.set(jobs)
    try:
        yield
    finally:
        _JOBS.reset(before)


def each(work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """``[work(item) for item in items]``, in several processes where `working` allows it.

    Parameters
    ----------
    work : callable
        Takes much longer than a hundredth of a second, and changes nothing that is looked at later.

    Raises
    ------
    SpecanError
        That of the first item that raises one.
    """
    if len(items) < 2:
        return [work(item) for item in items]
    can_be_copied = sys.platform == "linux" and threading.active_count() == 1
    jobs = min(_JOBS.get(), len(items)) if can_be_copied else 1
    copies = [_copy(work, items, range(k, len(items), jobs)) for k in range(1, jobs)]
    try:
        done = _done(work, items, range(0, len(items), jobs))
        for process, source in copies:
            with suppress(EOFError):  # ended from outside: its parts are done here
                done |= source.recv()
            process.join()
    except BaseException:  # interrupted: the copies end with it
        for process, _ in copies:
            process.kill()
            process.join()
        raise
    done |= _done(work, items, [k for k in range(len(items)) if k not in done])
    for k in range(len(items)):
        fault = done[k][0]
        if fault is not None:
            raise fault
    return [done[k][1] for k in range(len(items))]


def _done(work: Callable[[Item], Result], items: Sequence[Item], parts: Iterable[int]) -> Outcomes:
    """Outcomes of parts, by their numbers."""
    found: Outcomes = {}
    with working(1):
        for k in parts:
            forget()
            try:
                found[k] = None, work(items[k])
            except SpecanError as fault:
                found[k] = fault, None
    forget()
    return found


def _copy(work: Callable[[Item], Result], items: Sequence[Item], parts: Iterable[int]) -> tuple[Any, Any]:
    """A process that does some of the parts, and where its results come from."""
    from multiprocessing import get_context

    context = get_context("fork")
    source, sink = context.Pipe(duplex=False)

    def send() -> None:
        with suppress(KeyboardInterrupt):
            sink.send(_done(work, items, parts))

    process = context.Process(target=send)
    process.start()
    sink.close()
    return process, source
