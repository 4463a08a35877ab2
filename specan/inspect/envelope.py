"""Waveforms of any length as the lowest and highest sample of each screen column, kept for the next time."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from specan.analysis.batch.identity import Identity, identify
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.extremes import low_and_high
from specan.inspect.opened import WatchedSource
from specan.study.user_effects import trust_record

STEP = 1024  # samples behind one pair of the overview
PIECE = STEP * 512
DIRECT = 2_000_000  # samples that are read for a view; above that the overview serves
# Places at which a long channel is looked at before it is read: half the columns of a wide screen.
LOOKS = 750


@dataclass
class Overview:
    """Lowest and highest sample of every `STEP` samples of one channel, as far as they were read.

    That of a long channel is kept; see `specan.inspect.envelope`.
    """

    recording: Recording
    channel: Channel

    def __post_init__(self) -> None:
        count = -(-self.channel.n_samples // STEP)
        self.low, self.high = np.full(count, np.nan), np.full(count, np.nan)
        self.read_to = 0
        self._place = place_of(self.recording, self.channel, STEP)
        kept = None if self._place is None else load(self._place, count)
        if kept is not None:
            self.low, self.high = kept
            self.read_to = self.channel.n_samples
        self._lock = Lock()

    @property
    def finished(self) -> bool:
        """Whether the whole channel was read."""
        return self.read_to >= self.channel.n_samples

    @property
    def looked_at(self) -> bool:
        """Whether there is something for every part of the channel."""
        return self.read_to > 0 or bool(np.isfinite(self.low[-1:]).all())

    def look(self, parts: list[NDArray[np.float64]]) -> None:
        """Take samples in the middle of equal parts of the channel for the whole of each, until it is read."""
        edges = np.linspace(0, self.low.size, len(parts) + 1).astype(int)
        with self._lock:
            for first, last, samples in zip(edges, edges[1:], parts, strict=False):
                self.low[first:last] = np.fmin.reduce(samples)
                self.high[first:last] = np.fmax.reduce(samples)

    def read_on(self) -> None:
        """Read the next piece."""
        with self._lock:
            start, stop = self.read_to, min(self.read_to + PIECE, self.channel.n_samples)
            if start >= stop:
                return
            samples = self.recording.read([self.channel], start, stop)[0]
            edges = np.arange(0, samples.size, STEP)
            pairs = slice(start // STEP, start // STEP + edges.size)
            self.low[pairs] = np.fmin.reduceat(samples, edges)
            self.high[pairs] = np.fmax.reduceat(samples, edges)
            self.read_to = stop
            if self._place is not None and self.finished:
                keep(self._place, self.low, self.high)


class Waveform:
    """Draws parts of one channel; short parts are read from the file, long ones from the overview."""

    def __init__(self, recording: Recording, channel: Channel) -> None:
        self.recording, self.channel = recording, channel
        self.overview = Overview(recording, channel)

    def needs_overview(self, start_s: float, stop_s: float) -> bool:
        """Whether a part is longer than what is read for a view."""
        first, last = self._samples(start_s, stop_s)
        return last - first > DIRECT and not self.overview.finished

    def part(
        self, start_s: float, stop_s: float, columns: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
            low, high = self.overview.low[pairs], self.overview.high[pairs]
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


def look(waveforms: list[Waveform]) -> None:
    """A first picture of long channels from few samples: what lies between them is not seen yet."""
    together: dict[tuple[int, int], list[Waveform]] = defaultdict(list)
    for waveform in waveforms:
        if not waveform.overview.looked_at and waveform.channel.n_samples > LOOKS * PIECE // 16:
            together[id(waveform.recording), waveform.channel.n_samples].append(waveform)
    for (_, length), alike in together.items():
        recording, channels = alike[0].recording, [w.channel for w in alike]
        middles = ((np.arange(LOOKS) + 0.5) * (length - STEP) / LOOKS).astype(int)
        read = [recording.read(channels, m, m + STEP) for m in middles.tolist()]
        for row, waveform in enumerate(alike):
            waveform.overview.look([samples[row] for samples in read])


def read_overviews(waveforms: list[Waveform], tell: Callable[[float], bool]) -> None:
    """Read what the overviews lack, piece by piece; `tell` hears the part done and says whether to go on.

    It hears 0 when there is a first picture of channels that take long to read.
    """
    total = max(sum(w.channel.n_samples for w in waveforms), 1)
    look(waveforms)
    if not tell(sum(w.overview.read_to for w in waveforms) / total):
        return
    while waiting := [w for w in waveforms if not w.overview.finished]:
        for waveform in waiting:
            waveform.overview.read_on()
        if not tell(sum(w.overview.read_to for w in waveforms) / total):
            return


# Overviews of long channels, kept for the next time that the same file is opened.
#
# They lie in the user's configuration directory: recordings are often where nothing may be written. A file is known by
# its size, its time, its metadata and samples all over it, a channel by its first samples as they are read now, so that
# another calibration has another overview. What is damaged is as if it were not there.

LEAST = 20_000_000  # samples; fewer are read within a second
MOST_FILES = 104  # of four recordings with all their channels; the oldest go
_DIGEST = hashlib.sha256().digest_size

Real = NDArray[np.float64]


def folder() -> Path:
    """Where they lie."""
    return trust_record().parent / "overviews"


def place_of(recording: Recording, channel: Channel, step: int) -> Path | None:
    """The file of a channel's overview; None for what is short, or is not a file."""
    source = recording.source
    if channel.n_samples < LEAST or not isinstance(source, WatchedSource):
        return None
    with contextlib.suppress(OSError):
        known = _identity(str(source.path), source.stamp)
        about = (known.digest, known.mtime_ns, channel.group, channel.name, channel.n_samples, step)
        digest = hashlib.sha256(repr(about).encode())
        digest.update(np.ascontiguousarray(recording.read([channel], 0, step)).tobytes())
        return folder() / digest.hexdigest()
    return None


@lru_cache(maxsize=4)
def _identity(path: str, stamp: tuple[int, int]) -> Identity:
    return identify(path)


def load(place: Path, count: int) -> tuple[Real, Real] | None:
    """Lowest and highest samples of `count` steps; None where they are not kept, or not whole."""
    with contextlib.suppress(OSError):
        content = place.read_bytes()
        pairs = content[_DIGEST:]
        if len(pairs) == 16 * count and hashlib.sha256(pairs).digest() == content[:_DIGEST]:
            low, high = np.frombuffer(pairs, dtype="<f8").reshape(2, count).astype(np.float64)
            return low, high
    return None


def keep(place: Path, low: Real, high: Real) -> None:
    """Keep an overview; where nothing can be written nothing is kept."""
    pairs = np.stack([low, high]).astype("<f8").tobytes()
    part = place.with_name(f"{place.name}.{os.getpid()}.part")
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(hashlib.sha256(pairs).digest() + pairs)
        part.replace(place)
        for old in sorted(place.parent.iterdir(), key=lambda p: p.stat().st_mtime)[:-MOST_FILES]:
            old.unlink()
