"""Overlapping blocks on a fixed grid of samples, whatever the pieces in which the samples arrive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from specan.arrays import Real


class OverlappedBlocks:
    """Cuts consecutive pieces (channels, m) into blocks that begin at 0, hop, 2 hop, ...

    A result that is a sum over blocks depends on where these begin (in its last bits at least). On this grid it depends
    on the samples alone, not on how much of them a reader holds at once.

    Parameters
    ----------
    block : int
        Length of a block in samples.
    hop : int, optional
        Distance of their beginnings; by default one follows the other.
    shifts : sequence of int, optional
        Samples by which each channel is read later than the grid says (to align delayed channels).

    Examples
    --------
    >>> grid = OverlappedBlocks(4, 2)
    >>> [b[0].tolist() for piece in ([0, 1, 2], [3, 4, 5, 6]) for b in grid.feed(np.array([piece], float))]
    [[0.0, 1.0, 2.0, 3.0], [2.0, 3.0, 4.0, 5.0]]
    """

    def __init__(self, block: int, hop: int | None = None, shifts: Sequence[int] | None = None) -> None:
        hop = block if hop is None else hop
        if not 0 < hop <= block:
            raise ValueError(f"a hop of {hop} samples for blocks of {block}")
        self.block, self.hop = block, hop
        earliest = min(shifts, default=0) if shifts is not None else 0
        # Only differences matter: a shift below zero delays all the others instead.
        self._shifts = [] if shifts is None or len(set(shifts)) < 2 else [s - earliest for s in shifts]
        self._span = block + max(self._shifts, default=0)
        self._held: Real | None = None

    def feed(self, samples: Real) -> Iterator[Real]:
        """Take the next piece; yield every block (channels, block) that is complete by now.

        A block is a view wherever possible: use it before the next one is asked for.
        """
        if self._held is not None and self._held.shape[1]:
            samples = np.concatenate([self._held, samples], axis=1)
        start = 0
        while start + self._span <= samples.shape[1]:
            yield self._cut(samples, start)
            start += self.hop
        self._held = samples[:, start:].copy()

    @property
    def rest(self) -> Real | None:
        """The samples after the last complete block of those that follow each other; None before the first sample."""
        return self._held

    def _cut(self, samples: Real, start: int) -> Real:
        if not self._shifts:
            return samples[:, start : start + self.block]
        return np.stack(
            [row[start + s : start + s + self.block] for row, s in zip(samples, self._shifts, strict=True)]
        )
