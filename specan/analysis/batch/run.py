"""A batch from its directories to its tables.

Decisions: docs/decisions/batch.md.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan.analysis.batch.calibrations import assign_calibrations, fingerprint
from specan.analysis.batch.inputs import (
    Input,
    check_own,
    check_table,
    claim,
    find_inputs,
    is_of_a_batch,
    remember_own,
)
from specan.analysis.batch.one_file import Task, analyse_unchanged
from specan.analysis.batch.pool import spread
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import Kept, Store, keys_of
from specan.analysis.batch.tables import write_tables
from specan.dsp.multirate import keep_freed_memory
from specan.errors import RequestError
from specan.io.calibration_file import read_calibration
from specan.io.channel_table import read_channel_table
from specan.io.results_text import COLUMNS, OPTIONAL, read_table
from specan.result import Result

if TYPE_CHECKING:
    import pandas as pd

STORE = ".specan"
# Below this many bytes of recordings another process costs more than it gains.
WORTH_A_PROCESS = 100_000_000


@dataclass(frozen=True, repr=False)
class BatchReport(Result):
    """What a batch has done.

    Attributes
    ----------
    results : tuple of FileResult
        Sorted by label, without their lines.
    tables : tuple of Path
        The files that were written.
    rows : tuple of int
        Their numbers of rows.
    resumed : int
        Number of results that an earlier batch had left.
    calibration : tuple of str
        Which calibrations were applied; ``no file`` where there is none.
    inputs : tuple of Input
        Files that are no calibrator recordings.
    """

    results: tuple[FileResult, ...]
    tables: tuple[Path, ...]
    rows: tuple[int, ...]
    resumed: int = 0
    calibration: tuple[str, ...] = ()
    inputs: tuple[Input, ...] = ()

    dimensions = ("file",)

    def summary(self) -> str:
        """What it is, on one line."""
        counts = ", ".join(
            f"{len(self.of_kind(kind))} {words}"
            for kind, words in (("done", "analysed"), ("aside", "skipped"), ("failed", "failed"))
        )
        return f"{counts}; tables in {self.tables[0].parent}"

    def columns(self) -> dict[str, Any]:
        """One row for each file."""
        return {
            "file": [r.label for r in self.results],
            "kind": [r.kind for r in self.results],
            "reason": [r.reason for r in self.results],
        }

    def table(self, name: str) -> pd.DataFrame:
        """One of the tables that were written: ``sine``, ``noise``, ``bands``, ``other``, ``orders`` or ``skipped``.

        Raises
        ------
        RequestError
            There is no table of that name.
        """
        return read_table(
            next((p for p in self.tables if p.stem == name), self.tables[0].with_name(f"{name}.txt"))
        )

    def of_kind(self, kind: str) -> tuple[FileResult, ...]:
        """Results that are "done", "aside" or "failed"."""
        return tuple(r for r in self.results if r.kind == kind)


@dataclass(frozen=True)
class Means:
    """How a batch is worked off.

    Attributes
    ----------
    jobs : int
        Number of processes; by default one for each core, but no more than the recordings are worth.
    cluster : str
        Address of a dask scheduler whose workers analyse the files in place of processes here.
    progress : callable
        Called with the number of files done, of all files, and an estimate of the seconds that remain.
    warn : callable
        Called with what the user should know while the work goes on.
    """

    jobs: int | None = None
    cluster: str | None = None
    progress: Callable[[int, int, float], None] | None = None
    warn: Callable[[str], None] = lambda _: None

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise RequestError(f"the number of processes is {self.jobs}", expected="1 or more")
        if self.jobs is not None and self.cluster is not None:
            raise RequestError(
                "--jobs and --cluster are both given", expected="--jobs or --cluster, not both"
            )

    def results(self, tasks: Sequence[Task]) -> Iterator[tuple[int, FileResult]]:
        """Position and result of every file, in the order in which they are ready."""
        if self.cluster is not None:
            from specan.analysis.batch.cluster import spread_over_cluster

            return spread_over_cluster(self.cluster, tasks, self.warn)
        worth = sum(task.entry.size for task in tasks) // WORTH_A_PROCESS
        return spread(tasks, _one, self.jobs or max(1, min(os.cpu_count() or 1, worth)), _lost)


def run_batch(
    directories: Sequence[Path],
    out: Path,
    settings: BatchSettings | None = None,
    *,
    calibration: Path | None = None,
    channel_table: Path | None = None,
    **means: Any,
) -> BatchReport:
    """Analyse every recording below `directories` and write the tables into `out`.

    Files are analysed independently, each with its samples read once (once more for orders), by `jobs` processes
    or the workers of a cluster. The result of each is kept in `out` as soon as it is there, and the tables are put
    together at the end in the order of the labels: a batch that is interrupted goes on where it was when it is run
    again, and its tables are those of one that was not.

    Parameters
    ----------
    calibration, channel_table : Path, optional
        For all files, in place of what the directories hold.
    **means
        How the work is done: fields of `Means`.

    Raises
    ------
    RequestError
        A directory does not exist, `out` cannot be written to or is in use, the calibration is not valid, or the
        cluster does not answer.
    InputError
        There is no recording.
    """
    work = Means(**means)
    settings = (settings or BatchSettings()).completed()
    if channel_table is not None:
        read_channel_table(channel_table)
    table = str(channel_table or "")
    inputs = find_inputs(directories, channel_table=table, sampling_rate=settings.sampling_rate)
    certain = tuple(name for name in COLUMNS if name not in OPTIONAL or settings.orders is not None)
    with claim(out, certain):
        store = Store(out / STORE)
        assigned = assign_calibrations(inputs, calibration, store.place, settings.calibration)
        for made in store.place.glob("*.toml"):
            check_own(out / made.name, store.place, made)
        keys = {
            entry.label: key for entry, key in zip(assigned.inputs, map(keys_of(settings), assigned.inputs))
        }
        kept = {label: one for label, key in keys.items() if (one := store.find(key))}
        todo = [entry for entry in assigned.inputs if entry.label not in kept]
        resumed = len(kept)
        failed = _work_off(todo, settings, work, keys, store, kept)
        results = [*assigned.calibrators, *failed, *kept.values()]
        results.sort(key=lambda result: result.label)
        header = [f"settings {settings.fingerprint}: {settings.as_json()}"]
        header += [f"calibration: {line}" for line in assigned.said]
        if channel_table is not None:
            header.append(f"channel table: {channel_table.name} ({fingerprint(channel_table)}), given")
        written = write_tables(store.place, header, results, settings.decimal)
        _publish(store.place, out, written)
        store.keep_only(keys[label] for label in kept)
    return BatchReport(
        results=tuple(results),
        tables=tuple(out / name for name in written),
        rows=tuple(written.values()),
        resumed=resumed,
        calibration=tuple("no file" if line == "none" else line for line in assigned.said),
        inputs=tuple(_published(entry, store.place, out) for entry in assigned.inputs),
    )


def _published(entry: Input, place: Path, out: Path) -> Input:
    """A file of a batch whose calibration, where the batch has made it, now lies beside the tables."""
    made = Path(entry.calibration)
    return replace(entry, calibration=str(out / made.name)) if made.parent == place else entry


def _work_off(
    todo: Sequence[Input],
    settings: BatchSettings,
    work: Means,
    keys: Mapping[str, str],
    store: Store,
    kept: dict[str, Kept],
) -> list[FileResult]:
    """Keep the results of files in `store` and in `kept` as they are ready; return those that are not to be kept."""
    before, failed = len(kept), []
    read = cache(read_calibration)
    calibrations = [read(entry.calibration) if entry.calibration else None for entry in todo]
    tasks = [Task(e, settings, found) for e, found in zip(todo, calibrations, strict=True)]
    begin, total, done = time.monotonic(), max(sum(entry.size for entry in todo), 1), 0
    with closing(work.results(tasks)) as results:  # type: ignore[type-var]
        for count, (position, result) in enumerate(results, before + 1):
            entry = todo[position]
            if result.kind == "failed":
                failed.append(result)
            else:
                kept[entry.label] = store.put(result, keys[entry.label])
            done += entry.size
            if work.progress is not None:
                remaining = (time.monotonic() - begin) * (total - done) / max(done, 1)
                work.progress(count, before + len(tasks), remaining)
    return failed


def _publish(ready: Path, out: Path, written: Collection[str]) -> None:
    """Put tables that are complete in place, one right after the other; those of an earlier batch alone go."""
    for name in OPTIONAL.intersection(written):
        check_table(out / name)
    for path in [*sorted(ready.glob("*.toml")), *(ready / name for name in written)]:
        try:
            if path.suffix == ".toml":
                remember_own(path, ready)
            path.replace(out / path.name)
        except OSError as fault:
            raise RequestError(
                f"{path.name} cannot be written to {out} ({fault.strerror or fault})",
                remedy="close the program that has it open, and run the same command again",
            ) from None
    for name in COLUMNS.keys() - set(written):
        if is_of_a_batch(out / name):
            (out / name).unlink()


def _one(task: Task) -> FileResult:
    keep_freed_memory()  # files of a second work in 20 MB, again and again
    return analyse_unchanged(task)


def _lost(task: Task) -> FileResult:
    reason = "the process that analysed it was killed (out of memory?); run it alone, or with fewer processes"
    return FileResult(task.entry.label, "failed", reason)
