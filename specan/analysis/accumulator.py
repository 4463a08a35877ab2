"""Analyses that take a recording's samples in pieces, so that memory does not grow with its length."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording

READ_BLOCK = 1 << 16  # samples of a channel that are read at once

Found = TypeVar("Found", covariant=True)


class Reader(Protocol):
    """What takes samples `start` to `stop` of `channels`."""

    channels: tuple[Channel, ...]
    start: int
    stop: int

    def add(self, samples: NDArray[np.float64], /) -> None:
        """Take the next samples (channels, m), as many as there are."""
        ...


class Accumulator(Reader, Protocol[Found]):
    """An analysis of these samples."""

    def result(self) -> Found:
        """What was found."""
        ...


def read_through(accumulator: Accumulator[Found], recording: Recording) -> Found:
    """Give an analysis its samples, and return what it finds."""
    for samples in recording.blocks(accumulator.channels, READ_BLOCK, accumulator.start, accumulator.stop):
        accumulator.add(samples)
    return accumulator.result()
