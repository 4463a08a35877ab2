"""What a frequency weighting rings with because a record is cut, told from what the record holds."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp.history_filters import WEIGHTINGS_RING, sampled_weighting
from specan.dsp.sections import fast_length
from specan.dsp.weighting import WEIGHTINGS, Weighting

# Whatever went before the record, the weighting rings with a sum of its own decays. All of them are what it answers to
# some signals before the record; a few of one rise, at these frequencies in Hz, are as good as all: from below the
# lowest pole of A, B and C to the highest, 20.6 Hz to 12 kHz.
_RISES = (0.3, 3.0, 20.0, 100.0, 700.0, 4000.0)
# Decays that differ from sums of the others by less are the same.
_ALIKE = 1e-10
# Seconds in which they fall by 100 dB.
_WINDOW = 0.09
# So many later pieces of the signal, this far apart in s, give every phase of some lines at once.
_LATER, _STEP = 8, 0.006
# They begin after so many times what the weighting rings for.
_SINCE = 1.5
# A later piece is part of what goes on if it is not much weaker than the beginning: more than this part of its energy.
_WEAK = 1e-3


class RecordStart:
    """Takes the decays off the beginning of what a weighting makes of a record.

    The beginning is y = decays + what goes on + events. What goes on is like later pieces of y: a steady tone, cut, is
    two of them, times factors. Least squares tell the three apart: an event is neither, and stays.

    Parameters
    ----------
    response : ndarray, shape (n,)
        Impulse response of the weighting.
    rate : float
        Sampling rate in Hz.

    Attributes
    ----------
    seen : int
        Samples of a beginning that are looked at.

    Examples
    --------
    A constant, switched on:

    >>> response = np.array([1.0, *(-0.02 * 0.98 ** np.arange(5000))])
    >>> start = RecordStart(response, 1000.0)
    >>> float(np.abs(start.without(np.cumsum(response)[None, :2000])).max().round(6))
    0.0
    """

    def __init__(self, response: NDArray[np.float64], rate: float) -> None:
        n = response.size
        t = np.arange(-n, 0) / rate
        rises = np.exp(2.0 * np.pi * np.outer(_RISES, t))
        points = fast_length(2 * n)
        lines = np.fft.rfft(response, points)
        decays = np.fft.irfft(np.fft.rfft(rises, points) * lines, points)[:, n : 2 * n]
        self._decays = decays / np.linalg.norm(decays, axis=1, keepdims=True)
        self._window, self._step = round(_WINDOW * rate), max(round(_STEP * rate), 1)
        self._later = int(_SINCE * n)
        self.seen = self._later + self._window + _LATER * self._step
        self._bases: dict[
            int, tuple[NDArray[np.float64], NDArray[np.float64]]
        ] = {}  # of beginnings of one length
        # What rings after a record is a sum of decays too: its products with them, of the last samples.
        whole = np.fft.rfft(self._base(n)[0], points)
        self._after = np.fft.irfft(np.conj(whole) * lines, points)[:, n:0:-1]

    def decays(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is to be taken off the beginning of a record, shape (channels, n), of which later pieces are taken."""
        n = min(self._window, y.shape[1])
        base, whole = self._base(n)
        count = (y.shape[1] - 2 * n) // self._step
        first = max(n, min(self._later, y.shape[1] - n - _LATER * self._step))
        places = first + self._step * np.arange(min(max(count, 0), _LATER))
        amounts = np.empty((len(y), len(base)))
        for row, amount in zip(y, amounts, strict=True):
            begin = row[:n].astype(np.float64)
            amount[:] = base @ begin
            if not places.size:
                continue
            rest = begin - amount @ base
            later = np.array([row[at : at + n] for at in places], dtype=np.float64)
            share = later @ base.T
            later -= share @ base
            alike = later @ later.T
            least = _WEAK * (rest @ rest) + np.finfo(float).eps * np.trace(alike)
            if least > 0.0:
                amount -= np.linalg.solve(alike + least * np.eye(len(later)), later @ rest) @ share
        return amounts @ whole[:, : y.shape[1]]

    def without(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The beginning of a record without its decays."""
        found, decays = y.astype(np.float64), self.decays(y)
        found[:, : decays.shape[1]] -= decays
        return found

    def energy_after(self, last: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of what rings after the last samples, shape (channels, n)."""
        seen = self._after[:, self._after.shape[1] - last.shape[1] :]
        return np.array([np.add.reduce(np.square(seen @ row)) for row in last])

    def _base(self, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The decays as orthonormal rows of `n` samples, and the same rows going on."""
        if n not in self._bases:
            left, size, right = np.linalg.svd(self._decays[:, :n], full_matrices=False)
            known = size > _ALIKE * size[0]
            self._bases[n] = right[known], (left[:, known] / size[known]).T @ self._decays
        return self._bases[n]


@lru_cache(maxsize=12)  # three weightings at the rates of a batch
def start_of(weighting: Weighting, rate: float, samples: int) -> tuple[NDArray[np.float64], RecordStart]:
    """Impulse response of a weighting, and what takes its decays off a beginning."""
    response = sampled_weighting(weighting, rate, samples)
    response.flags.writeable = False
    return response, RecordStart(response, rate)


@lru_cache(maxsize=12)
def _lines_of(weighting: Weighting, rate: float, samples: int, points: int) -> NDArray[np.complex128]:
    """The response as lines of a transform."""
    return np.asarray(np.fft.rfft(start_of(weighting, rate, samples)[0], points))


# In Hz. Above, the beginning alone would take more memory than all the rest of an analysis.
_HIGHEST_RATE = 1e6


class CutEnergy:
    """The part that a record's two cuts have in the energy behind A, B and C, ring-out included.

    That is the energy of the decays at its beginning, and of what rings after its end.

    Parameters
    ----------
    rate : float
        Sampling rate in Hz.
    """

    def __init__(self, rate: float) -> None:
        self._rate, self._ring = rate, round(WEIGHTINGS_RING * rate) if rate <= _HIGHEST_RATE else 0
        self._seen = start_of("A", rate, self._ring)[1].seen if self._ring else 0
        self._beginning: NDArray[np.float64] | None = None
        self._last: NDArray[np.float64] | None = None

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n)."""
        if self._beginning is None or self._last is None:
            self._beginning = self._last = samples[:, :0]
        lacking = self._seen - self._beginning.shape[1]
        if lacking > 0:
            self._beginning = np.concatenate([self._beginning, samples[:, :lacking]], axis=1)
        if self._ring:
            self._last = np.concatenate([self._last, samples[:, -self._ring :]], axis=1)[:, -self._ring :]

    def result(self) -> dict[Weighting, NDArray[np.float64]]:
        """The energy behind each weighting, shape (channels,)."""
        if self._beginning is None or self._last is None or not self._ring:
            return {}
        count = self._beginning.shape[1]
        points = fast_length(count + self._ring - 1)
        lines = np.fft.rfft(self._beginning, points)
        found: dict[Weighting, NDArray[np.float64]] = {}
        for weighting in WEIGHTINGS:
            if weighting != "Z":
                key = weighting, self._rate, self._ring
                start = start_of(*key)[1]
                beginning = np.fft.irfft(lines * _lines_of(*key, points), points)[:, :count]
                decays = start.decays(beginning)
                steady = 2.0 * beginning[:, : decays.shape[1]] - decays
                found[weighting] = np.add.reduce(steady * decays, axis=1) + start.energy_after(self._last)
        return found
