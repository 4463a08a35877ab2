"""Which calibration applies to which file of a batch."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import open_headers
from specan.analysis.batch.result import FileResult
from specan.analysis.excitation import CALIBRATOR_WORDS, stated_excitation
from specan.analysis.insertion import CalibrationSettings
from specan.errors import SpecanError, reason_of
from specan.io.calibration_file import FILE_NAME, calibration_beside, read_calibration, write_calibration
from specan.io.tdms_headers import metadata_of

_WORDS = tuple(word.encode() for word in CALIBRATOR_WORDS)
_USED = "calibrator recording: used for the calibration, not analysed"
_UNUSED = "calibrator recording: not analysed, and not used because a calibration was given"


@dataclass(frozen=True)
class Assigned:
    """Files with their calibrations, results of calibrator recordings, and which calibrations these are."""

    inputs: list[Input]
    calibrators: list[FileResult]
    said: tuple[str, ...]


def is_calibrator(entry: Input) -> bool:
    """Whether a file says so; one that cannot be opened will be opened again for its own sake, and then says why."""
    # Much faster than parsing: one of the words that name a calibrator has to be in the metadata. Other formats have no
    # such properties; a pipe, which would be waited for, is refused when it is opened.
    if not entry.path.lower().endswith(".tdms") or not os.path.isfile(entry.path):
        return False
    try:
        named = any(w in part for part in map(bytes.lower, metadata_of(entry.path)) for w in _WORDS)
        stated = stated_excitation(open_headers(entry)) if named else None
    except Exception:
        return False
    return stated is not None and stated.kind == "calibrator"


def assign_calibrations(
    inputs: Sequence[Input],
    given: Path | None,
    out: Path,
    settings: CalibrationSettings,
) -> Assigned:
    """Give each file its calibration; calibrator recordings become results of their own.

    The first that there is counts: the calibration that was given; a `calibration.toml` in the file's
    directory or in one above it, up to the directory of the batch; the calibrator recordings of that
    directory, all of them together, from which `calibration.toml` is written into `out`.

    Raises
    ------
    RequestError
        The calibration that was given is missing or not valid; one in a directory fails its recordings.
    """
    calibrators, others = list[Input](), list[Input]()
    for entry in inputs:
        (calibrators if is_calibrator(entry) else others).append(entry)
    if given is not None:
        read_calibration(given)
        aside = [FileResult(entry.label, "aside", _UNUSED) for entry in calibrators]
        said = f"{given.name} ({fingerprint(given)}), given"
        return Assigned([replace(e, calibration=str(given)) for e in others], aside, (said,))
    results, made, lines = _made(inputs, calibrators, out, settings)
    nearest, fault_of = cache(_nearest), cache(_fault_of)  # looked for once: files may be very many
    assigned: list[Input] = []
    for entry in others:
        beside = nearest(entry.root, os.path.dirname(entry.path))
        if beside is not None:
            if fault := fault_of(beside):
                results.append(FileResult(entry.label, "failed", entry.neutral(fault)))
                continue
            place = beside.relative_to(entry.root).as_posix()
            lines.append(f"{place} ({fingerprint(beside)}), from the directory")
        chosen = beside or made.get(entry.root)
        assigned.append(entry if chosen is None else replace(entry, calibration=str(chosen)))
    return Assigned(assigned, results, tuple(dict.fromkeys(lines)) or ("none",))


def _made(
    inputs: Sequence[Input], calibrators: Sequence[Input], out: Path, settings: CalibrationSettings
) -> tuple[list[FileResult], dict[str, Path], list[str]]:
    """Results of the calibrator recordings, the calibration of each root that has any, and lines on these."""
    results: list[FileResult] = []
    made: dict[str, Path] = {}
    lines: list[str] = []
    roots = list(dict.fromkeys(entry.root for entry in inputs))
    for root in roots:
        target = out / (FILE_NAME if len(roots) == 1 else f"calibration-{Path(root).resolve().name}.toml")
        mine = [entry for entry in calibrators if entry.root == root]
        outcome, notes = _calibrate(mine, target, settings)
        results += outcome
        if notes is not None:
            made[root] = target
            count = f"from {len(mine)} calibrator recordings"
            lines += [f"{target.name} ({fingerprint(target)}), {count}", *notes]
    return results, made, lines


def _fault_of(calibration: Path) -> str:
    """Why a calibration cannot be used, or nothing."""
    try:
        read_calibration(calibration)
    except Exception as fault:
        return (
            reason_of(fault) if isinstance(fault, SpecanError) else f"{calibration.name}: {reason_of(fault)}"
        )
    return ""


def _nearest(root: str, place: str) -> Path | None:
    """The calibration of a directory: its own, or that of the nearest one above it."""
    for directory in (Path(place), *Path(place).parents):
        beside = calibration_beside(directory / FILE_NAME)
        if beside is not None or directory == Path(root):
            return beside
    return None


def _calibrate(
    entries: Sequence[Input],
    target: Path,
    settings: CalibrationSettings,
) -> tuple[list[FileResult], tuple[str, ...] | None]:
    """Results of the calibrator recordings, and the notes of the calibration if there is one."""
    if not entries:
        return [], None
    from specan.analysis.calibration import join_insertions
    from specan.analysis.insertion import Insertion, evaluate_insertion

    results, insertions = [], list[Insertion]()
    for entry in entries:
        try:
            insertions.append(evaluate_insertion(open_headers(entry), settings))
            results.append(FileResult(entry.label, "aside", _USED))
        except Exception as fault:
            results.append(FileResult(entry.label, "failed", entry.neutral(reason_of(fault))))
    if not insertions:
        return results, None
    try:
        calibration = join_insertions(insertions, settings)
    except Exception as fault:
        return [FileResult(entry.label, "failed", reason_of(fault)) for entry in entries], None
    write_calibration(calibration, target)
    bad = [
        f"{c.channel} {c.verdict}: {', '.join(c.reasons)}"
        for c in calibration.channels
        if c.verdict != "good"
    ]
    return results, (*calibration.calibrator_decided, *calibration.notes, *bad)


def fingerprint(path: Path) -> str:
    """First twelve digits of the SHA-256 of a file's bytes."""
    return "sha256 " + hashlib.sha256(path.read_bytes()).hexdigest()[:12]
