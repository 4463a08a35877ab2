"""A change of a study: study file and history are replaced together, by one process at a time.

What is to be written is first kept whole in a file of its own. A process that ends in the middle leaves that file
behind, and whoever opens the study next finishes the change. So a study is always as it was before a change or as it
is after it.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

from specan.errors import RequestError
from specan.io.file_lock import is_the_file, try_lock
from specan.study.history import NAME as HISTORY
from specan.study.study_file import NAME

LOCK = ".lock"
PENDING = ".pending.json"
PATIENCE_S = (
    5.0  # a change that is being written takes milliseconds; a longer wait means a process that hangs
)


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
    history = directory / HISTORY
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
    with (directory / HISTORY).open("a+b") as stream:
        stream.truncate(pending["history_size"])
        stream.seek(0, os.SEEK_END)
        stream.write(pending["history"].encode("utf-8"))
        stream.flush()
        os.fsync(stream.fileno())
    if pending["study"] is not None:
        _write_whole(directory / NAME, pending["study"])
    (directory / PENDING).unlink()


def _write_whole(path: Path, text: str) -> None:
    """Replace a file in one step, on the disk before its name changes."""
    temporary = path.with_name(path.name + ".part")
    with temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(path)
