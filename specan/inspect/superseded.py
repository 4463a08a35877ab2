"""Work beside the page that ends early when nobody waits for it any more."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording

Tell = Callable[[float], bool]  # hears the part done, says whether to go on


class Superseded(Exception):
    """Another request came before this one was done."""


@dataclass(frozen=True, repr=False)
class Heard(Recording):
    """A recording that tells how much of a section an analysis has read, and ends it when told so."""

    tell: Tell = lambda part: True

    @classmethod
    def of(cls, recording: Recording, tell: Tell) -> Heard:
        """The same recording, heard."""
        return cls(**vars(recording), tell=tell)

    def blocks(
        self, channels: Sequence[Channel], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """Consecutive blocks, as of any recording.

        Raises
        ------
        Superseded
            `tell` said not to go on.
        """
        stop = min(c.n_samples for c in channels) if stop is None else stop
        done = start
        for samples in super().blocks(channels, size, start, stop):
            yield samples
            done += samples.shape[1]
            if not self.tell((done - start) / (stop - start)):
                raise Superseded
