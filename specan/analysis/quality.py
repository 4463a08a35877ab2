"""Dead, clipped and missing samples, found while the samples pass by for another purpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.dsp.clipping import is_cut_off, longest_run
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.result import gathered

# Converters are not symmetric: the largest positive code of 16 bits is 3.05e-5 short of full scale.
_FULL_SCALE_TOLERANCE = 4e-5
LARGEST = 1e150  # of a sample whose square, summed over any record, is a number
_HEAD = 2  # samples on either side of a block border that are looked at together
_GRID = 1 << 15
BLOCK = 1 << 17


@dataclass
class _Rail:
    """One side of a channel; the lower side is looked at with its sign turned."""

    extreme: float = -np.inf
    here: bool = False  # whether the block at hand reaches it
    clipped: bool = False

    def rise_to(self, top: float, full_scale: float) -> None:
        if top > self.extreme:
            # A rail below full scale is the extreme of the whole record: an earlier, lower one was none.
            self.extreme, self.clipped = top, self.clipped and self.extreme >= full_scale
        self.here = top == self.extreme


class QualityAccumulator:
    """Finds dead, clipped and non-finite channels in one pass over consecutive blocks.

    A channel is *clipped* where two or more consecutive samples are at the converter's full scale, or where it
    rests on its extreme value as `specan.dsp.clipping.is_cut_off` says: an amplifier may overload at less.
    Pulses of a tacho are no clipping.

    Parameters
    ----------
    channels : sequence of Channel
        The channels, in the order of the rows that `add` will be given.
    start, stop : int
        Which of their samples it is given, where it shares a pass with other analyses.

    Examples
    --------
    >>> import numpy as np
    >>> quality = QualityAccumulator((Channel("Mic 1", unit="Pa", full_scale=1.0),))
    >>> quality.add(np.clip(1.5 * np.sin(np.arange(1000) / 50.0), -1.0, 1.0)[None])
    >>> quality.result()[0].flags
    ('clipped',)
    """

    def __init__(self, channels: tuple[Channel, ...], start: int = 0, stop: int = 0) -> None:
        self.channels, self.start, self.stop = channels, start, stop
        self._grid = OverlappedBlocks(_GRID)
        self._not_finite = [False] * len(channels)
        self._rails = [(_Rail(), _Rail()) for _ in channels]
        self._tail = np.empty((len(channels), 0))

    def add(self, block: Real) -> None:
        """Take the next block, shape (channels, samples) of any length."""
        for part in self._grid.feed(block):
            self._take(part)

    def _take(self, block: Real) -> None:
        if not block.shape[1]:
            return
        highest, lowest = block.max(axis=1), block.min(axis=1)
        for row, channel in enumerate(self.channels):
            samples, border = block[row], np.concatenate([self._tail[row], block[row, :_HEAD]])
            if not (highest[row] < LARGEST and lowest[row] > -LARGEST):
                usable = np.abs(samples) < LARGEST
                self._not_finite[row] |= not usable.all()
                samples, border = samples[usable], border[np.abs(border) < LARGEST]
            if not samples.size:
                continue
            low, high = self._rails[row]
            full_scale = (channel.full_scale or np.inf) * (1.0 - _FULL_SCALE_TOLERANCE)
            low.rise_to(-float(samples.min()), full_scale)
            high.rise_to(float(samples.max()), full_scale)
            for sign, rail in ((-1.0, low), (1.0, high)):
                if rail.clipped or not (rail.here or rail.extreme >= full_scale):
                    continue
                rail.clipped = any(
                    longest_run(sign * part >= full_scale) >= 2 for part in (samples, border)
                ) or is_cut_off(sign * samples, rail.extreme, low.extreme + high.extreme)
        self._tail = np.concatenate([self._tail, block[:, -_HEAD:]], axis=1)[:, -_HEAD:]

    def result(self) -> tuple[Quality, ...]:
        """What was found, one entry a channel; call it once, after the last block."""
        if self._grid.rest is not None:
            self._take(self._grid.rest)
        return tuple(
            Quality(
                minimum=-low.extreme if np.isfinite(low.extreme) else float("nan"),
                maximum=high.extreme if np.isfinite(high.extreme) else float("nan"),
                clipped=(low.clipped or high.clipped) and channel.role != "tacho",
                not_finite=missing,
            )
            for channel, missing, (low, high) in zip(self.channels, self._not_finite, self._rails)
        )


def rms_and_quality(recording: Recording) -> dict[int, tuple[float, Quality]]:
    """RMS and quality by the place of a channel; channels of one rate and length are read together."""
    together = gathered(((c.sampling_rate, c.n_samples), place) for place, c in enumerate(recording.channels))
    found: dict[int, Any] = {}
    for (_, n_samples), places in together.items():
        channels = [recording.channels[p] for p in places]
        quality, energy = QualityAccumulator(tuple(channels)), np.zeros(len(channels))
        for block in recording.blocks(channels, BLOCK):
            quality.add(block)
            energy += np.einsum("ij,ij->i", block, block)
        rms = np.sqrt(energy / n_samples).tolist()
        found.update(zip(places, zip(rms, quality.result(), strict=True), strict=True))
    return found


def quality_flags(
    channels: Sequence[Channel], file_flags: Sequence[str], quality: Sequence[Quality] | None
) -> tuple[tuple[str, ...], ...]:
    """Words for each channel: those of its samples, and those of the file."""
    found = [()] * len(channels) if quality is None else [q.flags for q in quality]
    return tuple((*words, *file_flags) for words in found)
