"""What a file is, by its first bytes: a name promises nothing."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import NoReturn

from specan.errors import InputError
from specan.io.formats import BEGINNING, recognised

_POINTER = b"version https://git-lfs.github.com/spec/"
# First bytes, what they are called in a message, and what the user can do.
_FOREIGN = (
    (_POINTER, "a Git-LFS pointer, not the recording itself", "fetch the recording with 'git lfs pull'"),
    (b"PK\x03\x04", "a zip archive", "unpack it and name the recording inside"),
    (b"\x1f\x8b", "a gzip archive", "unpack it and name the recording inside"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it and name the recording inside"),
    (b"TDSh", "a TDMS index file, which holds no samples", "name the .tdms file that it belongs to"),
)


def format_of(path: Path) -> str:
    """Format of a recording: a name of `specan.io.formats`.

    Raises
    ------
    InputError
        The file is missing, cannot be read, is empty, or is something else; the message says what.
    """
    try:
        if not stat.S_ISREG(mode := os.stat(path).st_mode):
            _refuse(path, mode)
        with path.open("rb") as file:
            start = file.read(BEGINNING)
    except FileNotFoundError:
        raise InputError(f"the file {path} does not exist", remedy="check the path") from None
    except OSError as fault:
        raise InputError(f"{path} cannot be read ({fault.strerror or fault})") from None
    except ValueError as fault:  # a null character in the name
        raise InputError(f"{str(path)!r} is not a name of a file ({fault})") from None
    if name := recognised(start):
        return name
    what, remedy = _describe(start)
    named = path.suffix.lower() in (".tdms", ".wav")
    expected = "a TDMS or WAV recording" if named else "a recording: TDMS, WAV, UFF, MAT, HDF5 or CSV"
    raise InputError(f"{path.name} is {what}", expected=expected, remedy=remedy)


def _refuse(path: Path, mode: int) -> NoReturn:
    """A pipe would be waited for, and a device has no end."""
    if not stat.S_ISDIR(mode):
        what = "a pipe" if stat.S_ISFIFO(mode) else "a socket" if stat.S_ISSOCK(mode) else "a device"
        raise InputError(f"{path} is {what}, not a file", expected="a recording")
    try:
        os.scandir(path).close()
    except OSError as fault:
        raise InputError(
            f"{path} is a directory that cannot be read ({fault.strerror}); what it holds is not analysed",
            remedy="allow it to be read",
        ) from None
    raise InputError(f"{path} is a directory", expected="a recording")


def _describe(start: bytes) -> tuple[str, str]:
    if not start:
        return "empty", "record or copy it again"
    for magic, what, remedy in _FOREIGN:
        if start.startswith(magic):
            return what, remedy
    if not start.strip(b"\0"):
        return "filled with zeros", "copy it again: the copy was not completed"
    if _is_text(start):
        return "a text file", "name the recording itself"
    return f"of an unknown format (it begins with {start[:4]!r})", "name a recording"


def _is_text(start: bytes) -> bool:
    for cut in range(4):  # the last character may be cut in the middle
        try:
            text = start[: len(start) - cut].decode("utf-8")
        except UnicodeDecodeError:
            continue
        return all(c.isprintable() or c in "\r\n\t\ufeff" for c in text)
    return False
