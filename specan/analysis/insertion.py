"""One recording of a calibrator: what each microphone in the adapter made of the tone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specan.analysis.calibrator_tone import (
    HEARD_FROM_OUTSIDE_DB,
    CalibrationSettings,
    Candidates,
    candidates_of,
    decide_level,
    find_tone,
    nominal_mV_per_Pa,
    volts,
)
from specan.analysis.quality import QualityAccumulator
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.dsp.sine_fit import fit_sine
from specan.errors import InputError
from specan.units import LEVEL_REFERENCES

LONGEST_WINDOW_S = 1.0
# Microphones that hear the tone from further below are outside the adapter, and nobody expects them in it.
NOT_SEATED_DB = 35.0
MISSING = 0.5  # of the usual amplitude: below, the tone is missing from a window


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
        Circular mean relative to the reference of the recording.
    u_phase_deg : float
        Standard deviation of that mean, of this channel's own noise.
    impurity : float
        RMS of everything but the tone over the RMS of the tone.
    nominal : float or None
        Sensitivity that the file or the channel table states, mV/Pa.
    clipped : bool
        Whether the signal rests on a rail.
    windows, missing : int
        Windows that were evaluated, and those that were left out because the tone is missing in them.
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
    windows: int = 20
    missing: int = 0

    @property
    def usable(self) -> bool:
        """Whether its sensitivity counts: not clipped, and there in most windows."""
        return not self.clipped and self.missing <= self.windows


@dataclass(frozen=True)
class LeftOut:
    """A channel that this recording does not calibrate, and why; `named` if it should have heard the tone."""

    channel: str
    why: str
    named: bool


@dataclass(frozen=True)
class Insertion:
    """Result of one calibrator recording, with how level and frequency were decided."""

    label: str
    frequency_hz: float
    level_dB: float
    heard: tuple[Heard, ...]
    left_out: tuple[LeftOut, ...] = ()
    level_decided: str = "as given"
    level_confirmed: bool = True
    frequency_decided: str = "as given"


def evaluate_insertion(recording: Recording, settings: CalibrationSettings | None = None) -> Insertion:
    r"""Sensitivities and phases of the microphones in a calibrator, from one recording.

    The recording is cut into n windows; a sine is fitted to each (IEEE Std 1057-2017, at the frequency
    found from one channel), which needs no whole number of cycles. Then

    .. math:: sen_{mean} = \frac1n \sum sen_i, \qquad \varphi_{mean} = \arg \sum e^{j\varphi_i}

    with :math:`\varphi_i` relative to one microphone of the recording. The article that describes the rig
    takes the arithmetic mean of the phases; the circular one is equal for small angles and right at
    +-180 degrees. Windows in which a channel does not hold the tone (samples that stand still or are not
    finite, less than half the usual amplitude) are left out for that channel alone.

    Raises
    ------
    InputError
        No channel shows a tone, channels are not in volts, or the recording is too short.
    """
    settings = settings or CalibrationSettings()
    found = candidates_of(recording, settings)
    frequency, frequency_decided = find_tone(recording, found, settings)
    count, size = _cut(recording.label, found, frequency, settings)
    windows = _fit_windows(recording, found.channels, frequency, size, count)
    inside, left_out = _inside(found, windows, recording.label)
    chosen = [found.channels[i] for i in inside]
    amplitude = [windows.amplitude[i] for i in inside]
    level = decide_level(recording, chosen or found.channels[:1], amplitude or [0.0], frequency, settings)
    pascals = np.sqrt(2) * LEVEL_REFERENCES["Pa"].value * 10 ** (level.dB / 20)
    heard = _heard(found.channels, windows, inside, pascals)
    return Insertion(
        recording.label,
        frequency,
        level.dB,
        heard,
        left_out,
        level.decided,
        level.confirmed,
        frequency_decided,
    )


def _cut(label: str, found: Candidates, frequency: float, settings: CalibrationSettings) -> tuple[int, int]:
    """Number of windows and samples of each."""
    duration = found.n_samples / found.rate
    count = max(settings.windows, int(np.ceil(duration / LONGEST_WINDOW_S)))
    size = found.n_samples // count
    if size * frequency < 10 * found.rate:
        raise InputError(
            f"{label}: {duration:.3g} s hold fewer than {10 * count} cycles of {frequency:.6g} Hz",
            expected=f"{count} windows of at least ten cycles",
            remedy="record the calibrator for 5 s, or use fewer windows",
        )
    return count, size


@dataclass(frozen=True)
class _Windows:
    """Fits of all channels to all windows, on one time axis; arrays (channels, windows) or (channels,)."""

    phasors: NDArray[np.complex128]
    there: NDArray[np.bool_]  # whether the window holds the tone
    amplitude: NDArray[np.float64]  # mean over the windows that do, else 0
    rest: NDArray[np.float64]  # RMS of everything else
    finite: NDArray[np.bool_]
    clipped: NDArray[np.bool_]


def _fit_windows(
    recording: Recording, channels: list[Channel], frequency: float, size: int, count: int
) -> _Windows:
    rate = channels[0].sampling_rate
    shape = (len(channels), count)
    phasors, rest = np.zeros(shape, dtype=complex), np.zeros(shape)
    there, finite = np.ones(shape, dtype=bool), np.ones(shape, dtype=bool)
    # Full scales in volts; they are stated in the channel's unit.
    tops = [None if c.full_scale is None else abs(c.full_scale * c.raw_scale / c.gain) for c in channels]
    quality = QualityAccumulator(
        tuple(replace(c, full_scale=top) for c, top in zip(channels, tops, strict=True))
    )
    for window in range(count):
        start = window * size
        samples = volts(recording, channels, start, start + size)
        quality.add(samples)
        finite[:, window] = np.isfinite(samples).all(axis=1)
        there[:, window] = finite[:, window] & ~_stands_still(samples, rate / frequency)
        fit = fit_sine(np.nan_to_num(samples), rate, frequency)
        phasors[:, window] = fit.phasors[:, 0] * np.exp(-2j * np.pi * frequency * start / rate)
        rest[:, window] = fit.residual_rms
    amplitude = np.abs(phasors)
    for row in range(len(channels)):
        if there[row].any():
            usual = float(np.quantile(amplitude[row, there[row]], 0.75))
            faint = np.pad(amplitude[row] < MISSING * usual, 1)
            # The windows before and after hold the tone for a part of their time.
            there[row] &= ~np.logical_or.reduce([faint[:-2], faint[1:-1], faint[2:]])
    number = np.maximum(there.sum(axis=1), 1)
    return _Windows(
        phasors,
        there,
        (amplitude * there).sum(axis=1) / number,
        np.sqrt((rest**2 * there).sum(axis=1) / number),
        np.logical_and.reduce(finite, axis=1),
        np.array([_clipped(q, top) for q, top in zip(quality.result(), tops, strict=True)]),
    )


def _clipped(quality: Quality, top: float | None) -> bool:
    """Whether the tone rests on a rail, or one sample reaches a range that is known."""
    reaches = top is not None and max(quality.maximum, -quality.minimum) >= top * (1 - 1e-6)
    return quality.clipped_low or quality.clipped_high or reaches


def _stands_still(samples: NDArray[np.float64], period: float) -> NDArray[np.bool_]:
    """Whether each row holds the same value for a period of the tone or longer."""
    length = max(4, int(np.ceil(period)))
    with np.errstate(invalid="ignore"):
        equal = np.diff(samples, axis=1) == 0
    if equal.shape[1] < length or not equal.any():
        return np.zeros(len(samples), dtype=bool)
    run = np.cumsum(np.pad(equal, ((0, 0), (1, 0))), axis=1)
    still: NDArray[np.bool_] = (run[:, length - 1 :] - run[:, : 1 - length] == length - 1).any(axis=1)
    return still


def _inside(found: Candidates, windows: _Windows, label: str) -> tuple[list[int], tuple[LeftOut, ...]]:
    """Positions of the channels that hear the calibrator, and those that should but do not.

    Channels that somebody named need no more than a signal.
    """
    audible = windows.amplitude
    clear = audible > np.sqrt(2) * windows.rest
    if not clear.any():
        raise InputError(
            f"{label}: no channel shows a tone above everything else that it holds",
            expected="the recording of a calibrator",
            remedy="leave the file out, or name the channels",
        )
    named = bool(found.named_by)
    below = 20 * np.log10(audible[clear].max() / np.maximum(audible, np.finfo(float).tiny))
    enough = (windows.there.sum(axis=1) >= 2) & (audible > 0)
    left_out = [LeftOut(channel.label, why, named) for channel, why in found.left_out]
    inside = []
    for i, channel in enumerate(found.channels):
        if enough[i] and (named or (clear[i] and below[i] <= HEARD_FROM_OUTSIDE_DB)):
            inside.append(i)
        elif named and not enough[i]:
            left_out.append(LeftOut(channel.label, _why_silent(windows, i), True))
        elif clear[i] and below[i] <= NOT_SEATED_DB:
            why = f"shows the tone {below[i]:.0f} dB below the loudest (not seated?)"
            left_out.append(LeftOut(channel.label, why, False))
    return inside, tuple(left_out)


def _why_silent(windows: _Windows, i: int) -> str:
    if not windows.finite[i]:
        return "has samples that are not finite"
    return "gives no signal" if windows.amplitude[i] == 0 else "holds the tone in one window only"


def _heard(
    channels: list[Channel], windows: _Windows, inside: list[int], pascals: float
) -> tuple[Heard, ...]:
    """Means over the windows of each channel (the article's equations 1 and 2)."""
    if not inside:
        return ()
    there = windows.there[inside]
    # The first of those that hold the tone longest: a channel that drops out would cost the others their phases.
    reference = int(np.argmax(there.sum(axis=1)))
    unit = windows.phasors[inside] / np.maximum(np.abs(windows.phasors[inside]), np.finfo(float).tiny)
    turned = unit * np.conj(unit[reference])
    common = there & there[reference]
    middle = np.where(common, turned, 0).sum(axis=1)
    angle = np.degrees(np.angle(turned * np.conj(middle)[:, None]))
    own = _own_variance(np.where(common, angle, 0.0), common, reference)
    heard = []
    for row, i in enumerate(inside):
        values = 1000 * np.abs(windows.phasors[i, there[row]]) / pascals
        time = (np.flatnonzero(there[row]) + 0.5) / there.shape[1]
        mean = float(values.mean())
        heard.append(
            Heard(
                channel=channels[i].label,
                sensitivity=mean,
                scatter_percent=100 * float(values.std(ddof=1)) / mean,
                drift_percent=100 * float(np.polyfit(time, values, 1)[0]) / mean,
                phase_deg=float(np.degrees(np.angle(middle[row]))),
                u_phase_deg=float(np.sqrt(own[row] / max(int(common[row].sum()), 1))),
                impurity=float(windows.rest[i] * np.sqrt(2) / windows.amplitude[i]),
                nominal=nominal_mV_per_Pa(channels[i]),
                clipped=bool(windows.clipped[i]),
                windows=int(there[row].sum()),
                missing=int((~there[row]).sum()),
            )
        )
    # Without a window in common with the reference there is no phase, and a sensitivity alone does not chain.
    return tuple(h for h, together in zip(heard, common.any(axis=1), strict=True) if together)


def _own_variance(
    angle: NDArray[np.float64], common: NDArray[np.bool_], reference: int
) -> NDArray[np.float64]:
    r"""Variance of each channel's own phase in a window, from differences to the reference, deg^2.

    The phase of the tone itself is common to all channels of a window and unknown. With three channels or
    more, the deviations r from the mean over C channels have
    :math:`\mathrm{Var}\,r_c = \sigma_c^2 (1 - 2/C) + \sum \sigma^2 / C^2`, which is solved for
    :math:`\sigma_c^2`; of two channels each takes half.
    """
    together = common.all(axis=0)
    channels = len(angle)
    if channels > 2 and together.sum() > 2:
        kept = angle[:, together]
        variance = (kept - kept.mean(axis=0)).var(axis=1, ddof=1)
        total = variance.sum() * channels / (channels - 1)
        return np.maximum((variance - total / channels**2) / (1 - 2 / channels), 0.0)
    number = np.maximum(common.sum(axis=1) - 1, 1)
    half = (angle**2).sum(axis=1) / number / 2
    others = np.delete(half, reference)
    half[reference] = others.mean() if others.size else 0.0
    return half
