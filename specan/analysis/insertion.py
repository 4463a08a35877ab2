"""One recording of a calibrator: the tone, and what each microphone in the adapter made of it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specan.data.recording import Channel, Recording
from specan.dsp.sine_fit import fit_frequency, fit_sine, peak_frequency
from specan.errors import InputError
from specan.schema import Settings
from specan.units import LEVEL_REFERENCES

DEFAULT_LEVEL_DB = 94.0
# A microphone outside the adapter hears the calibrator at least this much less than one inside.
HEARD_FROM_OUTSIDE_DB = 15.0
LONGEST_WINDOW_S = 1.0


class CalibrationSettings(Settings):
    """How calibrator recordings are evaluated.

    Attributes
    ----------
    level_dB : float or None
        Sound pressure level of the calibrator re 20 uPa; None takes `CalibratorLevel_dB`, else 94 dB.
    frequency_hz : float or None
        Nominal tone; None takes `CalibratorFrequency_Hz`, else the strongest tone.
    windows : int
        Number of measurement windows n of the means; windows longer than a second are divided.
    u_level_dB : float
        Standard uncertainty of the calibrator's level, as its certificate says.
    channels : tuple of str
        Names or patterns of the calibrated channels; none takes `CalibratedChannels`, else all that
        show the tone.
    phase_model : {"delay", "constant"}
        How the phase goes on to other frequencies.
    """

    level_dB: float | None = None
    frequency_hz: Annotated[float, Field(gt=0)] | None = None
    windows: Annotated[int, Field(ge=2)] = 20
    u_level_dB: Annotated[float, Field(ge=0)] = 0.1
    channels: tuple[str, ...] = ()
    phase_model: Literal["delay", "constant"] = "delay"


@dataclass(frozen=True)
class Heard:
    """What one channel made of the calibrator's tone in one recording.

    Attributes
    ----------
    sensitivity : float
        Mean over the windows, mV/Pa.
    scatter_percent : float
        Standard deviation of the windows over their mean.
    drift_percent : float
        Change over the recording by the straight line through the windows.
    phase_deg : float
        Circular mean relative to the first channel of the recording.
    u_phase_deg : float
        Standard deviation of that mean.
    impurity : float
        RMS of everything but the tone over the RMS of the tone.
    nominal : float or None
        Sensitivity that the file or the channel table states, mV/Pa.
    clipped : bool
        Whether samples reach the converter's range.
    """

    channel: str
    sensitivity: float
    scatter_percent: float
    drift_percent: float
    phase_deg: float
    u_phase_deg: float
    impurity: float
    nominal: float | None
    clipped: bool


@dataclass(frozen=True)
class Insertion:
    """Result of one calibrator recording; `silent` names channels that should have heard it."""

    label: str
    frequency_hz: float
    level_dB: float
    windows: int
    heard: tuple[Heard, ...]
    silent: tuple[str, ...] = ()


def evaluate_insertion(recording: Recording, settings: CalibrationSettings | None = None) -> Insertion:
    r"""Sensitivities and phases of the microphones in a calibrator, from one recording.

    The recording is cut into n windows; a sine is fitted to each (IEEE Std 1057-2017, at the frequency
    found from all of the first channel), which needs no whole number of cycles. Then

    .. math:: sen_{mean} = \frac1n \sum sen_i, \qquad \varphi_{mean} = \arg \sum e^{j\varphi_i}

    with :math:`\varphi_i` relative to the first calibrated microphone. The article that describes the rig
    takes the arithmetic mean of the phases; the circular one is equal for small angles and right at
    +-180 degrees.

    Raises
    ------
    InputError
        No channel shows a tone, channels are not in volts, or the recording is too short.
    """
    settings = settings or CalibrationSettings()
    candidates, named = _candidates(recording, settings)
    rate = candidates[0].sampling_rate
    n = min(c.n_samples for c in candidates)
    frequency = _tone(recording, candidates, settings)
    count = max(settings.windows, int(np.ceil(n / rate / LONGEST_WINDOW_S)))
    size = n // count
    if size * frequency < 10 * rate:
        raise InputError(
            f"{recording.label}: {n / rate:.3g} s hold fewer than {10 * count} cycles of {frequency:.6g} Hz",
            expected=f"{count} windows of at least ten cycles",
            remedy="record the calibrator for 5 s, or ask for fewer windows",
        )
    phasors, noise, clipped = _windows(recording, candidates, frequency, size, count)
    amplitude = np.abs(phasors)
    inside = _inside(candidates, amplitude.mean(axis=1), noise, named, recording.label)
    level = _level(recording, candidates[0], settings)
    pascals = np.sqrt(2) * LEVEL_REFERENCES["Pa"].value * 10 ** (level / 20)
    reference = phasors[inside[0]] if inside else None
    heard = tuple(
        _heard(candidates[i], phasors[i], reference, noise[i], pascals, bool(clipped[i])) for i in inside
    )
    silent = tuple(c.name for i, c in enumerate(candidates) if named and i not in inside)
    return Insertion(recording.label, frequency, level, count, heard, silent)


def stated(recording: Recording, group: str, key: str) -> Any:
    """A property of the channel's group, of any other group, or of the file; None where there is none."""
    places = [recording.group_properties.get(group, {}), *recording.group_properties.values()]
    return next((place[key] for place in [*places, recording.properties] if key in place), None)


def _candidates(recording: Recording, settings: CalibrationSettings) -> tuple[list[Channel], bool]:
    """Channels that may be in the adapter, and whether somebody named them."""
    microphones = list(recording.by_role("microphone")) or [
        c for c in recording.channels if c.role == "other" and c.raw_unit in ("", "V")
    ]
    if not microphones:
        raise InputError(
            f"{recording.label} has no microphone channel",
            expected="a recording of a calibrator on microphones",
            remedy="name the channels, or give their roles in a channel table",
        )
    listed = stated(recording, microphones[0].group, "CalibratedChannels")
    named = True
    if settings.channels:
        chosen = list(recording.select(settings.channels))
    elif listed is not None:
        chosen = [_numbered(str(word).strip(), microphones, recording) for word in str(listed).split(",")]
    else:
        chosen, named = microphones, False
    for channel in chosen:
        if channel.raw_unit not in ("", "V"):
            raise InputError(
                f"{recording.label}: the samples of {channel.name!r} are in {channel.raw_unit}",
                expected="volts, from which a sensitivity in mV/Pa follows",
            )
        if channel.sampling_rate != chosen[0].sampling_rate:
            raise InputError(
                f"{recording.label}: {channel.name!r} and {chosen[0].name!r} have different sampling rates",
                remedy="calibrate them from separate recordings",
            )
    return chosen, named


def _numbered(word: str, microphones: list[Channel], recording: Recording) -> Channel:
    """The microphone that an entry of `CalibratedChannels` means: its name, its number, or its place."""
    for channel in microphones:
        digits = re.search(r"(\d+)\D*$", channel.name)
        if word in (channel.name, digits[1] if digits else None):
            return channel
    if word.isdigit() and 1 <= int(word) <= len(microphones):
        return microphones[int(word) - 1]
    raise InputError(
        f"{recording.label}: CalibratedChannels names {word!r}",
        expected="one of " + ", ".join(c.name for c in microphones),
    )


def _tone(recording: Recording, candidates: list[Channel], settings: CalibrationSettings) -> float:
    """Frequency of the tone, from the channel that hears most, over at most ten seconds."""
    rate = candidates[0].sampling_rate
    n = int(min(10 * rate, *(c.n_samples for c in candidates)))
    first = _volts(recording, candidates, 0, min(n, int(rate)))
    loudest = int(np.argmax(np.std(first, axis=1))) if first.size else 0
    nominal = settings.frequency_hz or stated(recording, candidates[0].group, "CalibratorFrequency_Hz")
    samples = _volts(recording, [candidates[loudest]], 0, n)[0]
    if n < 16 or not np.all(np.isfinite(samples)) or not np.any(samples):
        raise InputError(
            f"{recording.label}: no calibrated channel has a signal", expected="the tone of a calibrator"
        )
    low, high = (0.95 * float(nominal), 1.05 * float(nominal)) if nominal else (50.0, rate / 2)
    try:
        guess = peak_frequency(samples, rate, low, high)
    except ValueError as fault:
        raise InputError(
            f"{recording.label}: no tone can be sought ({fault})",
            expected="a recording that is long enough for its tone",
        ) from None
    return fit_frequency(samples, rate, guess).frequency_hz


def _volts(recording: Recording, channels: list[Channel], start: int, stop: int) -> NDArray[np.float64]:
    """Samples in volts, whatever sensitivity the file states."""
    back = np.array([[c.raw_scale / c.gain] for c in channels])
    return recording.read(channels, start, stop) * back


def _windows(
    recording: Recording, channels: list[Channel], frequency: float, size: int, count: int
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Phasors (channels, windows) on one time axis, RMS of the rest (channels), clipping (channels)."""
    rate = channels[0].sampling_rate
    phasors = np.zeros((len(channels), count), dtype=complex)
    rest = np.zeros((len(channels), count))
    clipped = np.zeros(len(channels), dtype=bool)
    # Full scale is stated in the channel's unit; here the samples are in volts.
    scales = [None if c.full_scale is None else abs(c.full_scale * c.raw_scale / c.gain) for c in channels]
    limit = np.array([np.inf if s is None else s for s in scales])
    for window in range(count):
        start = window * size
        samples = _volts(recording, channels, start, start + size)
        fit = fit_sine(samples, rate, frequency)
        phasors[:, window] = fit.phasors[:, 0] * np.exp(-2j * np.pi * frequency * start / rate)
        rest[:, window] = fit.residual_rms
        clipped |= np.max(np.abs(samples), axis=1) >= limit * (1 - 1e-6)
    return phasors, np.sqrt(np.mean(rest**2, axis=1)), clipped


def _inside(
    channels: list[Channel],
    amplitude: NDArray[np.float64],
    noise: NDArray[np.float64],
    named: bool,
    label: str,
) -> list[int]:
    """Positions of the channels that hear the calibrator; those that somebody named need no more than a signal."""
    audible = np.where(np.isfinite(amplitude), amplitude, 0.0)
    clear = audible > np.sqrt(2) * noise
    if not clear.any():
        raise InputError(
            f"{label}: no channel shows a tone above everything else that it holds",
            expected="the recording of a calibrator",
            remedy="leave the file out, or name the channels",
        )
    if named:
        return [int(i) for i in np.flatnonzero(audible > 0)]
    enough = audible >= audible.max() * 10 ** (-HEARD_FROM_OUTSIDE_DB / 20)
    return [int(i) for i in np.flatnonzero(enough & clear)]


def _level(recording: Recording, channel: Channel, settings: CalibrationSettings) -> float:
    if settings.level_dB is not None:
        return settings.level_dB
    written = stated(recording, channel.group, "CalibratorLevel_dB")
    return DEFAULT_LEVEL_DB if written is None else float(written)


def _heard(
    channel: Channel,
    phasors: NDArray[np.complex128],
    reference: NDArray[np.complex128] | None,
    noise: float,
    pascals: float,
    clipped: bool,
) -> Heard:
    """Means over the windows of one channel (the article's equations 1 and 2)."""
    n = len(phasors)
    sensitivities = 1000 * np.abs(phasors) / pascals
    mean = float(sensitivities.mean())
    slope = float(np.polyfit((np.arange(n) + 0.5) / n, sensitivities, 1)[0])
    turned = phasors / np.abs(phasors)
    if reference is not None:
        turned = turned * np.conj(reference / np.abs(reference))
    middle = turned.mean()
    spread = np.angle(turned * np.conj(middle))
    return Heard(
        channel=channel.name,
        sensitivity=mean,
        scatter_percent=100 * float(sensitivities.std(ddof=1)) / mean,
        drift_percent=100 * slope / mean,
        phase_deg=float(np.degrees(np.angle(middle))),
        u_phase_deg=float(np.degrees(np.sqrt(np.sum(spread**2) / (n - 1) / n))),
        impurity=float(noise * np.sqrt(2) / np.abs(phasors).mean()),
        nominal=1000 * channel.raw_scale / channel.gain if channel.unit == "Pa" else None,
        clipped=clipped,
    )
