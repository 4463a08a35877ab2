"""Band levels: fractional octaves, frequency weightings, averaging, and what has to be said beside them.

Decisions: docs/decisions/bands.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from specan.analysis.accumulator import feed
from specan.analysis.quality import QualityAccumulator, quality_flags
from specan.analysis.section import SectionSettings, joined, section, slices, slow_part, weightable
from specan.arrays import Real
from specan.data.band_levels import BandLevels, LevelHistory, OtherSettling
from specan.data.levels import Quality, level
from specan.data.recording import Recording
from specan.divisions import division_name
from specan.dsp import band_history
from specan.dsp.band_energy import BandEnergyAccumulator, EnergySpectrum
from specan.dsp.bands import Bands
from specan.dsp.multirate import LOWEST_BAND
from specan.dsp.record_edges import Fade
from specan.dsp.statistics import exceeded
from specan.dsp.weighting import FAST, IMPULSE, IMPULSE_DECAY, SLOW, WEIGHTINGS, Weighting
from specan.errors import RequestError
from specan.result import picked
from specan.schema import Division
from specan.units import level_reference

Settling = Literal["left-out", "counted"]
AUDIO_RANGE = (20.0, 20000.0)
TIME_CONSTANTS = {"fast": FAST, "slow": SLOW, "impulse": IMPULSE}
# Readings of a history, unless an interval is asked for: in a time constant (a level falls by 0.54 dB from one to the
# next at most), and in all.
READINGS_PER_TIME_CONSTANT, READINGS = 8, 1000

# A fade spreads a line over 1 / fade. Bands narrower than 2 / fade would see more of a neighbouring line than the
# skirts of their filters let through: in these the ends are counted. (The class 1 limits of IEC 61260-1 hold for tones
# that are themselves faded over 2 / bandwidth.)
LEAST_FADE_CYCLES = 2.0
# A fade changes the level of such a band by as many standard deviations of noise, or dB, where something is at the
# ends. Of white noise in 1/24 octaves it changes 0.6 % of the levels by as much in 1 s, 0.06 % in 2 s.
BY_ENDS, BY_ENDS_DB = 3.0, 6.0
LINEAR_SETTLING = {
    "left-out": "about the mean; the section is faded in and out over an eighth of it, 0.5 s at most, so that the cut "
    "at its ends is left out of the bands",
    "counted": "about the mean; filters at rest at the start of the section; all energy at the outputs of the bands, "
    "ring-out after its end included, over the length of the section",
}
READING_SETTLING = (
    "filters and time weighting at rest at the start of the section, 5 time constants + 3/B to settle; "
    "the reading is that at its end"
)
MAX_SETTLING = {
    "counted": "filters and time weighting at rest at the start of the section; the maximum is over all of it",
    "left-out": "filters and time weighting at rest at the start of the section; for the maximum of a band the time "
    "weighting begins after 6/B",
}
MIN_SETTLING = (
    "filters and time weighting at rest at the start of the section; the minimum leaves out the first "
    "5 time constants + 3/B of each band"
)


class Octave(SectionSettings):
    """Settings of a fractional-octave analysis.

    Attributes
    ----------
    fraction : {1, 2, 3, 6, 12, 24, "bark"}
        1/1 to 1/24 octave, or critical bands (Zwicker 1961).
    weighting : {"A", "B", "C", "Z"}
        Of the band levels. A, B and C are for sound pressure; the overall levels with all of them stand
        beside every spectrum of sound pressure anyway.
    averaging : {"linear", "fast", "slow", "impulse"} or float
        Linear over the section, or exponential: 0.125 s, 1 s, 35 ms with a peak detector that falls with
        1.5 s, or any time constant in s.
    hold : {"max", "min"} or None
        Of an exponential average: the largest or smallest level instead of that at the end of the section.
    interval_s : float or None
        Distance of the readings of an exponential average's history; by default an eighth of the time constant
        (of 0.125 s for impulse), or a multiple of it that gives at most 1000 readings.
    percentiles : tuple of float
        Of an exponential average: also find the levels exceeded during so many percent of the time, and the maximum
        and minimum. They rest on the readings of the history after a band has settled.
    fmin, fmax : float
        The bands from the one that contains `fmin` to the one that contains `fmax`; by default 20 Hz to
        20 kHz, or to the highest band below half the sampling rate.
    band : float or None
        The one band that contains this frequency, instead of a range.
    channels : tuple of str
        Names or patterns; all by default.
    start_s, stop_s : float
        Time section.
    velocity_reference : {"1 nm/s", "50 nm/s"}
        What 0 dB of velocity is: that of ISO 1683, or that of building acoustics.
    settling : {"left-out", "counted"}
        Whether what the cut at the two ends of the section does to the bands is left out of a linear average or a
        maximum, or counted. What the other choice gives is beside it.

    Examples
    --------
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> pascals = 0.02 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(48000) / 48000)
    >>> mic = Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=48000.0, n_samples=48000)
    >>> found = Octave(band=1000)(Recording("a.tdms", (mic,), ArraySource([pascals])))
    >>> found.level_dB.round(2).tolist(), found.overall_dB["A"].round(2).tolist(), found.references[0].text
    ([[60.0]], [60.0], '20 uPa')
    """

    fraction: Division = 3
    weighting: Weighting = "Z"
    averaging: Literal["linear", "fast", "slow", "impulse"] | float = "linear"
    hold: Literal["max", "min"] | None = None
    interval_s: float | None = Field(default=None, gt=0.0)
    percentiles: tuple[Annotated[float, Field(gt=0.0, lt=100.0)], ...] = ()
    fmin: float | None = Field(default=None, ge=LOWEST_BAND)
    fmax: float | None = Field(default=None, gt=0.0)
    band: float | None = Field(default=None, ge=LOWEST_BAND)
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s"
    settling: Settling = "counted"

    @field_validator("averaging", mode="before")
    @classmethod
    def _known_averaging(cls, value: object) -> object:
        # Of a union, pydantic would report each member's fault.
        if value in ("linear", *TIME_CONSTANTS):
            return value
        with suppress(ValueError):
            if 0.0 < float(str(value)) < np.inf:
                return float(str(value))
        raise ValueError("linear, fast, slow, impulse, or a time constant in s above 0")

    @model_validator(mode="after")
    def _consistent(self) -> Octave:
        if self.band is not None and (self.fmin is not None or self.fmax is not None):
            raise ValueError("one band or a range from fmin to fmax can be chosen, not both")
        if self.averaging == "linear" and (self.hold or self.interval_s is not None or self.percentiles):
            raise ValueError(
                "hold, interval and percentiles need averaging fast, slow, impulse or a time constant in s"
            )
        if self.fmin is not None and self.fmax is not None and self.fmin > self.fmax:
            raise ValueError(f"fmin ({self.fmin:g} Hz) is above fmax ({self.fmax:g} Hz)")
        return self

    @property
    def time_constant(self) -> float:
        """Of the exponential average, in s."""
        return TIME_CONSTANTS[self.averaging] if isinstance(self.averaging, str) else self.averaging

    @property
    def averaging_name(self) -> str:
        """The averaging in words."""
        return self.averaging if isinstance(self.averaging, str) else f"{self.averaging:g} s"

    def reading_interval(self, duration: float) -> float:
        """Distance in s of the readings of a history over `duration` seconds."""
        if self.interval_s is not None:
            return self.interval_s
        step = max(self.time_constant, FAST) if self.averaging == "impulse" else self.time_constant
        step /= READINGS_PER_TIME_CONSTANT
        return step * max(1, int(np.ceil(duration / step / READINGS)))

    def bands(self, sampling_rate: float) -> Bands:
        """The bands that are found.

        Raises
        ------
        RequestError
            A band that was asked for reaches above half the sampling rate.
        """
        nyquist = sampling_rate / 2.0
        if self.band is not None:
            low = high = self.band
        else:
            low = AUDIO_RANGE[0] if self.fmin is None else self.fmin
            high = AUDIO_RANGE[1] if self.fmax is None else self.fmax
        wanted = Bands.between(self.fraction, min(low, high), high)
        found = wanted[wanted.upper <= nyquist]
        stated = self.band is not None or self.fmax is not None
        if not len(found) or (stated and len(found) < len(wanted)):
            possible = Bands.between(self.fraction, min(LOWEST_BAND, nyquist), nyquist)
            possible = possible[possible.upper <= nyquist]
            name = division_name(self.fraction).removesuffix(" band")
            raise RequestError(
                f"the {name} band at {high if stated else low:g} Hz reaches above half the "
                f"sampling rate of {sampling_rate:g} Hz",
                expected=f"bands up to {possible.nominal.max(initial=0.0):g} Hz",
                remedy="choose a lower frequency",
            )
        return found

    def __call__(self, recording: Recording) -> BandLevels:
        """Read the recording (once in 32 channels) and return the band levels."""
        parts = []
        for few in slices(len(weightable(recording, self.channels, self.weighting)[0])):
            found = OctaveAccumulator(recording, self, few)
            quality = QualityAccumulator(found.channels, found.start, found.stop)
            feed(recording, [found, quality])
            parts.append(found.result(quality.result()))
        return joined(
            parts,
            "channels groups units references level_dB overall_dB flags history other percentile_dB "
            "percentile_overall_dB",
        )


class OctaveAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Parameters
    ----------
    few : slice
        Which of the chosen channels.

    Raises
    ------
    RequestError
        The section is empty, a band is too high, or a weighting is asked for what is not sound pressure.
    InputError
        No channel has samples.
    """

    def __init__(self, recording: Recording, settings: Octave, few: slice = slice(None)) -> None:
        self.recording, self.settings = recording, settings
        chosen, self.notes = weightable(recording, settings.channels, settings.weighting)
        # The section and the weightings are those of all the channels that were chosen.
        self.start, self.stop = section(recording, chosen, settings.start_s, settings.stop_s)
        pressure = any(channel.target_unit == "Pa" for channel in chosen)
        self._overall = WEIGHTINGS if pressure else ("Z",)
        self.channels = chosen[few]
        self.sampling_rate = self.channels[0].sampling_rate
        self.bands = settings.bands(self.sampling_rate)
        self.references = tuple(
            level_reference(c.target_unit, settings.velocity_reference) for c in self.channels
        )
        self._zero = np.array([reference.value**2 for reference in self.references])
        self._pressure = np.array([channel.target_unit == "Pa" for channel in self.channels])
        self._derivatives = np.array([channel.derivatives for channel in self.channels])
        rows, n, lowest = len(self.channels), self.stop - self.start, float(self.bands.lower[0])
        slow = slow_part(recording, self.channels, self.start, self.stop, lowest)
        self._at_work: BandEnergyAccumulator | band_history.BandHistoryAccumulator
        if settings.averaging == "linear":
            weighted = self._pressure.tolist()
            self._at_work = BandEnergyAccumulator(rows, self.sampling_rate, n, slow, weighted=weighted)
            return
        filters = [band_history.band_filter(band, settings.weighting) for band in self.bands]
        filters += [band_history.weighting_filter(weighting) for weighting in self._overall]
        self._duration = n / self.sampling_rate
        interval = settings.reading_interval(self._duration)
        count = int(self._duration / interval + 1e-9)
        self._times = np.linspace(interval, interval * count, count)
        decay = IMPULSE_DECAY if settings.averaging == "impulse" else None
        self._at_work = band_history.BandHistoryAccumulator(
            band_history.Record(rows, self.sampling_rate, n, self._derivatives.tolist(), slow),
            filters,
            band_history.Average(settings.time_constant, decay, np.append(self._times, self._duration)),
        )

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m) of `channels`."""
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            self._at_work.add(samples)

    def spectrum(self, fraction: int | str = 24) -> EnergySpectrum:
        """What was added, for bands of 1/`fraction` octave and wider (linear averages only); call it once."""
        assert isinstance(self._at_work, BandEnergyAccumulator)
        with np.errstate(invalid="ignore", over="ignore"):
            return self._at_work.result(fraction if isinstance(fraction, int) else 24)

    def result(self, quality: Sequence[Quality] | None = None) -> BandLevels:
        """Band levels of what was added; call it once. `quality` gives the channels' flags."""
        if isinstance(self._at_work, BandEnergyAccumulator):
            found = self.of_spectrum(self.spectrum(self.settings.fraction))
        else:
            with np.errstate(invalid="ignore", over="ignore"):
                found = self._of_histories(self._at_work.result())
        return replace(found, flags=quality_flags(self.channels, self.recording.flags, quality))

    def of_spectrum(self, spectrum: EnergySpectrum) -> BandLevels:
        """A linear average over the section, divided into bands; no sample is read again."""
        settings, counts = self.settings, self.settings.settling == "counted"
        duration, width = spectrum.n_samples / self.sampling_rate, self.bands.upper - self.bands.lower
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold anything
            counted, without_ends = (self._of_bands(each) for each in (spectrum, spectrum.between_ends()))
            overall, with_cut = (self._totals(each) for each in (spectrum, replace(spectrum, cut={})))
        fade = Fade.of(spectrum.n_samples, self.sampling_rate).samples / self.sampling_rate
        narrow = width * fade < LEAST_FADE_CYCLES
        left_out = np.where(narrow, counted, without_ends)
        averaged = np.full(width.size, duration)
        if not counts:
            averaged[~narrow] = spectrum.independent / self.sampling_rate
        u_dB = scatter_of_noise(width, averaged)
        with np.errstate(invalid="ignore"):  # no energy: -inf in both
            by_ends = narrow & (np.abs(without_ends - counted) > np.minimum(BY_ENDS * u_dB, BY_ENDS_DB))
        other = np.where(by_ends, without_ends, left_out) if counts else counted
        return self._result(
            level_dB=counted if counts else left_out,
            u_dB=u_dB,
            overall_dB=overall,
            duration_s=duration,
            settling=LINEAR_SETTLING[settings.settling],
            # A weighting's share of the cut is known and taken off totals in either case.
            other=OtherSettling(self._exchanged, other, with_cut),
        )

    def _of_histories(self, histories: band_history.Histories) -> BandLevels:
        """Time-weighted mean squares of the bands, then of the weightings of the whole signal."""
        settings, n, zero, elapsed = self.settings, len(self.bands), self._zero, self._times
        shown, highest, other, settling = _held(histories, settings)
        shown_dB, other_dB, highest_dB = (level(each, zero[:, None]) for each in (shown, other, highest))
        other_dB[:, n:] = level(histories.with_cut[0][:, n:], zero[:, None])  # totals leave the cut out
        readings_dB = level(histories.readings[:, :, :-1], zero[:, None, None])  # the last is that at the end
        exceeded_dB = {
            percent: level(values, zero[:, None])
            for percent, values in _exceeded(histories, highest, elapsed, settings.percentiles).items()
        }
        exchanged = OtherSettling(self._exchanged, other_dB[:, :n], self._totals_in(other_dB))
        # An exponential average of time constant tau scatters like a linear one over 2 tau.
        averaged = min(2.0 * settings.time_constant, self._duration)
        return self._result(
            level_dB=shown_dB[:, :n],
            u_dB=scatter_of_noise(self.bands.upper - self.bands.lower, averaged),
            overall_dB=self._totals_in(shown_dB),
            duration_s=self._duration,
            settling=settling,
            unsettled=histories.settled_s[:n] > self._duration,
            other=exchanged if settings.hold == "max" else None,
            history=LevelHistory(
                time_s=settings.start_s + elapsed,
                level_dB=readings_dB[:, :n],
                overall_dB=self._totals_in(readings_dB),
                interval_s=settings.reading_interval(self._duration),
                max_dB=highest_dB[:, :n],
                overall_max_dB=self._totals_in(highest_dB),
            ),
            percentile_dB={p: v[:, :n] for p, v in exceeded_dB.items()} or None,
            percentile_overall_dB={p: self._totals_in(v) for p, v in exceeded_dB.items()} or None,
        )

    def _totals_in(self, levels_dB: Real) -> dict[str, Real]:
        """Of levels (channels, filters) or (channels, filters, times), the overall ones.

        A, B and C are of sound pressure. The derivative of a whole signal has no end at high frequencies, its
        integral none at low ones.
        """
        found: dict[str, Real] = {}
        for k, weighting in enumerate(self._overall, len(self.bands)):
            usable = (self._derivatives == 0) & (self._pressure | (weighting == "Z"))
            found[weighting] = np.where(
                usable.reshape(-1, *[1] * (levels_dB.ndim - 2)), levels_dB[:, k], np.nan
            )
        return found

    def _result(self, **found: Any) -> BandLevels:
        return BandLevels(
            **self.settings.origin(self.recording, self.channels, self.notes),
            references=self.references,
            **picked(self.bands, "exact_hz=mid nominal_hz=nominal lower_hz=lower upper_hz=upper"),
            **picked(self.settings, "fraction weighting averaging=averaging_name hold start_s"),
            sampling_rate=self.sampling_rate,
            **found,
        )

    @property
    def _exchanged(self) -> str:
        return "left-out" if self.settings.settling == "counted" else "counted"

    def _of_bands(self, spectrum: EnergySpectrum) -> Real:
        weights = None if self.settings.weighting == "Z" else spectrum.weights(self.settings.weighting)
        if self._derivatives.any():
            quantity = self._as_quantity(spectrum)
            weights = quantity if weights is None else weights * quantity
        return level(spectrum.band_mean_square(self.bands, weights), self._zero[:, None])

    def _as_quantity(self, spectrum: EnergySpectrum) -> Real:
        """|j w|^2 or its inverse for channels whose samples have to be differentiated or integrated."""
        squared = np.square(2 * np.pi * spectrum.frequencies)
        return np.stack([squared ** int(times) for times in self._derivatives])

    def _totals(self, spectrum: EnergySpectrum) -> dict[str, Real]:
        """Levels of the whole signal, with each weighting."""
        whole = np.maximum(spectrum.mean_square - np.square(spectrum.mean), 0.0)
        if self._derivatives.any():
            # Integration makes drift infinite: from the lowest band upwards, for channels that need it.
            above = spectrum.frequencies >= self.bands.lower[0]
            converted = np.add.reduce(spectrum.nodes * self._as_quantity(spectrum) * above, axis=1)
            whole = np.where(self._derivatives != 0, converted, whole)
        overall = {"Z": whole}
        for name in WEIGHTINGS:
            if name != "Z":
                overall[name] = np.where(self._pressure, spectrum.weighted(name), np.nan)
        return {name: level(values, self._zero) for name, values in overall.items()}


def _held(histories: band_history.Histories, settings: Octave) -> tuple[Real, Real, Real, str]:
    """Mean squares that are shown, the maximum, that of the other settling, and words on what is shown."""
    counted, left_out = histories.maximum, histories.later_maximum
    highest, other = (counted, left_out) if settings.settling == "counted" else (left_out, counted)
    if settings.hold is None:
        return histories.readings[:, :, -1], highest, other, READING_SETTLING
    if settings.hold == "max":
        return highest, highest, other, MAX_SETTLING[settings.settling]
    return histories.minimum, highest, other, MIN_SETTLING


def _exceeded(
    histories: band_history.Histories, highest: Real, elapsed: Real, percentiles: Sequence[float]
) -> dict[float, Real]:
    """Mean squares (channels, filters) exceeded during so many percent of the time, with the extremes.

    Each filter's readings count from the time on at which it has settled: five time constants and 3/B.
    """
    if not percentiles:
        return {}
    chosen, readings = sorted(set(percentiles)), histories.readings[:, :, :-1]
    each = [exceeded(readings[:, k, elapsed >= s], chosen) for k, s in enumerate(histories.settled_s)]
    return {0.0: highest, **dict(zip(chosen, np.stack(each, axis=-1))), 100.0: histories.minimum}


def scatter_of_noise(bandwidth: Real, duration: float | Real) -> Real:
    """Standard deviation in dB of the level of stationary Gaussian noise: 4.34 / sqrt(B T).

    The mean square of a band of width B over a time T has B T pairs of degrees of freedom, so its
    relative standard deviation is 1 / sqrt(B T); 10 / ln 10 = 4.34.
    """
    return 10.0 / np.log(10.0) / np.sqrt(bandwidth * duration)
