"""Files spread over the workers of a dask cluster, which read them from a path that all machines share."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import Task, analyse_unchanged
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.store import program_identity, state_of
from specan.errors import RequestError, library

if TYPE_CHECKING:
    from distributed import Client, Future

# Seconds: for the scheduler to answer, and for a first worker, or another after the last one has gone.
ANSWER, WORKER = 5.0, 30.0
_EXAMPLE = "that of a dask scheduler, such as tcp://host:8786"


@dataclass(frozen=True)
class Refusal:
    """A worker cannot do a task; `everywhere` where no other worker should try."""

    worker: str
    reason: str
    everywhere: bool = False


def spread_over_cluster(
    address: str, tasks: Sequence[Task], warn: Callable[[str], None]
) -> Iterator[tuple[int, FileResult]]:
    """Position and result of every file, in the order in which they are ready.

    A file whose worker dies, or does not see it, is given to another worker.

    Parameters
    ----------
    address : str
        Of the scheduler.
    warn : callable
        Told once for each worker that does not see a file.

    Raises
    ------
    RequestError
        The scheduler does not answer, has no workers or is lost, a worker runs another version, or no
        worker sees a file.
    """
    if not tasks:
        return
    with _connected(address) as client:
        try:
            yield from _results(client, tasks, warn)
        except (CancelledError, OSError) as fault:
            raise RequestError(
                f"the connection to the scheduler {address} was lost ({type(fault).__name__})",
                remedy="start it and repeat the command; finished results are kept",
            ) from None


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    distributed = library("distributed", "cluster")
    if not re.fullmatch(r"(\w+://)?[^/]+:\d+", address):
        raise RequestError(f"{address!r} is not an address of a cluster", expected=_EXAMPLE)
    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise RequestError(
            f"the cluster address {address} does not answer ({str(fault).splitlines()[0]})",
            expected=_EXAMPLE,
            remedy="start one with 'dask scheduler', or check the address",
        ) from None
    try:
        yield client
    finally:
        client.close(timeout=ANSWER)


def _ready(client: Client, running: Mapping[Future, int]) -> list[Future]:
    """Tasks that have ended; none where that takes long."""
    from distributed import wait

    try:
        with client.as_current():
            return list(wait(list(running), timeout=WORKER, return_when="FIRST_COMPLETED").done)
    except TimeoutError:
        if not client.nthreads():
            _wait_for_workers(client)
        return []


def _results(
    client: Client, tasks: Sequence[Task], warn: Callable[[str], None]
) -> Iterator[tuple[int, FileResult]]:
    """Keep every worker busy until all is done; few tasks are under way, so that memory stays bounded."""
    running: dict[Future, int] = {}
    refused: dict[int, dict[str, str]] = defaultdict(dict)  # position to worker to reason
    told: set[str] = set()
    waiting = list(range(len(tasks)))[::-1]
    _wait_for_workers(client)
    while waiting or running:
        room = 2 * sum(client.nthreads().values()) - len(running)
        for _ in range(min(max(room, 0 if running else 1), len(waiting))):
            position = waiting.pop()
            task = tasks[position]
            others = [worker for worker in client.nthreads() if worker not in refused[position]]
            allowed = others if refused[position] else None
            sent = client.submit(
                run_task, task, state_of(task.entry.path), program_identity(), pure=False, workers=allowed
            )
            running[sent] = position
        for future in _ready(client, running):
            position = running.pop(future)
            found = _result(future, tasks[position].entry)
            if isinstance(found, FileResult):
                yield position, found
                continue
            refused[position][found.worker] = found.reason
            if found.everywhere or not set(client.nthreads()) - set(refused[position]):
                remedy = "mount the recordings under the same path on every worker; finished results are kept"
                if found.everywhere:
                    remedy = "install the same versions everywhere and restart the workers"
                raise RequestError(found.reason, remedy=remedy)
            if found.worker not in told:
                told.add(found.worker)
                warn(f"{found.reason}; its files go to other workers.")
            waiting.append(position)


def _wait_for_workers(client: Client) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKER)
    except TimeoutError:
        raise RequestError(
            f"the scheduler {client.scheduler.address} has no worker",  # type: ignore[union-attr]
            remedy="start some with 'dask worker ADDRESS'; finished results are kept",
        ) from None


def _result(future: Future, entry: Input) -> FileResult | Refusal:
    from distributed import KilledWorker

    try:
        found: FileResult | Refusal = future.result()
    except KilledWorker:
        reason = "every worker that analysed it was killed (out of memory?); run it alone"
        return FileResult(entry.label, "failed", reason)
    except ImportError as fault:
        raise RequestError(
            f"a worker of the cluster cannot load specan ({fault})", remedy="install it on every worker"
        ) from None
    return found


def run_task(task: Task, wanted: tuple[int, int] | None, program: str) -> FileResult | Refusal:
    """Analyse one file on a worker, where program and file are those that are wanted."""
    from distributed import get_worker

    worker: Any = get_worker().address
    mine = program_identity()
    if mine != program:
        return Refusal(worker, f"the worker {worker} runs {mine}, and this is {program}", everywhere=True)
    seen = state_of(task.entry.path)
    if wanted is not None and wanted != seen:
        what = "cannot read" if seen is None else "sees another file at"
        return Refusal(worker, f"the worker {worker} {what} {task.entry.path}")
    return analyse_unchanged(task)
