"""Compile loops with numba where it is installed (``specan[fast]``); without it they run as Python."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

HAS_NUMBA = find_spec("numba") is not None


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, compiled at its first call and kept on disk. Import modules that use this only when needed."""
    if not HAS_NUMBA:
        return function
    from numba import njit

    made: Callable[..., Any] = njit(cache=True)(function)
    return made
