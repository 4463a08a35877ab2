"""A batch from its directories to its tables.

Decisions: docs/decisions/batch.md.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
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
from specan.analysis.batch.one_file import Outcome, analyse_unchanged, open_headers
from specan.analysis.batch.pool import spread
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import Context, Kept, Store, common_context, context_of, unchanged
from specan.analysis.batch.tables import write_tables
from specan.data.calibration import Calibration
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
Progress = Callable[[int, int, float], None]


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
        Which calibrations were applied, as the headers of the tables say it.
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


def run_batch(
    directories: Sequence[Path],
    out: Path,
    settings: BatchSettings | None = None,
    *,
    calibration: Path | None = None,
    channel_table: Path | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    verify: bool = False,
    progress: Progress | None = None,
    warn: Callable[[str], None] = lambda _: None,
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
    jobs : int, optional
        Number of processes; by default one for each core, but no more than the recordings are worth.
    cluster : str, optional
        Address of a dask scheduler whose workers analyse the files in place of processes here.
    verify : bool
        Hash every byte of the recordings to find out whether a kept result holds, in place of size, time and samples.
    progress : callable, optional
        Called with the number of files done, of all files, and an estimate of the seconds that remain.
    warn : callable, optional
        Called with what the user should know while the work goes on.

    Raises
    ------
    RequestError
        A directory does not exist, `out` cannot be written to or is in use, the calibration is not valid, or the
        cluster does not answer.
    InputError
        There is no recording.
    """
    if jobs is not None and jobs < 1:
        raise RequestError(f"the number of processes is {jobs}", expected="1 or more")
    if jobs is not None and cluster is not None:
        raise RequestError("--jobs and --cluster are both given", expected="--jobs or --cluster, not both")
    keep_freed_memory()  # files of a second work in 20 MB, again and again
    settings = (settings or BatchSettings()).completed()
    inputs = find_inputs(directories)
    if channel_table is not None or settings.sampling_rate is not None:
        told = {"channel_table": str(channel_table or ""), "sampling_rate": settings.sampling_rate}
        inputs = [replace(entry, **told) for entry in inputs]  # type: ignore[arg-type]
    if channel_table is not None:
        read_channel_table(channel_table)
    with claim(out, _certain(settings)):
        store = Store(out / STORE)
        begun = store.holds_results()
        earlier = {entry.label: unchanged(entry, store, verify=verify) if begun else None for entry in inputs}
        assigned = assign_calibrations(
            inputs,
            calibration,
            store.place,
            settings.calibration,
            open_headers,
            lambda entry: earlier[entry.label] is not None,
        )
        for made in store.place.glob("*.toml"):
            check_own(out / made.name, store.place, made)
        work = _Work(settings, jobs, cluster, verify, warn, store)
        kept = work.kept_of(assigned.inputs, earlier)
        resumed = len(kept)
        failed = work.do([entry for entry in assigned.inputs if entry.label not in kept], kept, progress)
        results = [*assigned.calibrators, *failed, *(one.result for one in kept.values())]
        results.sort(key=lambda result: result.label)
        header = [f"settings {settings.fingerprint}: {settings.as_json()}", *assigned.header]
        if channel_table is not None:
            header.append(f"channel table: {channel_table.name} ({fingerprint(channel_table)}), given")
        written = write_tables(store.place, header, results, kept, settings.decimal)
        _publish(store.place, out, written)
        store.keep_only(kept)
    tables = tuple(out / name for name in written)
    said = [line.removeprefix("calibration: ") for line in assigned.header]
    inputs = [_published(entry, store.place, out) for entry in assigned.inputs]
    applied = tuple("none, nominal sensitivities" if line == "none" else line for line in said)
    rows = tuple(written.values())
    return BatchReport(tuple(results), tables, rows, resumed, applied, tuple(inputs))


def _published(entry: Input, place: Path, out: Path) -> Input:
    """A file of a batch whose calibration, where the batch has made it, now lies beside the tables."""
    made = Path(entry.calibration)
    return replace(entry, calibration=str(out / made.name)) if made.parent == place else entry


def _watched(
    todo: Sequence[Input],
    outcomes: Iterator[tuple[int, Outcome | Kept]],
    before: int,
    progress: Progress | None,
) -> Iterator[tuple[Input, Outcome | Kept]]:
    """The outcomes with their inputs; tells the progress of each."""
    begin, left = time.monotonic(), sum(entry.size for entry in todo)
    total, done = max(left, 1), 0
    with closing(outcomes):  # type: ignore[type-var]
        for count, (position, outcome) in enumerate(outcomes, before + 1):
            yield todo[position], outcome
            done += todo[position].size
            if progress is not None:
                remaining = (time.monotonic() - begin) * (total - done) / max(done, 1)
                progress(count, before + len(todo), remaining)


@dataclass(frozen=True)
class _Work:
    """How files are analysed, and where their results are kept."""

    settings: BatchSettings
    jobs: int | None
    cluster: str | None
    verify: bool
    warn: Callable[[str], None]
    store: Store

    @cached_property
    def common(self) -> str:
        """Of what all results are made."""
        return common_context(self.settings)

    @cached_property
    def context(self) -> Context:
        """Of what the result of a file is made."""
        return context_of(self.common)

    def kept_of(self, inputs: Sequence[Input], earlier: Mapping[str, Kept | None]) -> dict[str, Kept]:
        """Results of earlier batches that still hold."""
        found = {entry: earlier[entry.label] for entry in inputs}
        return {
            e.label: one for e, one in found.items() if one is not None and one.context == self.context(e)
        }

    def do(self, todo: Sequence[Input], kept: dict[str, Kept], progress: Progress | None) -> list[FileResult]:
        """Analyse files; adds their results to `kept`, and returns those that are not to be kept."""
        failed = []
        for entry, outcome in _watched(todo, self._outcomes(todo), len(kept), progress):
            if isinstance(outcome, Kept):
                kept[entry.label] = outcome
            elif outcome.identity is None:
                failed.append(outcome.result)
            else:
                kept[entry.label] = self.store.put(outcome.result, outcome.identity, self.context(entry))
        return failed

    def _outcomes(self, todo: Sequence[Input]) -> Iterator[tuple[int, Outcome | Kept]]:
        """Position and outcome of every file, in the order in which they are ready; processes here keep it."""
        calibrations = _calibrations_of(todo)
        if self.cluster is not None:
            from specan.analysis.batch.cluster import spread_over_cluster

            yield from spread_over_cluster(
                self.cluster, todo, self.settings, calibrations, self.verify, self.warn
            )
            return
        worth = sum(entry.size for entry in todo) // WORTH_A_PROCESS
        jobs = self.jobs or max(1, min(os.cpu_count() or 1, worth))
        context = (self.settings.model_dump_json(), calibrations, self.verify, self.store.place, self.common)
        yield from spread(todo, _one, _prepare, context, jobs, _lost)


def _calibrations_of(todo: Sequence[Input]) -> dict[str, Calibration]:
    return {path: read_calibration(path) for path in sorted({entry.calibration for entry in todo} - {""})}


def _certain(settings: BatchSettings) -> tuple[str, ...]:
    """Tables that will be written whatever the recordings hold."""
    return tuple(name for name in COLUMNS if name not in OPTIONAL or settings.orders is not None)


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


# What a process needs for its files, set once by `_prepare`.
_settings = BatchSettings()
_calibrations: dict[str, Calibration] = {}
_verify = False
_store: Store
_context: Context


def _prepare(
    settings: str, calibrations: dict[str, Calibration], verify: bool, place: Path, common: str
) -> None:
    global _settings, _verify, _store, _context
    keep_freed_memory()
    _settings, _verify = BatchSettings.model_validate_json(settings), verify
    _store, _context = Store(place, joined=True), context_of(common)
    _calibrations.clear()
    _calibrations.update(calibrations)


def _one(entry: Input) -> Outcome | Kept:
    outcome = analyse_unchanged(entry, _settings, _calibrations.get(entry.calibration), whole=_verify)
    if outcome.identity is None:
        return outcome
    try:
        return _store.put(outcome.result, outcome.identity, _context(entry))
    except RequestError:  # the first process says it
        return outcome


def _lost(entry: Input) -> Outcome | Kept:
    return Outcome(
        FileResult(
            entry.label,
            "failed",
            "the process that analysed it was ended from outside (memory?); "
            "run it alone, or with fewer processes",
        )
    )
