"""What the two ends of a record do to levels: the cut, the ringing of weightings, a drift."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from specan.arrays import Complex, Real
from specan.dsp.multirate import fast_length
from specan.dsp.weighting import WEIGHTINGS, WEIGHTINGS_RING, Weighting, sampled_weighting
from specan.dsp.windows import falling_step

LONGEST_FADE_S = 0.5
"""The spectrum of the fade's slope is exp(-(pi f F / 12)^2): 20 Hz away from a tone, 0.5 s leave 60 dB less of its cut
than there was, 40 Hz away 240 dB less."""

SHORTEST_PART = 8
"""A record is faded over an eighth of its length at most: the scatter of its levels grows by 8 % or less."""


@dataclass(frozen=True)
class Fade:
    """A record of `n_samples` faded in and out over `samples` each.

    Examples
    --------
    >>> fade = Fade.of(80000, 8000.0)
    >>> fade.samples, fade.weights(0, 80000)[[0, 4000, 40000, 79999]].round(3).tolist()
    (4000, [0.0, 1.0, 1.0, 0.0])
    >>> round(fade.averaged / 80000, 3), round(fade.independent / 80000, 3)
    (0.947, 0.949)
    """

    n_samples: int
    samples: int

    @classmethod
    def of(cls, n_samples: int, sampling_rate: float) -> Fade:
        """The fade that a record of this length gets."""
        return cls(n_samples, min(n_samples // SHORTEST_PART, round(LONGEST_FADE_S * sampling_rate)))

    def weights(self, first: int, count: int) -> Real:
        """Factors on `count` samples from the number `first` on."""
        if not self.samples:
            return np.ones(count)
        rise, weights = _rise(self.samples), np.ones(count)
        low, high = min(first + count, self.samples), max(first, self.n_samples - self.samples)
        if first < low:
            weights[: low - first] = rise[first:low]
        if high < first + count:
            weights[high - first :] = rise[self.n_samples - first - count : self.n_samples - high][::-1]
        return weights

    def touches(self, first: int, count: int) -> bool:
        """Whether some of these samples are faded."""
        return self.samples > 0 and (first < self.samples or first + count > self.n_samples - self.samples)

    @property
    def averaged(self) -> float:
        """Samples that the average is over: the sum of the squared factors."""
        return self._sum(2)

    @property
    def independent(self) -> float:
        """Samples without a fade whose mean square would scatter as much."""
        return self._sum(2) ** 2 / self._sum(4)

    def _sum(self, power: int) -> float:
        faded = self.weights(0, self.samples)
        return self.n_samples - 2.0 * self.samples + 2.0 * float(np.add.reduce(faded**power))


@lru_cache(maxsize=4)
def _rise(samples: int) -> Real:
    return 1.0 - falling_step(np.arange(samples, dtype=np.float64) + 0.5, 0.0, float(samples))


# Whatever went before the record, the weighting rings with a sum of its own decays. All of them are what it answers to
# some signals before the record; a few of one rise, at these frequencies in Hz, are as good as all: from below the
# lowest pole of A, B and C to the highest, 20.6 Hz to 12 kHz.
_RISES = (0.3, 3.0, 20.0, 100.0, 700.0, 4000.0)
# Decays that differ from sums of the others by less are the same: what is left of them is an event as well as a decay.
_ALIKE = 1e-7
# Seconds in which they fall by 100 dB.
_WINDOW = 0.09
# So many later pieces of the signal, this far apart in s, give every phase of some lines at once.
_LATER, _STEP = 8, 0.006
# Steps are longer by parts of the golden ratio: of a tone that fits evenly into all of them the pieces have one phase.
_UNEVEN = (5**0.5 - 1) / 2
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
    window : int
        Samples that the decays are fitted to.

    Examples
    --------
    A constant, switched on:

    >>> response = np.array([1.0, *(-0.02 * 0.98 ** np.arange(5000))])
    >>> start = RecordStart(response, 1000.0)
    >>> float(np.abs(start.without(np.cumsum(response)[None, :2000])).max().round(6))
    0.0
    """

    def __init__(self, response: Real, rate: float) -> None:
        n = response.size
        t = np.arange(-n, 0) / rate
        rises = np.exp(2.0 * np.pi * np.outer(_RISES, t))
        points = fast_length(2 * n)
        lines = np.fft.rfft(response, points)
        decays = np.fft.irfft(np.fft.rfft(rises, points) * lines, points)[:, n : 2 * n]
        sizes = np.linalg.norm(decays, axis=1)
        known = sizes > 0  # of slow sampling: a rise over many octaves above it leaves nothing
        self._decays = decays[known] / sizes[known, None]
        self.window, self._step = round(_WINDOW * rate), max(round(_STEP * rate), 1)
        self._later = int(_SINCE * n)
        self.seen = self._later + self.window + _LATER * self._step
        self._bases: dict[int, tuple[Real, Real]] = {}  # of beginnings of one length
        # What rings after a record is a sum of decays too: its products with them, of the last samples.
        whole = np.fft.rfft(self._base(n)[0], points)
        self._after = np.fft.irfft(np.conj(whole) * lines, points)[:, n:0:-1]

    def decays(self, y: Real) -> Real:
        """What is to be taken off the beginning of a record, shape (channels, n), of which later pieces are taken."""
        third = y.shape[1] // 3  # of what is short: the rest has two later pieces, which make a tone
        n = min(self.window, third if third >= 2 * self._step else y.shape[1])
        base, whole = self._base(n)
        count = (y.shape[1] - 2 * n) // self._step
        first = max(n, min(self._later, y.shape[1] - n - _LATER * self._step))
        number = np.arange(min(max(count, 0), _LATER))
        places = first + np.round(self._step * (number + _UNEVEN * number % 1.0)).astype(int)
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

    def without(self, y: Real) -> Real:
        """The beginning of a record without its decays."""
        found, decays = y.astype(np.float64), self.decays(y)
        found[:, : decays.shape[1]] -= decays
        return found

    def energy_after(self, last: Real) -> Real:
        """Of what rings after the last samples, shape (channels, n)."""
        seen = self._after[:, self._after.shape[1] - last.shape[1] :]
        return np.array([np.add.reduce(np.square(seen @ row)) for row in last])

    def _base(self, n: int) -> tuple[Real, Real]:
        """The decays as orthonormal rows of `n` samples, and the same rows going on."""
        if n not in self._bases:
            # Singular values of a triangle: those of long rows can take a hundred times as long.
            rows, triangle = np.linalg.qr(self._decays[:, :n].T)
            left, size, right = np.linalg.svd(triangle.T, full_matrices=False)
            known = size > _ALIKE * np.max(size, initial=0.0)
            self._bases[n] = right[known] @ rows.T, (left[:, known] / size[known]).T @ self._decays
        return self._bases[n]


@lru_cache(maxsize=12)  # three weightings at the rates of a batch
def start_of(weighting: Weighting, rate: float, samples: int) -> tuple[Real, RecordStart]:
    """Impulse response of a weighting, and what takes its decays off a beginning."""
    response = sampled_weighting(weighting, rate, samples)
    response.flags.writeable = False
    return response, RecordStart(response, rate)


@lru_cache(maxsize=12)
def _lines_of(weighting: Weighting, rate: float, samples: int, points: int) -> Complex:
    """The response as lines of a transform."""
    return np.asarray(np.fft.rfft(start_of(weighting, rate, samples)[0], points))


# In Hz. Above, the beginning alone would take more memory than all the rest of an analysis.
_HIGHEST_RATE = 1e6


class CutEnergy:
    """The part that a record's two cuts have in the energy behind A, B and C, ring-out included.

    That is the energy of the decays at its beginning, and of what rings after its end.

    Parameters
    ----------
    rows : int
        Number of channels.
    rate : float
        Sampling rate in Hz.
    """

    def __init__(self, rows: int, rate: float) -> None:
        self._rate, self._ring = rate, round(WEIGHTINGS_RING * rate) if rate <= _HIGHEST_RATE else 0
        self._seen = start_of("A", rate, self._ring)[1].seen if self._ring else 0
        self._beginning = self._last = np.empty((rows, 0))

    def add(self, samples: Real) -> None:
        """Take the next samples, shape (channels, n)."""
        lacking = self._seen - self._beginning.shape[1]
        if lacking > 0:
            self._beginning = np.concatenate([self._beginning, samples[:, :lacking]], axis=1)
        if self._ring:
            self._last = np.concatenate([self._last, samples[:, -self._ring :]], axis=1)[:, -self._ring :]

    def result(self) -> dict[Weighting, Real]:
        """The energy behind each weighting, shape (channels,)."""
        count = self._beginning.shape[1]
        if not count or not self._ring:
            return {}
        points = fast_length(count + self._ring - 1)
        lines = np.fft.rfft(self._beginning, points)
        found: dict[Weighting, Real] = {}
        for weighting in WEIGHTINGS:
            if weighting != "Z":
                key = weighting, self._rate, self._ring
                start = start_of(*key)[1]
                beginning = np.fft.irfft(lines * _lines_of(*key, points), points)[:, :count]
                decays = start.decays(beginning)
                steady = 2.0 * beginning[:, : decays.shape[1]] - decays
                found[weighting] = np.add.reduce(steady * decays, axis=1) + start.energy_after(self._last)
        return found


# At an end a drift is (a + b t + c t^2 + d t^3) exp(-t^2 / 2 s^2): there is nothing of it above 1 / s. With s of 0.1 s
# it meets an oscillation of 0.5 Hz to 0.001 of itself; s is longer where oscillations from 1 / s on are analysed, which
# must stay. A record has so many s at least: in a shorter one a drift cannot be told from these.
_SPREAD, _SPREADS, _TERMS = 0.1, 10.0, 4
# It is over after so many s: 1e-6 of the last term are left.
_SEEN = 6.0


@dataclass(frozen=True)
class SlowPart:
    """A constant part, and a drift at either end that makes the record begin and end smoothly.

    Attributes
    ----------
    constant : ndarray, shape (channels,)
        Mean of the samples.
    beginning, end : ndarray, shape (channels, m)
        What the first and the last samples drift, about the mean.
    n_samples : int
        Length of the record.
    total, square : ndarray, shape (channels,)
        What the drift has in the sum of all samples about the mean, and in that of their squares.

    Examples
    --------
    >>> drift = np.cos(np.arange(40000) / 40000)[None]
    >>> slow = SlowPart.of(np.zeros(1), drift[:, :4000], drift[:, -4000:], 40000, drift_spread(40000, 8000.0, 20.0))
    >>> float(np.abs(drift[:, :10] - slow.drift(0, 10)).max().round(3))
    0.0
    """

    constant: Real
    beginning: Real
    end: Real
    n_samples: int
    total: Real
    square: Real

    @classmethod
    def of(cls, constant: Real, first: Real, last: Real, n_samples: int, spread: float) -> SlowPart:
        """From the mean and the samples at the ends, by least squares; see `drift_spread`."""
        drifts = []
        total, square = np.zeros((2, constant.size))
        for samples in (first, last[:, ::-1]):
            about = samples - constant[:, None]
            drift = _drift(about, spread)
            total += np.add.reduce(drift, axis=1)
            square += np.add.reduce((2.0 * about - drift) * drift, axis=1)
            drifts.append(drift)
        return cls(constant, drifts[0], drifts[1][:, ::-1], n_samples, total, square)

    @classmethod
    def only(cls, constant: Real) -> SlowPart:
        """A constant part and no drift."""
        none, zero = np.empty((constant.size, 0)), np.zeros(constant.size)
        return cls(constant, none, none, 0, zero, zero)

    def off(self, samples: Real, first: int) -> Real:
        """Samples, from the number `first` on, without it."""
        without, drift = samples - self.constant[:, None], self.drift(first, samples.shape[1])
        return without if drift is None else without - drift

    def drift(self, first: int, count: int) -> Real | None:
        """What `count` samples from the number `first` on drift; None where they do not."""
        m = self.beginning.shape[1]
        if not m or m <= first <= first + count <= self.n_samples - m:
            return None
        found = np.zeros((self.constant.size, count))
        for place, drift in ((-first, self.beginning), (self.n_samples - m - first, self.end)):
            low, high = max(place, 0), min(place + m, count)
            if low < high:
                found[:, low:high] += drift[:, low - place : high - place]
        return found


def drift_spread(n_samples: int, sampling_rate: float, lowest_hz: float) -> float:
    """s in samples, for levels from a frequency on; 0 where nothing is taken for a drift."""
    spread = min(max(_SPREAD, 1.0 / lowest_hz), n_samples / sampling_rate / _SPREADS)
    return spread * sampling_rate if spread * lowest_hz >= 1.0 and sampling_rate <= _HIGHEST_RATE else 0.0


def drift_length(spread: float) -> int:
    """How many samples at either end tell the drift."""
    return int(_SEEN * spread)


def _drift(samples: Real, spread: float) -> Real:
    """At the beginning of samples, shape (channels, n)."""
    if not samples.shape[1]:
        return samples
    # Each channel alone: none depends on how many there are.
    base = _base(samples.shape[1], spread)
    return np.array([(base @ row) @ base for row in samples])


@lru_cache(maxsize=4)
def _base(count: int, spread: float) -> Real:
    """Polynomials, fitted with the weights that they are faded out with."""
    t = np.arange(count) / spread
    root = np.exp(-0.25 * t * t)
    return np.ascontiguousarray(np.linalg.qr((t ** np.arange(_TERMS)[:, None] * root).T)[0].T * root)
