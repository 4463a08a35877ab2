"""The steps of a study, each kept: one line of JSON a step, only ever appended to.

Study file and history are replaced together, by one process at a time. What is to be written is first kept whole in a
file of its own. A process that ends in the middle leaves that file behind, and whoever opens the study next finishes
the change. So a study is always as it was before a change or as it is after it.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from specan.errors import RequestError
from specan.io.output_file import is_the_file, try_lock
from specan.result import Result, counted, finite
from specan.study.study_file import NAME as STUDY_FILE

NAME = "history.jsonl"

LOCK = ".lock"
PENDING = ".pending.json"
PATIENCE_S = (
    5.0  # a change that is being written takes milliseconds; a longer wait means a process that hangs
)


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes
    ----------
    action : str
        ``new``, ``add``, ``drop``, ``edit`` (the study file or the rig was changed by hand) or ``data``
        (changed data were accepted).
    because : str
        The user's reason.
    model_effects : tuple of str
        Effects of the model after the step, nuisances left out.
    fit_error, held_out_error : mapping or None
        ``{"value", "unit", "metric"}``.
    errors : mapping
        The same for every observable: ``{"fit": [...], "held_out": [...]}``.
    parameters : mapping
        ``{"effect.parameter": {"value", "low", "high", "unit"}}``.
    hashes : mapping
        Of the study's content, the rig, every file.
    """

    step: int
    action: str
    model_effects: tuple[str, ...]
    fit_error: Mapping[str, Any]
    held_out_error: Mapping[str, Any] | None
    reduced_chi2: float | None
    p_value: float | None
    parameters: Mapping[str, Mapping[str, Any]]
    hashes: Mapping[str, Any]
    effect: str = ""
    because: str = ""
    held_out_reduced_chi2: float | None = None
    errors: Mapping[str, Any] = field(default_factory=dict)
    at_bound: tuple[str, ...] = ()
    model_discrepancy_percent: float = 0.0
    version: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**vars(self), "model_effects": list(self.model_effects), "at_bound": list(self.at_bound)}


def line_of(step: Step) -> str:
    """A step as the line that is kept of it."""
    return json.dumps(finite(step.as_dict()), ensure_ascii=False, sort_keys=True) + "\n"


class History(Result):
    """The steps that were taken in a directory."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / NAME
        self.steps = self._read()

    dimensions = ("step",)

    def summary(self) -> str:
        """Where it is kept, and what the last step did."""
        last = f", last: {self.last.action} {self.last.effect}".rstrip() if self.last else ""
        return f"{self.path.parent}, {counted(len(self.steps), 'step')}{last}"

    def columns(self) -> dict[str, Any]:
        """One row for each step; errors are RMS in `unit`."""
        return {
            "step": [s.step for s in self.steps],
            "action": [s.action for s in self.steps],
            "effect": [s.effect for s in self.steps],
            "because": [s.because for s in self.steps],
            "fit_error": [s.fit_error["value"] for s in self.steps],
            "held_out_error": [s.held_out_error["value"] if s.held_out_error else None for s in self.steps],
            "unit": [s.fit_error["unit"] for s in self.steps],
            "reduced_chi2": [s.reduced_chi2 for s in self.steps],
            "held_out_reduced_chi2": [s.held_out_reduced_chi2 for s in self.steps],
        }

    @property
    def last(self) -> Step | None:
        """The latest step."""
        return self.steps[-1] if self.steps else None

    def append(self, step: Step) -> None:
        """Take in a step that `specan.study.history` writes."""
        self.steps.append(step)

    def _read(self) -> list[Step]:
        if not self.path.exists():
            return []
        steps = []
        for number, line in enumerate(self.path.read_text(encoding="utf-8").splitlines(), 1):
            if not line.strip():
                continue
            try:
                content = json.loads(line)
                content["model_effects"] = tuple(content["model_effects"])
                content["at_bound"] = tuple(content["at_bound"])
                steps.append(Step(**content))
            except (ValueError, TypeError, KeyError) as fault:
                raise RequestError(
                    f"{self.path}, line {number} is damaged ({fault})",
                    remedy="restore the file from a copy, or remove that line",
                ) from None
        return steps


@contextlib.contextmanager
def changing(directory: Path) -> Iterator[None]:
    """Keep other processes from changing the study in a directory meanwhile.

    Raises
    ------
    RequestError
        Another process is changing it, or the directory cannot be written to.
    """
    path = directory / LOCK
    try:
        stream = path.open("a")
    except OSError as fault:
        raise RequestError(
            f"the study {directory} cannot be written to ({fault.strerror})",
            expected="a directory that may be changed",
            remedy="copy the study to another place",
        ) from None
    with stream:
        if not try_lock(stream.fileno()) or not is_the_file(stream.fileno(), str(path)):
            raise RequestError(
                f"another command is changing the study {directory}", remedy="wait until it has finished"
            )
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # Windows keeps an open file; the next change takes it over
                path.unlink()


def commit(directory: Path, study_text: str | None, history_lines: str) -> None:
    """Write the study file (where it changes) and append to the history, both or neither.

    Parameters
    ----------
    directory : Path
        Of the study; the caller is `changing` it.
    study_text : str or None
        New content of the study file; None where it stays.
    history_lines : str
        Lines to append to the history.
    """
    history = directory / NAME
    size = history.stat().st_size if history.exists() else 0
    pending = {"study": study_text, "history_size": size, "history": history_lines}
    _write_whole(directory / PENDING, json.dumps(pending))
    _finish(directory)


def recover(directory: Path) -> None:
    """Finish a change that a process left half done; nothing where there is none.

    Raises
    ------
    RequestError
        The change cannot be finished here.
    """
    end = time.monotonic() + PATIENCE_S
    while (directory / PENDING).exists():
        try:
            with changing(directory):
                if (directory / PENDING).exists():
                    _finish(directory)
            return
        except RequestError:  # a process that is alive is writing it
            if time.monotonic() > end:
                raise
            time.sleep(0.02)


def _finish(directory: Path) -> None:
    """Apply what is pending; the same whether none, half or all of it was applied before."""
    pending = json.loads((directory / PENDING).read_text(encoding="utf-8"))
    with (directory / NAME).open("a+b") as stream:
        stream.truncate(pending["history_size"])
        stream.seek(0, os.SEEK_END)
        stream.write(pending["history"].encode("utf-8"))
        stream.flush()
        os.fsync(stream.fileno())
    if pending["study"] is not None:
        _write_whole(directory / STUDY_FILE, pending["study"])
    (directory / PENDING).unlink()


def _write_whole(path: Path, text: str) -> None:
    """Replace a file in one step, on the disk before its name changes."""
    temporary = path.with_name(path.name + ".part")
    with temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(path)
