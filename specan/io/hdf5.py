"""Recordings in HDF5 files, those of MATLAB 7.3 among them; samples stay in the file until they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from specan.data.recording import Recording
from specan.errors import InputError, library
from specan.io.array_tree import Array, Tree, column_of
from specan.io.signals import Opening

SUFFIXES = (".h5", ".hdf5")

MAGIC = b"\x89HDF\r\n\x1a\n"


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is HDF5; a block of the user's own (MATLAB's) may stand before its mark."""
    return start.startswith(MAGIC) or start.startswith(b"MATLAB 7.3 MAT-file")


def open_recording(path: Path, opening: Opening) -> Recording:
    """Open the signals of an HDF5 file.

    Raises
    ------
    InputError
        The file is damaged, or holds no signal.
    RequestError
        h5py is not installed.
    """
    h5py = library("h5py", "hdf5")
    tree = Tree()
    try:
        with h5py.File(path, "r") as file:

            def visit(name: str, node: Any) -> None:
                where = tuple(filter(None, name.split("/")))
                if name.startswith("#"):  # MATLAB's own store of references
                    return
                for key, value in node.attrs.items():
                    if not key.startswith("MATLAB_"):
                        tree.put((*where, key), value)
                if isinstance(node, h5py.Group):
                    # Names that lead to another file: a file of a stranger could name any file of this machine.
                    for below in node:
                        if isinstance(node.get(below, getlink=True), h5py.ExternalLink):
                            tree.aside["/".join((*where, below))] = _ELSEWHERE
                elif node.external or node.is_virtual:
                    tree.aside[name] = _ELSEWHERE
                else:
                    _dataset(h5py, file, path, where, node, tree)

            visit("", file)
            file.visititems(visit)
    except OSError as fault:
        raise InputError(f"{path.name} is a damaged HDF5 file ({fault})", remedy="copy it again") from None
    return tree.recording(opening)


_ELSEWHERE = "its samples lie in another file, which is not read; copy them into this one"


def _dataset(h5py: Any, file: Any, path: Path, where: tuple[str, ...], node: Any, tree: Tree) -> None:
    kind = node.attrs.get("MATLAB_class", b"")
    if kind == b"char":
        tree.words[where] = "".join(chr(code) for code in node[()].ravel())
    elif node.dtype == h5py.ref_dtype:
        said = [file[reference] for reference in node[()].ravel()]
        tree.words[where] = [
            "".join(chr(code) for code in np.ravel(one[()])) for one in said if one.dtype.kind == "u"
        ]
    elif node.size == 1 or node.dtype.kind in "OSU":
        tree.put(where, node[()])
    else:

        def read(start: int, stop: int, column: int) -> np.ndarray:
            with h5py.File(path, "r") as again:
                return column_of(again["/".join(where)], start, stop, column)

        tree.arrays[where] = Array(tuple(node.shape), node.dtype.kind, read)
