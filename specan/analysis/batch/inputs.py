"""Which files a batch takes, what they are called in its results, and whether there is a place for these."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from specan.errors import InputError, RequestError
from specan.io.open import find_recordings, suffixes
from specan.io.output_file import check_output, locked


@dataclass(frozen=True)
class Input:
    """One file of a batch.

    Attributes
    ----------
    path : str
        Where it lies, absolute.
    label : str
        Path relative to the directory that was named, with forward slashes.
    root : str
        That directory, absolute.
    size : int
        Bytes.
    calibration : str
        File of the calibration that applies; empty for none.
    channel_table : str
        Given for all files; empty for what lies beside them.
    sampling_rate : float or None
        Given for all files, in hertz.
    """

    path: str
    label: str
    root: str
    size: int
    calibration: str = ""
    channel_table: str = ""
    sampling_rate: float | None = None

    def neutral(self, reason: str) -> str:
        """A message as it goes into results: without the place of the file on this machine."""
        reason = reason.replace(self.path, self.label)
        if len(Path(self.root).parts) > 1:  # the root of a disk is in every path
            reason = reason.replace(os.path.join(self.root, ""), "")
            reason = re.sub(re.escape(self.root) + r"""(?=[\s'",;:)]|$)""", ".", reason)
        return reason.removeprefix(f"{self.label}: ")


def find_inputs(directories: Sequence[Path], **given: Any) -> list[Input]:
    """All recordings below the directories, sorted by label, with what was given for all of them.

    Raises
    ------
    RequestError
        A directory does not exist.
    InputError
        There is no recording at all.
    """
    # Absolute: in a message such a path is found again, where "in" or "." would be parts of words.
    found = [
        Input(path := os.path.abspath(one.path), one.label, os.path.abspath(one.root), _size(path), **given)
        for one in find_recordings(directories)
    ]
    if not found:
        listed = ", ".join(str(directory) for directory in directories)
        raise InputError(
            f"{listed} holds no recording",
            expected=f"files that end in {', '.join(suffixes())}, at any depth",
        )
    return found


def _size(path: str) -> int:
    try:
        return os.stat(path).st_size
    except OSError:
        return 0  # a broken link, or gone already: the analysis says so


def is_of_a_batch(path: Path) -> bool:
    """Whether a file begins as a table of a batch of that name does."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            words = file.readline().split()
    except OSError:
        return False
    return words[:2] == ["#", "specan"] and words[-1] == path.name


def check_table(path: Path) -> None:
    """Refuse a place that holds anything but a table of a batch.

    Raises
    ------
    RequestError
        Something else is there: made by another command, or not by specan.
    """
    check_output(path)
    if path.is_file() and path.stat().st_size and not is_of_a_batch(path):
        raise RequestError(
            f"{path} is not a table of a batch: another command wrote it",
            remedy="choose another directory with -o, or move the file",
        )


_WRITTEN = "written"  # in the store: what batches have put into the output directory, by name and hash


def check_own(path: Path, store: Path, new: Path | None = None) -> None:
    """Refuse to replace a file of the output directory that no batch wrote there, or that was changed since.

    Tables say in their header that they are a batch's; a calibration and a page may be anybody's.

    Raises
    ------
    RequestError
        There is such a file, and its bytes are not those of `new`.
    """
    try:
        known = (store / _WRITTEN).read_text("utf-8").splitlines()
    except OSError:
        known = []
    if path.exists() and _named(path) not in [*known, *([_named(new)] if new else [])]:
        raise RequestError(
            f"{path} exists and is not what a batch wrote there",
            remedy="choose another directory with -o, or move the file",
        )


def remember_own(path: Path, store: Path) -> None:
    """Note that a batch wrote a file."""
    with (store / _WRITTEN).open("a", encoding="utf-8") as file:
        file.write(f"{_named(path)}\n")


def _named(path: Path) -> str:
    digest = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "no file"
    return f"{digest} {path.name}"


@contextlib.contextmanager
def claim(out: Path, tables: Sequence[str]) -> Iterator[None]:
    """Make sure before the work that `tables` can be written to `out`, and that no other batch writes there.

    Raises
    ------
    RequestError
        The place is a file, cannot be written to, is in use, or holds a file of such a name that specan did not
        write.
    """
    with contextlib.ExitStack() as held:
        busy = f"another batch is writing to {out}"
        try:
            out.mkdir(parents=True, exist_ok=True)
            held.enter_context(
                locked(out / ".specan-lock", busy, "wait for it, or choose another place with -o")
            )
            for name in tables:
                if (out / name).exists():
                    (out / name).open("a").close()  # a spreadsheet may hold it, or it may be a directory
                    check_table(out / name)
        except OSError as fault:
            raise RequestError(
                f"the output directory {out} cannot be written to ({fault.strerror or fault})",
                expected="an existing directory, or one that can be created",
                remedy="choose another with -o",
            ) from None
        yield
