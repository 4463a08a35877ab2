"""The work on one file, on whatever machine: analyse it, and make sure that it did not change meanwhile."""

from __future__ import annotations

import os
from dataclasses import dataclass

from specan.analysis.batch.identity import Identity, identify
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import analyse_file
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.data.calibration import Calibration


@dataclass(frozen=True)
class Outcome:
    """Result of a file and what the file was then; without an identity the result is not to be kept."""

    result: FileResult
    identity: Identity | None = None


def analyse_unchanged(
    entry: Input, settings: BatchSettings, calibration: Calibration | None, *, whole: bool = False
) -> Outcome:
    """Result of one file; a file that changes while it is read has none.

    Parameters
    ----------
    whole : bool
        Hash all bytes of the file as well.
    """
    try:
        before = identify(entry.path, whole=whole)
    except Exception:
        before = None  # the analysis says why
    result = analyse_file(entry, settings, calibration)
    if before is None:
        return Outcome(result)
    if not before.untouched(entry.path):
        return Outcome(FileResult(entry.label, "failed", _changed(entry, before)))
    return Outcome(result, None if result.kind == "failed" else before)


def _changed(entry: Input, before: Identity) -> str:
    try:
        size = os.stat(entry.path).st_size
    except OSError:
        return "it vanished while it was read; put it back and run the batch again"
    how = f"from {before.size} to {size} bytes" if size != before.size else "in time, not in size"
    return f"it changed while it was read ({how}); run the batch again when the recording is complete"
