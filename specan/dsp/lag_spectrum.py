"""The energy spectrum of a record of any length, from blocks, without the leakage of blocks."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.dsp.multirate import ROWS, few_rows
from specan.dsp.windows import falling_step

_UNTOUCHED = 0.75  # of a block: lags up to here keep their full weight


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
    sparing : bool
        Whether to hold r and the samples of the last block in place of R and their transform: half the memory for
        three transforms in place of one.
    at_ends : callable, optional
        Given rows and what `energy` is more for the faded record (less where negative), once for each block that is
        faded: it is linear in the lags, so these need not be held until the end.

    Examples
    --------
    >>> x = np.array([[1.0, 2.0, 0.0, -1.0]])
    >>> spectrum = LagSpectrum(1, 4)
    >>> spectrum.add(slice(0, 1), x, np.fft.rfft(x, 8), 0)
    >>> float(spectrum.energy()[0, 0].round(9)), float(x.sum()) ** 2
    (4.0, 4.0)
    """

    def __init__(
        self,
        rows: int,
        length: int,
        buffers: NDArray[np.complex128] | None = None,
        *,
        sparing: bool = False,
        at_ends: Callable[[slice, NDArray[np.float64]], None] = lambda rows, energy: None,
    ) -> None:
        self.length, self._rows, self._sparing = length, rows, sparing
        self._sum: NDArray[Any] = np.zeros((rows, length + 1), dtype=np.float64 if sparing else np.complex128)
        self._previous: NDArray[Any] | None = None
        # What a fade takes away from the samples of the previous block.
        self._taken: NDArray[np.float64] | None = None
        self._blocks = self._longest = self._half = 0
        self._at_ends = at_ends
        # Used again and again: fresh memory costs more than the arithmetic.
        self._buffers = working_memory(rows, length) if buffers is None else buffers

    def add(
        self,
        rows: slice,
        block: NDArray[np.float64],
        transform: NDArray[np.complex128],
        half: int,
        taken: NDArray[np.float64] | None = None,
        end: NDArray[np.complex128] | None = None,
    ) -> None:
        """Take some rows of the next block, shape (rows, at most L), those of all rows one after the other.

        `transform` is that of 2 L samples, shape (rows, L + 1), of which the block fills the half that `half` says.
        `taken` is what a fade takes away from the block, `end` the transform of that. Successive blocks are in
        alternate halves of the 2 L samples. That puts X_{b+1} after X_b without a factor, since the correlation is
        circular.
        """
        if self._blocks:
            self._correlate(rows, transform, end)
        count = block.shape[1]
        if self._previous is None:
            self._previous = np.empty_like(self._sum)
        if self._sparing:
            self._previous[rows, :count], self._previous[rows, count:] = block, 0.0
        else:
            self._previous[rows] = transform
        if taken is not None:
            if self._taken is None:
                self._taken = np.zeros((self._rows, self.length))
            self._taken[rows, :count], self._taken[rows, count:] = taken, 0.0
        if rows.stop < self._rows:
            return
        if taken is None:
            self._taken = None
        self._half, self._longest = half, count
        self._blocks += 1
        if count < self.length and self._blocks > 1:  # the last one
            self._close()

    @property
    def closed(self) -> bool:
        """Whether the last block has been seen, as it was shorter."""
        return self._blocks > 1 and self._previous is None

    def _close(self) -> None:
        """Correlate the last block, and let go of it: what all rates hold together is large."""
        for rows in few_rows(self._rows):
            self._correlate(rows, None, None)
        self._previous = self._taken = None

    def _transformed(self, samples: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Transform of samples in the half of the previous block."""
        padded = np.zeros((samples.shape[0], 2 * self.length))
        padded[:, self._half * self.length :][:, : self.length] = samples[:, : self.length]
        return np.fft.rfft(padded)

    def _before(self, rows: slice) -> tuple[NDArray[np.complex128], NDArray[np.complex128] | None]:
        """Transforms of the previous block and of what is taken away from it."""
        assert self._previous is not None
        previous = self._previous[rows]
        end = None if self._taken is None else self._transformed(self._taken[rows])
        return self._transformed(previous) if self._sparing else previous, end

    def _correlate(
        self,
        rows: slice,
        following: NDArray[np.complex128] | None,
        following_end: NDArray[np.complex128] | None,
    ) -> None:
        """Add conj(X_b) (X_b + X_{b+1}); with Y = X - E what conj(Y_b) (Y_b + Y_{b+1}) is more."""
        previous, end = self._before(rows)
        product, conjugate = (buffer[: previous.shape[0]] for buffer in self._buffers)
        np.conjugate(previous, out=conjugate)
        if following is None:
            product[...] = previous
        else:
            np.add(previous, following, out=product)
        product *= conjugate
        self._sum[rows] += self._lags(product) if self._sparing else product
        if end is None and following_end is None:
            return
        total = np.zeros_like(previous)
        for other in (end, following_end):
            if other is not None:
                total -= np.multiply(conjugate, other, out=product)
        if end is not None:
            np.conjugate(end, out=conjugate)
            for other, sum_up in (
                (previous, np.subtract),
                (following, np.subtract),
                (end, np.add),
                (following_end, np.add),
            ):
                if other is not None:
                    sum_up(total, np.multiply(conjugate, other, out=product), out=total)
        self._at_ends(rows, self._energy_of(self._lags(total)))

    def _lags(self, cross: NDArray[np.complex128]) -> NDArray[np.float64]:
        return np.fft.irfft(cross)[:, : self.length + 1]

    def energy(self, rows: slice = slice(None)) -> NDArray[np.float64]:
        """Energy spectrum, shape (rows, L + 1), at m / (2 L) cycles a sample.

        The sum over all 2 L lines, divided by 2 L, is the energy. Call it after the last block, once for each row.
        Rounding leaves some 1e-17 of the energy in every band; where there is nothing else a line may be
        negative.
        """
        if self._previous is not None and self._blocks == 1 and self._longest <= _UNTOUCHED * self.length:
            # All lags of the record lie where nothing is faded out: the squared transform is the same.
            transform, end = self._before(rows)
            energy = _squared(transform)
            if end is not None:
                self._at_ends(rows, _squared(transform - end) - energy)
            return energy
        if self._previous is not None:
            self._close()
        lags = self._sum[rows].copy() if self._sparing else self._lags(self._sum[rows])
        return self._energy_of(lags)

    def _energy_of(self, lags: NDArray[np.float64]) -> NDArray[np.float64]:
        lags *= _fade(self.length)
        symmetric = np.concatenate([lags, lags[:, -2:0:-1]], axis=1)
        return np.asarray(np.fft.rfft(symmetric).real)


def working_memory(rows: int, length: int) -> NDArray[np.complex128]:
    """What a `LagSpectrum` works in."""
    return np.empty((2, min(rows, ROWS), length + 1), dtype=np.complex128)


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
