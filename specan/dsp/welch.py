"""Welch's averaged auto and cross spectra of many channels, in one pass, and how sure few averages are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.arrays import Complex, Flags, Real
from specan.dsp.motion import convert
from specan.dsp.multirate import keep_freed_memory
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.windows import WindowName, window, window_correlation

Averaging = Literal["linear", "exponential", "max", "min"]


class SpectralMatrix(NamedTuple):
    """Averaged one-sided spectral densities of n lines.

    Attributes
    ----------
    frequency_hz : array (n,)
    auto : array (channels, n)
        Auto spectral density of every channel, unit^2/Hz.
    cross : complex array (references, channels, n)
        Cross spectral density, mean of conj(reference) * channel: its phase is that of the channel
        over the reference, and a delayed channel has a falling phase.
    n_blocks : int
        Number of blocks in the average.
    n_effective : float
        Number of independent blocks that would give the same variance (`effective_averages`).
    """

    frequency_hz: Real
    auto: Real
    cross: Complex
    n_blocks: int
    n_effective: float

    def above_zero(self) -> SpectralMatrix:
        """The lines above 0 Hz."""
        return self._replace(
            frequency_hz=self.frequency_hz[1:], auto=self.auto[..., 1:], cross=self.cross[..., 1:]
        )


def has_mirror(lines: int, block: int) -> Flags:
    """Which of the first lines of a DFT stand for two: all but 0 Hz and half the sampling rate."""
    number = np.arange(lines)
    return (number > 0) & (2 * number != block)


def hop_of(block: int, overlap: float) -> int:
    """Distance between block starts for an overlap of 0 to below 1."""
    if not 0.0 <= overlap < 1.0:
        raise ValueError(f"overlap {overlap} is not in [0, 1)")
    return max(1, round(block * (1 - overlap)))


def effective_averages(n_blocks: int, name: WindowName, overlap_hop: float) -> float:
    """Independent blocks that give the variance of `n_blocks` overlapped ones.

    n / (1 + 2 sum_m (1 - m/n) rho(m hop)^2), rho the normalised correlation of the window with itself
    (Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73), `overlap_hop` the hop in block lengths.

    Examples
    --------
    >>> round(effective_averages(100, "hann", 0.5), 2), effective_averages(100, "hann", 1.0)
    (94.79, 100.0)
    """
    if n_blocks < 1:
        return 0.0
    m = np.arange(1, min(n_blocks, int(np.ceil(1 / overlap_hop))))
    alike = np.sum((1 - m / n_blocks) * window_correlation(name, m * overlap_hop) ** 2)
    return float(n_blocks / (1 + 2 * alike))


class CrossSpectra:
    """Accumulates auto spectra of all channels and cross spectra against some, piece by piece.

    Blocks lie on a fixed grid of samples and are added one after the other, elementwise: the bits of the result
    depend neither on the pieces in which samples arrive nor on how many channels are analysed together.

    Parameters
    ----------
    rate : float
        Sampling rate in Hz.
    block : int
        Samples per block; lines are rate / block apart.
    window_name : str
        See `specan.dsp.windows.WINDOWS`; periodic.
    overlap : float
        0 to below 1.
    n_channels : int
    references : sequence of int
        Channels against which cross spectra are formed; none by default.
    lines : int, optional
        Keep lines 0 to `lines`; default all up to half the rate.
    detrend : bool
        Take the mean out of each block.
    shifts : sequence of int, optional
        Samples by which each channel is read later; its phase is turned back, so that the
        result is that of the unshifted channel without the loss that a delay puts on H1.
    averaging : {"linear", "exponential", "max", "min"}
        Exponential: each new block has the weight 1/n_exponential once there are that many.
        Max and min hold keep the largest and smallest density of each line, and have no cross spectra.
    derivatives : sequence of int, optional
        How many times each channel is differentiated before the window; see `specan.dsp.motion.convert`.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x = rng.standard_normal(20000)
    >>> spectra = CrossSpectra(1000.0, 256, "hann", 0.5, n_channels=2, references=[0])
    >>> spectra.add(np.stack([x[:9000], 3 * x[:9000]]))
    >>> spectra.add(np.stack([x[9000:], 3 * x[9000:]]))
    >>> found = spectra.result()
    >>> bool(np.allclose(found.cross[0, 1] / found.auto[0], 3)), found.n_blocks
    (True, 155)
    """

    def __init__(
        self,
        rate: float,
        block: int,
        window_name: WindowName = "hann",
        overlap: float = 0.5,
        *,
        n_channels: int,
        references: Sequence[int] = (),
        lines: int | None = None,
        detrend: bool = True,
        shifts: Sequence[int] | None = None,
        averaging: Averaging = "linear",
        n_exponential: int = 10,
        derivatives: Sequence[int] = (),
    ) -> None:
        if averaging in ("max", "min") and references:
            raise ValueError("a hold has no cross spectra")
        keep_freed_memory()
        self.rate, self.block, self.window_name = rate, block, window_name
        self.hop = hop_of(block, overlap)
        self.references = tuple(references)
        self.averaging, self.n_exponential, self.detrend = averaging, n_exponential, detrend
        self.shifts = [0] * n_channels if shifts is None else list(shifts)
        self.n_blocks = 0
        self._derivatives = [(row, times) for row, times in enumerate(derivatives) if times]
        self._lines = block // 2 if lines is None else min(lines, block // 2)
        self._window = window(window_name, block)
        self._grid = OverlappedBlocks(block, self.hop, shifts)
        kept = (n_channels, self._lines + 1)
        self._auto = np.zeros(kept)
        self._cross = np.zeros((len(self.references), *kept), dtype=complex)

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m), m of any length."""
        for block in self._grid.feed(samples):
            self.add_block(block)

    def clear(self) -> None:
        """Begin another average."""
        self.n_blocks = 0
        self._auto[...] = 0.0
        self._cross[...] = 0.0

    def add_block(self, block: Real) -> None:
        """Take one block (channels, block)."""
        windowed = block - (
            np.add.reduce(block, axis=-1, keepdims=True) / self.block if self.detrend else 0.0
        )
        for row, times in self._derivatives:
            convert(windowed[row], times)
        windowed *= self._window
        spectra = np.fft.rfft(windowed)[:, : self._lines + 1]
        self.n_blocks += 1
        self._take(self._auto, np.square(spectra.real) + np.square(spectra.imag))
        for reference, total in zip(self.references, self._cross, strict=True):
            self._take(total, spectra * np.conj(spectra[reference]))

    def _take(self, total: NDArray[Any], new: NDArray[Any]) -> None:
        if self.averaging == "linear":
            total += new
        elif self.n_blocks == 1:
            total[...] = new
        elif self.averaging == "exponential":
            new -= total
            new /= min(self.n_blocks, self.n_exponential)
            total += new
        elif self.averaging == "max":
            np.maximum(total, new, out=total)
        else:
            np.minimum(total, new, out=total)

    def result(self) -> SpectralMatrix:
        """The average so far; NaN if no block was complete."""
        lines = np.arange(self._lines + 1)
        frequency = np.asarray(lines * (self.rate / self.block), dtype=np.float64)
        scale = np.where(has_mirror(lines.size, self.block), 2.0, 1.0) / (self.rate * np.sum(self._window**2))
        if self.n_blocks == 0:
            scale *= np.nan
        elif self.averaging == "linear":
            scale /= self.n_blocks
        auto: Real = self._auto * scale
        cross: Complex = np.multiply(self._cross, scale)
        if any(self.shifts):
            turn = np.exp(-2j * np.pi * np.outer(self.shifts, frequency) / self.rate)
            cross *= turn[None, :, :] * np.conj(turn[list(self.references)])[:, None, :]
        return SpectralMatrix(frequency, auto, cross, self.n_blocks, self._effective())

    def _effective(self) -> float:
        if self.averaging in ("max", "min"):
            return float(min(self.n_blocks, 1))
        count = self.n_blocks
        if self.averaging == "exponential":
            # Weights (1 - a)^k a have the variance of (2 - a) / a equal ones.
            count = min(count, 2 * self.n_exponential - 1)
        return effective_averages(count, self.window_name, self.hop / self.block)


# What few averages do to a stated uncertainty: Student's factor, and the scatter of a level in dB.
# See docs/decisions/spectra.md.

# Of the normal distribution, within which 95 % lie.
_NORMAL = 1.959963984540054


def student_factor(degrees_of_freedom: ArrayLike) -> Real:
    """By how much an uncertainty from few values is raised, so that 1.96 times it is the 95 % interval.

    Infinite for no degree of freedom.

    Examples
    --------
    >>> student_factor([2, 10, np.inf]).round(3).tolist()
    [2.195, 1.137, 1.0]
    """
    from scipy.special import stdtrit

    # The quantile is slow, and the lines of a spectrum have few different degrees of freedom.
    nu, place = np.unique(np.asarray(degrees_of_freedom, dtype=float), return_inverse=True)
    with np.errstate(invalid="ignore"):
        found = np.where(nu > 0, stdtrit(np.clip(nu, 1e-3, 1e9), 0.975) / _NORMAL, np.inf)
    found = np.where(np.isnan(nu), np.nan, np.where(np.isposinf(nu), 1.0, found))
    return np.asarray(found[place].reshape(np.shape(degrees_of_freedom)))


def log_bias(averages: ArrayLike) -> Real:
    """Mean of the natural logarithm of a mean of `averages` independent squared magnitudes of noise, over its own.

    psi(n) - ln n.

    Examples
    --------
    >>> log_bias([1, 10]).round(4).tolist()
    [-0.5772, -0.0508]
    """
    from scipy.special import digamma

    return np.asarray(digamma(np.asarray(averages, dtype=float)) - np.log(averages))


def log_variance(averages: ArrayLike) -> Real:
    """Variance of that logarithm: psi'(n).

    Examples
    --------
    >>> log_variance([1, 10]).round(4).tolist()
    [1.6449, 0.1052]
    """
    from scipy.special import polygamma

    return np.asarray(polygamma(1, np.asarray(averages, dtype=float)))


def power_density(signal: Real, rate: float, block: int) -> tuple[Real, Real]:
    """One-sided power density of a signal, and its frequencies: Hann windows that overlap by half, means taken off."""
    from scipy.signal import welch

    frequency, power = welch(signal, rate, nperseg=min(block, signal.size))
    return frequency, power
