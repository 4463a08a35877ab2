"""Transfer functions of channels over a reference: H1, H2, Hv, and with the generator as instrument."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specan.analysis.section import of_one_rate, reference_channel, section
from specan.data.frequency_response import LOW_COHERENCE, LOW_SNR_PERCENT, FrequencyResponse
from specan.data.recording import Channel, Recording
from specan.dsp.transfer_function import Estimate, Estimator, delays_of, estimate, u_phase_deg
from specan.dsp.welch import CrossSpectra, SpectralMatrix
from specan.dsp.windows import WindowName, line_correlation, window_correlation
from specan.errors import InputError
from specan.schema import Settings

READ_BLOCK = 1 << 16
# Lines up to rate / 2.56: above them the converters' anti-aliasing filters fall off.
SAMPLES_PER_LINE = 2.56
# A delay is compensated where it would cost H1 more than a thousandth; a look at this many blocks finds it.
TOLERATED_LOSS, PREVIEW_BLOCKS = 1e-3, 32
_DISTINCT_PEAK = 6.0  # times the RMS of an impulse response; white noise of 8192 samples reaches 4


class TransferFunction(Settings):
    """Settings of a transfer function analysis.

    Attributes
    ----------
    reference : str or None
        Name of the reference channel; the vibrometer by default.
    instrument : str or None
        For H3c, the channel that drives the system; the generator by default.
    channels : tuple of str
        Names or patterns of the responses; by default the microphones, without any all other channels.
    estimator : {"H1", "H2", "Hv", "H3c"}
    lines : int
        Number of lines up to rate/2.56; a block has 2.56 times as many samples.
    window, overlap
        Of the blocks. Hann with 50 % gives 95 % of the blocks' number as independent averages.
    align : bool
        Read channels later by the delay that is found at the beginning of the recording, where it would
        bias the result.
    start_s, stop_s : float
        Time section.

    Examples
    --------
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
    channels: tuple[str, ...] = ()
    estimator: Estimator = "H1"
    lines: int = Field(default=3200, ge=8, le=10_000_000)
    window: WindowName = "hann"
    overlap: float = Field(default=0.5, ge=0.0, le=0.95)
    align: bool = True
    start_s: float = Field(default=0.0, ge=0.0)
    stop_s: float | None = Field(default=None, gt=0.0)

    @property
    def block(self) -> int:
        """Samples of a block."""
        return round(self.lines * SAMPLES_PER_LINE)

    def accumulator(self, recording: Recording) -> TransferFunctionAccumulator:
        """For a pass over the recording that serves several analyses."""
        return TransferFunctionAccumulator(recording, self)

    def __call__(self, recording: Recording) -> FrequencyResponse:
        """Read the recording once and return the transfer functions."""
        accumulator = self.accumulator(recording)
        for samples in recording.blocks(
            accumulator.channels, READ_BLOCK, accumulator.start, accumulator.stop
        ):
            accumulator.add(samples)
        return accumulator.result()


class TransferFunctionAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Raises
    ------
    InputError
        No reference, no instrument where one is needed, no response at the reference's sampling rate,
        or fewer samples than a block.
    """

    def __init__(self, recording: Recording, settings: TransferFunction) -> None:
        self.recording, self.settings = recording, settings
        self.reference = reference_channel(recording, settings.reference)
        self.instrument = self._find_instrument()
        helpers = (self.reference,) if self.instrument is None else (self.reference, self.instrument)
        self.responses, self.notes = self._find_responses(helpers)
        self.channels = (*helpers, *self.responses)
        self.start, self.stop = section(recording, self.channels, settings.start_s, settings.stop_s)
        if self.stop - self.start < settings.block:
            raise InputError(
                f"{recording.label}: {self.stop - self.start} samples are less than one block",
                expected=f"at least {settings.block} samples for {settings.lines} lines",
                remedy="ask for fewer lines",
            )
        self.shifts = self._delays() if settings.align else [0] * len(self.channels)
        self._spectra = self._accumulate(settings.lines, self.shifts)

    def _find_instrument(self) -> Channel | None:
        if self.settings.estimator != "H3c":
            return None
        if self.settings.instrument is not None:
            return self.recording.channel(self.settings.instrument)
        found = self.recording.by_role("generator")
        if not found:
            raise InputError(
                f"{self.recording.label} has no generator channel",
                expected="an instrument for H3c",
                remedy="name a channel as the instrument, or use H1",
            )
        return found[0]

    def _find_responses(self, helpers: Sequence[Channel]) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
        patterns = self.settings.channels or [
            f"{c.group}/{c.name}" for c in self.recording.by_role("microphone")
        ]
        chosen, notes = of_one_rate(self.recording, patterns, like=self.reference)
        responses = tuple(c for c in chosen if c not in helpers)
        if not responses or any(c.sampling_rate != self.reference.sampling_rate for c in helpers):
            raise InputError(
                f"{self.recording.label}: no response is sampled together with {self.reference.name}",
                expected=f"channels at {self.reference.sampling_rate:g} Hz",
                remedy="; ".join(notes) or "choose channels other than the reference",
            )
        return responses, notes

    def _accumulate(self, lines: int | None, shifts: Sequence[int]) -> CrossSpectra:
        settings = self.settings
        return CrossSpectra(
            self.reference.sampling_rate,
            settings.block,
            settings.window,
            settings.overlap,
            n_channels=len(self.channels),
            references=[0] if self.instrument is None else [0, 1],
            lines=lines,
            shifts=shifts,
        )

    def _delays(self) -> list[int]:
        """Samples by which each channel lags the reference, where that would bias its transfer function."""
        settings, rate = self.settings, self.reference.sampling_rate
        stop = min(self.stop, self.start + PREVIEW_BLOCKS * settings.block)
        preview = self._accumulate(None, [0] * len(self.channels))
        for samples in self.recording.blocks(self.channels, READ_BLOCK, self.start, stop):
            preview.add(samples)
        seen = preview.result()
        first = estimate("H1", seen.auto[0], seen.auto, seen.cross[0], seen.n_effective)
        # Lines without coherence would drown the peak; 2/n is what chance gives.
        weight = np.maximum(first.coherence - 2 / max(seen.n_effective, 2.0), 0.0)
        weighted = np.where(np.isfinite(first.response), first.response, 0.0) * np.nan_to_num(weight)
        lags = np.rint(delays_of(weighted, settings.block, rate) * rate).astype(int)
        impulse = np.abs(np.fft.irfft(weighted, settings.block, axis=-1))
        distinct = impulse.max(axis=-1) > _DISTINCT_PEAK * np.sqrt(np.mean(impulse**2, axis=-1))
        margin = (self.stop - self.start) - settings.block
        return [
            int(lag)
            if sure
            and 1 - window_correlation(settings.window, lag / settings.block) > TOLERATED_LOSS
            and abs(lag) <= min(settings.block // 2, margin)
            else 0
            for lag, sure in zip(lags, distinct)
        ]

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples (channels, m) of `channels`."""
        self._spectra.add(samples)

    def result(self) -> FrequencyResponse:
        """Transfer functions from what was added so far."""
        spectra = _without_mean(self._spectra.result())
        found = self._estimate(spectra)
        f, settings = spectra.frequency_hz, self.settings
        own, base = np.stack([c.correction(f) for c in self.responses]), self.reference.correction(f)
        with np.errstate(divide="ignore", invalid="ignore"):
            response = found.response * own / base
        u_percent = 100 * found.u_relative
        step = self.reference.sampling_rate / settings.block
        return FrequencyResponse(
            label=self.recording.label,
            frequency_hz=f,
            channels=tuple(c.name for c in self.responses),
            units=tuple(quotient(c.target_unit, self.reference.target_unit) for c in self.responses),
            reference=self.reference.name,
            response=response,
            coherence=found.coherence,
            u_magnitude_percent=u_percent,
            u_phase_deg=u_phase_deg(found.u_relative),
            u_common_percent=self._together(lambda c: np.full(len(f), c.u_gain_percent)),
            u_common_phase_deg=self._together(lambda c: c.u_phase_deg(f)),
            estimator=settings.estimator,
            n_blocks=spectra.n_blocks,
            n_effective=spectra.n_effective,
            line_correlation=line_correlation(settings.window),
            delay_s=np.array(self.shifts[-len(self.responses) :]) / self.reference.sampling_rate,
            reference_rms=float(np.sqrt(np.sum(spectra.auto[0] * np.abs(base) ** 2) * step)),
            reference_unit=self.reference.target_unit,
            flags=tuple(
                (
                    *self.recording.flags,
                    *_flags(spectra, found, row, len(self.channels) - len(self.responses)),
                )
                for row in range(len(self.responses))
            ),
            notes=(*self.notes, *self._remarks()),
            settings=settings.model_dump(),
        )

    def _estimate(self, spectra: SpectralMatrix) -> Estimate:
        first = len(self.channels) - len(self.responses)
        extra: dict[str, Any] = {}
        if self.instrument is not None:
            extra = {
                "auto_instrument": spectra.auto[1],
                "instrument_reference": spectra.cross[1, 0],
                "instrument_response": spectra.cross[1, first:],
            }
        return estimate(
            self.settings.estimator,
            spectra.auto[0],
            spectra.auto[first:],
            spectra.cross[0, first:],
            spectra.n_effective,
            **extra,
        )

    def _together(self, of: Any) -> NDArray[np.float64]:
        """Uncertainty of response and reference in quadrature, (responses, lines)."""
        return np.stack([np.hypot(of(c), of(self.reference)) for c in self.responses])

    def _remarks(self) -> list[str]:
        remarks = []
        for c in (self.reference, *self.responses):
            if c.derivatives:
                kind = "displacement" if c.derivatives > 0 else "acceleration"
                remarks.append(f"{c.name}: {kind} is converted to velocity by j w")
        late = [c.name for c, shift in zip(self.channels, self.shifts) if shift]
        if late:
            remarks.append(f"aligned before the analysis and turned back after it: {', '.join(late)}")
        return remarks


def _without_mean(spectra: SpectralMatrix) -> SpectralMatrix:
    """The line at 0 Hz holds what detrending has left: nothing."""
    return spectra._replace(
        frequency_hz=spectra.frequency_hz[1:], auto=spectra.auto[:, 1:], cross=spectra.cross[..., 1:]
    )


def _flags(spectra: SpectralMatrix, found: Estimate, row: int, first: int) -> list[str]:
    own = spectra.auto[first + row]
    if not np.all(np.isfinite(own)):
        return ["not-finite"]
    if not np.any(own > 0):
        return ["dead"]
    if not np.any(spectra.auto[0] > 0):
        return ["no-reference"]
    flags = []
    with np.errstate(invalid="ignore"):
        if not np.median(100 * found.u_relative[row]) <= LOW_SNR_PERCENT:
            flags.append("low-snr")
        if np.median(found.coherence[row]) < LOW_COHERENCE:
            flags.append("low-coherence")
    return flags


def quotient(unit: str, over: str) -> str:
    """Unit of a ratio.

    Examples
    --------
    >>> quotient("Pa", "m/s"), quotient("Pa", "V"), quotient("Pa", "Pa")
    ('Pa/(m/s)', 'Pa/V', '1')
    """
    if unit == over:
        return "1"
    if over == "1":
        return unit
    return f"{unit}/({over})" if "/" in over or "*" in over else f"{unit}/{over}"
