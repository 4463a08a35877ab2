"""A lock on a file, which the system frees when the process ends in whatever way."""

from __future__ import annotations

import os


def try_lock(handle: int) -> bool:
    """Take the lock of an open file; False where another process holds it.

    Parameters
    ----------
    handle : int
        File descriptor of a file that is open for writing.
    """
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def is_the_file(handle: int, name: str) -> bool:
    """Whether an open file is the one that lies under `name` now: a lock on a removed file locks nobody out."""
    try:
        return os.path.samestat(os.fstat(handle), os.stat(name))
    except OSError:
        return False
