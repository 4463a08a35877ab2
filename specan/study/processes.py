"""Independent parts of a computation in several processes.

The others are copies of this one: they have everything that was worked out before, and send home what they return. So
a part may rest on anything, but must change nothing. Only Linux copies a process cheaply and safely; elsewhere, and in
a process with threads (a lock that another thread holds would never be given back), the parts are done here.

What is computed does not depend on the number of processes: what models keep to be faster is forgotten before every
part, because a product of matrices depends in its last digits on what is multiplied together.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any, TypeVar

from specan.errors import SpecanError
from specan.models.kept import forget

Item = TypeVar("Item")
Result = TypeVar("Result")

_JOBS: ContextVar[int] = ContextVar("jobs", default=1)


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
    waiting = _Waiting(len(items))
    copies = (
        [_copy(work, items, waiting) for _ in range(1, min(_JOBS.get(), len(items)))]
        if _can_be_copied()
        else []
    )
    try:
        done = _done(work, items, waiting)
        for copy in copies:
            done |= _received(*copy)
    except BaseException:  # interrupted: the copies end with it
        for process, source in copies:
            with suppress(ProcessLookupError, ChildProcessError, OSError):
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
                os.close(source)
        raise
    finally:
        waiting.close()
    # A copy that was ended from outside has sent nothing: its parts are done here.
    done |= _done(work, items, [k for k in range(len(items)) if k not in done])
    for k in range(len(items)):
        fault = done[k][0]
        if fault is not None:
            raise fault
    return [done[k][1] for k in range(len(items))]


class _Waiting:
    """Numbers of the parts that no process has begun: a pipe, from which each takes the next."""

    def __init__(self, count: int) -> None:
        self._source, sink = os.pipe()
        with os.fdopen(sink, "wb") as file:
            file.write(b"".join(k.to_bytes(4, "little") for k in range(count)))

    def __iter__(self) -> Iterator[int]:
        while number := os.read(self._source, 4):
            yield int.from_bytes(number, "little")

    def close(self) -> None:
        os.close(self._source)


Outcomes = dict[int, tuple[SpecanError | None, Any]]


def _can_be_copied() -> bool:
    return sys.platform == "linux" and threading.active_count() == 1


def _done(work: Callable[[Item], Result], items: Sequence[Item], waiting: Iterable[int]) -> Outcomes:
    """Outcomes of parts, by their numbers."""
    found: Outcomes = {}
    with working(1):
        for k in waiting:
            forget()
            try:
                found[k] = None, work(items[k])
            except SpecanError as fault:
                found[k] = fault, None
    forget()
    return found


def _copy(work: Callable[[Item], Result], items: Sequence[Item], waiting: _Waiting) -> tuple[int, int]:
    """A process that does some of the parts, and where its results come from."""
    source, sink = os.pipe()
    process = os.fork()
    if process:
        os.close(sink)
        return process, source
    try:
        os.close(source)
        with os.fdopen(sink, "wb") as pipe:
            pickle.dump(_done(work, items, waiting), pipe, pickle.HIGHEST_PROTOCOL)
    finally:
        os._exit(0)  # nothing that the other process has begun to write is written twice


def _received(process: int, source: int) -> Outcomes:
    """What a process sends home; nothing where it was ended before."""
    with os.fdopen(source, "rb") as pipe:
        sent = pipe.read()
    os.waitpid(process, 0)
    try:
        found: Outcomes = pickle.loads(sent)
    except (EOFError, pickle.UnpicklingError):
        return {}
    return found
