"""Spectra against time, in no more columns than a page can show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specan.analysis.accumulator import READ_BLOCK
from specan.analysis.section import section, weightable
from specan.analysis.spectrum import (
    DEFAULT_LINES,
    SAMPLES_PER_LINE,
    BlockSettings,
    block_of,
    correction_of_block,
    integrated,
    lines_between,
    scale_of,
)
from specan.data.recording import Recording
from specan.data.spectrum import Spectrogram
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.weighting import power_weighting
from specan.dsp.welch import CrossSpectra, has_mirror, hop_of

VALUES = 8_000_000
"""Most numbers of a spectrogram: channels times columns times lines, 64 MB."""


BLOCKS, LEAST_LINES = 50, 16
"""Blocks side by side in a section where no number of lines is given, and the fewest lines for that."""


class SpectrogramSettings(BlockSettings):
    """Settings of a spectrogram: those of a spectrum, and how many columns it may have.

    Consecutive blocks are averaged into one column as soon as there are more blocks than `columns`, or than
    `VALUES` leave room for: many channels with many lines have fewer columns, in memory that is bounded.

    Examples
    --------
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(16000) / 8000
    >>> channel = Channel("Mic 1", unit="Pa", sampling_rate=8000.0, n_samples=16000)
    >>> recording = Recording("a.tdms", (channel,), ArraySource([np.cos(2 * np.pi * (500 + 500 * t) * t)]))
    >>> found = SpectrogramSettings(lines=100)(recording)
    >>> strongest = found.frequency_hz[np.argmax(found.density[0], axis=1)]
    >>> float(strongest[0]), float(strongest[-1])
    (531.25, 2468.75)
    """

    columns: int = Field(default=1000, ge=1)

    def __call__(self, recording: Recording) -> Spectrogram:
        """Read the recording once and return the spectrogram."""
        channels, notes = weightable(recording, self.channels, self.weighting)
        start, stop = section(recording, channels, self.start_s, self.stop_s)
        rate, lines = channels[0].sampling_rate, self.lines
        usual = int((stop - start) / SAMPLES_PER_LINE / BLOCKS)
        if lines is None and usual >= LEAST_LINES:  # a short section has fewer: it has to show what changes
            lines = DEFAULT_LINES >> max(math.ceil(math.log2(DEFAULT_LINES / usual)), 0)
        block = block_of(recording, self.model_copy(update={"lines": lines}), stop - start)
        hop = hop_of(block, self.overlap)
        n_blocks = (stop - start - block) // hop + 1
        frequency: NDArray[np.float64] = np.arange(block // 2 + 1, dtype=np.float64) * (rate / block)
        kept = lines_between(frequency, self)
        room = max(1, VALUES // (len(channels) * int(kept.sum())))
        per_column = -(-n_blocks // min(self.columns, room))
        gain = np.square(np.abs([correction_of_block(c, frequency, self.window) for c in channels]))
        gain *= power_weighting(frequency, self.weighting)
        count = n_blocks // per_column  # an incomplete last column is left out
        density = np.zeros((len(channels), count, int(kept.sum())))
        grid, average = OverlappedBlocks(block, hop), CrossSpectra(
            rate, block, self.window, n_channels=len(channels), detrend=self.detrend,
            derivatives=[c.derivatives for c in channels],
        )  # fmt: skip
        pieces = recording.blocks(channels, READ_BLOCK, start, stop)
        for column, auto in zip(range(count), _means(pieces, grid, average, per_column), strict=False):
            density[:, column] = (auto * gain)[:, kept]
        time: NDArray[np.float64] = np.arange(count, dtype=np.float64) * (per_column * hop / rate)
        width = ((per_column - 1) * hop + block) / rate
        return Spectrogram(
            label=recording.label,
            time_s=time + (start / rate + width / 2),
            frequency_hz=frequency[kept],
            channels=tuple(c.label for c in channels),
            units=tuple(c.target_unit for c in channels),
            density=density,
            has_mirror=has_mirror(len(frequency), block)[kept],
            scale=scale_of(self, block, rate),
            blocks_per_column=per_column,
            notes=(*notes, *integrated(channels, self.window, block)),
            settings=self.model_dump(),
        )


def _means(
    pieces: Iterable[NDArray[np.float64]], grid: OverlappedBlocks, average: CrossSpectra, count: int
) -> Iterator[NDArray[np.float64]]:
    """Power spectra, each a mean of `count` blocks."""
    for samples in pieces:
        for part in grid.feed(samples):
            average.add_block(part)
            if average.n_blocks == count:
                yield average.result().auto
                average.clear()
