"""One eighth of the sampling rate, by overlap-add in the frequency domain."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp.smooth_step import falling_step

FACTOR = 8
PASS, STOP = 0.40, 0.50
"""Edges of the low-pass filter over the new sampling rate: response 1 to 1e-17 below PASS, 0 above STOP."""


@lru_cache(maxsize=16)
def low_pass(low: int) -> NDArray[np.float64]:
    """Response at `low` + 1 lines up to half the new rate, over the factor by which a transform becomes shorter."""
    response = falling_step(np.arange(low + 1) / (2.0 * low), PASS, STOP) / FACTOR
    response[-1] = 0.0
    response.flags.writeable = False
    return response


class Decimator:
    """Low-pass filters and thins out consecutive blocks whose transforms are already there.

    The filter has zero phase, so the decimated stream is not late. Its response is 1 up to `PASS` and
    0 from `STOP` (times the new rate) on, so that nothing is aliased and no droop has to be divided
    out; between them it falls as an error function, so that it rings for less than half a block.

    Parameters
    ----------
    rows : int
        Number of channels.
    length : int
        L, samples of a block; the transforms given to `add` are over 2 L samples. A multiple of 16.
    """

    def __init__(self, rows: int, length: int) -> None:
        self._low = length // FACTOR
        self._response = low_pass(self._low)
        self._pending = np.zeros((rows, self._low))

    def add(self, spectrum: NDArray[np.complex128], half: int) -> NDArray[np.float64]:
        """Take the transform of the next block; return L / 8 samples of the decimated stream.

        `half` says in which half of the 2 L samples the block stands. The stream begins L / 16 of its
        samples before the first block: there the filter rings already.
        """
        low = self._low
        filtered = np.fft.irfft(spectrum[:, : low + 1] * self._response, 2 * low)
        # The block's own samples stand from half * low on; half a block of ringing on either side.
        filtered = np.roll(filtered, low // 2 - half * low, axis=1)
        complete = self._pending + filtered[:, :low]
        self._pending = filtered[:, low:]
        return complete

    def rest(self) -> NDArray[np.float64]:
        """The L / 8 samples in which the filter rings after the last block."""
        return self._pending
