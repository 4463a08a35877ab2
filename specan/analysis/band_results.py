"""Mean squares become band levels: references, scatter, flags, and what has to be said beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.analysis.octave_settings import OctaveSettings
from specan.data.band_levels import BandLevels, LevelHistory, OtherSettling
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.dsp.band_energy import EnergySpectrum
from specan.dsp.band_history import Histories
from specan.dsp.record_edges import Fade
from specan.dsp.weighting import WEIGHTINGS
from specan.result import picked
from specan.units import level_reference

Real = NDArray[np.float64]

LEAST_FADE_CYCLES = 2.0
"""A fade spreads a line over 1 / fade. Bands narrower than 2 / fade would see more of a neighbouring line than the
skirts of their filters let through: in these the ends are counted. (The class 1 limits of IEC 61260-1 hold for tones
that are themselves faded over 2 / bandwidth.)"""
BY_ENDS, BY_ENDS_DB = 3.0, 6.0
"""A fade changes the level of such a band by as many standard deviations of noise, or dB, where something is at the
ends. Of white noise in 1/24 octaves it changes 0.6 % of the levels by as much in 1 s, 0.06 % in 2 s."""
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


class BandResults:
    """What mean squares of some channels are as levels.

    Parameters
    ----------
    channels : sequence of Channel
        In the order of the rows of all mean squares.
    settings : OctaveSettings
        The fraction, weighting and range to use, and what is shown.
    sampling_rate : float
        In Hz.
    **about
        Label, flags and notes of the result.
    """

    def __init__(
        self, channels: Sequence[Channel], settings: OctaveSettings, sampling_rate: float, **about: Any
    ) -> None:
        self.channels, self.settings, self.sampling_rate = channels, settings, sampling_rate
        self.bands = settings.bands(sampling_rate)
        self.references = tuple(level_reference(c.target_unit, settings.velocity_reference) for c in channels)
        self._about = {"label": "", "flags": ((),) * len(channels), **about}
        self._zero = np.array([reference.value**2 for reference in self.references])
        self._pressure = np.array([channel.target_unit == "Pa" for channel in channels])
        self._derivatives = np.array([channel.derivatives for channel in channels])

    def of_spectrum(self, spectrum: EnergySpectrum) -> BandLevels:
        """A linear average over a section, divided into bands; no sample is read again."""
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

    def of_histories(
        self, histories: Histories, overall: Sequence[str], elapsed: Real, duration: float
    ) -> BandLevels:
        """Time-weighted mean squares.

        Parameters
        ----------
        histories : Histories
            Of the bands, then of the weightings `overall` of the whole signal; the last reading is that at
            the end of the section.
        elapsed : array
            When the other readings are, in s from the beginning of the section.
        """
        settings, n, zero = self.settings, len(self.bands), self._zero

        def totals(levels_dB: Real) -> dict[str, Real]:
            """Of levels (channels, filters) or (channels, filters, times), the overall ones.

            A, B and C are of sound pressure. The derivative of a whole signal has no end at high frequencies, its
            integral none at low ones.
            """
            found = {}
            for k, weighting in enumerate(overall):
                usable = (self._derivatives == 0) & (self._pressure | (weighting == "Z"))
                usable = usable.reshape(-1, *[1] * (levels_dB.ndim - 2))
                found[weighting] = np.where(usable, levels_dB[:, n + k], np.nan)
            return found

        shown, highest, other, settling = _held(histories, settings)
        shown_dB, other_dB, highest_dB = (level(each, zero[:, None]) for each in (shown, other, highest))
        other_dB[:, n:] = level(histories.with_cut[0][:, n:], zero[:, None])  # totals leave the cut out
        readings_dB = level(histories.readings[:, :, :-1], zero[:, None, None])
        exceeded_dB = {
            percent: level(values, zero[:, None])
            for percent, values in _exceeded(histories, highest, elapsed, settings.percentiles).items()
        }
        exchanged = OtherSettling(self._exchanged, other_dB[:, :n], totals(other_dB))
        # An exponential average of time constant tau scatters like a linear one over 2 tau.
        averaged = min(2.0 * settings.time_constant, duration)
        return self._result(
            level_dB=shown_dB[:, :n],
            u_dB=scatter_of_noise(self.bands.upper - self.bands.lower, averaged),
            overall_dB=totals(shown_dB),
            duration_s=duration,
            settling=settling,
            unsettled=histories.settled_s[:n] > duration,
            other=exchanged if settings.hold == "max" else None,
            history=LevelHistory(
                time_s=settings.start_s + elapsed,
                level_dB=readings_dB[:, :n],
                overall_dB=totals(readings_dB),
                interval_s=settings.reading_interval(duration),
                max_dB=highest_dB[:, :n],
                overall_max_dB=totals(highest_dB),
            ),
            percentile_dB={p: v[:, :n] for p, v in exceeded_dB.items()} or None,
            percentile_overall_dB={p: totals(v) for p, v in exceeded_dB.items()} or None,
        )

    def _result(self, **found: Any) -> BandLevels:
        return BandLevels(
            channels=tuple(channel.label for channel in self.channels),
            groups=tuple(channel.group for channel in self.channels),
            units=tuple(channel.target_unit for channel in self.channels),
            references=self.references,
            exact_hz=self.bands.mid,
            **picked(self.bands, "nominal_hz=nominal lower_hz=lower upper_hz=upper"),
            **picked(self.settings, "fraction weighting averaging=averaging_name hold start_s"),
            sampling_rate=self.sampling_rate,
            settings=self.settings.model_dump(mode="json"),
            **self._about,
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
        whole = spectrum.alternating_mean_square
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


def _held(histories: Histories, settings: OctaveSettings) -> tuple[Real, Real, Real, str]:
    """Mean squares that are shown, the maximum, that of the other settling, and words on what is shown."""
    counted, left_out = histories.maximum, histories.later_maximum
    highest, other = (counted, left_out) if settings.settling == "counted" else (left_out, counted)
    if settings.hold is None:
        return histories.readings[:, :, -1], highest, other, READING_SETTLING
    if settings.hold == "max":
        return highest, highest, other, MAX_SETTLING[settings.settling]
    return histories.minimum, highest, other, MIN_SETTLING


def _exceeded(
    histories: Histories, highest: Real, elapsed: Real, percentiles: Sequence[float]
) -> dict[float, Real]:
    """Mean squares (channels, filters) exceeded during so many percent of the time, with the extremes.

    Each filter's readings count from the time on at which it has settled: five time constants and 3/B.
    """
    if not percentiles:
        return {}
    found = {0.0: highest}
    for percent in sorted(set(percentiles)):
        found[percent] = np.full(highest.shape, np.nan)
        for number, settled in enumerate(histories.settled_s):
            readings = histories.readings[:, number, :-1][:, elapsed >= settled]
            if readings.shape[1]:
                found[percent][:, number] = np.quantile(readings, 1.0 - percent / 100.0, axis=1)
    return {**found, 100.0: histories.minimum}


def level(mean_square: Real, zero: Real | float) -> Real:
    """10 lg(mean square / `zero`) in dB; minus infinity for nothing, NaN for NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10.0 * np.log10(np.asarray(mean_square) / zero)


def scatter_of_noise(bandwidth: Real, duration: float | Real) -> Real:
    """Standard deviation in dB of the level of stationary Gaussian noise: 4.34 / sqrt(B T).

    The mean square of a band of width B over a time T has B T pairs of degrees of freedom, so its
    relative standard deviation is 1 / sqrt(B T); 10 / ln 10 = 4.34.
    """
    return 10.0 / np.log(10.0) / np.sqrt(bandwidth * duration)


def quality_flags(
    channels: Sequence[Channel], file_flags: Sequence[str], quality: Sequence[Quality] | None
) -> tuple[tuple[str, ...], ...]:
    """Words for each channel: those of its samples, and those of the file."""
    found = [()] * len(channels) if quality is None else [q.flags for q in quality]
    return tuple((*words, *file_flags) for words in found)
