"""Opening recordings: what a file is by its content, one entry for every format, the recordings of directories."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NoReturn

from specan.data.calibration import Calibration, apply
from specan.data.recording import Recording
from specan.errors import InputError, NoSignalError, RequestError, SpecanError
from specan.io.calibration_file import read_calibration
from specan.io.channel_table import NAMES, ChannelTable, find_channel_table, read_channel_table
from specan.io.csv_signals import lines_of
from specan.io.sampling_rate import FASTEST_HZ, SLOWEST_HZ, is_rate
from specan.io.signals import Opening
from specan.schema import regular


@dataclass(frozen=True)
class Found:
    """A recording that was found in a directory.

    Attributes
    ----------
    path : Path
        The file.
    label : str
        Its name in results: relative to the directory, forward slashes, prefixed by the name of the
        directory where several were named.
    root : Path
        The directory that was named.
    """

    path: Path
    label: str
    root: Path = Path()


def open_recording(
    path: Path | str,
    *,
    root: Path | str | None = None,
    label: str | None = None,
    channel_table: ChannelTable | Path | str | None = None,
    calibration: Calibration | Path | str | None = None,
    sampling_rate: float | None = None,
) -> Recording:
    """Open a recording of any format that specan reads.

    The format is decided by the file's content. A channel table `channels.toml` or `channels.csv`
    beside the file, or in a directory above it up to `root`, is applied unless one is given.

    Parameters
    ----------
    path : path
        The file.
    root : path, optional
        The directory that was named; the label is relative to it.
    label : str, optional
        Name of the recording in results, instead.
    channel_table : ChannelTable or path, optional
        What the user knows about the channels.
    calibration : Calibration or path, optional
        Sensitivities and phases to apply.
    sampling_rate : float, optional
        Sampling rate in hertz of every channel, whatever the file says.

    Returns
    -------
    Recording
        Headers only; samples are read when they are asked for.

    Raises
    ------
    InputError
        The file is missing, is not a recording, or holds no time signal; the message says what it is.
    RequestError
        The channel table or the calibration cannot be used.
    """
    path = Path(path)
    form = format_of(path)
    if sampling_rate is not None and not is_rate(sampling_rate):
        raise RequestError(
            f"the sampling rate is {sampling_rate:g} Hz",
            expected=f"a rate above zero, {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz",
        )
    table = _table(channel_table, path, None if root is None else Path(root))
    name = label or path.name
    if label is None and root is not None and path.is_relative_to(root):
        name = path.relative_to(root).as_posix()
    try:
        recording: Recording = form.open_recording(path, Opening(name, table, sampling_rate))
    except (SpecanError, OSError):
        raise
    except Exception as fault:  # a damaged number can end in any error of Python
        raise InputError(
            f"{name} cannot be opened ({type(fault).__name__}: {fault})",
            expected="complete headers",
            remedy="copy or record it again",
        ) from fault
    if calibration is None:
        return recording
    if not isinstance(calibration, Calibration):
        calibration = read_calibration(calibration)
    return apply(calibration, recording)


def find_recordings(directories: Sequence[Path | str]) -> list[Found]:
    """Recordings in directories and below them, and directories that cannot be read, sorted by label.

    Files with the endings of `suffixes` in any case. Directories of one name get a number, so that labels differ.

    Raises
    ------
    RequestError
        A directory does not exist.
    """
    found = []
    endings = suffixes()
    prefixes = _prefixes([Path(d) for d in directories])
    for directory, prefix in zip(map(Path, directories), prefixes, strict=True):
        if not os.path.isdir(directory):  # Path.is_dir raises where a name is too long
            what = "is a file" if os.path.exists(directory) else "does not exist"
            raise RequestError(f"the directory {directory} {what}", remedy="name a directory of recordings")
        found += [Found(path, prefix + below, directory) for path, below in _below(directory, endings)]
    return sorted(found, key=lambda f: f.label)


def _below(directory: Path, endings: tuple[str, ...]) -> Iterator[tuple[Path, str]]:
    """Recordings, and directories that cannot be read: what they hold would be missed without a word.

    Each with its path from `directory` on. There may be very many: a path is taken apart once for a directory.
    """
    closed: list[Path] = []
    for place, below, files in os.walk(directory, onerror=lambda fault: closed.append(Path(fault.filename))):
        below.sort()
        here = Path(place)
        inside = "" if here == directory else here.relative_to(directory).as_posix() + "/"
        for name in files:  # a broken link and a pipe are inputs that fail
            stem, dot, end = name.rpartition(".")
            if stem and (dot + end).lower() in endings and name.lower() not in NAMES:
                yield here / name, inside + name
    for path in closed:
        yield path, path.relative_to(directory).as_posix()


def _prefixes(directories: Sequence[Path]) -> list[str]:
    if len(directories) == 1:
        return [""]
    names = [d.resolve().name for d in directories]
    counts = (names[:k].count(name) for k, name in enumerate(names))
    return [f"{name}-{before + 1}/" if before else f"{name}/" for name, before in zip(names, counts)]


def _table(given: ChannelTable | Path | str | None, path: Path, root: Path | None) -> ChannelTable | None:
    if isinstance(given, ChannelTable):
        return given
    if given is not None:
        return read_channel_table(given)
    beside = channel_table_of(path, root)
    return None if beside is None else read_channel_table(beside)


def channel_table_of(path: Path, root: Path | None = None) -> Path | None:
    """The channel table that applies to a recording: beside it, or in a directory above it up to `root`.

    Raises
    ------
    RequestError
        A directory holds two of them.
    """
    for directory in path.parents:
        if (table := find_channel_table(directory)) is not None:
            return table
        if root is None or directory == root or not path.is_relative_to(root):
            break
    return None


_POINTER = b"version https://git-lfs.github.com/spec/"
# First bytes, what they are called in a message, and what the user can do.
_FOREIGN = (
    (_POINTER, "a Git-LFS pointer, not the recording itself", "fetch the recording with 'git lfs pull'"),
    (b"PK\x03\x04", "a zip archive", "unpack it and name the recording inside"),
    (b"\x1f\x8b", "a gzip archive", "unpack it and name the recording inside"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it and name the recording inside"),
    (b"TDSh", "a TDMS index file, which holds no samples", "name the .tdms file that it belongs to"),
)


def format_of(path: Path) -> Any:
    """Format of a recording: a module of `formats`.

    Raises
    ------
    InputError
        The file is missing, cannot be read, is empty, or is something else; the message says what.
    """
    try:
        if path.is_dir():
            _refuse(path)
        with regular(path).open("rb") as file:
            start = file.read(BEGINNING)
    except RequestError as fault:  # one recording of several, which costs only itself
        raise InputError(fault.found, expected="a recording") from None
    except FileNotFoundError:
        raise InputError(f"the file {path} does not exist", remedy="check the path") from None
    except OSError as fault:
        raise InputError(f"{path} cannot be read ({fault.strerror or fault})") from None
    except ValueError as fault:  # a null character in the name
        raise InputError(f"{str(path)!r} is not a name of a file ({fault})") from None
    for _, module in formats():
        if module.recognises(start):
            return module
    what, remedy = _describe(start)
    named = path.suffix.lower() in (".tdms", ".wav")
    expected = "a TDMS or WAV recording" if named else "a recording: TDMS, WAV, UFF, MAT, HDF5 or CSV"
    kind = NoSignalError if lines_of(start) and not named else InputError
    raise kind(f"{path.name} is {what}", expected=expected, remedy=remedy)


def _refuse(path: Path) -> NoReturn:
    """Say what a directory in place of a recording costs."""
    try:
        os.scandir(path).close()
    except OSError as fault:
        raise InputError(
            f"{path} is a directory that cannot be read ({fault.strerror}); its files are not analysed",
            remedy="give read permission",
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
    if lines_of(start):
        return (
            "a text file",
            "name the recording, or put times first: a column 'time [s]', row number / sampling rate",
        )
    return f"of an unknown format (it begins with {start[:4]!r})", "name a recording"


# File formats of recordings: the built-in ones, tried in this order, then those that installed packages bring.
#
# A format is a module with ``SUFFIXES``, the endings of the files that are looked for in directories,
# ``recognises(start: bytes) -> bool``, told by the first bytes of a file, and
# ``open_recording(path, opening: specan.io.signals.Opening) -> Recording``. A package of yours names it as an entry
# point of the group ``specan.formats``. A file's name decides nothing.
FORMATS = ("wav", "hdf5", "mat", "uff", "tdms", "csv_signals")
ENTRY_POINTS = "specan.formats"
BEGINNING = 4096  # bytes that a format is shown


def formats() -> Iterator[tuple[str, Any]]:
    """Names and modules of the formats; a module is imported when its turn comes."""
    for name in FORMATS:
        yield name, importlib.import_module(f"specan.io.{name}")
    for point in entry_points(group=ENTRY_POINTS):
        yield point.name, point.load()


def suffixes() -> tuple[str, ...]:
    """Endings of the files that are looked for in directories, lower case."""
    return tuple(suffix for _, module in formats() for suffix in getattr(module, "SUFFIXES", ()))
