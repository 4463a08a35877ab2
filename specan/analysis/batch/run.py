"""A batch from its directories to its tables."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from specan.analysis.batch.calibrations import assign_calibrations, fingerprint
from specan.analysis.batch.inputs import Input, claim, find_inputs
from specan.analysis.batch.one_file import analyse_file, open_headers
from specan.analysis.batch.pool import spread
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.tables import write_tables
from specan.data.calibration import Calibration
from specan.errors import RequestError
from specan.io.calibration_file import read_calibration
from specan.io.channel_table import read_channel_table
from specan.io.results_text import COLUMNS

PARTS = ".specan-parts"
# Below this many bytes of recordings another process costs more than it gains.
WORTH_A_PROCESS = 100_000_000
Progress = Callable[[int, int, float], None]


@dataclass(frozen=True)
class BatchReport:
    """What a batch has done.

    Attributes
    ----------
    results : tuple of FileResult
        Sorted by label, without their lines.
    tables : tuple of Path
        The files that were written.
    """

    results: tuple[FileResult, ...]
    tables: tuple[Path, ...]

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
    progress: Progress | None = None,
) -> BatchReport:
    """Analyse every recording below `directories` and write the tables into `out`.

    Files are analysed independently, each with its samples read once, by `jobs` processes; the tables
    are put together at the end in the order of the labels, so that they do not depend on the order in
    which files were finished.

    Parameters
    ----------
    calibration, channel_table : Path, optional
        For all files, in place of what the directories hold.
    jobs : int, optional
        Number of processes; by default one for each core, but no more than the recordings are worth.
    progress : callable, optional
        Called with the number of files done, of all files, and the part of all bytes that is done.

    Raises
    ------
    RequestError
        A directory does not exist, `out` cannot be written to, or the calibration is not valid.
    InputError
        There is no recording.
    """
    if jobs is not None and jobs < 1:
        raise RequestError(f"the number of processes is {jobs}", expected="1 or more")
    settings = (settings or BatchSettings()).completed()
    inputs = [
        replace(entry, channel_table=str(channel_table or ""), sampling_rate=settings.sampling_rate)
        for entry in find_inputs(directories)
    ]
    if channel_table is not None:
        read_channel_table(channel_table)
    if jobs is None:
        worth = sum(entry.size for entry in inputs) // WORTH_A_PROCESS
        jobs = max(1, min(os.cpu_count() or 1, worth))
    with claim(out, tuple(COLUMNS)):
        parts = out / PARTS
        shutil.rmtree(parts, ignore_errors=True)  # of a batch that was killed
        parts.mkdir()
        try:
            assigned = assign_calibrations(inputs, calibration, out, settings.calibration, open_headers)
            results = [*assigned.calibrators]
            blocks: dict[str, dict[str, Path]] = {}
            for position, result in _work(assigned.inputs, settings, jobs, progress):
                blocks[result.label] = _keep(parts, position, result)
                results.append(replace(result, blocks={}))
            results.sort(key=lambda result: result.label)
            header = [f"settings {settings.fingerprint}: {settings.as_json()}", *assigned.header]
            if channel_table is not None:
                header.append(f"channel table: {channel_table.name} ({fingerprint(channel_table)}), given")
            write_tables(out, header, results, blocks)
        finally:
            shutil.rmtree(parts, ignore_errors=True)
    return BatchReport(tuple(results), tuple(out / name for name in COLUMNS))


def _work(
    inputs: Sequence[Input], settings: BatchSettings, jobs: int, progress: Progress | None
) -> Iterator[tuple[int, FileResult]]:
    total, done = max(sum(entry.size for entry in inputs), 1), 0
    context = (settings.model_dump_json(),)
    for count, (position, result) in enumerate(spread(inputs, _one, _prepare, context, jobs, _lost), 1):
        done += inputs[position].size
        if progress is not None:
            progress(count, len(inputs), done / total)
        yield position, result


def _keep(parts: Path, position: int, result: FileResult) -> dict[str, Path]:
    """The lines of a file on disk until all are there: memory does not grow with the number of files."""
    kept = {}
    for table, lines in result.blocks.items():
        kept[table] = parts / f"{position:07d}.{table}"
        kept[table].write_text(lines, encoding="utf-8", newline="\n")
    return kept


# What a process needs for its files, set once by `_prepare`.
_settings = BatchSettings()
_calibrations: dict[str, Calibration] = {}


def _prepare(settings: str) -> None:
    global _settings  # noqa: PLW0603 - the initialiser of a process has no other place
    _settings = BatchSettings.model_validate_json(settings)
    _calibrations.clear()


def _one(entry: Input) -> FileResult:
    if entry.calibration and entry.calibration not in _calibrations:
        _calibrations[entry.calibration] = read_calibration(entry.calibration)
    return analyse_file(entry, _settings, _calibrations.get(entry.calibration))


def _lost(entry: Input) -> FileResult:
    return FileResult(
        entry.label,
        "failed",
        "the process that analysed it was ended from outside (memory?); run it alone, or with fewer processes",
    )
