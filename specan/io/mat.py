"""Recordings in MAT files of MATLAB: version 5 to 7 through scipy, version 7.3 as HDF5."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from specan.data.recording import Recording
from specan.errors import InputError
from specan.io.array_tree import Array, Tree, column_of
from specan.io.signals import Opening

SUFFIXES = (".mat",)

# Memory that a file may take: what Python and scipy need, and for each byte of the file 32. Integers of 16 bits that
# were saved as double are packed to a quarter at best, signals hardly at all; scipy holds three copies.
_BYTES, _BYTES_FOR_A_BYTE = 1 << 30, 32


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is a MAT file of version 5 to 7 (the header's end names the byte order)."""
    return start.startswith(b"MATLAB 5.0 MAT-file") and start[126:128] in (b"IM", b"MI")


def open_recording(path: Path, opening: Opening) -> Recording:
    """Read the signals of a MAT file; all its variables are held in memory.

    Raises
    ------
    InputError
        The file is damaged, takes too much memory, or holds no signal.
    """
    tree = Tree()
    for where, value in _variables(path).items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
            tree.arrays[where] = Array(value.shape, value.dtype.kind, partial(column_of, value))
        else:
            tree.put(where, value)
    return tree.recording(opening)


def _variables(path: Path) -> dict[tuple[str, ...], Any]:
    """Words, numbers and arrays of a file, by their paths; read in a process of their own, which may crash."""
    most = _BYTES + _BYTES_FOR_A_BYTE * path.stat().st_size
    done = subprocess.run(
        [sys.executable, "-m", "specan.io.mat_worker", str(path.absolute()), str(most)],
        capture_output=True, check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},  # threads hold memory
    )  # fmt: skip
    try:
        found = pickle.loads(done.stdout)
    except Exception:
        last = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
        found = " ".join(["its reader crashed", *last])
    if isinstance(found, str):
        raise InputError(f"{path.name} is a damaged MAT file ({found})", remedy="save it again")
    return dict(found)
