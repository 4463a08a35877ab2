"""A recording that shows how far it has been read."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import click
import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan_cli.output import asked, say

_LONG_SAMPLES = 50_000_000  # some seconds of work


@dataclass(frozen=True, repr=False)
class Shown(Recording):
    """A recording with a bar on a terminal where reading it takes some time, and a line under ``--verbose``."""

    said: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, recording: Recording) -> Shown:
        """The same recording, shown."""
        return cls(**vars(recording))

    def blocks(
        self, channels: Sequence[Channel], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """Consecutive blocks, as of any recording."""
        stop = min(c.n_samples for c in channels) if stop is None else stop
        rate = channels[0].sampling_rate if channels else 0.0
        text = f"Reading {self.label}: {len(channels)} channels, {stop - start} samples at {rate:g} Hz."
        if asked("verbose") and text not in self.said:
            say(text)
            self.said.add(text)
        short = (stop - start) * len(channels) < _LONG_SAMPLES
        hidden = short or asked("quiet") or not sys.stderr.isatty()
        with click.progressbar(length=stop - start, file=sys.stderr, label=self.label, hidden=hidden) as bar:
            for samples in super().blocks(channels, size, start, stop):
                yield samples
                bar.update(samples.shape[1])
