"""Complex lines of several channels as rows: all real parts, one channel after the other, then all imaginary parts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array


class KeptLines:
    """What observations of complex lines share.

    Attributes
    ----------
    recording : str
    channels : tuple of str
    kept : bool array (channels, lines)
        Rows in use; the real and the imaginary part of a line go together.
    """

    recording: str
    channels: tuple[str, ...]
    kept: NDArray[np.bool_]

    @property
    def n(self) -> int:
        """Number of real values."""
        return 2 * int(self.kept.sum())

    @property
    def recordings(self) -> tuple[str, ...]:
        """The one recording."""
        return (self.recording,)

    def stack(self, lines: NDArray[np.complex128]) -> Array:
        """Rows of complex lines (channels, lines, ...)."""
        return np.concatenate([lines.real[self.kept], lines.imag[self.kept]])

    def rows(self, of_lines: Any) -> NDArray[Any]:
        """Rows of what both parts of a line have alike, broadcast to (channels, lines)."""
        return np.tile(np.broadcast_to(of_lines, self.kept.shape)[self.kept], 2)

    @property
    def channel_of_row(self) -> NDArray[np.str_]:
        """Name of the channel of every row."""
        return self.rows(np.array(self.channels)[:, None])

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """Some of the rows; a line stays where either of its parts does."""
        half = self.n // 2
        kept = self.kept.copy()
        kept[self.kept] = mask[:half] | mask[half:]
        found: Self = replace(self, kept=kept)  # type: ignore[type-var]
        return found
