"""Files spread over processes; results come back as they are ready, and a dead worker costs one file."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future

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
    waiting, suspects = yield from _round(items, waiting, work, prepare, context, jobs)
    while waiting or suspects:
        # Some process died, and nobody knows over which item: those in work are tried one at a time.
        for position in suspects:
            _, dead = yield from _round(items, [position], work, prepare, context, 1)
            if dead:
                yield position, on_death(items[position])
        waiting, suspects = yield from _round(items, waiting, work, prepare, context, jobs)


def _round(
    items: Sequence[Item],
    positions: Sequence[int],
    work: Callable[[Item], Result],
    prepare: Callable[..., None],
    context: tuple[Any, ...],
    jobs: int,
) -> Generator[tuple[int, Result], None, tuple[list[int], list[int]]]:
    """Work until done or until a process dies; returns what was not begun and what was in work then."""
    # Loaded here: a batch in one process does without.
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    waiting = list(positions)[::-1]
    running: dict[Future[Result], int] = {}
    if not waiting:
        return [], []
    # A copy of this process has everything loaded, a new one takes 0.4 s. Copied are processes without threads only: a
    # lock that another thread holds would never be given back. Other systems than Linux begin new ones.
    copied = sys.platform == "linux" and threading.active_count() == 1
    context_of = multiprocessing.get_context("fork" if copied else "spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(min(jobs, len(waiting)), context_of, _begin, (prepare, *context))
    try:
        while waiting or running:
            # Two for each process: none waits while a result is put away here.
            while waiting and len(running) < 2 * jobs:
                position = waiting.pop()
                running[pool.submit(work, items[position])] = position
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                result = future.result()
                yield running.pop(future), result
    except BrokenProcessPool:
        return waiting[::-1], sorted(running.values())
    except BaseException:  # interrupted, or not wanted any more: nobody waits for what is in work
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return [], []


def _begin(prepare: Callable[..., None], *context: Any) -> None:
    """Prepare a process; it leaves interruptions to the one that began it, and ends with that one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare(*context)


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
