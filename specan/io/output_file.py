"""The one way in which a file is written: as a whole or not at all, and never over what cannot be made again.

A recording is never replaced. Other files that specan did not write are replaced only when the user says so:
a slip of tab completion must not cost a measurement. See docs/decisions/batch.md.
"""

from __future__ import annotations

import csv
import glob
import os
import re
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from specan.errors import RequestError

STANDARD_OUTPUT = Path("-")
_PART = ".part"
# First bytes of recordings: TDMS and its index; WAV in its four kinds; Sony Wave64; FLAC, AIFF and HDF5 are not
# read by specan, but they hold measurements as well.
_RECORDINGS = (
    b"TDSm", b"TDSh", b"RIFF", b"RIFX", b"RF64", b"BW64", b"riff", b"fLaC", b"FORM", b"\x89HDF\r\n\x1a\n",
)  # fmt: skip
_MARK = re.compile(rb"specan \d+\.\d")
# Where a program may name itself, and what a file of that format begins with.
_MARKED_FORMATS = (
    b"\x89PNG", b"%PDF", b"<?xml", b"<!DOCTYPE html>", b"PAR1", b"    -1", b'{\n  "written_by": "specan ',
)  # fmt: skip
_TABLE = re.compile(rb"# specan \d+\.\d")
_CALIBRATION = b"# Sensitivities and phases of channels, as `specan calibrate`"
# An export: the first column is the time, every other one ends with its unit in brackets.
_SAMPLES = re.compile(rb'(\xef\xbb\xbf)?time_s([,;]("([^"]|"")* \[[^"\]]*\]"|[^",;\n]* \[[^",;\n\]]*\]))+\n')
_HEAD, _TAIL = 1 << 16, 1 << 20


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording; False where there is none."""
    return (_bytes(path, 0, 16) or b"").startswith(_RECORDINGS)


def written_by_specan(path: Path) -> bool:
    """Whether a file is a result of specan, as its header says; an empty file holds nothing to lose."""
    head = _bytes(path, 0, _HEAD)
    if head is None:
        return False
    if not head or head.startswith(_CALIBRATION) or _TABLE.match(head) or _SAMPLES.match(head):
        return True
    if not head.startswith(_MARKED_FORMATS):
        return False
    return bool(_MARK.search(head) or _MARK.search(_bytes(path, -_TAIL, _TAIL) or b""))


def check_output(path: Path, inputs: Iterable[Path] = (), *, force: bool = False) -> None:
    """Refuse a place whose content must not be replaced.

    Parameters
    ----------
    path : Path
        Where a result is to go; ``-`` is standard output.
    inputs : iterable of Path
        What the result is made from.
    force : bool
        The user said that a file which specan did not write may be replaced.

    Raises
    ------
    RequestError
        `path` is one of the inputs (under whatever name), a recording, or without `force` a file that specan
        did not write.
    """
    if path == STANDARD_OUTPUT or not stat.S_ISREG(_mode(path)):
        return
    for given in inputs:
        with suppress(OSError):
            if path.samefile(given):
                what = "is the recording itself" if is_recording(path) else "is what the result is made from"
                raise RequestError(f"{path} {what}", remedy="choose another file with -o")
    if is_recording(path):
        raise RequestError(
            f"{path} is a recording, and a recording is never replaced",
            remedy="choose another file, or remove this one yourself",
        )
    if not force and not written_by_specan(path):
        raise RequestError(
            f"{path} exists and does not say that specan wrote it",
            remedy="choose another file, or replace it with --force",
        )


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A neighbour of `path` to write to, put in its place when all went well.

    For ``-`` and for devices the finished file is copied there.

    Raises
    ------
    RequestError
        The place is a recording, or cannot be written to.
    """
    mode = _mode(path)
    if stat.S_ISDIR(mode):
        raise RequestError(f"{path} cannot be written (it is a directory)", remedy="name a file in it")
    copied = path == STANDARD_OUTPUT or bool(mode and not stat.S_ISREG(mode))
    if not copied and is_recording(path):
        check_output(path, force=True)  # it was not there when the work began
    with suppress(OSError):  # no name of a file: writing says so
        path = path.resolve() if path.is_symlink() else path
    # One for each process: of two that write to one place, the last to finish wins, and neither mixes with the other.
    half = path.with_name(f".{path.name}.{os.getpid()}{_PART}")
    try:
        if copied:
            yield from _copied(path)
            return
        _remove_abandoned(path)
        yield half
        half.replace(path)
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise RequestError(
            f"{path} cannot be written ({fault.strerror or fault})",
            expected="an existing, writable directory with free space",
            remedy="choose another place",
        ) from None
    finally:
        with suppress(OSError):
            half.unlink(missing_ok=True)


@contextmanager
def text_file(path: Path, *, durable: bool = True) -> Iterator[TextIO]:
    """Open `path` for text with ``\\n`` line ends; a reader sees the old file or the whole new one.

    Names that are not UTF-8 are written as ``\\udcff``-like escapes; see `specan.io.results_text.word`. `durable` waits
    until the bytes are on the disk, which what can be made again does not need.
    """
    with (
        whole_file(path) as half,
        half.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file,
    ):
        yield file
        file.flush()
        if durable:
            os.fsync(file.fileno())


def check_directory(path: Path) -> None:
    """Refuse a place whose directory does not exist, before the work is done.

    Raises
    ------
    RequestError
        It does not.
    """
    if not path.absolute().parent.is_dir():
        raise RequestError(f"the directory of {path} does not exist", remedy="create it, or choose another")


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Write a table with commas, as a whole or not at all."""
    with text_file(path) as file:
        sheet = csv.writer(file, lineterminator="\n")
        sheet.writerow(header)
        sheet.writerows(rows)


def _remove_abandoned(path: Path) -> None:
    """Remove what processes that are no more have left beside a file."""
    for half in path.parent.glob(f".{glob.escape(path.name)}.*{_PART}"):
        number = half.name.removesuffix(_PART).rpartition(".")[2]
        if number.isdigit() and not _runs(int(number)):
            with suppress(OSError):
                half.unlink()


def _runs(process: int) -> bool:
    """Whether a process is there; Windows does not remove a file that one has open, and need not be asked."""
    if os.name == "nt":
        return process == os.getpid()
    try:
        os.kill(process, 0)
    except (OSError, OverflowError) as fault:
        return not isinstance(fault, ProcessLookupError)
    return True


def remove_parts(directory: Path) -> None:
    """Remove what an interrupted write has left."""
    for half in directory.glob(f".*{_PART}"):
        half.unlink()


def _copied(path: Path) -> Iterator[Path]:
    import shutil

    with tempfile.TemporaryDirectory() as place:
        half = Path(place) / "output"
        yield half
        with half.open("rb") as made:
            if path == STANDARD_OUTPUT:
                sys.stdout.flush()
                if hasattr(sys.stdout, "buffer"):
                    shutil.copyfileobj(made, sys.stdout.buffer)
                else:  # a program that runs specan has put text in its place
                    sys.stdout.write(made.read().decode("utf-8"))
                sys.stdout.flush()
            else:
                with path.open("wb") as device:
                    shutil.copyfileobj(made, device)


def _mode(path: Path) -> int:
    """What kind of file it is; 0 where there is none, or no name of one: writing will say so."""
    try:
        return os.stat(path).st_mode
    except (OSError, ValueError):
        return 0


def _bytes(path: Path, start: int, count: int) -> bytes | None:
    """Bytes from a place on, or from the end if it is negative; None where there is nothing to be read."""
    if not stat.S_ISREG(_mode(path)):
        return None
    try:
        with path.open("rb") as file:
            file.seek(start if start >= 0 else max(0, file.seek(0, 2) + start))
            return file.read(count)
    except OSError:
        return None


@contextmanager
def locked(path: Path, busy: str, remedy: str) -> Iterator[None]:
    """Keep other processes out meanwhile: those that ask for the same file, which is removed in the end.

    Raises
    ------
    RequestError
        Another process holds it: `busy`.
    OSError
        It cannot be written.
    """
    with path.open("a") as file:
        try:
            if os.name == "nt":
                import msvcrt

                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
            else:
                import fcntl

                fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A lock on a file that was removed locks nobody out.
            held = os.path.samestat(os.fstat(file.fileno()), os.stat(path))
        except OSError:
            held = False
        if not held:
            raise RequestError(busy, remedy=remedy)
        try:
            yield
        finally:
            with suppress(OSError):  # Windows keeps an open file; the next one takes it over
                path.unlink()
