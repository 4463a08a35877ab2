"""Mean squares become band levels: references, scatter, flags, and what has to be said beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from specan.dsp.bands import Bands
from specan.dsp.record_edges import Fade
from specan.dsp.weighting import WEIGHTINGS
from specan.units import LevelReference, level_reference

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


def band_levels(
    spectrum: EnergySpectrum, channels: Sequence[Channel], settings: OctaveSettings, **about: Any
) -> BandLevels:
    """Divide an energy spectrum into bands; no sample is read again.

    Parameters
    ----------
    spectrum : EnergySpectrum
        Linear average over a section; see `OctaveAccumulator.spectrum`.
    channels : sequence of Channel
        In the order of its rows.
    settings : OctaveSettings
        The fraction, weighting and range to use; `averaging` does not count.
    """
    found = settings.bands(spectrum.sampling_rate)
    duration, width = spectrum.n_samples / spectrum.sampling_rate, found.upper - found.lower
    with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold anything
        counted, left_out = (
            _levels_of(each, channels, settings, found) for each in (spectrum, spectrum.between_ends())
        )
        with_cut = _totals(replace(spectrum, cut={}), channels, settings)
    narrow = width * Fade.of(spectrum.n_samples, spectrum.sampling_rate).samples < (
        LEAST_FADE_CYCLES * spectrum.sampling_rate
    )
    without_ends = left_out[0]
    left_out = (np.where(narrow, counted[0], without_ends), counted[1])
    averaged = np.full(len(found), duration)
    if settings.settling == "left-out" and spectrum.inner is not None:
        averaged[~narrow] = spectrum.independent / spectrum.sampling_rate
    shown, other = (counted, left_out) if settings.settling == "counted" else (left_out, counted)
    u_dB = scatter_of_noise(width, averaged)
    if settings.settling == "counted":
        with np.errstate(invalid="ignore"):  # no energy: -inf in both
            by_ends = narrow & (np.abs(without_ends - counted[0]) > np.minimum(BY_ENDS * u_dB, BY_ENDS_DB))
        other = (np.where(by_ends, without_ends, left_out[0]), left_out[1])
    return BandLevels(
        **_common(found, channels, settings, **about),
        averaging="linear",
        hold=None,
        level_dB=shown[0],
        u_dB=u_dB,
        overall_dB=shown[1],
        duration_s=duration,
        sampling_rate=spectrum.sampling_rate,
        settling=LINEAR_SETTLING[settings.settling],
        # A weighting's share of the cut is known and taken off totals in either case.
        other=OtherSettling(_exchanged(settings), other[0], with_cut),
    )


def _levels_of(
    spectrum: EnergySpectrum, channels: Sequence[Channel], settings: OctaveSettings, found: Bands
) -> tuple[Real, dict[str, Real]]:
    """Levels of the bands and of the whole."""
    quantity = _as_quantity(channels, spectrum.frequencies)
    weights = None if settings.weighting == "Z" else spectrum.weights(settings.weighting)
    if quantity is not None:
        weights = quantity if weights is None else weights * quantity
    mean_square = spectrum.band_mean_square(found, weights)
    return level(mean_square, _zero(channels, settings)[:, None]), _totals(spectrum, channels, settings)


def weighted_levels(
    histories: Histories,
    overall: Sequence[str],
    elapsed: Real,
    duration: float,
    channels: Sequence[Channel],
    settings: OctaveSettings,
    *,
    sampling_rate: float,
    **about: Any,
) -> BandLevels:
    """Time-weighted mean squares as levels.

    Parameters
    ----------
    histories : Histories
        Of the bands, then of the weightings `overall` of the whole signal; the last reading is that at
        the end of the section.
    elapsed : array
        When the other readings are, in s from the beginning of the section.
    """
    found = settings.bands(sampling_rate)
    n, zero, usable = len(found), _zero(channels, settings), _usable(channels, overall)

    def totals(levels_dB: Real) -> dict[str, Real]:
        """Of levels (channels, filters) or (channels, filters, times), the overall ones."""
        return {
            w: np.where(usable[w].reshape(-1, *[1] * (levels_dB.ndim - 2)), levels_dB[:, n + k], np.nan)
            for k, w in enumerate(overall)
        }

    shown, highest, other, settling = _held(histories, settings)
    shown_dB, other_dB, highest_dB = (level(each, zero[:, None]) for each in (shown, other, highest))
    other_dB[:, n:] = level(histories.with_cut[0][:, n:], zero[:, None])  # totals leave the cut out
    readings_dB = level(histories.readings[:, :, :-1], zero[:, None, None])
    exceeded_dB = {
        percent: level(values, zero[:, None])
        for percent, values in _exceeded(histories, highest, elapsed, settings.percentiles).items()
    }
    # An exponential average of time constant tau scatters like a linear one over 2 tau.
    averaged = min(2.0 * settings.time_constant, duration)
    return BandLevels(
        **_common(found, channels, settings, **about),
        averaging=settings.averaging_name,
        hold=settings.hold,
        level_dB=shown_dB[:, :n],
        u_dB=scatter_of_noise(found.upper - found.lower, averaged),
        overall_dB=totals(shown_dB),
        duration_s=duration,
        sampling_rate=sampling_rate,
        settling=settling,
        unsettled=histories.settled_s[:n] > duration,
        other=OtherSettling(_exchanged(settings), other_dB[:, :n], totals(other_dB))
        if settings.hold == "max"
        else None,
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


def _held(histories: Histories, settings: OctaveSettings) -> tuple[Real, Real, Real, str]:
    """Mean squares that are shown, the maximum, that of the other settling, and words on what is shown."""
    counted, left_out = histories.maximum, histories.later_maximum
    highest, other = (counted, left_out) if settings.settling == "counted" else (left_out, counted)
    if settings.hold is None:
        return histories.readings[:, :, -1], highest, other, READING_SETTLING
    if settings.hold == "max":
        return highest, highest, other, MAX_SETTLING[settings.settling]
    return histories.minimum, highest, other, MIN_SETTLING


def _exchanged(settings: OctaveSettings) -> str:
    return "left-out" if settings.settling == "counted" else "counted"


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


def channel_reference(channel: Channel, settings: OctaveSettings) -> LevelReference:
    """What levels of the channel are over."""
    return level_reference(channel.target_unit, settings.velocity_reference)


def quality_flags(
    channels: Sequence[Channel], file_flags: Sequence[str], quality: Sequence[Quality] | None
) -> tuple[tuple[str, ...], ...]:
    """Words for each channel: those of its samples, and those of the file."""
    found = [()] * len(channels) if quality is None else [q.flags for q in quality]
    return tuple((*words, *file_flags) for words in found)


def _common(
    found: Bands,
    channels: Sequence[Channel],
    settings: OctaveSettings,
    *,
    label: str = "",
    file_flags: Sequence[str] = (),
    quality: Sequence[Quality] | None = None,
    notes: Sequence[str] = (),
) -> Mapping[str, Any]:
    """What both averagings have in common."""
    return {
        "label": label,
        "channels": tuple(channel.label for channel in channels),
        "groups": tuple(channel.group for channel in channels),
        "units": tuple(channel.target_unit for channel in channels),
        "references": tuple(channel_reference(channel, settings) for channel in channels),
        "fraction": settings.fraction,
        "weighting": settings.weighting,
        "exact_hz": found.mid,
        "nominal_hz": found.nominal,
        "lower_hz": found.lower,
        "upper_hz": found.upper,
        "start_s": settings.start_s,
        "flags": quality_flags(channels, file_flags, quality),
        "notes": tuple(notes),
        "settings": settings.model_dump(mode="json"),
    }


def _zero(channels: Sequence[Channel], settings: OctaveSettings) -> Real:
    return np.array([channel_reference(channel, settings).value ** 2 for channel in channels])


def _usable(channels: Sequence[Channel], overall: Sequence[str]) -> dict[str, NDArray[np.bool_]]:
    """For which channels an overall level means something: A, B and C of sound pressure."""
    pressure = np.array([channel.target_unit == "Pa" for channel in channels])
    # The derivative of a whole signal has no end at high frequencies, its integral none at low ones.
    measured = np.array([channel.derivatives == 0 for channel in channels])
    return {name: measured if name == "Z" else measured & pressure for name in overall}


def _as_quantity(channels: Sequence[Channel], frequencies: Real) -> Real | None:
    """|j w|^2 or its inverse for channels whose samples have to be differentiated or integrated."""
    if not any(channel.derivatives for channel in channels):
        return None
    return np.stack([np.square(2 * np.pi * frequencies) ** channel.derivatives for channel in channels])


def _totals(
    spectrum: EnergySpectrum, channels: Sequence[Channel], settings: OctaveSettings
) -> dict[str, Real]:
    """Levels of the whole signal, with each weighting."""
    whole, quantity = spectrum.alternating_mean_square, _as_quantity(channels, spectrum.frequencies)
    if quantity is not None:
        # Integration makes drift infinite: from the lowest band upwards, for channels that need it.
        above = spectrum.frequencies >= settings.bands(spectrum.sampling_rate).lower[0]
        converted = np.add.reduce(spectrum.nodes * quantity * above, axis=1)
        whole = np.where([channel.derivatives != 0 for channel in channels], converted, whole)
    pressure = np.array([channel.target_unit == "Pa" for channel in channels])
    overall = {"Z": whole}
    for name in WEIGHTINGS:
        if name != "Z":
            overall[name] = np.where(pressure, spectrum.weighted(name), np.nan)
    return {name: level(values, _zero(channels, settings)) for name, values in overall.items()}
