"""What models keep between evaluations to be faster, and how it is forgotten."""

from __future__ import annotations

from collections.abc import Callable

_CLEAR: list[Callable[[], None]] = []


def forgotten_by(clear: Callable[[], None]) -> None:
    """Have `forget` clear what is kept; it depends on what came before, if in the last digits only."""
    _CLEAR.append(clear)


def forget() -> None:
    """Clear it all."""
    for clear in _CLEAR:
        clear()
