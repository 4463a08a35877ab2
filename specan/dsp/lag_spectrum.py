"""The energy spectrum of a record of any length, from blocks, without the leakage of blocks."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.dsp.windows import falling_step

_UNTOUCHED = 0.75  # of a block: lags up to here keep their full weight
_ROWS = 4  # enough to share what is common, few enough to stay in the cache


class LagSpectrum:
    """Energy spectrum of consecutive blocks, exact but for what is further apart than a block.

    The autocorrelation r(k) = sum_t x(t) x(t + k) of a record that is split into blocks x_b of L samples
    is, for 0 <= k <= L, a sum over each block and its successor alone; with X_b the transform over 2 L
    samples (Rader, IEEE Trans. Audio Electroacoust. 18 (1970) 439),

        R(f) = sum_b conj(X_b) (X_b + X_{b+1}),    r(k) = irfft(R)(k), 0 <= k <= L.

    No window touches the samples, so a tone does not leak from its band however the blocks fall. r is
    exact up to lag L; it is faded out between 3/4 L and L, and its transform is the energy spectrum
    seen through a kernel of width 1/L whose side lobes vanish. The energy behind a filter |H(f)|^2 is
    sum |H|^2 S: exact, as long as the autocorrelation of H dies out within 3/4 L.

    Parameters
    ----------
    rows : int
        Number of channels.
    length : int
        L, an even number of samples.
    buffers : complex array, shape (2, at least min(rows, 4), L + 1), optional
        Memory to work in, which others may use between the calls.

    Examples
    --------
    >>> x = np.array([[1.0, 2.0, 0.0, -1.0]])
    >>> spectrum = LagSpectrum(1, 4)
    >>> spectrum.add(np.fft.rfft(x, 8))
    >>> float(spectrum.energy()[0, 0].round(9)), float(x.sum()) ** 2
    (4.0, 4.0)
    """

    def __init__(self, rows: int, length: int, buffers: NDArray[np.complex128] | None = None) -> None:
        self.length = length
        self._cross = np.zeros((rows, length + 1), dtype=np.complex128)
        self._previous: NDArray[np.complex128] | None = None
        self._previous_end: NDArray[np.complex128] | None = None
        self._blocks, self._longest = 0, 0
        # What the cross spectra of a faded record have more than those of the record itself.
        self._faded_more: NDArray[np.complex128] | None = None
        # That of the beginning, as lags: half the memory for the long time until the end.
        self._faded_lags: NDArray[np.float64] | None = None
        # Used again and again: fresh memory costs more than the arithmetic.
        self._buffers = working_memory(rows, length) if buffers is None else buffers

    def add(
        self,
        transform: NDArray[np.complex128],
        end: NDArray[np.complex128] | None = None,
        n_samples: int | None = None,
    ) -> None:
        """Take the next block: the transform of 2 L samples, shape (rows, L + 1), of which `n_samples` are the block's.

        `end` is the transform of what a fade takes away from the block, None for nothing. Successive
        blocks are in alternate halves of the 2 L samples. That puts X_{b+1} after X_b
        without a factor, since the correlation is circular.
        """
        if self._previous is not None:
            self._correlate(transform)
            self._correlate_ends(transform, end)
        self._previous, self._previous_end = transform, end
        self._blocks += 1
        self._longest = self.length if n_samples is None else n_samples
        if self._longest < self.length and self._blocks > 1:  # the last one
            self._close()

    @property
    def closed(self) -> bool:
        """Whether the last block has been seen, as it was shorter."""
        return self._blocks > 1 and self._previous is None

    def _close(self) -> None:
        """Correlate the last block, and let go of its transforms: those of all rates together are large."""
        self._correlate(None)
        self._correlate_ends(None, None)
        self._previous = self._previous_end = None

    def _correlate_ends(
        self, following: NDArray[np.complex128] | None, following_end: NDArray[np.complex128] | None
    ) -> None:
        """With Y = X - E: conj(Y_b) (Y_b + Y_{b+1}) - conj(X_b) (X_b + X_{b+1})."""
        mine, end = self._previous, self._previous_end
        if end is None and following_end is None:
            if self._faded_more is not None:
                self._faded_lags, self._faded_more = self._lags(self._faded_more), None
            return
        assert mine is not None
        if self._faded_more is None:
            self._faded_more = np.zeros_like(self._cross)
        for top in range(0, mine.shape[0], _ROWS):
            rows = slice(top, top + _ROWS)
            total = self._faded_more[rows]
            product, conjugate = (buffer[: total.shape[0]] for buffer in self._buffers)
            np.conjugate(mine[rows], out=conjugate)
            for other in (end, following_end):
                if other is not None:
                    total -= np.multiply(conjugate, other[rows], out=product)
            if end is None:
                continue
            np.conjugate(end[rows], out=conjugate)
            for other, sum_up in (
                (mine, np.subtract),
                (following, np.subtract),
                (end, np.add),
                (following_end, np.add),
            ):
                if other is not None:
                    sum_up(total, np.multiply(conjugate, other[rows], out=product), out=total)

    def _lags(self, cross: NDArray[np.complex128]) -> NDArray[np.float64]:
        lags = np.zeros(cross.shape) if self._faded_lags is None else self._faded_lags
        for top in range(0, lags.shape[0], _ROWS):
            lags[top : top + _ROWS] += np.fft.irfft(cross[top : top + _ROWS])[:, : self.length + 1]
        return lags

    def _correlate(self, following: NDArray[np.complex128] | None) -> None:
        assert self._previous is not None
        for top in range(0, self._cross.shape[0], _ROWS):
            rows = slice(top, top + _ROWS)
            previous = self._previous[rows]
            product, conjugate = (buffer[: previous.shape[0]] for buffer in self._buffers)
            np.conjugate(previous, out=conjugate)
            if following is None:
                product[...] = previous
            else:
                np.add(previous, following[rows], out=product)
            product *= conjugate
            self._cross[rows] += product

    def energy(self, *, faded: bool = False) -> NDArray[np.float64]:
        """Energy spectrum, shape (rows, L + 1), at m / (2 L) cycles a sample; of the faded record if asked for.

        The sum over all 2 L lines, divided by 2 L, is the energy. Call it after the last block.
        Rounding leaves some 1e-17 of the energy in every band; where there is nothing else a line may be
        negative.
        """
        if self._previous is not None and self._blocks == 1 and self._longest <= _UNTOUCHED * self.length:
            # All lags of the record lie where nothing is faded out: the squared transform is the same.
            end = self._previous_end if faded else None
            return _squared(self._previous if end is None else self._previous - end)
        if self._previous is not None:
            self._close()
        more = self._faded_more if faded else None
        earlier = self._faded_lags if faded else None
        fade = _fade(self.length)
        energy = np.empty(self._cross.shape)
        for top in range(0, energy.shape[0], _ROWS):
            rows = slice(top, top + _ROWS)
            cross = self._cross[rows] if more is None else self._cross[rows] + more[rows]
            lags = np.fft.irfft(cross)[:, : self.length + 1]
            if earlier is not None:
                lags += earlier[rows]
            lags *= fade
            symmetric = np.concatenate([lags, lags[:, -2:0:-1]], axis=1)
            energy[rows] = np.fft.rfft(symmetric).real
        return energy


def working_memory(rows: int, length: int) -> NDArray[np.complex128]:
    """What a `LagSpectrum` works in."""
    return np.empty((2, min(rows, _ROWS), length + 1), dtype=np.complex128)


@lru_cache(maxsize=4)
def _fade(length: int) -> NDArray[np.float64]:
    fade = falling_step(np.arange(length + 1.0), _UNTOUCHED * length, length)
    fade.flags.writeable = False
    return fade


def _squared(transform: NDArray[np.complex128]) -> NDArray[np.float64]:
    squared = np.square(transform.real)
    squared += np.square(transform.imag)
    return np.asarray(squared)


def total_energy(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum over all 2 L lines, divided by 2 L, of an energy spectrum with L + 1 lines."""
    inner = 2.0 * np.add.reduce(lines[:, 1:-1], axis=1)
    return (inner + lines[:, 0] + lines[:, -1]) / (2 * (lines.shape[1] - 1))
