"""Waveforms of any length: short parts are read from the file, long ones from the extremes of their pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.statistics import low_and_high
from specan.result import gathered

COLUMNS = 1500  # of a picture
STEP = 1024  # samples behind one pair of the overview
PIECE = STEP * 512
DIRECT = 2_000_000  # samples that are read for a view; above that the overview serves


class Waveform:
    """Draws parts of one channel; short parts are read from the file.

    Long ones are drawn from an overview: the lowest and highest of every `STEP` samples, read piece by piece.
    """

    def __init__(self, recording: Recording, channel: Channel) -> None:
        self.recording, self.channel, self.read_to = recording, channel, 0
        self._low, self._high = np.full((2, -(-channel.n_samples // STEP)), np.nan)

    @property
    def finished(self) -> bool:
        """Whether the whole channel was read."""
        return self.read_to >= self.channel.n_samples

    def read_on(self) -> None:
        """Read the next piece."""
        start, stop = self.read_to, min(self.read_to + PIECE, self.channel.n_samples)
        samples = self.recording.read([self.channel], start, stop)[0]
        edges = np.arange(0, samples.size, STEP)
        pairs = slice(start // STEP, start // STEP + edges.size)
        self._low[pairs] = np.fmin.reduceat(samples, edges)
        self._high[pairs] = np.fmax.reduceat(samples, edges)
        self.read_to = stop

    def needs_overview(self, start_s: float, stop_s: float) -> bool:
        """Whether a part is longer than what is read for a view."""
        first, last = self._samples(start_s, stop_s)
        return last - first > DIRECT and not self.finished

    def part(self, start_s: float, stop_s: float, columns: int = COLUMNS) -> tuple[Real, Real]:
        """Times and samples to draw a line through: all of them where they are few, else two a column."""
        first, last = self._samples(start_s, stop_s)
        rate = self.channel.sampling_rate
        if last - first <= 2 * columns:
            samples = self.recording.read([self.channel], first, last)[0]
            return np.arange(first, last) / rate, samples
        if last - first <= DIRECT:
            low, high = low_and_high(self.recording.read([self.channel], first, last)[0], columns)
        else:
            pairs = slice(first // STEP, -(-last // STEP))
            low, high = self._low[pairs], self._high[pairs]
            first, last = pairs.start * STEP, pairs.stop * STEP
            if low.size > columns:
                low, high = low_and_high(low, columns)[0], low_and_high(high, columns)[1]
        width = (last - first) / low.size
        times = (first + (np.arange(low.size) + 0.5) * width) / rate
        return np.repeat(times, 2), np.stack([low, high], axis=1).ravel()

    def _samples(self, start_s: float, stop_s: float) -> tuple[int, int]:
        rate, length = self.channel.sampling_rate, self.channel.n_samples
        first = min(max(int(np.floor(start_s * rate)), 0), length)
        return first, min(max(int(np.ceil(stop_s * rate)) + 1, first), length)


def common_reach(drawn: Iterable[tuple[str, Real]]) -> dict[str, float]:
    """Largest magnitude among the channels of each unit; 1 where there is none."""
    found = gathered((unit, float(np.nanmax(np.abs(values), initial=0.0))) for unit, values in drawn)
    return {unit: max(filter(np.isfinite, ends), default=0.0) or 1.0 for unit, ends in found.items()}


def read_overviews(waveforms: list[Waveform], tell: Callable[[float], bool] = lambda part: True) -> None:
    """Read what the overviews lack, piece by piece; `tell` hears the part done and says whether to go on."""
    total = max(sum(w.channel.n_samples for w in waveforms), 1)
    while waiting := [w for w in waveforms if not w.finished]:
        for waveform in waiting:
            waveform.read_on()
        if not tell(sum(w.read_to for w in waveforms) / total):
            return
