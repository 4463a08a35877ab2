"""Impulse responses from recordings of noise, sweeps, maximum length sequences or single impulses."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specan.analysis.excitation import recognise
from specan.analysis.section import of_one_rate, section
from specan.analysis.transfer_function import RESPONSES, TransferFunction
from specan.data.channel import Channel
from specan.data.decay import ImpulseResponses
from specan.data.recording import Recording
from specan.dsp.deconvolution import Deconvolution
from specan.errors import InputError, RequestError
from specan.schema import Settings

Real = NDArray[np.float64]

# The reference is over where it stays below this share of its largest magnitude.
_SILENT = 1e-3
_SHORTEST_S = 0.1  # of a response after a reference that has ended
# The lines of H1 end at rate / 2.56; the last ones are faded out, so that the response does not ring there.
_FADED = 0.1


class ImpulseResponse(Settings):
    """Settings of a measurement of impulse responses.

    Attributes
    ----------
    reference : str or None
        Channel that holds the excitation; by default the generator, or the vibrometer where there is none.
    channels : tuple of str
        Names or patterns of the responses; by default microphones and accelerometers, without any all others.
    method : {"deconvolution", "H1"} or None
        Division of the whole section's spectra (sweeps, maximum length sequences, impulses), or the inverse
        transform of an averaged transfer function (noise). By default as the excitation is recognised.
    length_s : float or None
        Of the responses; by default what follows the end of the reference, half the section where the
        reference does not end, or half a block of H1.
    start_s, stop_s : float
        Time section.

    Examples
    --------
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(24000) / 8000
    >>> sweep = np.where(t < 2, np.sin(2 * np.pi * (50 * t + 800 * t**2)), 0.0)
    >>> late = np.append(np.zeros(80), 0.25 * sweep[:-80])
    >>> channels = (
    ...     Channel("Out", role="generator", unit="V", sampling_rate=8000.0, n_samples=24000),
    ...     Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=8000.0, n_samples=24000),
    ... )
    >>> found = ImpulseResponse()(Recording("a.wav", channels, ArraySource([sweep, late])))
    >>> found.method, int(np.argmax(found.samples[0])), found.samples.shape[1]
    ('deconvolution', 80, 8000)
    """

    reference: str | None = None
    channels: tuple[str, ...] = ()
    method: Literal["deconvolution", "H1"] | None = None
    length_s: float | None = Field(default=None, gt=0.0)
    start_s: float = Field(default=0.0, ge=0.0)
    stop_s: float | None = Field(default=None, gt=0.0)

    def __call__(self, recording: Recording) -> ImpulseResponses:
        """Read the section and return the responses."""
        reference = _excitation_channel(recording, self.reference)
        chosen, notes = of_one_rate(
            recording,
            self.channels or [f"{c.group}/{c.name}" for c in recording.channels if c.role in RESPONSES],
            like=reference,
        )
        responses = tuple(c for c in chosen if c != reference)
        if not responses or responses[0].sampling_rate != reference.sampling_rate:
            raise InputError(
                f"{recording.label}: no response is sampled together with {reference.name}",
                expected=f"channels at {reference.sampling_rate:g} Hz besides it",
                remedy="; ".join(notes) or "choose channels other than the reference",
            )
        method = self.method or ("H1" if recognise(recording).kind == "noise" else "deconvolution")
        how = _averaged if method == "H1" else _deconvolved
        samples, upper, remarks = how(self, recording, reference, responses)
        return ImpulseResponses(
            label=recording.label,
            channels=responses,
            reference=reference.name,
            reference_unit=reference.target_unit,
            method=method,
            sampling_rate=reference.sampling_rate,
            samples=samples,
            upper_hz=upper,
            notes=(*notes, *remarks),
            settings=self.model_dump(mode="json"),
        )


def _excitation_channel(recording: Recording, name: str | None) -> Channel:
    if name is not None:
        return recording.channel(name)
    for role in ("generator", "vibrometer"):
        found = recording.by_role(role)
        if found:
            return found[0]
    raise InputError(
        f"{recording.label} has neither a generator nor a vibrometer channel",
        expected="a channel that holds the excitation",
        remedy="name one as the reference",
    )


def _averaged(
    settings: ImpulseResponse, recording: Recording, reference: Channel, responses: tuple[Channel, ...]
) -> tuple[Real, float, tuple[str, ...]]:
    """Inverse transform of H1, whose blocks are at least twice as long as the response."""
    rate = reference.sampling_rate
    lines = None if settings.length_s is None else int(np.ceil(2 * settings.length_s * rate / 2.56))
    found = TransferFunction(
        reference=f"{reference.group}/{reference.name}",
        channels=tuple(f"{c.group}/{c.name}" for c in responses),
        lines=lines,
        start_s=settings.start_s,
        stop_s=settings.stop_s,
    )(recording)
    count = found.frequency_hz.size
    block = round(rate / (found.frequency_hz[-1] / count))
    spectrum = np.zeros((len(responses), block // 2 + 1), dtype=complex)
    fade = np.ones(count)
    last = max(1, int(_FADED * count))
    fade[-last:] = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, last + 1) / (last + 1))
    spectrum[:, 1 : count + 1] = np.where(np.isfinite(found.response), found.response, 0.0) * fade
    samples = np.fft.irfft(spectrum, block, axis=-1)
    wanted = block // 2 if settings.length_s is None else min(block, round(settings.length_s * rate))
    top = found.frequency_hz[-last - 1] if last < count else found.frequency_hz[-1]
    remark = f"responses hold frequencies up to {top:.6g} Hz ({found.n_effective:.0f} independent averages)"
    return samples[:, :wanted], float(top), (*found.notes, remark)


def _deconvolved(
    settings: ImpulseResponse, recording: Recording, reference: Channel, responses: tuple[Channel, ...]
) -> tuple[Real, float, tuple[str, ...]]:
    """Division of spectra of the whole section, one response at a time."""
    rate = reference.sampling_rate
    start, stop = section(recording, (reference, *responses), settings.start_s, settings.stop_s)
    driven = recording.read((reference,), start, stop)[0]
    driven = driven - np.median(driven)  # a sweep's mean is not its zero
    if not np.isfinite(driven).all() or not driven.any():
        raise InputError(
            f"{recording.label}: {reference.name} holds no signal",
            expected="the excitation, without NaN",
            remedy="name another reference",
        )
    length, remarks = _length(settings, driven, rate)
    division = Deconvolution(driven)
    f = np.arange(division.length // 2 + 1) * (rate / division.length)
    base = reference.correction(f)
    found = np.empty((len(responses), length))
    for row, channel in enumerate(responses):
        samples = recording.read((channel,), start, stop)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = channel.correction(f) / base
        found[row] = division.response(
            samples - np.mean(samples), length, np.where(np.isfinite(factor), factor, 0.0)
        )
    return found, rate / 2, remarks


def _length(settings: ImpulseResponse, driven: Real, rate: float) -> tuple[int, tuple[str, ...]]:
    """Samples of the responses, and what is to be said about that."""
    n = driven.size
    if settings.length_s is not None:
        wanted = round(settings.length_s * rate)
        if wanted > n:
            raise RequestError(
                f"responses of {settings.length_s:g} s do not fit a section of {n / rate:.4g} s",
                expected=f"at most {n / rate:.4g} s",
            )
        return wanted, ()
    end = int(np.flatnonzero(np.abs(driven) > _SILENT * np.abs(driven).max())[-1]) + 1
    if n - end >= _SHORTEST_S * rate:
        return n - end, ()
    return n // 2, ("the reference does not end before the recording: responses are as long as half of it",)
