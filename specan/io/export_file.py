"""What the export formats share: samples in blocks, a missing library."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import RequestError

BLOCK = 1 << 16


@dataclass(frozen=True)
class Excerpt:
    """Channels of one sampling rate, from sample `start` to `stop`."""

    recording: Recording
    channels: tuple[Channel, ...]
    start: int
    stop: int

    @property
    def rate(self) -> float:
        """Sampling rate in hertz."""
        return self.channels[0].sampling_rate

    @property
    def n(self) -> int:
        """Number of samples of each channel."""
        return self.stop - self.start

    def names(self) -> list[str]:
        """Names of the channels, with their group where two channels share a name."""
        plain = [c.name for c in self.channels]
        return [c.name if plain.count(c.name) == 1 else f"{c.group}/{c.name}" for c in self.channels]

    def blocks(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Time in seconds from the beginning of the recording, and samples (channels, n)."""
        first = self.start
        for samples in self.recording.blocks(self.channels, BLOCK, self.start, self.stop):
            yield (first + np.arange(samples.shape[1])) / self.rate, samples
            first += samples.shape[1]


def library(name: str, extra: str) -> Any:
    """A library that only some users need."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise RequestError(
            f"{name} is not installed", expected="it for this format", remedy=f"pip install 'specan[{extra}]'"
        ) from None


def write_excerpt(excerpt: Excerpt, form: str, path: Path, decimal: str = ".") -> None:
    """Write it as ``csv``, ``uff``, ``wav`` or ``parquet``; `decimal` is the decimal sign of CSV."""
    module = importlib.import_module(f"specan.io.export_{form}")
    extra = (decimal,) if form == "csv" else ()
    getattr(module, f"write_{form}")(excerpt, path, *extra)


def together(channels: Sequence[Channel]) -> str:
    """Units of several channels in words: ``Pa (Mic 1, Mic 2), V (Generator)``."""
    units = dict.fromkeys(c.unit for c in channels)
    return ", ".join(f"{unit} ({', '.join(c.name for c in channels if c.unit == unit)})" for unit in units)
