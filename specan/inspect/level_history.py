"""Level against time, piece by piece: what is on screen first, the rest after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.analysis.band_results import level
from specan.analysis.section import constant_part
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.band_history import BandHistoryAccumulator
from specan.dsp.history_filters import weighting_filter
from specan.dsp.multirate import LENGTH
from specan.dsp.time_weighting import FAST, SLOW
from specan.dsp.weighting import Weighting
from specan.units import level_reference

_BLOCK = 1 << 16
_PIECE_S = 20.0
# Before a piece this many time constants are read: what lies further back has decayed by 130 dB.
_LEAD = 30.0
_MOST = 2000  # readings


@dataclass
class LevelCurves:
    """Time-weighted levels of channels of one rate, as far as they are known; NaN elsewhere.

    Channels are taken as they were measured; those that are no sound pressure have the Z weighting.

    Attributes
    ----------
    times : array (n,)
        From the beginning of the recording, in s.
    levels : array (channels, n)
    """

    recording: Recording
    channels: tuple[Channel, ...]
    weighting: Weighting
    averaging: str

    def __post_init__(self) -> None:
        duration = min(c.duration_s for c in self.channels)
        self.time_constant = {"fast": FAST, "slow": SLOW}[self.averaging]
        interval = max(self.time_constant, duration / _MOST)
        self.times = np.arange(1, max(int(duration / interval + 1e-9), 1) + 1) * min(interval, duration)
        self._constant: NDArray[np.float64] | None = None
        self.levels = np.full((len(self.channels), self.times.size), np.nan)
        per_piece = max(int(max(_PIECE_S, _LEAD * self.time_constant) / interval), 1)
        self.pieces = [slice(k, k + per_piece) for k in range(0, self.times.size, per_piece)]

    def fill(self, start_s: float, stop_s: float, tell: Callable[[float], bool]) -> bool:
        """Fill the pieces that touch a part of the recording, then the others; False if told to stop."""

        def apart(piece: slice) -> bool:
            seen = self.times[piece]
            return bool(seen[-1] < start_s or seen[0] > stop_s)

        ordered = sorted(self.pieces, key=apart)
        for number, piece in enumerate(ordered, 1):
            if np.isnan(self.levels[:, piece]).any() or number == 1:
                self.levels[:, piece] = self._piece(piece)
            if not tell(number / len(ordered)):
                return False
        return True

    def _piece(self, piece: slice) -> NDArray[np.float64]:
        rate = self.channels[0].sampling_rate
        times = self.times[piece]
        before = self.times[piece.start - 1] if piece.start else 0.0
        # On the grid of the transform's blocks, so that a piece has the numbers of the whole.
        first = max(int((before - _LEAD * self.time_constant) * rate), 0) // LENGTH * LENGTH
        end = -(-(int(np.ceil(times[-1] * rate)) + 1) // LENGTH) * LENGTH
        last = min(end, *(c.n_samples for c in self.channels))
        if self._constant is None:
            length = min(c.n_samples for c in self.channels)
            self._constant = constant_part(self.recording, self.channels, 0, length)
        history = BandHistoryAccumulator(
            len(self.channels),
            rate,
            last - first,
            [weighting_filter(self.weighting), weighting_filter("Z")],
            self.time_constant,
            None,
            np.asarray(times - first / rate, dtype=np.float64),
            offset=self._constant,
        )
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            for samples in self.recording.blocks(self.channels, _BLOCK, first, last):
                history.add(samples)
            readings = history.result().readings
        pressure = np.array([[c.unit == "Pa"] for c in self.channels])
        zero = np.array([[level_reference(c.unit).value ** 2] for c in self.channels])
        return np.asarray(level(np.where(pressure, readings[:, 0], readings[:, 1]), zero))
