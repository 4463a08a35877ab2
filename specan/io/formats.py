"""File formats of recordings: the built-in ones, and those that installed packages bring.

A format is a module with ``recognises(start: bytes) -> bool``, told by the first bytes of a file, and
``open_recording(path, *, label, channel_table, sampling_rate) -> Recording``. A package of yours names it as an
entry point of the group ``specan.formats``. A file's name decides nothing.
"""

from __future__ import annotations

import importlib
from importlib.metadata import entry_points
from typing import Any

# name -> module; tried in this order, those without a mark of their own last
FORMATS = {
    "tdms": "specan.io.tdms",
    "wav": "specan.io.wav",
    "hdf5": "specan.io.hdf5",
    "mat": "specan.io.mat",
    "uff": "specan.io.uff_signals",
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
