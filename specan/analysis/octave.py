"""Band levels: fractional octaves, frequency weightings, averaging."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from specan.analysis.quality import BLOCK, QualityAccumulator
from specan.analysis.section import of_one_rate, section
from specan.data.band_levels import BandLevels
from specan.data.levels import Quality
from specan.data.recording import Channel, Recording
from specan.dsp import bands
from specan.dsp.band_energy import BandEnergyAccumulator, EnergySpectrum
from specan.dsp.multirate import LOWEST_BAND
from specan.dsp.weighting import WEIGHTINGS, Weighting, power_weighting
from specan.errors import RequestError
from specan.schema import Settings
from specan.units import VELOCITY_50_NM_S, LevelReference, level_reference

Fraction = Literal[1, 3, 6, 12, 24]
AUDIO_RANGE = (20.0, 20000.0)
LINEAR_SETTLING = (
    "filters at rest at the start of the section; all energy at their outputs, ring-out after its end "
    "included, over the length of the section"
)


class Octave(Settings):
    """Settings of a fractional-octave analysis.

    Attributes
    ----------
    fraction : {1, 3, 6, 12, 24}
        1/1 to 1/24 octave.
    weighting : {"A", "B", "C", "Z"}
        Of the band levels. A, B and C are for sound pressure; the overall levels with all of them stand
        beside every spectrum of sound pressure anyway.
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

    Examples
    --------
    >>> from specan.data.recording import ArraySource
    >>> pascals = 0.02 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(48000) / 48000)
    >>> mic = Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=48000.0, n_samples=48000)
    >>> found = Octave(band=1000)(Recording("a.tdms", (mic,), ArraySource([pascals])))
    >>> found.level_db.round(2).tolist(), found.overall_db["A"].round(2).tolist(), found.references[0].text
    ([[60.0]], [60.0], '20 uPa')
    """

    fraction: Fraction = 3
    weighting: Weighting = "Z"
    fmin: float | None = Field(default=None, ge=LOWEST_BAND)
    fmax: float | None = Field(default=None, gt=0.0)
    band: float | None = Field(default=None, ge=LOWEST_BAND)
    channels: tuple[str, ...] = ()
    start_s: float = Field(default=0.0, ge=0.0)
    stop_s: float | None = Field(default=None, gt=0.0)
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s"

    @model_validator(mode="after")
    def _consistent(self) -> Octave:
        if self.band is not None and (self.fmin is not None or self.fmax is not None):
            raise ValueError("either one band or a range from fmin to fmax")
        if self.fmin is not None and self.fmax is not None and self.fmin > self.fmax:
            raise ValueError(f"fmin not above fmax ({self.fmin:g} Hz, {self.fmax:g} Hz)")
        return self

    def accumulator(self, recording: Recording) -> OctaveAccumulator:
        """For a pass over the recording that serves several analyses."""
        return OctaveAccumulator(recording, self)

    def __call__(self, recording: Recording) -> BandLevels:
        """Read the recording once and return the band levels."""
        accumulator = self.accumulator(recording)
        quality = QualityAccumulator(accumulator.channels)
        for samples in recording.blocks(accumulator.channels, BLOCK, accumulator.start, accumulator.stop):
            quality.add(samples)
            accumulator.add(samples)
        return accumulator.result(quality.result())

    def bands(self, sampling_rate: float) -> NDArray[np.int64]:
        """Numbers of the bands; see `specan.dsp.bands`.

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
        index = bands.band_range(min(low, high), high, self.fraction)
        fits = bands.band_edges(index, self.fraction)[1] <= nyquist
        stated = self.band is not None or self.fmax is not None
        if not fits.any() or (stated and not fits[-1]):
            top = bands.band_at(nyquist, self.fraction)
            top -= 0 if float(bands.band_edges(top, self.fraction)[1]) <= nyquist else 1
            raise RequestError(
                f"the 1/{self.fraction} octave band at {high if stated else low:g} Hz reaches above half the "
                f"sampling rate of {sampling_rate:g} Hz",
                expected=f"bands up to {bands.nominal_frequency(top, self.fraction):g} Hz",
                remedy="choose a lower frequency",
            )
        return index[fits]


class OctaveAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Raises
    ------
    RequestError
        The section is empty, a band is too high, or a weighting is asked for what is no sound pressure.
    InputError
        No channel has samples.
    """

    def __init__(self, recording: Recording, settings: Octave) -> None:
        self.recording, self.settings = recording, settings
        self.channels, self.notes = _weightable(recording, settings)
        self.start, self.stop = section(recording, self.channels, settings.start_s, settings.stop_s)
        self.sampling_rate = self.channels[0].sampling_rate
        self.bands = settings.bands(self.sampling_rate)
        self._energy = BandEnergyAccumulator(len(self.channels), self.sampling_rate)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples (channels, m) of `channels`."""
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            self._energy.add(samples)

    def spectrum(self) -> EnergySpectrum:
        """What was added so far, in a form that can be divided into other bands; call it once."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self._energy.result()

    def result(self, quality: Sequence[Quality] | None = None) -> BandLevels:
        """Band levels of what was added; call it once. `quality` gives the channels' flags."""
        return band_levels(
            self.spectrum(),
            self.channels,
            self.settings,
            label=self.recording.label,
            file_flags=self.recording.flags,
            quality=quality,
            notes=self.notes,
        )


def band_levels(
    spectrum: EnergySpectrum,
    channels: Sequence[Channel],
    settings: Octave,
    *,
    label: str = "",
    file_flags: Sequence[str] = (),
    quality: Sequence[Quality] | None = None,
    notes: Sequence[str] = (),
) -> BandLevels:
    """Divide an energy spectrum into bands; no sample is read again.

    Parameters
    ----------
    spectrum : EnergySpectrum
        Linear average over a section; see `OctaveAccumulator.spectrum`.
    channels : sequence of Channel
        In the order of its rows.
    settings : Octave
        The fraction, weighting and range to use.
    """
    index = settings.bands(spectrum.sampling_rate)
    frequencies = spectrum.frequencies
    quantity = _as_quantity(channels, frequencies)
    weights = power_weighting(frequencies, settings.weighting)
    with np.errstate(invalid="ignore"):
        mean_square = spectrum.band_mean_square(
            index, settings.fraction, weights if quantity is None else weights * quantity
        )
        overall = _overall(spectrum, channels, quantity, index, settings.fraction)
    references = tuple(_reference(channel, settings) for channel in channels)
    zero = np.array([reference.value**2 for reference in references])
    lower, upper = bands.band_edges(index, settings.fraction)
    duration = spectrum.n_samples / spectrum.sampling_rate
    return BandLevels(
        label=label,
        channels=tuple(channel.name for channel in channels),
        groups=tuple(channel.group for channel in channels),
        units=tuple(channel.target_unit for channel in channels),
        references=references,
        fraction=settings.fraction,
        weighting=settings.weighting,
        averaging="linear",
        hold=None,
        exact_hz=bands.mid_frequencies(index, settings.fraction),
        nominal_hz=np.array([bands.nominal_frequency(int(k), settings.fraction) for k in index]),
        lower_hz=lower,
        upper_hz=upper,
        level_db=level(mean_square, zero[:, None]),
        u_db=scatter_of_noise(upper - lower, duration),
        overall_db={name: level(values, zero) for name, values in overall.items()},
        start_s=settings.start_s,
        duration_s=duration,
        sampling_rate=spectrum.sampling_rate,
        settling=LINEAR_SETTLING,
        flags=_flags(channels, file_flags, quality),
        notes=tuple(notes),
        settings=settings.model_dump(mode="json"),
    )


def level(mean_square: NDArray[np.float64], zero: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """10 lg(mean square / `zero`) in dB; minus infinity for nothing, NaN for NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10.0 * np.log10(np.asarray(mean_square) / zero)


def scatter_of_noise(bandwidth: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """Standard deviation in dB of the level of stationary Gaussian noise: 4.34 / sqrt(B T).

    The mean square of a band of width B over a time T has B T pairs of degrees of freedom, so its
    relative standard deviation is 1 / sqrt(B T); 10 / ln 10 = 4.34.
    """
    return 10.0 / np.log(10.0) / np.sqrt(bandwidth * duration)


def _weightable(recording: Recording, settings: Octave) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels of one rate, of sound pressure where the weighting asks for it, and notes on the others."""
    chosen, notes = of_one_rate(recording, settings.channels)
    if settings.weighting == "Z":
        return chosen, notes
    pressure = tuple(c for c in chosen if c.target_unit == "Pa")
    other = [c for c in chosen if c.target_unit != "Pa"]
    if not pressure or (settings.channels and other):
        raise RequestError(
            f"{recording.label}: {other[0].name} is in {other[0].target_unit}",
            expected=f"sound pressure in Pa for the {settings.weighting} weighting",
            remedy="choose the microphones, give their sensitivities, or use the Z weighting",
        )
    return pressure, (
        *notes,
        *(f"{c.name} is left out: {settings.weighting} is for Pa, not {c.target_unit}" for c in other),
    )


def _as_quantity(channels: Sequence[Channel], frequencies: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """|j w|^2 or its inverse for channels whose samples have to be differentiated or integrated."""
    if not any(channel.derivatives for channel in channels):
        return None
    return np.stack([np.square(2 * np.pi * frequencies) ** channel.derivatives for channel in channels])


def _overall(
    spectrum: EnergySpectrum,
    channels: Sequence[Channel],
    quantity: NDArray[np.float64] | None,
    index: NDArray[np.int64],
    fraction: int,
) -> dict[str, NDArray[np.float64]]:
    """Mean square of the whole signal, with each weighting."""
    whole = spectrum.alternating_mean_square
    if quantity is not None:
        # Integration makes drift infinite: from the lowest band upwards, for channels that need it.
        above = spectrum.frequencies >= bands.band_edges(index[0], fraction)[0]
        converted = np.add.reduce(spectrum.nodes * quantity * above, axis=1)
        whole = np.where([channel.derivatives != 0 for channel in channels], converted, whole)
    pressure = np.array([channel.target_unit == "Pa" for channel in channels])
    overall = {"Z": whole}
    for name in WEIGHTINGS:
        if name != "Z":
            weighted = spectrum.through(lambda f, name=name: power_weighting(f, name))  # type: ignore[misc]
            overall[name] = np.where(pressure, weighted, np.nan)
    return overall


def _reference(channel: Channel, settings: Octave) -> LevelReference:
    if channel.target_unit == "m/s" and settings.velocity_reference == "50 nm/s":
        return VELOCITY_50_NM_S
    return level_reference(channel.target_unit)


def _flags(
    channels: Sequence[Channel], file_flags: Sequence[str], quality: Sequence[Quality] | None
) -> tuple[tuple[str, ...], ...]:
    found = [()] * len(channels) if quality is None else [q.flags for q in quality]
    return tuple((*words, *file_flags) for words in found)
