"""Complex lines of several channels as rows: all real parts, one channel after the other, then all imaginary parts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array, Observation

ABOVE_NOISE = (
    10.0  # times its noise that a line's power must be for its level to count: noise then adds 0.4 dB
)


class KeptLines(Observation):
    """What observations of complex lines share.

    Attributes
    ----------
    recording : str
    channels : tuple of str
    kept : bool array (channels, lines)
        Rows in use; the real and the imaginary part of a line go together.
    level_of : str
        What the levels of its rows are called.
    cells : tuple of str
        Labels of the rows whose powers are added up to a level.
    """

    level_of: ClassVar[str]
    cells: ClassVar[tuple[str, ...]]
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

    def powers(self) -> tuple[Array, Array]:
        """Which rows count for a level, and the power of noise in each that is beside it."""
        raise NotImplementedError

    def stack(self, lines: NDArray[np.complex128]) -> Array:
        """Rows of complex lines (channels, lines, ...)."""
        return np.concatenate([lines.real[self.kept], lines.imag[self.kept]])

    def lines_of(self, rows: Array, unused: float = 0.0) -> NDArray[np.complex128]:
        """Complex lines (channels, lines) of their rows: `stack` undone."""
        lines = np.full(self.kept.shape, unused, dtype=complex)
        real, imaginary = np.split(rows, 2)
        lines[self.kept] = real + 1j * imaginary
        return lines

    def turned(self, rows: Array) -> Array:
        """Rows of lines turned by a right angle."""
        real, imaginary = np.split(rows, 2)
        return np.concatenate([-imaginary, real])

    def sizes(self, rows: Array) -> Array:
        """RMS of the two parts of each line, for both of its rows."""
        real, imaginary = np.split(rows, 2)
        return np.tile(np.sqrt((real**2 + imaginary**2) / 2), 2)

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
