"""Work beside the page that ends early when nobody waits for it any more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Channel, Recording, SampleSource

Tell = Callable[[float], bool]  # hears the part done, says whether to go on
_PIECE = 1 << 16


class Superseded(Exception):
    """Another request came before this one was done."""


class _Accumulator(Protocol):
    channels: tuple[Channel, ...]
    start: int
    stop: int

    def add(self, samples: NDArray[np.float64]) -> None: ...
    def result(self) -> Any: ...


@dataclass(frozen=True)
class _Heard:
    """Samples whose reading is told."""

    source: SampleSource
    total: int
    tell: Tell
    done: list[int] = field(default_factory=lambda: [0])

    def read(self, indices: Sequence[int], start: int, stop: int) -> NDArray[np.float64]:
        """Samples of the chosen channels; see `SampleSource`."""
        self.done[0] += stop - start
        if not self.tell(min(self.done[0] / max(self.total, 1), 1.0)):
            raise Superseded
        return self.source.read(indices, start, stop)


def heard(recording: Recording, total: int, tell: Tell) -> Recording:
    """A recording that tells how much of `total` samples an analysis has read, and ends it when told so."""
    return replace(recording, source=_Heard(recording.source, total, tell))


def run(accumulator: _Accumulator, recording: Recording, tell: Tell) -> Any:
    """Feed an analysis its section of a recording and return the result.

    Raises
    ------
    Superseded
        `tell` said not to go on.
    """
    first, last = accumulator.start, accumulator.stop
    done = first
    for samples in recording.blocks(accumulator.channels, _PIECE, first, last):
        accumulator.add(samples)
        done += samples.shape[1]
        if not tell((done - first) / (last - first)):
            raise Superseded
    return accumulator.result()
