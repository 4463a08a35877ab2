"""How a long computation tells what it does."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """What is being done, and the share of the whole that is over before it."""

    def __call__(self, text: str, share: float | None = None) -> None:
        """Tell."""


def unheard(text: str, share: float | None = None) -> None:
    """A progress that nobody is told of."""
