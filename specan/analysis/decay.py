"""Impulse responses; reverberation times and clarity from them (ISO 3382-1, ISO 3382-2)."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import scipy.fft
from pydantic import Field

from specan.analysis.excitation import recognise
from specan.analysis.section import (
    SectionSettings,
    channel_named,
    compared,
    of_one_rate,
    responses_to,
    section,
)
from specan.analysis.transfer_function import TransferFunction
from specan.arrays import Complex, Real
from specan.data.channel import Channel
from specan.data.decay import VALUES, DecayTimes, ImpulseResponses
from specan.data.levels import level
from specan.data.recording import Recording
from specan.dsp import bands
from specan.dsp.energy_decay import decay_line, energy_decay, noise_floor
from specan.errors import InputError, RequestError
from specan.result import picked

# Evaluation ranges in dB below the beginning, and the range above the noise that they need: their end and 10 dB
# (ISO 3382-1:2009, 5.3.3 and 6).
_RANGES = {"edt": (0.0, -10.0), "t20": (-5.0, -25.0), "t30": (-5.0, -35.0)}
_ABOVE_NOISE_DB = 10.0
# Standard deviation of T over positions: factor and term of 1/n (ISO 3382-2:2008, 7.1), and n of an integrated
# impulse response.
_SCATTER = {"t20": (0.88, 1.90), "t30": (0.55, 1.52)}
_DECAYS_OF_AN_IMPULSE_RESPONSE = 10
_ARRIVAL = 0.1  # of the largest magnitude: -20 dB (ISO 3382-1:2009, A.1)
_FIRST_INTERVAL_S = 0.01
_LEAD_S = 1.0  # of silence before the record, for what the reversed filter puts there
_FILTER_LASTS = 3.0  # times 1 / B: an order 4 band-pass has fallen to 1 % of its peak
# Lines at which the band filter lets less than this through are left out.
_FILTER_FLOOR = 1e-10


class Decay(SectionSettings):
    """Settings of an evaluation of impulse responses.

    Attributes
    ----------
    fraction : {1, 3}
        Octaves or one-third octaves.
    fmin, fmax : float
        Bands from the one that contains `fmin` to the one that contains `fmax`; by default 125 Hz to 4 kHz in
        octaves, 100 Hz to 5 kHz in thirds (ISO 3382-2:2008, 6), as far as the sampling rate allows.
    channels : tuple of str
        Names or patterns; all microphones by default, all channels where there is none.
    start_s, stop_s : float
        Time section.

    Examples
    --------
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(32000) / 16000
    >>> decaying = np.random.default_rng(1).standard_normal(t.size) * 10 ** (-3 * t / 1.2)
    >>> mic = Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=16000.0, n_samples=t.size)
    >>> found = Decay(fmin=1000, fmax=4000)(Recording("a.wav", (mic,), ArraySource([decaying])))
    >>> found.t20_s.round(1).tolist()
    [[1.2, 1.2, 1.2]]
    """

    fraction: Literal[1, 3] = 1
    fmin: float | None = Field(default=None, gt=0.0)
    fmax: float | None = Field(default=None, gt=0.0)

    def __call__(self, recording: Recording, upper_hz: float = math.inf) -> DecayTimes:
        """Read the section and return the decay times; the responses hold up to `upper_hz`."""
        microphones = [c.path for c in recording.channels if c.role == "microphone"]
        chosen, notes = of_one_rate(recording, self.channels or microphones)
        rate = chosen[0].sampling_rate
        found = self._bands(rate, min(upper_hz, rate / 2))
        width = found.upper - found.lower
        rows = [self._channel(recording, c, found.mid, width) for c in chosen]
        reasons = [row if isinstance(row, str) else "" for row in rows]
        if all(reasons):
            raise InputError(
                f"{recording.label}: {chosen[0].label} {_REASONS[reasons[0]]}",
                expected="an impulse response",
                remedy="choose other channels or another section",
            )
        values = [{} if isinstance(row, str) else row for row in rows]
        results: dict[str, Any] = {
            name: np.stack([np.broadcast_to(v.get(name, np.nan), width.shape) for v in values])
            for name in _RESULTS
        }
        without = [f"{c.label} {_REASONS[why]}: no decay times" for c, why in zip(chosen, reasons) if why]
        return DecayTimes(
            **self.origin(recording, chosen, (*notes, *without), units=()),
            fraction=self.fraction,
            exact_hz=found.mid,
            nominal_hz=found.nominal,
            bandwidth_hz=width,
            **results,
            start_s=np.array([v.get("start_s", np.nan) for v in values]),
            flags=tuple((why,) if why else () for why in reasons),
        )

    def _bands(self, rate: float, top: float) -> bands.Bands:
        low, high = (125.0, 4000.0) if self.fraction == 1 else (100.0, 5000.0)
        found = bands.Bands.between(self.fraction, self.fmin or low, self.fmax or high)
        below = found.upper <= top
        if not below.any() or (self.fmax is not None and not below[-1]):
            raise RequestError(
                f"bands up to {self.fmax or high:g} Hz do not fit responses up to {top:g} Hz, sampled at {rate:g} Hz",
                expected=f"bands whose upper edge is at most {top:g} Hz",
            )
        return found[below]

    def _channel(
        self, recording: Recording, channel: Channel, mid: Real, width: Real
    ) -> dict[str, Any] | str:
        """The results of a channel over its own length, or why it has none."""
        try:
            start, stop = section(recording, (channel,), self.start_s, self.stop_s)
        except RequestError:
            return "short"
        samples = recording.read((channel,), start, stop)[0]
        if not np.isfinite(samples).all():
            return "not-finite"
        if np.ptp(samples) == 0.0:
            return "dead"
        # Near 1, so that no square is lost; a power of two changes no digit.
        samples = np.ldexp(samples, -np.frexp(np.abs(samples).max())[1])
        samples = samples - np.mean(samples)
        rate = channel.sampling_rate
        arrival = int(np.argmax(np.abs(samples) >= _ARRIVAL * np.abs(samples).max()))
        # A band of width B is known no sooner than 1 / B after the arrival.
        known = samples.size - arrival > rate / width
        if not known.any():
            return "short"
        lead = int(_LEAD_S * rate)
        length = scipy.fft.next_fast_len(lead + samples.size, real=True)
        spectrum = scipy.fft.rfft(np.concatenate([np.zeros(lead), samples]), length)
        found: list[dict[str, float]] = [{} for _ in mid]
        for k in np.flatnonzero(known):
            energy, step = _band_energy(spectrum, length, lead + samples.size, mid[k] / rate, self.fraction)
            places = int((lead + arrival) / step), int(lead / step)
            found[k] = _evaluate(energy, *places, step / rate, width[k])
        values = {name: np.array([one.get(name, np.nan) for one in found]) for name in _RESULTS}
        return {"start_s": start / rate + arrival / rate, **values}


# Words of channels without a result, and what they say.
_REASONS = {
    "dead": "holds one value only",
    "not-finite": "has samples that are not finite",
    "short": "is too short",
}
_RESULTS = [name for name in VALUES if name != "curvature_percent"]  # which follows from others


def _band_energy(spectrum: Complex, length: int, n: int, mid: float, fraction: int) -> tuple[Real, float]:
    """Squared envelope of one band at a lower rate, and how many samples of the record one of it spans.

    The filter is reversed in time: its slow decay lies before each arrival and not after it (ISO 3382-1:2009, 7.3).
    Only the lines that it lets through are transformed back, which gives the complex envelope.
    """
    with np.errstate(divide="ignore"):
        gain = bands.power_response(np.log(np.arange(spectrum.size) / length / mid), fraction)
    kept = np.flatnonzero(gain > _FILTER_FLOOR)
    first, last = int(kept[0]), int(kept[-1]) + 1
    response = bands.complex_response(np.arange(first, last) / length / mid, fraction)
    count = scipy.fft.next_fast_len(last - first)
    lines = np.zeros(count, dtype=complex)
    lines[: last - first] = spectrum[first:last] * np.conj(response)
    step = length / count
    envelope = scipy.fft.ifft(lines) * (2.0 / step)
    return 0.5 * np.abs(envelope[: int(n / step)]) ** 2, step


def _evaluate(energy: Real, arrival: int, recorded: int, step_s: float, width: float) -> dict[str, float]:
    """All parameters of one band.

    Parameters
    ----------
    energy : array (n,)
        Squared envelope, `step_s` seconds apart.
    arrival, recorded : int
        Where the direct sound arrives, and where the record begins.
    width : float
        Bandwidth in Hz.
    """
    interval = max(1, int(_FIRST_INTERVAL_S / step_s))
    after = energy[arrival:]
    floor = noise_floor(after, interval)
    curve = energy_decay(after, floor)
    # What the reversed filter puts before the arrival is energy of the direct sound.
    first = max(0, arrival - int(_FILTER_LASTS / width / step_s))
    before = float(np.sum(energy[first:arrival])) - floor.power * max(0, arrival - max(first, recorded))
    course = level(curve, curve[0])
    top = float(np.max(np.convolve(after[: floor.end], np.ones(interval) / interval, "valid")))
    bottom = floor.power or float(np.mean(after[-interval:]))
    range_dB = 10.0 * math.log10(top / bottom) if bottom > 0 else math.inf
    found = {"range_dB": range_dB, "nonlinearity_permille": math.nan}
    for name, (upper, lower) in _RANGES.items():
        line = decay_line(course, upper, lower)
        enough = range_dB >= _ABOVE_NOISE_DB - lower
        time = found[f"{name}_s"] = line.samples * step_s if enough else math.nan
        if name in _SCATTER:
            factor, term = _SCATTER[name]
            scatter = (1.0 + term / _DECAYS_OF_AN_IMPULSE_RESPONSE) / (width * time) if time > 0 else math.nan
            found[f"u_{name}_s"] = factor * time * math.sqrt(scatter)
            if enough:
                found["nonlinearity_permille"] = line.nonlinearity
    total, times = float(curve[0]) + before, (np.arange(curve.size) + 0.5) * step_s
    for name, limit in (("c50_dB", 0.050), ("c80_dB", 0.080)):
        late = float(np.interp(limit, times - 0.5 * step_s, curve, right=math.nan))
        found[name] = 10.0 * math.log10((total - late) / late) if 0 < late < total else math.nan
        if limit == 0.050:  # noise that is stronger than the response leaves none
            found["d50_percent"] = 100.0 * (1.0 - late / total) if 0 <= late <= total else math.nan
    # The integral of t p^2 is that of the decay curve.
    found["centre_time_s"] = float(np.sum(curve) * step_s / total)
    return found


# Share of the reference's strongest line below which a line is not divided: -60 dB, beyond the 30 dB by which an
# exponential sweep over ten octaves falls; 0.01 dB at its weakest line.
_FLOOR = 1e-6
# The reference is over where it stays below this share of its largest magnitude.
_SILENT = 1e-3
_SHORTEST_S = 0.1  # of a response after a reference that has ended
# The lines of H1 end at rate / 2.56; the last ones are faded out, so that the response does not ring there.
_FADED = 0.1


class ImpulseResponse(SectionSettings):
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
    method: Literal["deconvolution", "H1"] | None = None
    length_s: float | None = Field(default=None, gt=0.0)

    def __call__(self, recording: Recording) -> ImpulseResponses:
        """Read the section and return the responses."""
        recording, others = compared(recording, self.reference, self.channels)
        roles = ("generator", "vibrometer")
        reference = channel_named(recording, self.reference, roles, "a channel that holds the excitation")
        responses, notes = responses_to(recording, (reference,), self.channels, others)
        method = self.method or ("H1" if recognise(recording).kind == "noise" else "deconvolution")
        how = _averaged if method == "H1" else _deconvolved
        samples, upper, remarks = how(self, recording, reference, responses)
        return ImpulseResponses(
            **self.origin(
                recording, responses, dict.fromkeys((*notes, *remarks)), [c.unit for c in responses]
            ),
            sources=responses,
            reference=reference.label,
            reference_unit=reference.target_unit,
            method=method,
            sampling_rate=reference.sampling_rate,
            samples=samples,
            upper_hz=upper,
        )


def _averaged(
    settings: ImpulseResponse, recording: Recording, reference: Channel, responses: tuple[Channel, ...]
) -> tuple[Real, float, tuple[str, ...]]:
    """Inverse transform of H1, whose blocks are at least twice as long as the response."""
    rate = reference.sampling_rate
    _section(settings, recording, (reference, *responses))
    lines = None if settings.length_s is None else max(8, int(np.ceil(2 * settings.length_s * rate / 2.56)))
    paths = tuple(c.path for c in responses)
    part = picked(settings, "start_s stop_s")
    found = TransferFunction(reference=reference.path, channels=paths, lines=lines, **part)(recording)
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
    remark = f"responses are valid up to {top:.6g} Hz ({found.n_effective:.0f} independent averages)"
    return samples[:, :wanted], float(top), (*found.notes, remark)


def _deconvolved(
    settings: ImpulseResponse, recording: Recording, reference: Channel, responses: tuple[Channel, ...]
) -> tuple[Real, float, tuple[str, ...]]:
    """Division of spectra of the whole section, one response at a time."""
    rate = reference.sampling_rate
    start, stop = _section(settings, recording, (reference, *responses))
    driven = recording.read((reference,), start, stop)[0]
    driven = driven - np.median(driven)  # a sweep's mean is not its zero
    if not np.isfinite(driven).all() or not driven.any():
        raise InputError(
            f"{recording.label}: {reference.label} holds no signal",
            expected="the excitation, without NaN",
            remedy="name another reference",
        )
    length, remarks = _length(settings, driven, rate)
    points = scipy.fft.next_fast_len(2 * driven.size, real=True)
    spectrum = scipy.fft.rfft(driven, points)
    power = np.abs(spectrum) ** 2
    inverse = np.conj(spectrum) / (power + _FLOOR * max(float(power.max()), np.finfo(float).tiny))
    f = np.arange(points // 2 + 1) * (rate / points)
    base = reference.correction(f)
    found = np.empty((len(responses), length))
    for row, channel in enumerate(responses):
        samples = recording.read((channel,), start, stop)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = channel.correction(f) / base
        lines = scipy.fft.rfft(samples - np.mean(samples), points) * inverse
        found[row] = scipy.fft.irfft(lines * np.where(np.isfinite(factor), factor, 0.0), points)[:length]
    return found, rate / 2, remarks


def _section(
    settings: ImpulseResponse, recording: Recording, channels: tuple[Channel, ...]
) -> tuple[int, int]:
    """First sample of the section and the one behind its last; responses must fit in."""
    start, stop = section(recording, channels, settings.start_s, settings.stop_s)
    rate = channels[0].sampling_rate
    lasts = (stop - start) / rate
    if settings.length_s is not None and not 1 / rate <= settings.length_s <= lasts:
        raise RequestError(
            f"responses of {settings.length_s:g} s do not fit a section of {lasts:.4g} s",
            expected=f"{1 / rate:.4g} to {lasts:.4g} s",
        )
    return start, stop


def _length(settings: ImpulseResponse, driven: Real, rate: float) -> tuple[int, tuple[str, ...]]:
    """Samples of the responses, and what is to be said about that."""
    n = driven.size
    if settings.length_s is not None:
        return round(settings.length_s * rate), ()
    end = int(np.flatnonzero(np.abs(driven) > _SILENT * np.abs(driven).max())[-1]) + 1
    if n - end >= _SHORTEST_S * rate:
        return n - end, ()
    return n // 2, (
        "the excitation lasts to the end of the recording: responses are half as long as the recording",
    )
