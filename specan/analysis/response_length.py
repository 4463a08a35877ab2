"""A first look at a recording: delays of the responses, how long they ring, and what blocks take from them.

See docs/decisions/leakage.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from specan.analysis.accumulator import READ_BLOCK
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.leakage import leakage_bias
from specan.dsp.statistics import median
from specan.dsp.transfer_function import arrivals, estimate
from specan.dsp.welch import CrossSpectra, SpectralMatrix, effective_averages, hop_of
from specan.dsp.windows import WindowName, window, window_correlation

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# The look takes as many samples as this many blocks, in blocks longer by up to this power of two, of which it
# holds at least so many: delays and echoes of several blocks are seen as such.
_LOOK_BLOCKS, _LONGEST, _LEAST = 32, 8, 4
# Welch's blocks of a reference that passes each line once: squared windows this far apart add up evenly (a Hann
# window's square has no harmonic above the second). Half a block apart they do not, and a response is weighted
# otherwise than what drove it, by about its delay over the block.
PASSING_OVERLAP = 0.75
# A delay is compensated where it would cost H1 more than a thousandth.
TOLERATED_LOSS = 1e-3
_DISTINCT_PEAK = 6.0  # times the RMS of an impulse response; white noise of 65536 samples reaches 4.8
# Leakage that is taken as none: 1 % (0.09 dB), about what a calibration leaves, or half the random uncertainty.
TOLERATED_LEAKAGE, TOLERATED_SHARE = 0.01, 0.5
# A block is not lengthened beyond this number of independent averages: with 8 the factor of Student's distribution
# for a line's own noise is 1.09.
LEAST_AVERAGES = 8.0
_NEIGHBOURS = (1 / 15,) * 15
# Median coherence with the generator from which on it is what drives the reference.
_DRIVEN = 0.1


class Windowed(Protocol):
    """Settings with a window and an overlap."""

    window: WindowName
    overlap: float


@dataclass(frozen=True)
class Look:
    """Responses as the beginning of a recording shows them, in blocks of `block` samples.

    Attributes
    ----------
    block : int
    n_effective : float
    lags : tuple of int
        Samples by which each channel's strongest arrival lags the reference; 0 where none is distinct.
    response : complex array (channels, block // 2)
        H1 of each channel, lines from 1 on, turned back by its lag.
    variance : array (channels, block // 2)
        Mean square of its random error.
    power : array (block // 2,)
        Spectrum of the reference.
    foreign_share : float
        Share of the reference's power that is not the generator's (median over the lines); NaN without a generator.
    whole : SpectralMatrix or None
        The averages themselves, where they are those of the whole section.
    """

    block: int
    n_effective: float
    window: WindowName
    lags: tuple[int, ...]
    response: Complex
    variance: Real
    power: Real
    foreign_share: float
    whole: SpectralMatrix | None = None

    def bias(self, block: int, first: int = 0) -> Complex:
        """What blocks of `block` samples, of which `self.block` is a multiple, take from each of their lines.

        Of the channels from `first` on.
        """
        ratio = self.block // block
        rows = [
            leakage_bias(h, v, self.window, ratio)
            for h, v in zip(self.response[first:], self.variance[first:], strict=True)
        ]
        return np.stack(rows)[:, ratio - 1 :: ratio]

    def leakage(self, block: int) -> Real:
        """RMS of `bias` over that of the response, weighted with the reference's power, of each other channel."""
        ratio = self.block // block
        power = self.power[ratio - 1 :: ratio]
        response = self.response[1:, ratio - 1 :: ratio]
        return rms_ratio(np.abs(self.bias(block, 1)) ** 2, np.abs(response) ** 2, power)

    def random(self, averages: float) -> Real:
        """Relative random error that as many averages leave, likewise weighted, of each other channel."""
        found = rms_ratio(self.variance[1:], np.abs(self.response[1:]) ** 2, self.power)
        return found * np.sqrt(self.n_effective / max(averages, 1.0))


def rms_ratio(square: Real, over: Real, weight: Real | float = 1.0) -> Real:
    """Root of the weighted sum of one square over that of another."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nansum(square * weight, axis=-1) / np.nansum(over * weight, axis=-1)
    return np.sqrt(np.nan_to_num(ratio, posinf=0.0))


def passes_once(recording: Recording, reference: Channel, block: int, start: int, stop: int) -> bool:
    """Whether few blocks hold most of a line's energy: a sweep, a burst or a blow, and not steady noise.

    As many blocks as the look has, spread over the section. The effective number of those that drive a line is
    (sum P)^2 / sum P^2, P their powers: n for a steady tone, about (n + 1) / 2 for noise (a squared magnitude has
    two degrees of freedom) and 1 for what passes once. The limit lies halfway between the last two, as a ratio.
    """
    count = min(_LOOK_BLOCKS, (stop - start) // block)
    if count < 2:
        return False
    firsts = np.linspace(start, stop - block, count).astype(int).tolist()
    bell = window("hann", block)
    total, square = np.zeros(block // 2), np.zeros(block // 2)
    for first in firsts:
        samples = recording.read([reference], first, first + block)[0]
        power = np.abs(np.fft.rfft((samples - np.mean(samples)) * bell)[1 : block // 2 + 1]) ** 2
        total += power
        square += power**2
    known = np.isfinite(total) & (square > 0)
    if not known.any():
        return False
    effective = np.average(total[known] ** 2 / square[known], weights=total[known])
    return bool(effective < np.sqrt((count + 1) / 2))


def look(
    recording: Recording,
    channels: Sequence[Channel],
    generator: Channel | None,
    how: Windowed,
    block: int,
    section: tuple[int, int],
    *,
    whole: bool = False,
) -> Look:
    """Look at the first 32 blocks of `block` samples.

    Parameters
    ----------
    channels : sequence of Channel
        The reference first.
    generator : Channel or None
        What drives the reference, where it was recorded and is not among `channels`.
    how : Windowed
        Window and overlap.
    section : pair of int
        Of the recording.
    whole : bool
        Look at all of it: what passes each line once has driven few of them in the beginning.
    """
    rate, (start, stop) = channels[0].sampling_rate, section
    longest = block * max([r for r in (1, 2, 4, _LONGEST) if _LEAST * r * block <= stop - start], default=1)
    read = [*channels, *([] if generator is None else [generator])]
    spectra = CrossSpectra(rate, longest, how.window, how.overlap, n_channels=len(read), references=[0])
    until = stop if whole else min(stop, start + _LOOK_BLOCKS * block)
    for samples in recording.blocks(read, READ_BLOCK, start, until):
        spectra.add(samples)
    seen = spectra.result()
    first = estimate("H1", seen.auto[0], seen.auto, seen.cross[0], seen.n_effective)
    # Lines without coherence would drown the peak; 2/n is what chance gives.
    weight = np.maximum(first.coherence - 2 / max(seen.n_effective, 2.0), 0.0)
    weighted = np.where(np.isfinite(first.response), first.response, 0.0) * np.nan_to_num(weight)
    impulse = np.abs(np.fft.irfft(weighted, longest, axis=-1))
    distinct = impulse.max(axis=-1) > _DISTINCT_PEAK * np.sqrt(np.mean(impulse**2, axis=-1))
    lags = arrivals(impulse) * distinct
    count = len(channels)
    response = first.response[:count, 1:].copy()
    for row in np.flatnonzero(lags[:count]):
        response[row] *= np.exp(2j * np.pi * lags[row] * seen.frequency_hz[1:] / rate)
    return Look(
        block=longest,
        n_effective=seen.n_effective,
        window=how.window,
        lags=tuple(int(lag) for lag in lags[:count]),
        response=response,
        variance=2 * (first.u_relative[:count, 1:] * np.abs(response)) ** 2,
        power=seen.auto[0, 1:],
        foreign_share=np.nan if generator is None else _foreign(first.coherence[-1, 1:], seen.n_effective),
        whole=seen if until == stop else None,
    )


def _foreign(coherence: Real, averages: float) -> float:
    """One minus the median coherence, chance (1 - g^2)/n taken out; NaN where the generator drives nothing."""
    known = coherence[np.isfinite(coherence)]
    if not known.size or averages <= 1:
        return float("nan")
    seen = median(known)
    seen = (seen - 1 / averages) / (1 - 1 / averages)
    return 1 - seen if seen > _DRIVEN else float("nan")


def shifts_of(seen: Look, block: int, n: int) -> list[int]:
    """Samples by which each channel is to be read later, so that blocks of `block` lose nothing by its delay.

    Parameters
    ----------
    n : int
        Samples of the section, of which at least one block has to be left.
    """
    return [
        lag
        if abs(lag) <= n - block
        and 1 - window_correlation(seen.window, min(abs(lag) / block, 1.0)) > TOLERATED_LOSS
        else 0
        for lag in seen.lags
    ]


def averages_in(n: int, block: int, window_name: WindowName, overlap: float) -> float:
    """Independent averages of blocks of `block` samples in a section of n."""
    hop = hop_of(block, overlap)
    return effective_averages(1 + (n - block) // hop if n >= block else 0, window_name, hop / block)


def sufficient_block(seen: Look, block: int, n: int, overlap: float) -> int:
    """The shortest block, `block` times a power of two, that takes too little from any channel to matter.

    Beyond the blocks of the look, the leakage of a decaying response falls with the square of the length.
    """
    while block < seen.block:
        if _suffices(seen, seen.leakage(block), block, n, overlap):
            return block
        block *= 2
    left = seen.leakage(seen.block)
    while not _suffices(seen, left * (seen.block / block) ** 2, block, n, overlap) and block < n << 4:
        block *= 2
    return block


def _suffices(seen: Look, leakage: Real, block: int, n: int, overlap: float) -> bool:
    random = seen.random(averages_in(n, block, seen.window, overlap))
    # Where the look's blocks are too short as well, what looks random in them is leakage, which goes with 1 / length.
    random = random * min(1.0, seen.block / block)
    return bool(np.all(leakage <= np.maximum(TOLERATED_LEAKAGE, TOLERATED_SHARE * random)))


def leakage(
    response: Complex,
    u_relative: Real,
    block: int,
    window: WindowName,
    shifts: Sequence[int],
    seen: Complex | None,
) -> Real:
    """Relative standard uncertainty per real component that leakage adds, (responses, lines).

    What blocks take from each line, judged from the result itself. Lags beyond half a block are hardly seen
    there: where the longer blocks of a first look show twice that (mean square over 15 lines), theirs is taken.
    The square is averaged over three lines; of a complex error of that size each component has half.

    Parameters
    ----------
    response : complex array (responses, lines)
        From blocks of `block` samples, read later by `shifts` samples.
    u_relative : array (responses, lines)
        Relative standard uncertainty per real component from noise.
    seen : complex array (responses, lines) or None
        What the longer blocks show; see `Look.bias`.
    """
    f = np.arange(1, response.shape[-1] + 1)
    square = np.empty(response.shape)
    for row, (own, u, shift) in enumerate(zip(response, u_relative, shifts, strict=True)):
        turned = own * np.exp(2j * np.pi * f * shift / block) if shift else own
        variance = 2 * (u * np.abs(own)) ** 2
        square[row] = np.abs(leakage_bias(turned, variance, window)) ** 2
        if seen is not None:
            longer = np.abs(seen[row, : len(f)]) ** 2
            more = _mean_over(longer, _NEIGHBOURS) > 2 * _mean_over(square[row], _NEIGHBOURS)
            square[row] = np.where(more, np.maximum(square[row], longer), square[row])
        with np.errstate(divide="ignore", invalid="ignore"):
            square[row] = np.sqrt(_mean_over(square[row], (0.25, 0.5, 0.25)) / 2) / np.abs(own)
    return square


def _mean_over(values: NDArray[np.float64], weights: Sequence[float]) -> NDArray[np.float64]:
    """Weighted mean over neighbouring lines (an odd number), the ends repeated."""
    return np.convolve(np.pad(values, len(weights) // 2, mode="edge"), weights, "valid")
