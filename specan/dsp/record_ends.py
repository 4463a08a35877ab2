"""The two ends of a record, apart from the rest: what fading it in and out takes away, on every stage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import FACTOR, LENGTH, ROWS, Decimator, Stage
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
    """Transforms of what a fade takes away from the blocks of a `MultirateTransform`: of nothing but the ends.

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

    def of(self, stage: Stage, block: NDArray[np.float64], half: int) -> NDArray[np.complex128] | None:
        """Transform of the part of a stage's next block that the fade takes away; None where it takes nothing."""
        part = self._taken_away(block) if stage.number == 0 else self._decimated(stage.number, block.shape[1])
        spectrum = None if part is None else self._transform(part, half)
        if not stage.last:
            self._decimate(stage.number + 1, spectrum, half)
        return spectrum

    def _taken_away(self, block: NDArray[np.float64]) -> NDArray[np.float64] | None:
        first, count = self._position, block.shape[1]
        self._position += count
        if not self._fade.touches(first, count):
            return None
        return block * (1.0 - self._fade.weights(first, count))

    def _transform(self, part: NDArray[np.float64], half: int) -> NDArray[np.complex128]:
        padded = np.zeros((min(self._rows, ROWS), 2 * LENGTH))
        result = np.empty((self._rows, LENGTH + 1), dtype=np.complex128)
        for top in range(0, self._rows, ROWS):
            rows = part[top : top + ROWS]
            padded[: rows.shape[0], half * LENGTH : half * LENGTH + part.shape[1]] = rows
            np.fft.rfft(padded[: rows.shape[0]], out=result[top : top + ROWS])
        return result

    def _decimate(self, number: int, spectrum: NDArray[np.complex128] | None, half: int) -> None:
        pieces = self._pieces.setdefault(number, [])
        if spectrum is None:
            pieces.append(self._rest(number))
        else:
            pieces.append(
                self._decimators.setdefault(number, Decimator(self._rows, LENGTH)).add(spectrum, half)
            )

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
