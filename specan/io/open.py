"""Opening recordings: one entry for every format, and the recordings of directories."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from specan.data.calibration import Calibration, apply
from specan.data.recording import Recording
from specan.errors import InputError, RequestError, SpecanError
from specan.io.calibration_file import read_calibration
from specan.io.channel_table import ChannelTable, find_channel_table, read_channel_table
from specan.io.content import format_named, format_of
from specan.io.sampling_rate import FASTEST_HZ, SLOWEST_HZ, is_rate

SUFFIXES = (".tdms", ".wav")


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
    """

    path: Path
    label: str


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
    kind = format_of(path)
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
        recording: Recording = format_named(kind).open_recording(
            path, label=name, channel_table=table, sampling_rate=sampling_rate
        )
    except (SpecanError, OSError):
        raise
    except Exception as fault:  # a damaged number can end in any error of Python
        raise InputError(
            f"{name} cannot be opened ({type(fault).__name__}: {fault})",
            expected="headers that are whole",
            remedy="copy or record it again",
        ) from fault
    if calibration is None:
        return recording
    if not isinstance(calibration, Calibration):
        calibration = read_calibration(calibration)
    return apply(calibration, recording)


def find_recordings(directories: Sequence[Path | str]) -> list[Found]:
    """Recordings in directories and below them, and directories that cannot be read, sorted by label.

    ``*.tdms`` and ``*.wav`` in any case. Directories of one name get a number, so that labels differ.

    Raises
    ------
    RequestError
        A directory does not exist.
    """
    found = []
    prefixes = _prefixes([Path(d) for d in directories])
    for directory, prefix in zip(map(Path, directories), prefixes, strict=True):
        if not os.path.isdir(directory):  # Path.is_dir raises where a name is too long
            what = "is a file" if os.path.exists(directory) else "does not exist"
            raise RequestError(f"the directory {directory} {what}", remedy="name a directory of recordings")
        found += [Found(path, prefix + path.relative_to(directory).as_posix()) for path in _below(directory)]
    return sorted(found, key=lambda f: f.label)


def _below(directory: Path) -> Iterator[Path]:
    """Recordings, and directories that cannot be read: what they hold would be missed without a word."""
    closed: list[Path] = []
    for place, below, files in os.walk(directory, onerror=lambda fault: closed.append(Path(fault.filename))):
        below.sort()
        # A broken link and a pipe are inputs that fail.
        yield from (Path(place, name) for name in files if Path(name).suffix.lower() in SUFFIXES)
    yield from closed


def _prefixes(directories: Sequence[Path]) -> list[str]:
    if len(directories) == 1:
        return [""]
    names = [d.resolve().name for d in directories]
    seen: dict[str, int] = {}
    prefixes = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        prefixes.append(f"{name}/" if seen[name] == 1 else f"{name}-{seen[name]}/")
    return prefixes


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
    for directory in _upwards(path.parent, root):
        if (table := find_channel_table(directory)) is not None:
            return table
    return None


def _upwards(directory: Path, root: Path | None) -> Iterable[Path]:
    yield directory
    if root is not None and directory.is_relative_to(root):
        while directory != root:
            directory = directory.parent
            yield directory
