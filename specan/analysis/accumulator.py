"""Analyses that take a recording's samples in pieces, so that memory does not grow with its length."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol, TypeVar

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording

READ_BLOCK = 1 << 16  # samples of a channel that are read at once

Found = TypeVar("Found", covariant=True)


class Reader(Protocol):
    """What takes samples `start` to `stop` of `channels`."""

    channels: tuple[Channel, ...]
    start: int
    stop: int

    def add(self, samples: Real, /) -> None:
        """Take the next samples (channels, m), as many as there are."""
        ...


class Accumulator(Reader, Protocol[Found]):
    """An analysis of these samples."""

    def result(self) -> Found:
        """What was found."""
        ...


def read_through(accumulator: Accumulator[Found], recording: Recording) -> Found:
    """Give an analysis its samples, and return what it finds."""
    feed(recording, [accumulator])
    return accumulator.result()


def feed(recording: Recording, accumulators: Sequence[Reader]) -> None:
    """Give every accumulator the samples of its channels, from its start to its stop.

    Accumulators at one sampling rate over one section share one pass over the file.
    """
    together: dict[tuple[float, int, int], list[Reader]] = defaultdict(list)
    for accumulator in accumulators:
        rate = accumulator.channels[0].sampling_rate
        together[rate, accumulator.start, accumulator.stop].append(accumulator)
    for (_, start, stop), group in together.items():
        known = {id(c): k for k, c in enumerate(recording.channels)}
        every = {id(c): c for accumulator in group for c in accumulator.channels}
        # In the order of the file, and those that begin later than in the file behind them.
        channels = sorted(every.values(), key=lambda c: known.get(id(c), len(known)))
        position = {id(c): i for i, c in enumerate(channels)}
        rows = [[position[id(c)] for c in accumulator.channels] for accumulator in group]
        whole = list(range(len(channels)))
        for block in recording.blocks(channels, READ_BLOCK, start, stop):
            for accumulator, mine in zip(group, rows, strict=True):
                accumulator.add(block if mine == whole else block[mine])
