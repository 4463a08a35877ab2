"""Recordings in MAT files of MATLAB: version 5 to 7 through scipy, version 7.3 as HDF5."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from specan.data.recording import Recording
from specan.errors import InputError
from specan.io.array_tree import Array, Tree
from specan.io.channel_table import ChannelTable


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is a MAT file of version 5 to 7 (the header's end names the byte order)."""
    return start.startswith(b"MATLAB 5.0 MAT-file") and start[126:128] in (b"IM", b"MI")


def open_recording(
    path: Path, *, label: str, channel_table: ChannelTable | None = None, sampling_rate: float | None = None
) -> Recording:
    """Read the signals of a MAT file; all its variables are held in memory.

    Parameters
    ----------
    path, label, channel_table, sampling_rate
        As for `specan.io.tdms.open_tdms`.

    Raises
    ------
    InputError
        The file is damaged, or holds no signal.
    """
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except Exception as fault:  # a damaged file ends in many errors
        raise InputError(
            f"{path.name} is a damaged MAT file ({type(fault).__name__}: {fault})", remedy="save it again"
        ) from None
    tree = Tree()
    for where, value in _leaves(content, ()):
        if isinstance(value, str):
            tree.words[where] = value.strip()
        elif (
            isinstance(value, np.ndarray)
            and value.dtype.kind in "OU"
            and all(isinstance(v, str) for v in value.flat)
        ):
            tree.words[where] = [str(v).strip() for v in value.flat]
        elif np.ndim(value) == 0 and np.issubdtype(np.asarray(value).dtype, np.number):
            tree.numbers[where] = float(np.real(value))
        elif isinstance(value, np.ndarray):
            tree.arrays[where] = _in_memory(value)
    return tree.recording(label, channel_table, sampling_rate)


def _in_memory(value: np.ndarray) -> Array:
    flat = value.reshape(-1, 1) if value.ndim < 2 or (1 in value.shape and value.ndim == 2) else value
    if flat.ndim == 2 and flat.shape[0] < flat.shape[1]:
        flat = flat.T

    def read(start: int, stop: int, column: int) -> np.ndarray:
        return flat[start:stop, column]

    return Array(value.shape, value.dtype.kind, read)


def _leaves(content: Any, above: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Variables, and members of structures and of lists of structures, by their paths."""
    if isinstance(content, dict):
        for name, value in content.items():
            if not name.startswith("__"):
                yield from _leaves(value, (*above, name))
    elif isinstance(content, (list, tuple)) or (isinstance(content, np.ndarray) and _structures(content)):
        for number, value in enumerate(np.asarray(content, dtype=object).flat, 1):
            yield from _leaves(value, (*above, str(number)))
    else:
        yield above, content


def _structures(content: np.ndarray) -> bool:
    return content.dtype.kind == "O" and any(isinstance(v, (dict, np.ndarray)) for v in content.flat)
