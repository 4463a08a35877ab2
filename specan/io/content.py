"""What a file is, by its first bytes, and the formats that can be read."""

from __future__ import annotations

import importlib
import os
import stat
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NoReturn

from specan.errors import InputError

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
    """Format of a recording: a name of `specan.io.content`.

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


# File formats of recordings: the built-in ones, and those that installed packages bring.
#
# A format is a module with ``recognises(start: bytes) -> bool``, told by the first bytes of a file, and
# ``open_recording(path, *, label, channel_table, sampling_rate) -> Recording``. A package of yours names it as an
# entry point of the group ``specan.formats``. A file's name decides nothing.

# name -> module; tried in this order, those without a mark of their own last
FORMATS = {
    "tdms": "specan.io.tdms",
    "wav": "specan.io.wav",
    "hdf5": "specan.io.hdf5",
    "mat": "specan.io.mat",
    "uff": "specan.io.uff",
    "csv": "specan.io.csv_signals",
}
# Marks at the beginning of a file, which spare the import of modules that have nothing to do with it.
_MARKS = {
    "tdms": (b"TDSm",),
    "wav": (b"RIFF", b"RIFX", b"RF64"),
    "hdf5": (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file"),
    "mat": (b"MATLAB 5.0 MAT-file",),
    "uff": (b"    -1", b"-1", b"   -1"),
}
ENTRY_POINTS = "specan.formats"
BEGINNING = 4096  # bytes that a format is shown


def recognised(start: bytes) -> str:
    """Name of the format of a file that begins so; empty where none is recognised."""
    for name, module in FORMATS.items():
        marks = _MARKS.get(name)
        possible = b"\0" not in start if marks is None else start.startswith(marks)
        if possible and importlib.import_module(module).recognises(start):
            return name
    for point in entry_points(group=ENTRY_POINTS):
        if point.load().recognises(start):
            return point.name
    return ""


def format_named(name: str) -> Any:
    """Module of a format."""
    if name in FORMATS:
        return importlib.import_module(FORMATS[name])
    return next(point for point in entry_points(group=ENTRY_POINTS) if point.name == name).load()
