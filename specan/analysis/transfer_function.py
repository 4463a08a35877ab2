"""Transfer functions of channels over a reference: H1, H2, Hv, and with the generator as instrument."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specan.analysis.accumulator import read_through
from specan.analysis.response_length import (
    LEAST_AVERAGES,
    PASSING_OVERLAP,
    Look,
    averages_in,
    leakage,
    look,
    passes_once,
    rms_ratio,
    shifts_of,
    sufficient_block,
)
from specan.analysis.section import SectionSettings, channel_named, compared, responses_to, section
from specan.data.frequency_response import LOW_COHERENCE, LOW_SNR_PERCENT, FrequencyResponse, leaking
from specan.data.recording import Recording
from specan.dsp.statistics import median
from specan.dsp.transfer_function import Estimate, Estimator, Instrument, estimate, u_phase_deg
from specan.dsp.welch import CrossSpectra, SpectralMatrix
from specan.dsp.windows import WindowName, line_correlation
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
    estimator: Estimator = "H1"
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

    def accumulator(self, recording: Recording) -> TransferFunctionAccumulator:
        """For a pass over the recording that serves several analyses."""
        return TransferFunctionAccumulator(recording, self)

    def __call__(self, recording: Recording) -> FrequencyResponse:
        """Read the recording once and return the transfer functions."""
        return read_through(self.accumulator(recording), recording)


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
        self.responses, notes = responses_to(recording, helpers, settings.channels)
        self.notes = (*others, *notes)
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
        self._spectra = CrossSpectra(
            self.reference.sampling_rate,
            self.settings.block,
            self.settings.window,
            self.settings.overlap,
            n_channels=len(self.channels),
            references=[0] if self.instrument is None else [0, 1],
            lines=self.settings.lines,
            shifts=self.shifts,
        )

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
        # A short section has been averaged already, in the same blocks.
        self._whole = None
        if seen is not None and seen.block == self.settings.block and not any(self.shifts):
            self._whole = None if self.instrument is not None else seen.whole

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
        """The beginning of the recording, the generator along with it where it is not analysed anyway."""
        generators = [
            c
            for c in self.recording.by_role("generator")
            if c not in self.channels
            and c.sampling_rate == self.reference.sampling_rate
            and c.n_samples >= self.stop
        ]
        return look(
            self.recording,
            self.channels,
            generators[0] if generators else None,
            self.settings,
            block,
            (self.start, self.stop),
            whole=self._passes_once,
        )

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples (channels, m) of `channels`."""
        if self._whole is None:
            self._spectra.add(samples)

    def result(self) -> FrequencyResponse:
        """Transfer functions from what was added so far; from all of a section that the first look took in."""
        spectra = self._spectra.result() if self._whole is None else self._whole
        spectra = spectra.part(len(self.channels), self.settings.n_lines)
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
        u_relative = np.hypot(found.u_relative, lost)
        step = self.reference.sampling_rate / settings.block
        return FrequencyResponse(
            label=self.recording.label,
            frequency_hz=f,
            channels=tuple(c.label for c in self.responses),
            units=tuple(quotient(c.target_unit, self.reference.target_unit) for c in self.responses),
            reference=self.reference.label,
            response=response,
            coherence=found.coherence,
            u_magnitude_percent=100 * u_relative,
            u_phase_deg=u_phase_deg(u_relative),
            u_leakage_percent=100 * lost,
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
            flags=tuple(
                (*self.recording.flags, *_flags(spectra, found, u_relative, lost, row, first))
                for row in range(len(self.responses))
            ),
            notes=(*self.notes, *self._remarks(found, lost)),
            settings=settings.model_dump(),
        )

    def _estimate(self, spectra: SpectralMatrix) -> Estimate:
        first = len(self.channels) - len(self.responses)
        instrument = None
        if self.instrument is not None:
            instrument = Instrument(spectra.auto[1], spectra.cross[1, 0], spectra.cross[1, first:])
        return estimate(
            self.settings.estimator,
            spectra.auto[0],
            spectra.auto[first:],
            spectra.cross[0, first:],
            spectra.n_effective,
            line_correlation=line_correlation(self.settings.window),
            instrument=instrument,
        )

    def _together(self, of: Any) -> NDArray[np.float64]:
        """Uncertainty of response and reference in quadrature, (responses, lines)."""
        return np.stack([np.hypot(of(c), of(self.reference)) for c in self.responses])

    def _remarks(self, found: Estimate, lost: NDArray[np.float64]) -> list[str]:
        remarks = [*self._on_lines(found, lost), *self._on_the_instrument()]
        channels = (self.reference, *self.responses)
        remarks += [f"{c.label}: {c.conversion}" for c in channels if c.conversion]
        late = [c.label for c, shift in zip(self.channels, self.shifts) if shift]
        if late:
            remarks.append(f"aligned before the analysis and turned back after it: {', '.join(late)}")
        return remarks

    def _on_lines(self, found: Estimate, lost: NDArray[np.float64]) -> list[str]:
        """Who chose the number of lines, and whether the blocks are too short for the response."""
        settings, rate = self.settings, self.reference.sampling_rate
        remarks = []
        if self._passes_once and settings.overlap == PASSING_OVERLAP:
            remarks.append("few blocks drive each line, as with a sweep: blocks overlap by 75 %")
        if self.asked is None and settings.n_lines != DEFAULT_LINES:
            why = "so that the response dies out within a block"
            if self.sufficient is not None and settings.block < self.sufficient:
                why = "as many as the length of the section allows"
            remarks.append(f"{settings.n_lines} lines, {why} ({settings.block / rate:.3g} s)")
        worst = [
            row
            for row, (taken, u) in enumerate(zip(lost, found.u_relative, strict=True))
            if median(leaking(100 * taken, 100 * np.hypot(u, taken))) > 0.5
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
        return f"--lines {wanted} would do, with a longer recording"

    def _on_the_instrument(self) -> list[str]:
        share = self.foreign_share
        if self.instrument is not None or not share > _FOREIGN:
            return []
        return [
            f"{100 * share:.2g} % of the power of {self.reference.label} is not the generator's: where that is noise "
            f"of {self.reference.label}, H1 reads low by as much, and H3c is the unbiased choice"
        ]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else "nearly all"


def block_of(lines: int) -> int:
    """Samples of a block with as many lines up to rate / 2.56."""
    return round(lines * SAMPLES_PER_LINE)


def _flags(
    spectra: SpectralMatrix,
    found: Estimate,
    u_relative: NDArray[np.float64],
    lost: NDArray[np.float64],
    row: int,
    first: int,
) -> list[str]:
    own = spectra.auto[first + row]
    if not np.all(np.isfinite(own)):
        return ["not-finite"]
    if not np.any(own > 0):
        return ["dead"]
    if not np.any(spectra.auto[0] > 0):
        return ["no-reference"]
    flags = []
    with np.errstate(invalid="ignore"):
        if not median(100 * u_relative[row]) <= LOW_SNR_PERCENT:
            flags.append("low-snr")
        if median(found.coherence[row]) < LOW_COHERENCE:
            flags.append("low-coherence")
    if median(leaking(100 * lost[row], 100 * u_relative[row])) > 0.5:
        flags.append("leakage")
    return flags
