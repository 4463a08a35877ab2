"""A tone in a long record: its phasor block by block, and what the scatter of the blocks says about its mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from specan.arrays import Complex, Real
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.sine_fit import phasors_of, products, solve_normal, tone_basis

_BLOCK_S, _BLOCK_CYCLES, _LEAST_BLOCKS, _LEAST_CYCLES = 0.1, 10.0, 8, 3.0
_LINES = 12  # of the block series from which the noise at the tone is taken
_ROUNDING = 1e-13  # of the power, which the difference of two sums leaves
_FARTHEST = 0.1  # offset of the frequency, in reciprocal block durations, that is still followed
_WANDER = 0.002  # loss of power by a wandering frequency above which block phases are followed


class Tone(NamedTuple):
    """Tone, harmonics and power of each channel.

    Attributes
    ----------
    frequency_hz : float
        Refined by the leading channel over the whole record.
    phasors : complex array (channels,)
        Peak amplitude and phase at the first sample, x = Re(phasor exp(+j w t)).
    harmonics : complex array (channels, h)
        Peak amplitudes of the fundamental and its harmonics, with the phase that they have when that of the
        leading channel's fundamental is zero.
    deviations : complex array (channels, blocks)
        Relative deviation of each block from the mean, (Y_b - Y) / Y.
    mean, power : arrays (channels,)
        Mean and mean square about it.
    residual : array (channels,)
        Mean square of what the fits leave.
    wandering : bool
        The frequency does not stay where it is; phases of the leading channel were followed.
    """

    frequency_hz: float
    phasors: Complex
    harmonics: Complex
    deviations: Complex
    mean: Real
    power: Real
    residual: Real
    wandering: bool


def block_length(n: int, rate: float, frequency_hz: float) -> int:
    """Samples of a block: a tenth of a second and ten cycles, eight blocks where the record is short.

    Blocks of one record have equal length and leave fewer samples at its end than there are blocks.
    """
    wanted = max(_BLOCK_S, _BLOCK_CYCLES / frequency_hz) * rate
    count = int(n // wanted)
    if count < _LEAST_BLOCKS:
        count = min(_LEAST_BLOCKS, int(n / rate * frequency_hz / _LEAST_CYCLES))
    return n // max(1, count)


class ToneSeries:
    """Fits a sine with harmonics to every block of a fixed grid and keeps the fundamentals.

    Within each block this is the three-parameter fit of IEEE Std 1057: no whole number of cycles is needed. What is
    kept grows by one complex number a block and channel: 15 MB for 26 channels in an hour.

    Parameters
    ----------
    rate, frequency_hz : float
        The frequency has to be right within a tenth of the reciprocal block duration.
    block : int
        See `block_length`.
    n_channels, harmonics : int

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> series = ToneSeries(8000.0, 100.0001, 800, n_channels=2)
    >>> series.add(np.stack([np.cos(2 * np.pi * 100 * t), 3 * np.sin(2 * np.pi * 100 * t)]))
    >>> tone = series.result(leader=0)
    >>> ratio = tone.phasors[1] / tone.phasors[0]
    >>> round(tone.frequency_hz, 9), round(float(abs(ratio)), 4), round(float(np.degrees(np.angle(ratio))), 4)
    (100.0, 3.0, -90.0)
    """

    def __init__(
        self, rate: float, frequency_hz: float, block: int, *, n_channels: int, harmonics: int = 10
    ) -> None:
        self.rate, self.frequency_hz, self.block = rate, frequency_hz, block
        self._basis = tone_basis(block, rate, frequency_hz, harmonics)
        self._gram = products(self._basis, self._basis)
        self._grid = OverlappedBlocks(block)
        self._series: list[Complex] = []
        self._sum, self._square, self._residual = np.zeros((3, n_channels))
        self._count = 0

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m), m of any length."""
        for block in self._grid.feed(samples):
            found = products(self._basis, block)
            self._sum += found[:, -1]
            square = np.add.reduce(block * block, axis=-1)
            self._square += square
            fitted = solve_normal(self._gram, found)
            explained = np.add.reduce(fitted * found, axis=-1)
            left = square - explained
            self._residual += np.where(left > _ROUNDING * square, left, 0.0)
            phasors = phasors_of(fitted)
            # Phases as they are at the first sample of the record.
            order = np.arange(1, phasors.shape[1] + 1)
            cycles = (self._count * (self.frequency_hz / self.rate)) % 1.0
            self._series.append(phasors * np.exp(-2j * np.pi * order * cycles))
            self._count += self.block

    def result(self, leader: int) -> Tone:
        """Coherent mean over the blocks, following the frequency of channel `leader`.

        Raises
        ------
        ValueError
            Not one block is complete.
        """
        if not self._series:
            raise ValueError("no complete block")
        series = np.stack(self._series, axis=1)  # (channels, blocks, harmonics)
        turns, deviation_hz, wandering = self._follow(series[leader, :, 0])
        order = np.arange(1, series.shape[2] + 1)
        # An offset within a block costs sinc(offset * duration).
        loss = np.maximum(np.sinc(order * deviation_hz * self.block / self.rate), 0.5)
        still = series * np.conj(turns)[:, None] ** order / loss
        fundamental = still[..., 0]
        phasors = np.mean(fundamental, axis=1)
        strength = abs(phasors[leader])
        lead = np.exp(1j * np.angle(phasors[leader])) if np.isfinite(strength) else 1.0
        with np.errstate(all="ignore"):  # a channel without the tone has no deviations
            deviations = fundamental / phasors[:, None] - 1
            harmonics = np.mean(still, axis=1) * np.conj(lead) ** order
        mean = self._sum / self._count
        freedom = 1 - len(self._basis) / self.block
        return Tone(
            frequency_hz=self.frequency_hz + deviation_hz,
            # Turns are counted from the middle of the first block.
            phasors=phasors * np.exp(-2j * np.pi * deviation_hz * (self.block - 1) / 2 / self.rate),
            harmonics=harmonics,
            deviations=deviations,
            mean=mean,
            power=np.maximum(self._square / self._count - mean**2, 0.0),
            residual=self._residual / self._count / freedom,
            wandering=wandering,
        )

    def _follow(self, lead: Complex) -> tuple[Complex, float, bool]:
        """Rotation of every block relative to the first, the frequency offset behind it, and whether it wanders."""
        time = np.asarray(np.arange(len(lead)) * (self.block / self.rate), dtype=np.float64)
        if len(lead) == 1 or not np.all(np.isfinite(lead)):
            return np.ones(len(lead), dtype=complex), 0.0, False
        offset = _slope(np.unwrap(np.angle(lead)), np.abs(lead) ** 2, time) / (2 * np.pi)
        if abs(offset) * self.block > _FARTHEST * self.rate:
            return np.ones(len(lead), dtype=complex), 0.0, False  # this is not the tone that was looked for
        ramp = np.exp(2j * np.pi * offset * time)
        still = lead * np.conj(ramp)
        power = np.mean(np.abs(still) ** 2)
        scatter = power - np.abs(np.mean(still)) ** 2
        noise = np.mean(np.abs(np.diff(still)) ** 2) / 2
        if scatter - noise > _WANDER * power:
            phases = np.exp(1j * np.angle(lead))  # dividing by a denormal magnitude would overflow
            return phases * np.conj(phases[0]), offset, True
        return ramp, offset, False


def _slope(values: Real, weights: Real, time: Real) -> float:
    """Slope of a weighted straight line."""
    largest = np.max(weights)
    if not largest > 0:
        return 0.0
    weights = weights / largest
    centred = time - np.sum(weights * time) / np.sum(weights)
    spread = np.sum(weights * centred**2)
    # All the weight on one block says nothing about a slope.
    return float(np.sum(weights * centred * values) / spread) if spread > 1e-6 * time[-1] ** 2 else 0.0


def freedom_of_mean(n: int) -> int:
    """Degrees of freedom behind `variance_of_mean` of n values: two for each periodogram line."""
    return 2 * min(_LINES, (n - 1) // 2) if n >= 4 else 0


def variance_of_mean(series: Real) -> Real:
    """Variance of the mean of each row of a stationary series (..., n), coloured or not.

    It is the spectral density at frequency zero over n, taken as the mean of the lowest periodogram lines
    (twelve, or all there are): for a series of tone phasors that is the noise close to the tone, which is what
    disturbs it, and not the noise in the whole band. NaN for fewer than four values.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal(1000)
    >>> bool(abs(np.sqrt(variance_of_mean(x) * 1000) - 1) < 0.4)
    True
    """
    n = series.shape[-1]
    lines = freedom_of_mean(n) // 2
    if n < 4:
        return np.full(series.shape[:-1], np.nan)
    spectrum = np.abs(np.fft.rfft(series, axis=-1)[..., 1 : lines + 1]) ** 2 / n
    return np.mean(spectrum, axis=-1) / n
