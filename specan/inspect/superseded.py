"""Work beside the page that ends early when nobody waits for it any more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from specan.data.recording import Channel, Recording

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
