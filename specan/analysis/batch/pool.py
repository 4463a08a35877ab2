"""Files spread over processes; results come back as they are ready, and a dead worker costs one file."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

Item = TypeVar("Item")
Result = TypeVar("Result")


def spread(
    items: Sequence[Item],
    work: Callable[[Item], Result],
    prepare: Callable[..., None],
    context: tuple[Any, ...],
    jobs: int,
    on_death: Callable[[Item], Result],
) -> Iterator[tuple[int, Result]]:
    """Position and result of every item, in the order in which they are ready.

    Parameters
    ----------
    work : callable
        Called with one item; a function of a module, since processes may be new ones (as on Windows).
    prepare, context : callable and tuple
        Called once in each process as ``prepare(*context)`` before any work.
    jobs : int
        Number of processes; with 1 the work is done in this one.
    on_death : callable
        Gives the result of an item whose process was ended from outside (out of memory, killed).
    """
    if jobs == 1 or len(items) < 2:
        prepare(*context)
        for position, item in enumerate(items):
            yield position, work(item)
        return
    waiting = list(range(len(items)))
    while waiting:
        dead, waiting = yield from _round(items, waiting, work, prepare, context, jobs)
        # Other processes may have taken the memory that the dead one asked for: its item is tried once more, alone.
        for position in dead:
            dead_again, _ = yield from _round(items, [position], work, prepare, context, 1)
            if dead_again:
                yield position, on_death(items[position])


def _round(
    items: Sequence[Item],
    positions: Sequence[int],
    work: Callable[[Item], Result],
    prepare: Callable[..., None],
    context: tuple[Any, ...],
    jobs: int,
) -> Generator[tuple[int, Result], None, tuple[list[int], list[int]]]:
    """Work until every process has ended; returns what a process died over, and what none has begun.

    This process only takes in results: it shares the cores with the others.
    """
    # Loaded here: a batch in one process does without.
    import multiprocessing
    from multiprocessing.connection import wait

    # A copy of this process has everything loaded, a new one takes 0.4 s. Copied are processes without threads only: a
    # lock that another thread holds would never be given back. Other systems than Linux begin new ones.
    copied = sys.platform == "linux" and threading.active_count() == 1
    processes: Any = multiprocessing.get_context("fork" if copied else "spawn")
    begun = processes.Value("q", 0)
    workers: dict[Any, Any] = {}
    done: set[int] = set()
    try:
        for _ in range(min(jobs, len(positions))):
            source, sink = processes.Pipe(duplex=False)
            told = (sink, begun, items, positions, work, prepare, context)
            worker = processes.Process(target=_serve, args=told, daemon=True)
            worker.start()
            sink.close()  # the end of the process is the end of what can be read
            workers[source] = source, worker
        while workers:
            for source in wait(list(workers)):
                try:
                    outcome: tuple[int, Any, Exception | None] = workers[source][0].recv()
                except (EOFError, OSError):
                    workers.pop(source)[1].join()
                    continue
                position, result, fault = outcome
                if fault is not None:
                    raise fault
                done.add(position)
                yield position, result
    finally:  # interrupted, or not wanted any more: nobody waits for what is in work
        for _, worker in workers.values():
            worker.terminate()
    count = begun.value
    return [p for p in positions[:count] if p not in done], list(positions[count:])


def _serve(
    sink: Connection,
    begun: Any,
    items: Sequence[Item],
    positions: Sequence[int],
    work: Callable[[Item], Result],
    prepare: Callable[..., None],
    context: tuple[Any, ...],
) -> None:
    """Work on what nobody has begun, until nothing is left.

    Interruptions are left to the process that began this one, which ends with that one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare(*context)
    while True:
        with begun.get_lock():
            number = begun.value
            begun.value = min(number + 1, len(positions))
        if number == len(positions):
            return
        try:
            sink.send((positions[number], work(items[positions[number]]), None))
        except Exception as fault:
            sink.send((positions[number], None, fault))


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
