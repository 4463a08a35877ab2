"""The process in which a MAT file is taken apart: the reader of a damaged one may crash, or ask for all memory.

    python -m specan.io.mat_worker FILE BYTES

The variables go to standard output as a pickle of arrays and words, or what is wrong as a pickled text.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np


def leaves(content: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Variables, and members of structures and of lists of structures, by their paths."""
    if isinstance(content, dict):
        for name, value in content.items():
            if not name.startswith("__"):
                yield from leaves(value, (*above, name))
    elif isinstance(content, (list, tuple)) or _structures(content):
        for number, value in enumerate(np.asarray(content, dtype=object).flat, 1):
            yield from leaves(value, (*above, str(number)))
    elif isinstance(content, (str, int, float, np.ndarray, np.generic)):
        yield above, content


def _structures(content: Any) -> bool:
    array = isinstance(content, np.ndarray) and content.dtype.kind == "O"
    return array and any(isinstance(v, (dict, np.ndarray)) for v in content.flat)


def main(path: str, most_bytes: int) -> None:
    """Write the variables of one file to standard output."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    except (ImportError, ValueError, OSError):
        pass  # Windows has no such limit
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no part of the answer
    from scipy.io import loadmat

    try:
        found: Any = dict(leaves(loadmat(path, simplify_cells=True)))
    except MemoryError:
        found = f"it takes more than {most_bytes / 1e9:.1f} GB of memory"
    except Exception as fault:  # a damaged file ends in many errors
        found = f"{type(fault).__name__}: {fault}"
    with sink:
        pickle.dump(found, sink, pickle.HIGHEST_PROTOCOL)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
