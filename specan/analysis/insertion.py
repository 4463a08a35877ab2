"""One recording of a calibrator: its tone and level, and what each microphone in the adapter made of them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from specan.analysis.quality import LARGEST, QualityAccumulator
from specan.analysis.section import reasons_apart
from specan.arrays import Complex, Flags, Real
from specan.data.channel import Channel
from specan.data.recording import Recording, properties_called
from specan.dsp.sine_fit import fit_frequency, fit_sine, peak_frequency
from specan.errors import InputError
from specan.result import shortened
from specan.schema import Settings
from specan.units import LEVEL_REFERENCES

DEFAULT_LEVEL_DB = 94.0
# Pistonphones work at 250 Hz and give 114 or 124 dB; sound calibrators with one level give 94 dB at 1 kHz.
PISTONPHONE_HZ, PISTONPHONE_DB = 250.0, (114.0, 124.0)
NEAR = 0.05  # of a stated frequency
# A level is taken from nominal sensitivities where they lead to within this of a usual one.
NEAR_LEVEL_DB = 3.0
# A microphone outside the adapter hears the calibrator at least this much less than one inside.
HEARD_FROM_OUTSIDE_DB = 15.0
LONGEST_FOR_FREQUENCY_S = 10.0


class CalibrationSettings(Settings):
    """How calibrator recordings are evaluated.

    Attributes
    ----------
    level_dB : float or None
        Sound pressure level of the calibrator re 20 uPa; None takes `CalibratorLevel_dB`, else what a
        calibrator of its frequency gives: 94 dB, or at 250 Hz the level of a pistonphone.
    frequency_hz : float or None
        Nominal tone; None takes `CalibratorFrequency_Hz`, else the strongest tone.
    windows : int
        Number of measurement windows n of the means; windows longer than a second are divided.
    u_level_dB : float
        Standard uncertainty of the calibrator's level, as its certificate says.
    u_insertion_dB : float
        Standard uncertainty by which a level differs from one insertion of the microphone to the next.
    u_insertion_deg : float
        The same of the phase between two microphones of one insertion, at the tone. Both hold where the
        recordings do not tell how well insertions repeat.
    channels : tuple of str
        Names or patterns of the calibrated channels; none takes `CalibratedChannels`, else all that
        show the tone.
    phase_model : {"delay", "constant"}
        How the phase goes on to other frequencies.
    """

    level_dB: Annotated[float | None, Field(ge=0, le=200)] = None
    frequency_hz: Annotated[float, Field(gt=0)] | None = None
    windows: Annotated[int, Field(ge=2)] = 20
    u_level_dB: Annotated[float, Field(ge=0, le=20)] = 0.1
    u_insertion_dB: Annotated[float, Field(ge=0, le=20)] = 0.05
    # The sound's ways to two seats differ by up to 0.2 mm: 0.2 mm / sqrt 3 x 360 degrees / 343 mm at 1 kHz.
    u_insertion_deg: Annotated[float, Field(ge=0, le=180)] = 0.12
    channels: tuple[str, ...] = ()
    phase_model: Literal["delay", "constant"] = "delay"


@dataclass(frozen=True)
class Candidates:
    """Channels that may be in the adapter, who named them (empty: nobody), all microphones, and what cannot be used."""

    channels: list[Channel]
    named_by: str
    microphones: list[Channel]
    left_out: tuple[tuple[Channel, str], ...] = ()

    @property
    def rate(self) -> float:
        """Their common sampling rate."""
        return self.channels[0].sampling_rate

    @property
    def n_samples(self) -> int:
        """Samples that all of them have."""
        return min(c.n_samples for c in self.channels)


def candidates_of(recording: Recording, settings: CalibrationSettings) -> Candidates:
    """Channels in which the calibrator is sought.

    Raises
    ------
    InputError
        There is no microphone, a named one does not exist, or samples are not in volts.
    """
    microphones = list(recording.by_role("microphone")) or [
        c for c in recording.channels if c.role == "other" and c.raw_unit in ("", "V")
    ]
    if not microphones:
        raise InputError(
            f"{recording.label} has no microphone channel",
            expected="a recording of a calibrator on microphones",
            remedy="name the channels, or give their roles in a channel table",
        )
    _, listed = next(properties_called("CalibratedChannels", recording, microphones[0].group), ("", None))
    if settings.channels:
        chosen, named_by = list(recording.select(settings.channels)), "--channel"
    elif listed is not None:
        named_by = "CalibratedChannels"
        chosen = [_numbered(str(word).strip(), microphones, recording) for word in str(listed).split(",")]
    else:
        chosen, named_by = microphones, ""
    in_volts = [c for c in chosen if c.raw_unit in ("", "V") and c.sampling_rate > 0 and c.n_samples > 0]
    if not in_volts:
        raise InputError(
            f"{recording.label}: the samples of {chosen[0].label!r} are in {chosen[0].raw_unit or 'no unit'}",
            expected="volts, from which a sensitivity in mV/Pa follows",
        )
    found, left_out = list[Channel](), []
    for c, reason in zip(chosen, reasons_apart(chosen, in_volts[0].sampling_rate), strict=True):
        if c.raw_unit not in ("", "V"):
            reason = f"has samples in {c.raw_unit}, not in V"
        if reason:
            left_out.append((c, reason))
        else:
            found.append(c)
    return Candidates(found, named_by, microphones, tuple(left_out))


def _stated_number(recording: Recording, group: str, key: str) -> float | None:
    """A property as a number; "114 dB" and "94,0" are numbers too."""
    _, written = next(properties_called(key, recording, group), ("", None))
    if written is None:
        return None
    found = re.match(r"\s*([-+]?\d+(?:[.,]\d*)?)", str(written))
    value = float(found[1].replace(",", ".")) if found else math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{recording.label}: the property {key} is {written!r}",
            expected="a number",
            remedy="give --level or --frequency",
        )
    return value


def _numbered(word: str, microphones: list[Channel], recording: Recording) -> Channel:
    """The microphone that an entry of `CalibratedChannels` means: its name, its number, or its place."""
    for channel in microphones:
        digits = re.search(r"(\d+)\D*$", channel.name)
        if word in (channel.name, channel.path, digits[1] if digits else None):
            return channel
    if word.isdigit() and 1 <= int(word) <= len(microphones):
        return microphones[int(word) - 1]
    raise InputError(
        f"{recording.label}: CalibratedChannels names {word!r}",
        expected="one of " + ", ".join(c.label for c in microphones),
    )


def volts(recording: Recording, channels: Sequence[Channel], start: int, stop: int) -> Real:
    """Samples in volts, whatever sensitivity the file states; NaN for all that is no number or too large to square."""
    back = np.array([[c.raw_scale / c.gain] for c in channels])
    samples = recording.read(channels, start, stop) * back
    return np.where(np.abs(samples) < LARGEST, samples, np.nan)


def find_tone(recording: Recording, found: Candidates, settings: CalibrationSettings) -> tuple[float, str]:
    """Frequency of the tone and how it was found, from the channel that hears most.

    Raises
    ------
    InputError
        No channel has a signal, or the tone is somewhere else than was said.
    """
    channels, rate = found.channels, found.rate
    nominal, by = settings.frequency_hz, "--frequency"
    if nominal is None:
        written = _stated_number(recording, channels[0].group, "CalibratorFrequency_Hz") or 0.0
        nominal, by = (written if written > 0 else None), "CalibratorFrequency_Hz"
    why = f"found near the {nominal:g} Hz of {by}" if nominal else "the strongest tone"
    tones = _tones(recording, channels, nominal)
    if not tones:
        raise InputError(
            f"{recording.label}: no calibrated channel has a signal", expected="the tone of a calibrator"
        )
    pure = [t for t in tones if t.pure]
    _reject_other_tone(recording, found, tones, nominal, by)
    loudest = max(pure or tones, key=lambda tone: tone.amplitude)
    n = min(found.n_samples, int(LONGEST_FOR_FREQUENCY_S * rate))
    start = (found.n_samples - n) // 2
    samples = np.nan_to_num(volts(recording, [loudest.channel], start, start + n)[0])
    low, high = _search(nominal, rate)
    guess = peak_frequency(samples, rate, low, high)
    return fit_frequency(samples, rate, guess).frequency_hz, why


@dataclass(frozen=True)
class _Tone:
    """The strongest tone of one channel in one section."""

    channel: Channel
    frequency_hz: float
    amplitude: float
    pure: bool  # holds more than half of the power


def _search(nominal: float | None, rate: float) -> tuple[float, float]:
    return ((1 - NEAR) * nominal, (1 + NEAR) * nominal) if nominal else (50.0, rate / 2)


def _tones(recording: Recording, channels: Sequence[Channel], nominal: float | None) -> list[_Tone]:
    """The strongest tone of each channel that has a signal, in three sections of at most a second."""
    rate = channels[0].sampling_rate
    n = min(c.n_samples for c in channels)
    size = min(n, int(rate))
    best: dict[int, _Tone] = {}
    for start in sorted({0, (n - size) // 2, n - size}) if size >= 16 else ():
        samples = volts(recording, channels, start, start + size)
        for row, x in enumerate(np.nan_to_num(samples)):
            if not np.ptp(x) > 0:
                continue
            try:
                frequency = peak_frequency(x, rate, *_search(nominal, rate))
            except ValueError as fault:
                raise InputError(
                    f"{recording.label}: no tone can be found ({fault})",
                    expected="a recording that is long enough for its tone",
                ) from None
            fit = fit_sine(x, rate, frequency)
            amplitude = float(abs(fit.phasors[0]))
            pure = bool(amplitude > np.sqrt(2) * float(fit.residual_rms))
            known = best.get(row)
            if known is None or (pure, amplitude) > (known.pure, known.amplitude):
                best[row] = _Tone(channels[row], frequency, amplitude, pure)
    return [best[row] for row in sorted(best)]


def _reject_other_tone(
    recording: Recording, found: Candidates, tones: Sequence[_Tone], nominal: float | None, by: str
) -> None:
    """Say so where the tone is on other channels, or at another frequency, than somebody stated."""
    heard = max((t.amplitude for t in tones if t.pure), default=0.0)
    names = {c.label for c in found.channels}
    rest = [c for c in found.microphones if c.label not in names and c.sampling_rate == found.rate]
    if found.named_by == "CalibratedChannels" and rest:
        others = [t for t in _tones(recording, rest, nominal) if t.pure]
        loud = [t for t in others if t.amplitude > heard * 10 ** (HEARD_FROM_OUTSIDE_DB / 20)]
        if loud:
            far = (
                "show no tone" if heard == 0 else f"read it {HEARD_FROM_OUTSIDE_DB:g} dB or more below others"
            )
            named = shortened([c.label for c in found.channels], 6)
            raise InputError(
                f"{recording.label}: the channels that CalibratedChannels names ({named}) {far}; the tone of "
                f"{loud[0].frequency_hz:.6g} Hz is on {shortened([t.channel.label for t in loud], 6)}",
                expected="the tone on the channels that are named",
                remedy="correct the property, or name the channels with --channel",
            )
    if heard == 0 and nominal is not None:
        anywhere = [t for t in _tones(recording, found.channels, None) if t.pure]
        if anywhere:
            loudest = max(anywhere, key=lambda tone: tone.amplitude)
            raise InputError(
                f"{recording.label}: the tone is at {loudest.frequency_hz:.6g} Hz ({loudest.channel.label}), "
                f"and {by} says {nominal:g} Hz",
                expected=f"a tone within {NEAR:.0%} of what is stated",
                remedy=f"give --frequency {loudest.frequency_hz:.0f} if that is the calibrator",
            )


@dataclass(frozen=True)
class Level:
    """Sound pressure level of the calibrator, how it was decided, and whether anything but habit says so."""

    dB: float
    decided: str
    confirmed: bool


def decide_level(
    recording: Recording,
    channels: Sequence[Channel],
    amplitude_V: Sequence[float],
    frequency_hz: float,
    settings: CalibrationSettings,
) -> Level:
    """Level of the calibrator: as given, as the file says, else as calibrators of its frequency have it.

    Nominal sensitivities choose between the levels of pistonphones. They do not choose another level than
    94 dB at other frequencies: an amplifier of 20 dB that nobody wrote down looks the same as 114 dB.

    Raises
    ------
    InputError
        A pistonphone whose level nothing tells.
    """
    if settings.level_dB is not None:
        return Level(settings.level_dB, "as given", True)
    written = _stated_number(recording, channels[0].group, "CalibratorLevel_dB")
    if written is not None:
        return Level(written, "property CalibratorLevel_dB", True)
    pairs = zip(channels, amplitude_V, strict=True)
    levels = [level_of(a / n) for c, a in pairs if (n := nominal_mV_per_Pa(c)) is not None and a > 0]
    if abs(frequency_hz - PISTONPHONE_HZ) > NEAR * PISTONPHONE_HZ:
        how = "assumed, as no property states it" + (
            f"; by nominal sensitivities {np.median(levels):.1f} dB" if levels else ""
        )
        return Level(DEFAULT_LEVEL_DB, how, False)
    usual = " or ".join(f"{level:g}" for level in PISTONPHONE_DB)
    if levels:
        middle = float(np.median(levels))
        nearest = min((DEFAULT_LEVEL_DB, *PISTONPHONE_DB), key=lambda level: abs(level - middle))
        if abs(nearest - middle) <= NEAR_LEVEL_DB:
            what = "a pistonphone" if nearest in PISTONPHONE_DB else "a calibrator"
            how = f"{what} at {frequency_hz:.0f} Hz; by nominal sensitivities {middle:.1f} dB"
            return Level(nearest, how, True)
    why = f"nominal sensitivities lead to {np.median(levels):.1f} dB" if levels else "its level is not stated"
    raise InputError(
        f"{recording.label}: the tone of {frequency_hz:.6g} Hz is that of a pistonphone ({usual} dB), and {why}",
        expected="the calibrator's level",
        remedy=f"give --level {PISTONPHONE_DB[0]:g}, or what its certificate says",
    )


def level_of(volts_per_mV_per_Pa: float) -> float:
    """Level of a tone from its amplitude in V over the sensitivity in mV/Pa."""
    return float(20 * np.log10(1000 * volts_per_mV_per_Pa / np.sqrt(2) / LEVEL_REFERENCES["Pa"].value))


def nominal_mV_per_Pa(channel: Channel) -> float | None:
    """Sensitivity that the file or the channel table states."""
    return 1000 * abs(channel.raw_scale / channel.gain) if channel.unit == "Pa" else None


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
    level: Level
    heard: tuple[Heard, ...]
    left_out: tuple[LeftOut, ...]
    frequency_decided: str


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
    return Insertion(recording.label, frequency, level, heard, left_out, frequency_decided)


def _cut(label: str, found: Candidates, frequency: float, settings: CalibrationSettings) -> tuple[int, int]:
    """Number of windows and samples of each."""
    duration = found.n_samples / found.rate
    count = max(settings.windows, int(np.ceil(duration / LONGEST_WINDOW_S)))
    size = found.n_samples // count
    if size * frequency < 10 * found.rate:
        raise InputError(
            f"{label}: {duration:.3g} s is shorter than {10 * count} cycles of {frequency:.6g} Hz",
            expected=f"{count} windows of at least ten cycles",
            remedy="record the calibrator for 5 s, or use fewer windows",
        )
    return count, size


@dataclass(frozen=True)
class _Windows:
    """Fits of all channels to all windows, on one time axis; arrays (channels, windows) or (channels,)."""

    phasors: Complex
    there: Flags  # whether the window holds the tone
    amplitude: Real  # mean over the windows that do, else 0
    rest: Real  # RMS of everything else
    finite: Flags
    clipped: Flags


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
    clipped = [  # the tone rests on a rail, or one sample reaches a range that is known
        q.clipped or (top is not None and max(q.maximum, -q.minimum) >= top * (1 - 1e-6))
        for q, top in zip(quality.result(), tops, strict=True)
    ]
    return _Windows(
        phasors,
        there,
        (amplitude * there).sum(axis=1) / number,
        np.sqrt((rest**2 * there).sum(axis=1) / number),
        np.logical_and.reduce(finite, axis=1),
        np.array(clipped),
    )


def _stands_still(samples: Real, period: float) -> Flags:
    """Whether each row holds the same value for a period of the tone or longer."""
    length = max(4, int(np.ceil(period)))
    with np.errstate(invalid="ignore"):
        equal = np.diff(samples, axis=1) == 0
    if equal.shape[1] < length or not equal.any():
        return np.zeros(len(samples), dtype=bool)
    run = np.cumsum(np.pad(equal, ((0, 0), (1, 0))), axis=1)
    still: Flags = (run[:, length - 1 :] - run[:, : 1 - length] == length - 1).any(axis=1)
    return still


def _inside(found: Candidates, windows: _Windows, label: str) -> tuple[list[int], tuple[LeftOut, ...]]:
    """Positions of the channels that hear the calibrator, and those that should but do not.

    Channels that somebody named need no more than a signal.
    """
    audible = windows.amplitude
    clear = audible > np.sqrt(2) * windows.rest
    if not clear.any():
        raise InputError(
            f"{label}: no channel has a dominant tone",
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


def _own_variance(angle: Real, common: Flags, reference: int) -> Real:
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
