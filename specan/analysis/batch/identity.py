"""What a file and the program were when a result was made: whether the result still holds."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

import specan
from specan.io.tdms_headers import metadata_of

BLOCK, BLOCKS = 1 << 16, 64
# What results are computed by; the rest of the package only shows them.
_COMPUTING = ("data", "dsp", "io", "analysis")


@dataclass(frozen=True)
class Identity:
    """A file at one moment.

    Attributes
    ----------
    size, mtime_ns : int
        Bytes, and the time of its last change.
    digest : str
        SHA-256 of the size, of the metadata and of 64 blocks of 64 KiB that are spread over the file.
    whole : str
        SHA-256 of all bytes; empty where that was not asked for.
    """

    size: int
    mtime_ns: int
    digest: str
    whole: str = ""

    def untouched(self, path: str) -> bool:
        """Whether size and time are still the same; a file that is gone is not."""
        try:
            now = os.stat(path)
        except OSError:
            return False
        return (now.st_size, now.st_mtime_ns) == (self.size, self.mtime_ns)


def identify(path: str, *, whole: bool = False) -> Identity:
    """What a file is now.

    Raises
    ------
    OSError
        It cannot be read.
    """
    now = os.stat(path)
    if not stat.S_ISREG(now.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", path)  # a pipe would be waited for
    return Identity(
        now.st_size, now.st_mtime_ns, _spread_digest(path, now.st_size), _whole(path) if whole else ""
    )


def _spread_digest(path: str, size: int) -> str:
    digest = hashlib.sha256(str(size).encode())
    for part in metadata_of(Path(path)):
        digest.update(part)
    with open(path, "rb", buffering=0) as file:
        for start in _starts(size):
            file.seek(start)
            digest.update(file.read(BLOCK))
    return digest.hexdigest()


def _starts(size: int) -> Iterator[int]:
    """Beginnings of the blocks: without a gap in a small file, else evenly from the first to the last byte."""
    if size <= BLOCK * BLOCKS:
        yield from range(0, size, BLOCK)
        return
    for number in range(BLOCKS):
        yield (size - BLOCK) * number // (BLOCKS - 1)


def _whole(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@lru_cache(maxsize=1)
def program_identity() -> str:
    """Version of specan with a hash of its source, and of the libraries that compute.

    Results of another program are not mixed with those of this one, not even of one that only a developer has
    changed.
    """
    import scipy

    place = Path(specan.__file__).parent
    sources = [*place.glob("*.py"), *(path for part in _COMPUTING for path in (place / part).rglob("*.py"))]
    digest = hashlib.sha256()
    for path in sorted(sources, key=lambda path: path.relative_to(place).as_posix()):
        digest.update(path.relative_to(place).as_posix().encode() + b"\0")
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return f"specan {specan.__version__} ({digest.hexdigest()[:12]}), numpy {np.__version__}, scipy {scipy.__version__}"
