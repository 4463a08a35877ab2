"""Several analyses of one recording, its samples read once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from specan.analysis.accumulator import READ_BLOCK, Reader
from specan.data.recording import Recording


def feed(recording: Recording, accumulators: Sequence[Reader]) -> None:
    """Give every accumulator the samples of its channels, from its start to its stop.

    Accumulators at one sampling rate over one section share one pass over the file.
    """
    together: dict[tuple[float, int, int], list[Reader]] = defaultdict(list)
    for accumulator in accumulators:
        rate = accumulator.channels[0].sampling_rate
        together[rate, accumulator.start, accumulator.stop].append(accumulator)
    for (_, start, stop), group in together.items():
        wanted = {id(c) for accumulator in group for c in accumulator.channels}
        channels = [c for c in recording.channels if id(c) in wanted]
        position = {id(c): i for i, c in enumerate(channels)}
        rows = [[position[id(c)] for c in accumulator.channels] for accumulator in group]
        whole = list(range(len(channels)))
        for block in recording.blocks(channels, READ_BLOCK, start, stop):
            for accumulator, mine in zip(group, rows, strict=True):
                accumulator.add(block if mine == whole else block[mine])
