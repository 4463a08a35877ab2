"""Transfer functions of channels over a reference, in blocks as long as the responses ring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field

from specan.analysis.accumulator import READ_BLOCK, read_through
from specan.analysis.section import (
    SectionSettings,
    channel_named,
    compared,
    responses_to,
    section,
    slow_part,
)  # fmt: skip
from specan.arrays import Complex, Real
from specan.data.channel import Channel
from specan.data.frequency_response import FrequencyResponse, leaking
from specan.data.recording import Recording
from specan.dsp import transfer_function
from specan.dsp.welch import CrossSpectra, SpectralMatrix, effective_averages, hop_of
from specan.dsp.windows import WindowName, line_correlation, window, window_correlation
from specan.errors import InputError
from specan.units import quotient

# Lines up to rate / 2.56: above them the converters' anti-aliasing filters fall off.
SAMPLES_PER_LINE = 2.56
DEFAULT_LINES, LEAST_LINES = 3200, 100
# Share of the reference's power that is not the generator's from which on H3c is recommended: H1 is low by as much.
_FOREIGN = 0.01


class TransferFunction(SectionSettings):
    """Settings of a transfer function analysis.

    Attributes
    ----------
    reference : str or None
        Name of the reference channel; the vibrometer by default, in a recording of several runs that of the
        channels' own run.
    instrument : str or None
        For H3c, the channel that drives the system; the generator by default.
    channels : tuple of str
        Names or patterns of the responses; by default microphones and accelerometers, without any all other channels.
    estimator : {"H1", "H2", "Hv", "H3c"}
    lines : int or None
        Number of lines up to rate/2.56; a block has 2.56 times as many samples. By default as many as the
        response needs: 3200 times a power of two, so that leakage is below 1 % or half the random
        uncertainty, while eight independent averages are left; fewer in a short section.
    window, overlap
        Of the blocks. Hann with 50 % gives 95 % of the blocks' number as independent averages. Unless it is asked
        for, blocks overlap by 75 % where the reference passes each line once, as a sweep does.
    align : bool
        Read channels later by the delay that is found at the beginning of the recording, where it would
        bias the result.
    start_s, stop_s : float
        Time section.

    Examples
    --------
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> v = np.random.default_rng(0).standard_normal(40000)
    >>> channels = (
    ...     Channel("Vib", role="vibrometer", unit="m/s", sampling_rate=8000.0, n_samples=40000),
    ...     Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=8000.0, n_samples=40000),
    ... )
    >>> recording = Recording("a.tdms", channels, ArraySource([v, 5 * v]))
    >>> found = TransferFunction(lines=100)(recording)
    >>> found.units, bool(np.allclose(found.response, 5)), found.reference
    (('Pa/(m/s)',), True, 'Vib')
    """

    reference: str | None = None
    instrument: str | None = None
    estimator: transfer_function.Estimator = "H1"
    lines: int | None = Field(default=None, ge=8, le=10_000_000)
    window: WindowName = "hann"
    overlap: float = Field(default=0.5, ge=0.0, le=0.95)
    align: bool = True

    @property
    def block(self) -> int:
        """Samples of a block; without `lines`, of one with 3200."""
        return block_of(self.n_lines)

    @property
    def n_lines(self) -> int:
        """`lines`, or 3200."""
        return self.lines or DEFAULT_LINES

    def __call__(self, recording: Recording) -> FrequencyResponse:
        """Read the recording once and return the transfer functions."""
        return read_through(TransferFunctionAccumulator(recording, self), recording)


class TransferFunctionAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Raises
    ------
    InputError
        No reference, no instrument where one is needed, no response at the reference's sampling rate,
        or fewer samples than a block.
    """

    def __init__(self, recording: Recording, settings: TransferFunction) -> None:
        recording, others = compared(recording, settings.reference, settings.channels)
        self.recording, self.asked = recording, settings.lines
        self.settings = settings
        self.reference = channel_named(recording, settings.reference, ("vibrometer",), "a reference")
        self.instrument = None
        if settings.estimator == "H3c":
            remedy = "name a channel as the instrument, or use H1"
            self.instrument = channel_named(
                recording, settings.instrument, ("generator",), "an instrument for H3c", remedy
            )
        helpers = (self.reference,) if self.instrument is None else (self.reference, self.instrument)
        self.responses, self.notes = responses_to(recording, helpers, settings.channels, others)
        self.channels = (*helpers, *self.responses)
        self.start, self.stop = section(recording, self.channels, settings.start_s, settings.stop_s)
        least, n = settings.lines or LEAST_LINES, self.stop - self.start
        if n < block_of(least):
            raise InputError(
                f"{recording.label}: {n} samples are less than one block",
                expected=f"at least {block_of(least)} samples for {least} lines",
                remedy="use fewer lines" if settings.lines else "analyse a longer section",
            )
        self._choose_blocks(block_of(settings.lines or self._most_lines(DEFAULT_LINES)))
        how, rate, references = self.settings, self.reference.sampling_rate, range(len(helpers))
        self._spectra = CrossSpectra(
            rate, how.block, how.window, how.overlap, lines=how.n_lines,
            n_channels=len(self.channels), references=references, shifts=self.shifts,
        )  # fmt: skip
        self._silence = self._around(self.channels, self.settings.block)
        self._spectra.add(self._silence)

    def _around(self, channels: Sequence[Channel], length: int) -> Real:
        """What blocks that reach over the ends of the section hold beyond them, where the reference passes once.

        Without these, what drives a line at an end is on the flank of a window, and the response to it on another part.
        """
        mean = np.zeros((len(channels), 1))
        if not self._passes_once:
            return mean[:, :0]
        mean[:, 0] = slow_part(self.recording, channels, self.start, self.stop).constant
        return np.repeat(mean, length, axis=1)

    def _choose_blocks(self, first: int) -> None:
        """Overlap, lines and shifts, by what the beginning of the recording shows in blocks of `first` samples."""
        settings, n = self.settings, self.stop - self.start
        self._passes_once = passes_once(self.recording, self.reference, first, self.start, self.stop)
        if self._passes_once and "overlap" not in settings.model_fields_set:
            settings = self.settings = settings.model_copy(update={"overlap": PASSING_OVERLAP})
        seen = self._look(first) if settings.align or settings.lines is None else None
        self.sufficient = None if seen is None else sufficient_block(seen, first, n, settings.overlap)
        self.foreign_share = np.nan if seen is None else seen.foreign_share
        if self.sufficient is not None and settings.lines is None:
            lines = self._most_lines(round(self.sufficient / SAMPLES_PER_LINE))
            self.settings = settings.model_copy(update={"lines": lines})
        self.shifts = [0] * len(self.channels)
        if seen is not None and settings.align:
            self.shifts = shifts_of(seen, self.settings.block, n)
        # Where its blocks are no longer than those of the analysis it has nothing more to say.
        self._longer = seen if seen is not None and seen.block > self.settings.block else None

    def _most_lines(self, lines: int) -> int:
        """As many lines, or half of them and so on until the section holds eight independent averages."""
        settings, n = self.settings, self.stop - self.start
        while (
            lines >= 2 * LEAST_LINES
            and averages_in(n, block_of(lines), settings.window, settings.overlap) < LEAST_AVERAGES
        ):
            lines //= 2
        return lines

    def _look(self, block: int) -> Look:
        """Look at the first 32 blocks of `block` samples, at the generator as well where it is not analysed anyway.

        What passes each line once has driven few of them in the beginning: then at all of the section.
        """
        rate, start, stop, how = self.reference.sampling_rate, self.start, self.stop, self.settings
        generators = [
            c
            for c in self.recording.by_role("generator")
            if c not in self.channels and c.sampling_rate == rate and c.n_samples >= stop
        ][:1]
        longest = block * max(
            [r for r in (1, 2, 4, _LONGEST) if _LEAST * r * block <= stop - start], default=1
        )
        read = [*self.channels, *generators]
        spectra = CrossSpectra(rate, longest, how.window, how.overlap, n_channels=len(read), references=[0])
        until = stop if self._passes_once else min(stop, start + _LOOK_BLOCKS * block)
        silence = self._around(read, longest)
        spectra.add(silence)
        for samples in self.recording.blocks(read, READ_BLOCK, start, until):
            spectra.add(samples)
        spectra.add(silence)
        seen = spectra.result()
        first = transfer_function.estimate("H1", seen.auto[0], seen.auto, seen.cross[0], seen.n_effective)
        # Lines without coherence would drown the peak; 2/n is what chance gives.
        weight = np.maximum(first.coherence - 2 / max(seen.n_effective, 2.0), 0.0)
        weighted = np.where(np.isfinite(first.response), first.response, 0.0) * np.nan_to_num(weight)
        impulse = np.abs(np.fft.irfft(weighted, longest, axis=-1))
        distinct = impulse.max(axis=-1) > _DISTINCT_PEAK * np.sqrt(np.mean(impulse**2, axis=-1))
        lags = transfer_function.arrivals(impulse) * distinct
        count = len(self.channels)
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
            foreign_share=_foreign(first.coherence[-1, 1:], seen.n_effective) if generators else np.nan,
        )

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m) of `channels`."""
        self._spectra.add(samples)

    def result(self) -> FrequencyResponse:
        """Transfer functions from what was added so far."""
        self._spectra.add(self._silence)
        spectra = self._spectra.result().above_zero()
        found = self._estimate(spectra)
        # The largest array by far, and used up.
        spectra = spectra._replace(cross=spectra.cross[..., :0].copy())
        f, settings = spectra.frequency_hz, self.settings
        base = self.reference.correction(f)
        response = np.empty_like(found.response)
        with np.errstate(divide="ignore", invalid="ignore"):
            for row, channel in enumerate(self.responses):
                np.divide(found.response[row] * channel.correction(f), base, out=response[row])
        shifts, first = self.shifts[-len(self.responses) :], len(self.channels) - len(self.responses)
        seen = None if self._longer is None else self._longer.bias(settings.block, first)
        lost = leakage(found.response, found.u_relative, settings.block, settings.window, shifts, seen)
        cut = self._cut(spectra) if self._passes_once else np.zeros(1)
        u_leakage = np.hypot(lost, cut)
        u_relative = np.hypot(found.u_relative, u_leakage)
        step = self.reference.sampling_rate / settings.block
        notes = (*self.notes, *self._remarks(found, lost, cut, spectra.auto[0]))
        units = [quotient(c.target_unit, self.reference.target_unit) for c in self.responses]
        shown = FrequencyResponse(
            **settings.origin(self.recording, self.responses, notes, units),
            frequency_hz=f,
            reference=self.reference.label,
            response=response,
            coherence=found.coherence,
            u_magnitude_percent=100 * u_relative,
            u_phase_deg=transfer_function.u_phase_deg(u_relative),
            u_leakage_percent=100 * u_leakage,
            degrees_of_freedom=found.degrees_of_freedom,
            u_common_percent=self._together(lambda c: np.full(len(f), c.u_gain_percent)),
            u_common_phase_deg=self._together(lambda c: c.u_phase_deg(f)),
            estimator=settings.estimator,
            n_blocks=spectra.n_blocks,
            n_effective=spectra.n_effective,
            line_correlation=line_correlation(settings.window),
            delay_s=np.array(shifts) / self.reference.sampling_rate,
            reference_rms=float(np.sqrt(np.sum(spectra.auto[0] * np.abs(base) ** 2) * step)),
            reference_unit=self.reference.target_unit,
        )
        words = (_flags(spectra, shown, row, first) for row in range(len(self.responses)))
        return replace(shown, flags=tuple((*self.recording.flags, *own) for own in words))

    def _cut(self, spectra: SpectralMatrix) -> Real:
        """What the ends of the section cut from a line's response, over all of it.

        By so much of what is left H1 may be wrong. A response that dies out by 60 dB in a quarter of a block, for which
        blocks are chosen, goes on beyond the end with `ringing`, and into the section from what drove it before.
        """
        block, cut = self.settings.block, np.zeros(self.settings.n_lines)
        away = np.arange(block) / block
        ringing, bell = 10 ** (-12 * away), 0.5 + 0.5 * np.cos(np.pi * away)
        for first, step in ((self.start, 1), (self.stop - block, -1)):
            samples = self.recording.read([self.reference], first, first + block) - self._silence[0, 0]
            both = samples[:, ::step] * [ringing, bell]
            lost, driven = np.abs(np.fft.rfft(both))[:, 1 : len(cut) + 1]
            cut += lost * driven
        hop = hop_of(block, self.settings.overlap)
        with np.errstate(divide="ignore", invalid="ignore"):
            cut /= spectra.n_blocks * hop * self.reference.sampling_rate / 2 * spectra.auto[0]
            return cut / np.maximum(1 - cut, 0)

    def _estimate(self, spectra: SpectralMatrix) -> transfer_function.Estimate:
        first = len(self.channels) - len(self.responses)
        instrument = None
        if self.instrument is not None:
            instrument = transfer_function.Instrument(
                spectra.auto[1], spectra.cross[1, 0], spectra.cross[1, first:]
            )
        return transfer_function.estimate(
            self.settings.estimator,
            spectra.auto[0],
            spectra.auto[first:],
            spectra.cross[0, first:],
            spectra.n_effective,
            line_correlation=line_correlation(self.settings.window),
            instrument=instrument,
        )

    def _together(self, of: Any) -> Real:
        """Uncertainty of response and reference in quadrature, (responses, lines)."""
        return np.stack([np.hypot(of(c), of(self.reference)) for c in self.responses])

    def _remarks(self, found: transfer_function.Estimate, lost: Real, cut: Real, drive: Real) -> list[str]:
        remarks = self._on_lines(found, lost)
        if self.instrument is None and self.foreign_share > _FOREIGN:
            remarks.append(
                f"{100 * self.foreign_share:.2g} % of the power of {self.reference.label} is not the generator's: "
                f"where that is noise of {self.reference.label}, H1 reads low by as much, and H3c is the unbiased "
                "choice"
            )
        if np.nansum(cut * drive) > _NOTED * np.nansum(drive):
            remarks.append(
                "leakage at lines that are driven at the ends of the section: record silence before and after a sweep"
            )
        channels = (self.reference, *self.responses)
        remarks += [f"{c.label}: {c.conversion}" for c in channels if c.conversion]
        late = [c.label for c, shift in zip(self.channels, self.shifts) if shift]
        if late:
            remarks.append(f"aligned before the analysis and turned back after it: {', '.join(late)}")
        return remarks

    def _on_lines(self, found: transfer_function.Estimate, lost: Real) -> list[str]:
        """Who chose the number of lines, and whether the blocks are too short for the response."""
        settings, rate = self.settings, self.reference.sampling_rate
        remarks = []
        if self._passes_once and settings.overlap == PASSING_OVERLAP:
            remarks.append("few blocks excite each line, as with a sweep: blocks overlap by 75 %")
        if self.asked is None and settings.n_lines != DEFAULT_LINES:
            why = "so that the response dies out within a block"
            if self.sufficient is not None and settings.block < self.sufficient:
                why = "as many as the length of the section allows"
            remarks.append(f"{settings.n_lines} lines, {why} ({settings.block / rate:.3g} s)")
        worst = [
            row
            for row, (taken, u) in enumerate(zip(lost, found.u_relative, strict=True))
            if np.median(leaking(100 * taken, 100 * np.hypot(u, taken))) > 0.5
        ]
        if not worst:
            return remarks
        square = np.abs(found.response[worst]) ** 2
        size = rms_ratio(2 * lost[worst] ** 2 * square, square)
        row = worst[int(np.argmax(size))]
        remarks.append(
            f"leakage: the response outlasts the blocks of {settings.block / rate:.3g} s, which take "
            f"{_percent(max(size))} of it ({self.responses[row].label}, RMS over the lines); {self._advice()}"
        )
        return remarks

    def _advice(self) -> str:
        settings, n = self.settings, self.stop - self.start
        if self.sufficient is None or self.sufficient <= settings.block:
            return "use more lines"
        wanted = settings.n_lines * (self.sufficient // settings.block)
        if averages_in(n, block_of(wanted), settings.window, settings.overlap) >= LEAST_AVERAGES:
            return f"use --lines {wanted}"
        return f"--lines {wanted} and a longer recording are needed"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else "nearly all"


def block_of(lines: int) -> int:
    """Samples of a block with as many lines up to rate / 2.56."""
    return round(lines * SAMPLES_PER_LINE)


def _flags(spectra: SpectralMatrix, found: FrequencyResponse, row: int, first: int) -> list[str]:
    """Words for a response: what most of its lines have, or why it has none."""
    own = spectra.auto[first + row]
    if not np.all(np.isfinite(own)):
        return ["not-finite"]
    if not np.any(own > 0):
        return ["dead"]
    if not np.any(spectra.auto[0] > 0):
        return ["no-reference"]
    return [word for word, lines in found.line_flags.items() if np.mean(lines[row]) > 0.5]


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
# Part of the drive beyond the ends of the section that is worth a note.
_NOTED = 1e-3
# Median coherence with the generator from which on it is what drives the reference.
_DRIVEN = 0.1


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
    """

    block: int
    n_effective: float
    window: WindowName
    lags: tuple[int, ...]
    response: Complex
    variance: Real
    power: Real
    foreign_share: float

    def bias(self, block: int, first: int = 0) -> Complex:
        """What blocks of `block` samples, of which `self.block` is a multiple, take from each of their lines.

        Of the channels from `first` on.
        """
        ratio = self.block // block
        rows = [
            transfer_function.leakage_bias(h, v, self.window, ratio)
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


def _foreign(coherence: Real, averages: float) -> float:
    """One minus the median coherence, chance (1 - g^2)/n taken out; NaN where the generator drives nothing."""
    known = coherence[np.isfinite(coherence)]
    if not known.size or averages <= 1:
        return float("nan")
    seen = float(np.median(known))
    seen = (seen - 1 / averages) / (1 - 1 / averages)
    return 1 - seen if seen > _DRIVEN else float("nan")


def shifts_of(seen: Look, block: int, n: int) -> list[int]:
    """Samples by which each channel is to be read later, so that blocks of `block` lose nothing by its delay.

    Parameters
    ----------
    n : int
        Samples of the section, of which at least one block has to be left.
    """
    late = np.array(seen.lags)
    lost = 1 - window_correlation(seen.window, np.minimum(np.abs(late) / block, 1.0))
    return np.where((np.abs(late) <= n - block) & (lost > TOLERATED_LOSS), late, 0).tolist()


def averages_in(n: int, block: int, window_name: WindowName, overlap: float) -> float:
    """Independent averages of blocks of `block` samples in a section of n."""
    hop = hop_of(block, overlap)
    return effective_averages(1 + (n - block) // hop if n >= block else 0, window_name, hop / block)


def sufficient_block(seen: Look, block: int, n: int, overlap: float) -> int:
    """The shortest block, `block` times a power of two, that takes too little from any channel to matter.

    Beyond the blocks of the look, the leakage of a decaying response falls with the square of the length. Where these
    are too short as well, what looks random in them is leakage, which goes with 1 / length.
    """
    left, longest = seen.leakage(min(block, seen.block)), n << 4
    while block < longest:
        beyond = min(1.0, seen.block / block)
        random = beyond * seen.random(averages_in(n, block, seen.window, overlap))
        if np.all(left * beyond**2 <= np.maximum(TOLERATED_LEAKAGE, TOLERATED_SHARE * random)):
            return block
        block *= 2
        if block <= seen.block:
            left = seen.leakage(block)
    return block


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
        square[row] = np.abs(transfer_function.leakage_bias(turned, variance, window)) ** 2
        if seen is not None:
            longer = np.abs(seen[row, : len(f)]) ** 2
            more = _mean_over(longer, _NEIGHBOURS) > 2 * _mean_over(square[row], _NEIGHBOURS)
            square[row] = np.where(more, np.maximum(square[row], longer), square[row])
        with np.errstate(divide="ignore", invalid="ignore"):
            square[row] = np.sqrt(_mean_over(square[row], (0.25, 0.5, 0.25)) / 2) / np.abs(own)
    return square


def _mean_over(values: Real, weights: Sequence[float]) -> Real:
    """Weighted mean over neighbouring lines (an odd number), the ends repeated."""
    return np.convolve(np.pad(values, len(weights) // 2, mode="edge"), weights, "valid")
