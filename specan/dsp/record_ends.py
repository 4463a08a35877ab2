"""The two ends of a record, apart from the rest: what fading it in and out takes away, on every stage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import FACTOR, LENGTH, Decimator, Stage
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

    def weights(self, first: int, count: int) -> NDArray[np.float64]:
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
def _rise(samples: int) -> NDArray[np.float64]:
    return 1.0 - falling_step(np.arange(samples, dtype=np.float64) + 0.5, 0.0, float(samples))


class RecordEnds:
    """What a fade takes away from the blocks of a `MultirateTransform`, on every stage: nothing but at the ends.

    Parameters
    ----------
    rows : int
        Number of channels.
    fade : Fade
    """

    def __init__(self, rows: int, fade: Fade) -> None:
        self._rows, self._fade, self._position = rows, fade, 0
        self._decimators: dict[int, Decimator] = {}
        self._pieces: dict[int, list[NDArray[np.float64] | None]] = {}
        self._parts: dict[int, NDArray[np.float64] | None] = {}

    def of(self, stage: Stage, rows: slice, block: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """What the fade takes away from some rows of a stage's next block; None where it takes nothing."""
        count = block.shape[1]
        if stage.number == 0:
            first = self._position
            self._position += count if rows.stop == self._rows else 0
            return (
                block * (1.0 - self._fade.weights(first, count)) if self._fade.touches(first, count) else None
            )
        if rows.start == 0:
            self._parts[stage.number] = self._decimated(stage.number, count)
        part = self._parts[stage.number]
        if rows.stop == self._rows:
            del self._parts[stage.number]
        return None if part is None else part[rows]

    def decimate(self, stage: Stage, rows: slice, spectrum: NDArray[np.complex128] | None, half: int) -> None:
        """Thin out what was taken away from these rows, of which this is the transform."""
        number = stage.number + 1
        pieces = self._pieces.setdefault(number, [])
        if rows.start == 0:
            pieces.append(
                self._rest(number) if spectrum is None else np.empty((self._rows, LENGTH // FACTOR))
            )
        if spectrum is not None:
            decimator, piece = self._decimators.get(number) or Decimator(self._rows, LENGTH), pieces[-1]
            self._decimators[number] = decimator
            assert piece is not None
            piece[rows] = decimator.add(spectrum, half, rows)

    def _rest(self, number: int) -> NDArray[np.float64] | None:
        decimator = self._decimators.pop(number, None)
        return None if decimator is None else decimator.rest()

    def _decimated(self, number: int, length: int) -> NDArray[np.float64] | None:
        """The next samples of a stage; None where all are zero."""
        size, pieces = LENGTH // FACTOR, self._pieces[number]
        if len(pieces) * size < length:  # the end: the decimator still rings
            pieces.append(self._rest(number))
        mine, self._pieces[number] = pieces[: -(-length // size)], pieces[-(-length // size) :]
        if all(piece is None for piece in mine):
            return None
        whole = [np.zeros((self._rows, size)) if piece is None else piece for piece in mine]
        return np.concatenate(whole, axis=1)[:, :length]
