"""Band levels: fractional octaves, frequency weightings, averaging.

Decisions: docs/decisions/bands.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specan.analysis.accumulator import feed
from specan.analysis.band_results import BandResults, quality_flags
from specan.analysis.octave_settings import OctaveSettings
from specan.analysis.quality import QualityAccumulator
from specan.analysis.section import joined, section, slices, slow_part, weightable
from specan.data.band_levels import BandLevels
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.dsp.band_energy import BandEnergyAccumulator, EnergySpectrum
from specan.dsp.band_history import BandHistoryAccumulator, band_filter, weighting_filter
from specan.dsp.record_edges import SlowPart
from specan.dsp.weighting import IMPULSE_DECAY, WEIGHTINGS


class Octave(OctaveSettings):
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

    def accumulator(self, recording: Recording) -> OctaveAccumulator:
        """For a pass over the recording that serves several analyses."""
        return OctaveAccumulator(recording, self)

    def __call__(self, recording: Recording) -> BandLevels:
        """Read the recording (once in 32 channels) and return the band levels."""
        parts = []
        for few in slices(len(weightable(recording, self.channels, self.weighting)[0])):
            found = OctaveAccumulator(recording, self, few)
            quality = QualityAccumulator(found.channels, found.start, found.stop)
            feed(recording, [found, quality])
            parts.append(found.result(quality.result()))
        return joined_levels(parts)


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
        self._at_work: BandEnergyAccumulator | BandHistoryAccumulator
        if settings.averaging == "linear":
            self._at_work = BandEnergyAccumulator(
                len(self.channels),
                self.sampling_rate,
                self.stop - self.start,
                self._slow_part(),
                weighted=[c.target_unit == "Pa" for c in self.channels],
            )
        else:
            self._at_work = self._history()

    def _history(self) -> BandHistoryAccumulator:
        settings, n = self.settings, self.stop - self.start
        filters = [band_filter(band, settings.weighting) for band in self.bands]
        filters += [weighting_filter(weighting) for weighting in self._overall]
        self._duration = n / self.sampling_rate
        interval = settings.reading_interval(self._duration)
        count = int(self._duration / interval + 1e-9)
        self._times = np.linspace(interval, interval * count, count)
        return BandHistoryAccumulator(
            len(self.channels),
            self.sampling_rate,
            n,
            filters,
            settings.time_constant,
            IMPULSE_DECAY if settings.averaging == "impulse" else None,
            np.append(self._times, self._duration),
            [channel.derivatives for channel in self.channels],
            self._slow_part(),
        )

    def _slow_part(self) -> SlowPart:
        lowest = float(self.bands.lower[0])
        return slow_part(self.recording, self.channels, self.start, self.stop, lowest)

    def add(self, samples: NDArray[np.float64]) -> None:
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
        flags = quality_flags(self.channels, self.recording.flags, quality)
        about = {"label": self.recording.label, "flags": flags, "notes": tuple(self.notes)}
        found = BandResults(self.channels, self.settings, self.sampling_rate, **about)
        if isinstance(self._at_work, BandEnergyAccumulator):
            return found.of_spectrum(self.spectrum(self.settings.fraction))
        with np.errstate(invalid="ignore", over="ignore"):
            histories = self._at_work.result()
        return found.of_histories(histories, self._overall, self._times, self._duration)


def joined_levels(parts: Sequence[BandLevels]) -> BandLevels:
    """The band levels of groups of channels as one result."""
    return joined(
        parts,
        "channels groups units references level_dB overall_dB flags history other percentile_dB percentile_overall_dB",
    )
