"""Files spread over processes; results come back as they are ready, and a dead worker costs one file."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def spread(
    items: Sequence[Item],
    work: Callable[[Item], Result],
    jobs: int,
    on_death: Callable[[Item], Result],
) -> Iterator[tuple[int, Result]]:
    """Position and result of every item, in the order in which they are ready.

    Parameters
    ----------
    work : callable
        Called with one item; a function of a module, since processes may be new ones (as on Windows).
    jobs : int
        Number of processes; with 1 the work is done in this one.
    on_death : callable
        Gives the result of an item whose process was ended from outside (out of memory, killed).
    """
    if jobs == 1 or len(items) < 2:
        for position, item in enumerate(items):
            yield position, work(item)
        return
    waiting = list(range(len(items)))
    while waiting:
        dead, waiting = yield from _round(items, waiting, work, jobs)
        # Other processes may have taken the memory that the dead one asked for: its item is tried once more, alone.
        for position in dead:
            dead_again, _ = yield from _round(items, [position], work, 1)
            if dead_again:
                yield position, on_death(items[position])


def _round(
    items: Sequence[Item],
    positions: Sequence[int],
    work: Callable[[Item], Result],
    jobs: int,
) -> Generator[tuple[int, Result], None, tuple[list[int], list[int]]]:
    """Work until a process dies; returns what was in work then, and what has not begun."""
    # Loaded here: a batch in one process does without.
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    # A copy of this process has everything loaded, a new one takes 0.4 s. Copied are processes without threads only: a
    # lock that another thread holds would never be given back. Other systems than Linux begin new ones.
    copied = sys.platform == "linux" and threading.active_count() == 1
    jobs, waiting = min(jobs, len(positions)), list(positions)[::-1]
    running: dict[Any, int] = {}
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("fork" if copied else "spawn"), _begin)
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                running[pool.submit(work, items[waiting[-1]])] = waiting[-1]
                waiting.pop()
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                yield running[done], done.result()
                del running[done]
    except BrokenProcessPool:
        return sorted(running.values()), waiting[::-1]
    finally:  # interrupted, or not wanted any more: nobody waits for what is in work
        for worker in list((pool._processes or {}).values()):
            worker.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
    return [], []


def _begin() -> None:
    """Interruptions are left to the process that began this one, which ends with that one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
