"""RMS, level, peak, crest factor, equivalent and percentile levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from specan.analysis.accumulator import read_through
from specan.analysis.quality import QualityAccumulator, quality_flags
from specan.analysis.section import SectionSettings, joined, of_one_rate, section, slices, slow_part
from specan.arrays import Flags, Real
from specan.data.band_levels import EDGES_DB, apart
from specan.data.levels import Quality, SignalLevels, level
from specan.data.recording import Recording
from specan.dsp import band_history
from specan.dsp.statistics import exceeded
from specan.dsp.weighting import FAST, SLOW, WEIGHTINGS, Weighting
from specan.units import level_reference

# Readings of the time-weighted level: five in a time constant, but no more of them than this.
READINGS_PER_TIME_CONSTANT, READINGS = 5, 200_000
# A C peak that only the beginning has, where a decay and a slow event cannot be told apart for sure, is flagged where
# the decays are worth this much in dB; later ones as near to it say that it is none of an event.
_EARLY_DB = 0.1
_ALIKE = 10.0 ** (-_EARLY_DB / 20.0)
_SETTLING = (
    "about the mean; the response of A, B and C to the cut at the start of the section is removed; percentiles and "
    f"minimum leave out the first {band_history.SETTLING_TIME_CONSTANTS:g} time constants after 0.09 s"
)


class Levels(SectionSettings):
    """Settings of single-number values.

    Attributes
    ----------
    weighting : {"A", "B", "C", "Z"} or None
        Of the time-weighted level; by default A for sound pressure. Channels in other units have Z.
    averaging : {"fast", "slow"}
        Of that level.
    percentiles : tuple of float
        N of the levels exceeded during N percent of the time.
    channels : tuple of str
        Names or patterns; all by default.
    start_s, stop_s : float
        Time section.
    velocity_reference : {"1 nm/s", "50 nm/s"}

    Examples
    --------
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> pascals = 1.0 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(48000) / 48000)
    >>> mic = Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=48000.0, n_samples=48000)
    >>> found = Levels()(Recording("a.tdms", (mic,), ArraySource([pascals])))
    >>> found.rms.round(4).tolist(), found.level_dB.round(2).tolist(), found.crest_factor.round(3).tolist()
    ([1.0], [93.98], [1.414])
    """

    weighting: Weighting | None = None
    averaging: Literal["fast", "slow"] = "fast"
    percentiles: tuple[Annotated[float, Field(gt=0.0, lt=100.0)], ...] = (5.0, 10.0, 50.0, 90.0, 95.0)
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s"

    @property
    def time_constant(self) -> float:
        """Of the time-weighted level, in s."""
        return {"fast": FAST, "slow": SLOW}[self.averaging]

    def __call__(self, recording: Recording) -> SignalLevels:
        """Read the recording (once in 32 channels) and return the values."""
        groups = slices(len(of_one_rate(recording, self.channels)[0]))
        parts = [read_through(LevelsAccumulator(recording, self, few), recording) for few in groups]
        return joined(
            parts,
            "channels groups units references mean minimum maximum rms equivalent_dB "
            "c_peak_dB percentile_dB max_dB min_dB flags",
        )


class LevelsAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Channels are taken as they were measured: a displacement is not made a velocity here.
    """

    def __init__(self, recording: Recording, settings: Levels, few: slice = slice(None)) -> None:
        self.recording, self.settings = recording, settings
        chosen, self.notes = of_one_rate(recording, settings.channels)
        # The section is that of all the channels that were chosen.
        self.start, self.stop = section(recording, chosen, settings.start_s, settings.stop_s)
        self.channels = chosen[few]
        self.sampling_rate = self.channels[0].sampling_rate
        self.duration = (self.stop - self.start) / self.sampling_rate
        self._pressure = np.array([channel.unit == "Pa" for channel in self.channels])
        self._weighting: Weighting = settings.weighting or "A"
        # The weighting's, that of channels for which there is none, and what else sound pressure has.
        first: list[Weighting] = [self._weighting, "Z"]
        self._weightings = [*first, *(w for w in WEIGHTINGS if w not in first and self._pressure.any())]
        filters = [band_history.weighting_filter(w) for w in self._weightings]
        tau = settings.time_constant
        step = max(tau / READINGS_PER_TIME_CONSTANT, self.duration / READINGS)
        times = np.arange(
            band_history.SETTLING_TIME_CONSTANTS * tau + filters[0].settling, self.duration, step
        )
        rows = len(self.channels)
        slow = slow_part(recording, self.channels, self.start, self.stop)
        self._constant = slow.constant
        self._history = band_history.BandHistoryAccumulator(
            band_history.Record(rows, self.sampling_rate, self.stop - self.start, slow=slow),
            filters,
            band_history.Average(tau, None, times),
            peak_of=self._weightings.index("C") if self._pressure.any() else None,
            read=len(first),
        )
        self._quality = QualityAccumulator(self.channels)

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m) of `channels`."""
        self._quality.add(samples)
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            self._history.add(samples)

    def result(self) -> SignalLevels:
        """What was found; call it once."""
        quality = self._quality.result()
        low, high = (np.array([getattr(q, name) for q in quality]) for name in ("minimum", "maximum"))
        references = tuple(level_reference(c.unit, self.settings.velocity_reference) for c in self.channels)
        zero = np.array([reference.value**2 for reference in references])
        with np.errstate(invalid="ignore", over="ignore"):
            found = self._history.result()
            rms = np.sqrt(found.mean_square[:, self._weightings.index("Z")])
        row, column = np.arange(len(self.channels)), np.where(self._pressure, 0, 1)
        shown = self._named(found.mean_square, found.maximum[row, column], found.peak, zero)
        highest, mean_square, c_peak = found.with_cut
        with_cut = self._named(mean_square, highest[row, column], c_peak, zero)
        with np.errstate(invalid="ignore"):
            only_early = found.later_peak < _ALIKE * found.peak
        nothing = np.full(len(self.channels), np.nan)
        percentile = exceeded(level(found.readings[row, column], zero[:, None]), self.settings.percentiles)
        return SignalLevels(
            **self.settings.origin(
                self.recording, self.channels, self.notes, [c.unit for c in self.channels]
            ),
            references=references,
            mean=self._constant,
            minimum=low,
            maximum=high,
            rms=rms,
            equivalent_dB={w: shown.get(f"Leq_{w}", nothing) for w in WEIGHTINGS},
            c_peak_dB=shown["C_peak"],
            weighting=self._weighting,
            averaging=self.settings.averaging,
            percentile_dB=dict(zip(self.settings.percentiles, percentile)),
            max_dB=shown["max"],
            min_dB=level(found.minimum[row, column], zero),
            start_s=self.settings.start_s,
            duration_s=self.duration,
            sampling_rate=self.sampling_rate,
            settling=_SETTLING,
            flags=self._flags(quality, shown, with_cut, only_early),
        )

    def _flags(
        self,
        quality: Sequence[Quality],
        shown: dict[str, Real],
        with_cut: dict[str, Real],
        only_early: Flags,
    ) -> tuple[tuple[str, ...], ...]:
        """Words on the samples, and on levels that would be others had the cut at the section's start counted."""
        least = {"C_peak": np.where(only_early, _EARLY_DB, EDGES_DB)}
        flags = []
        for row, words in enumerate(quality_flags(self.channels, self.recording.flags, quality)):
            names = [
                n
                for n in shown
                if n != "Leq_Z"
                and self._pressure[row]
                and apart(shown[n], with_cut[n], least.get(n, EDGES_DB))[row]
            ]
            counted = [f"counted-{name}={with_cut[name][row]:.3f}" for name in names]
            flags.append((*words, *(["edges"] if counted else []), *counted))
        return tuple(flags)

    def _named(self, mean_square: Real, maximum: Real, peak: Real, zero: Real) -> dict[str, Real]:
        """Levels by their names; what is for sound pressure only is NaN in other channels."""
        found = {f"Leq_{w}": level(mean_square[:, k], zero) for k, w in enumerate(self._weightings)}
        found["C_peak"] = level(np.square(peak), zero)
        found = {n: v if n == "Leq_Z" else np.where(self._pressure, v, np.nan) for n, v in found.items()}
        return {**found, "max": level(maximum, zero)}
