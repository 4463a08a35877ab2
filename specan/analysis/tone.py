"""Tones: frequency from the reference, amplitude and phase of every channel by least squares; steps joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from specan.analysis.accumulator import read_through
from specan.analysis.excitation import recognise
from specan.analysis.section import SectionSettings, compared, of_one_rate, section
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.data.tone import ToneTable
from specan.dsp.sine_fit import fit_frequency, fit_sine, peak_frequency
from specan.dsp.tone_series import Tone as Fitted
from specan.dsp.tone_series import ToneSeries, block_length, freedom_of_mean, variance_of_mean
from specan.dsp.transfer_function import phase_deg, u_phase_deg
from specan.dsp.welch import student_factor
from specan.errors import InputError, RequestError
from specan.result import clustered
from specan.units import quotient

LOW_SNR_DEG = 1.0  # random uncertainty of a phase from which on it is flagged
_LOOK_S = 2.0
# How far from a stated frequency the tone is looked for, and at most in a short section.
_NEAR, _FAR = 0.01, 0.05


class Tone(SectionSettings):
    """Settings of a tone analysis.

    Attributes
    ----------
    reference : str or None
        Channel over which phases stand; the vibrometer by default. Without one there are no phases.
    channels : tuple of str
        Names or patterns; all by default. The reference is always among them.
    frequency_hz : float or None
        By default from the recording's properties or its generator or vibrometer channel. A stated frequency
        is refined within 1 % (5 % where the section is short) on the leading channel.
    harmonics : int
    start_s, stop_s : float
        Time section.

    Examples
    --------
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(8000) / 8000
    >>> samples = [np.cos(2 * np.pi * 250.3 * t), 2 * np.cos(2 * np.pi * 250.3 * (t - 1e-3))]
    >>> channels = (
    ...     Channel("Vib", role="vibrometer", unit="m/s", sampling_rate=8000.0, n_samples=8000),
    ...     Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=8000.0, n_samples=8000),
    ... )
    >>> found = Tone()(Recording("a.tdms", channels, ArraySource(samples)))
    >>> round(found.frequency_hz, 6), np.round(found.phase_deg, 3).tolist(), np.round(found.tone_rms, 4).tolist()
    (250.3, [0.0, -90.108], [0.7071, 1.4142])
    """

    reference: str | None = None
    frequency_hz: float | None = Field(default=None, gt=0.0)
    harmonics: int = Field(default=10, ge=1, le=100)

    def __call__(self, recording: Recording) -> ToneTable:
        """Read the recording once and return the tone on every channel."""
        return read_through(ToneAccumulator(recording, self), recording)


class ToneAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Raises
    ------
    InputError
        No usable channel, or a section of less than two cycles.
    RequestError
        The frequency is not below half the sampling rate.
    """

    def __init__(self, recording: Recording, settings: Tone) -> None:
        others: tuple[str, ...] = ()
        if settings.reference is not None or recording.by_role("vibrometer"):
            recording, others = compared(recording, settings.reference, settings.channels)
        self.recording, self.settings = recording, settings
        if settings.reference is not None:
            self.reference: Channel | None = recording.channel(settings.reference)
        else:
            found = (c for c in recording.by_role("vibrometer") if c.sampling_rate > 0 and c.n_samples > 0)
            self.reference = next(found, None)
        chosen, notes = of_one_rate(recording, settings.channels, like=self.reference)
        self.notes = (*others, *notes)
        leaders = [*recording.by_role("generator"), *([self.reference] if self.reference else [])]
        rate = (self.reference or chosen[0]).sampling_rate
        leaders = [c for c in leaders if c.sampling_rate == rate and c.n_samples > 0]
        # File order, so that the table reads like the recording.
        wanted = {id(c) for c in (*chosen, *leaders)}
        self.channels = tuple(c for c in recording.channels if id(c) in wanted)
        self._shown = [i for i, c in enumerate(self.channels) if c in chosen or c is self.reference]
        self.start, self.stop = section(recording, self.channels, settings.start_s, settings.stop_s)
        self.leader, frequency = self._find_frequency(leaders or list(chosen), rate)
        if not frequency < rate / 2:
            raise RequestError(
                f"{recording.label}: {frequency:g} Hz is not below half the sampling rate of {rate:g} Hz",
                remedy="state another frequency",
            )
        n = self.stop - self.start
        if n * frequency < 2 * rate:
            raise InputError(
                f"{recording.label}: {n / rate:g} s hold less than two cycles of {frequency:g} Hz",
                remedy="analyse a longer section",
            )
        self.block = block_length(n, rate, frequency)
        self._series = ToneSeries(
            rate, frequency, self.block, n_channels=len(self.channels), harmonics=settings.harmonics
        )

    def _find_frequency(self, leaders: Sequence[Channel], rate: float) -> tuple[Channel, float]:
        """The channel with the cleanest tone among the leaders, and the tone's frequency there."""
        stated = self.settings.frequency_hz
        if stated is None:
            stated = recognise(self.recording).frequency_hz
        if stated is not None and not stated < rate / 2:
            return leaders[0], stated
        look = min(self.stop - self.start, int(_LOOK_S * rate))
        first = self.start + (self.stop - self.start - look) // 2
        found = []
        for channel in leaders:
            x = self.recording.read([channel], first, first + look)[0]
            found.append((*_tone_near(x, rate, stated), channel))
            if found[-1][0] > 0.5:  # good enough: the generator comes first
                break
        share, frequency, channel = max(found, key=lambda item: item[0])
        if share < 0.01 and stated is not None:
            return channel, stated  # nothing to refine it on
        return channel, frequency

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m) of `channels`."""
        self._series.add(samples)

    def result(self) -> ToneTable:
        """The tone from what was added so far."""
        fitted = self._series.result(self.channels.index(self.leader))
        f, shown = fitted.frequency_hz, self._shown
        channels = [self.channels[i] for i in shown]
        order = np.arange(1, fitted.harmonics.shape[1] + 1)
        correction = np.stack([c.correction(f * order) for c in channels])
        harmonics = np.abs(fitted.harmonics[shown] * correction) / np.sqrt(2)
        phasors = fitted.phasors[shown] * correction[:, 0]
        noise, rms = np.sqrt(fitted.residual[shown]), np.sqrt(fitted.power[shown])
        for i, c in enumerate(channels):
            if c.derivatives:  # noise cannot be turned into a velocity by one factor
                rms[i], noise[i] = np.sqrt(np.sum(harmonics[i] ** 2)), np.nan
        at = np.array([f])
        nothing = np.full(len(channels), np.nan)
        own = fitted.deviations[shown]
        usable, base, relative, base_phase, base_gain = False, np.nan + 0j, own, 0.0, 0.0
        if self.reference is not None:
            row = channels.index(self.reference)
            base, relative = phasors[row], own - own[row]
            base_phase = float(self.reference.u_phase_deg(at)[0])
            base_gain = self.reference.u_gain_percent
            steady = own.shape[1] < 4 or np.sqrt(variance_of_mean(own[row].real)) < 0.1
            usable = bool(abs(base) > 0 and steady)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = phasors / base if usable else np.full(len(channels), np.nan + 0j)
        freedom = freedom_of_mean(own.shape[1])
        few = float(student_factor(freedom)) if freedom else 1.0
        random_phase = u_phase_deg(few * np.sqrt(variance_of_mean(relative.imag)))
        random_percent = 100 * few * np.sqrt(variance_of_mean(relative.real))
        itself = np.array([c is self.reference for c in channels])
        common_phase = np.array([np.hypot(c.u_phase_deg(at)[0], base_phase) for c in channels])
        common_percent = np.array([np.hypot(c.u_gain_percent, base_gain) for c in channels])
        common_phase[itself], common_percent[itself] = 0.0, 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            thd = 100 * np.sqrt(np.sum(harmonics[:, 1:] ** 2, axis=1)) / harmonics[:, 0]
        return ToneTable(
            **self.settings.origin(self.recording, channels, (*self.notes, *self._remarks(fitted, channels))),
            frequency_hz=f,
            leader=self.leader.label,
            reference=self.reference.label if self.reference else None,
            roles=tuple(c.role for c in channels),
            rms=rms,
            tone_rms=harmonics[:, 0],
            harmonics_rms=harmonics,
            thd_percent=thd,
            noise_rms=noise,
            mean=fitted.mean[shown],
            n_blocks=fitted.deviations.shape[1],
            phase_deg=np.where(itself & usable, 0.0, phase_deg(ratio)),
            magnitude=np.abs(ratio),
            magnitude_units=tuple(
                quotient(c.target_unit, self.reference.target_unit) if self.reference else ""
                for c in channels
            ),
            u_random_percent=random_percent,
            degrees_of_freedom=freedom,
            u_common_phase_deg=common_phase,
            u_common_percent=common_percent,
            u_phase_deg=np.hypot(random_phase, common_phase) if usable else nothing,
            u_magnitude_percent=np.hypot(random_percent, common_percent) if usable else nothing,
            flags=tuple(
                (*self.recording.flags, *_flags(fitted, i, usable, random_phase[k]))
                for k, i in enumerate(shown)
            ),
        )

    def _remarks(self, fitted: Fitted, channels: list[Channel]) -> list[str]:
        remarks = []
        if fitted.wandering:
            remarks.append(f"the frequency varies; phases follow {self.leader.label} block by block")
        remarks += [f"{c.label}: {c.conversion}, its RMS without the noise" for c in channels if c.conversion]
        if fitted.deviations.shape[1] < 4:
            remarks.append("too short for an uncertainty: fewer than four blocks")
        return remarks


def _tone_near(x: Real, rate: float, stated: float | None) -> tuple[float, float]:
    """Share of the power that the strongest tone holds (near a stated frequency), and its frequency."""
    x = x - x.mean()
    power = float(np.mean(x**2))
    low, high = 0.0, rate / 2
    if stated is not None:
        width = min(max(_NEAR * stated, 1.5 * rate / len(x)), _FAR * stated)
        low, high = stated - width, min(stated + width, high)
    if not np.isfinite(power) or power == 0 or len(x) < 8:
        return -1.0, stated or rate / 8
    try:
        guess = peak_frequency(x, rate, low, high)
    except ValueError:  # too short to have a line there
        return 0.0, stated or rate / 8
    fit = fit_frequency(x, rate, guess)
    rest = float(fit_sine(x, rate, fit.frequency_hz).residual_rms) ** 2
    return 1 - rest / power, fit.frequency_hz


def _flags(fitted: Fitted, row: int, usable: bool, u_random_deg: float) -> list[str]:
    if not np.isfinite(fitted.power[row]):
        return ["not-finite"]
    if fitted.power[row] == 0:
        return ["dead"]
    flags = [] if usable else ["no-reference"]
    if u_random_deg > LOW_SNR_DEG:
        flags.append("low-snr")
    return flags


_SAME_FREQUENCY = 1e-4  # relative: repeats of one step
# A distorted drive is not a step of a transfer function: the reference of a loudspeaker at work has a few percent.
_DISTORTED_PERCENT = 10.0
# The mains and twice its frequency, within the 1 % of EN 50160; hum stands 10 dB and more below what drives.
_MAINS_HZ, _MAINS_WITHIN, _MAINS_BELOW = (50.0, 60.0, 100.0, 120.0), 0.01, 0.316


def not_steps(tables: Sequence[ToneTable]) -> dict[str, str]:
    """Recordings that were taken for a sine by their signal alone, and that are no step of their directory.

    Parameters
    ----------
    tables : sequence of ToneTable
        The sine recordings of one directory.

    Returns
    -------
    dict
        Label to the reason: a distorted tone (a square wave), hum. What is stated to be a sine is never among them.
    """
    found = {}
    for table in tables:
        if table.stated:
            continue
        driving = table.reference if table.reference in table.channels else table.leader
        thd = float(table.thd_percent[table.channels.index(driving)]) if driving in table.channels else 0.0
        others = [t.reference_rms for t in tables if t is not table and np.isfinite(t.reference_rms)]
        generated = any(
            role == "generator" and table.tone_rms[row] > table.noise_rms[row]
            for row, role in enumerate(table.roles)
        )
        at_mains = any(abs(table.frequency_hz - f) <= _MAINS_WITHIN * f for f in _MAINS_HZ)
        if thd > _DISTORTED_PERCENT:
            found[table.label] = f"{driving} is distorted by {thd:.0f} %, more than {_DISTORTED_PERCENT:g} %"
        elif (
            at_mains
            and not generated
            and others
            and table.reference_rms < _MAINS_BELOW * float(np.median(others))
        ):
            found[table.label] = f"a weak tone at {table.frequency_hz:.4g} Hz may be mains hum"
    return found


def _over_one_reference(tables: Sequence[ToneTable], label: str) -> list[ToneTable]:
    """Tables with phases; all over the same reference."""
    usable = [t for t in tables if t.reference is not None and np.isfinite(t.phase_deg).any()]
    if not usable:
        raise InputError(f"{label or 'the sine recordings'}: none has phases over a reference")
    references = sorted({str(t.reference) for t in usable})
    if len(references) > 1:
        raise InputError(
            f"{label or 'the sine recordings'} are over different references: {', '.join(references)}",
            expected="one reference",
        )
    return usable


def join_stepped_sine(tables: Sequence[ToneTable], label: str = "") -> FrequencyResponse:
    """Join the tone tables of several recordings to one frequency response.

    Lines are sorted by frequency. Recordings of the same frequency (to 1e-4) are averaged as complex numbers;
    their uncertainty is that of the mean, from their own uncertainties or from their scatter,
    whichever is larger. A channel that a recording does not have is NaN there.

    Parameters
    ----------
    tables : sequence of ToneTable
        All over the same reference. Tables without a usable reference are left out, with a note.
    label : str
        Of the result, usually the directory.

    Raises
    ------
    InputError
        No table has a reference, or the references or units differ.
    """
    usable = _over_one_reference(tables, label)
    units = _units(usable)
    by_label = sorted(usable, key=lambda table: table.label)
    steps = clustered(by_label, lambda table: table.frequency_hz, _SAME_FREQUENCY)
    values = np.array([[_at_step(step, name) for step in steps] for name in units])
    random, freedom, gain, phase = np.moveaxis(values[..., 1:].real, -1, 0)
    left_out = [t.label for t in tables if t not in usable]
    words = [
        {w for t in usable if name in t.channels for w in t.flags[t.channels.index(name)]} for name in units
    ]
    return FrequencyResponse(
        label=label,
        frequency_hz=np.array([np.mean([t.frequency_hz for t in step]) for step in steps]),
        channels=tuple(units),
        units=tuple(units.values()),
        reference=str(usable[0].reference),
        response=values[..., 0],
        coherence=np.full(random.shape, np.nan),
        u_magnitude_percent=random,
        u_phase_deg=u_phase_deg(random / 100),
        u_leakage_percent=np.zeros(random.shape),
        degrees_of_freedom=freedom,
        u_common_percent=gain,
        u_common_phase_deg=phase,
        estimator="stepped sine",
        n_blocks=min(t.n_blocks for t in usable),
        n_effective=float(min(t.n_blocks for t in usable)),
        line_correlation=0.0,
        delay_s=np.zeros(len(units)),
        reference_rms=float(np.sqrt(np.mean([t.reference_rms**2 for t in usable]))),
        reference_unit=usable[0].units[usable[0].channels.index(str(usable[0].reference))],
        flags=tuple(tuple(sorted(mine)) for mine in words),
        notes=tuple(f"{name} is left out: it has no phases over a reference" for name in left_out),
        settings=usable[0].settings,
    )


def _at_step(step: Sequence[ToneTable], name: str) -> tuple[complex, ...]:
    """Mean of a channel over the repeats of a step: value, random uncertainty, degrees of freedom, common parts."""
    found = [(t, t.channels.index(name)) for t in step if name in t.channels]
    if not found:
        return np.nan, np.nan, 0.0, np.nan, np.nan
    values = np.array([t.magnitude[i] * np.exp(1j * np.radians(t.phase_deg[i])) for t, i in found])
    return (
        complex(np.mean(values)),
        _random(values, np.array([t.u_random_percent[i] for t, i in found])),
        sum(t.degrees_of_freedom for t, _ in found),
        float(np.mean([t.u_common_percent[i] for t, i in found])),
        float(np.mean([t.u_common_phase_deg[i] for t, i in found])),
    )


def _units(tables: Sequence[ToneTable]) -> dict[str, str]:
    """Of every response over the reference, the same in all recordings."""
    units: dict[str, str] = {}
    for table in tables:
        for name, unit in zip(table.channels, table.magnitude_units):
            if name != table.reference and units.setdefault(name, unit) != unit:
                raise InputError(f"{table.label}: {name} is in {unit}, in other recordings in {units[name]}")
    return units


def _random(values: np.ndarray, u_percent: np.ndarray) -> float:
    """Relative standard uncertainty of a mean of complex values, per real component, in percent."""
    stated = float(np.sqrt(np.mean(u_percent**2) / len(values)))
    if len(values) == 1:
        return stated
    scatter = np.sum(np.abs(values - np.mean(values)) ** 2) / (2 * (len(values) - 1) * len(values))
    return max(stated, float(100 * np.sqrt(scatter) / np.abs(np.mean(values))))
