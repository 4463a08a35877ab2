"""Spectra, spectrograms and shock response spectra."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from specan.arrays import Flags, Real
from specan.data.levels import level
from specan.data.limits import Kept, LimitCurve
from specan.result import RecordingResult, Sheet, cell, counted, picked
from specan.units import level_reference

Scaling = Literal["amplitude", "rms", "psd"]
SCALINGS: tuple[Scaling, ...] = get_args(Scaling)


@dataclass(frozen=True)
class SpectrumScale:
    """How lines are to be read; shared by spectra and spectrograms.

    Attributes
    ----------
    scaling : {"amplitude", "rms", "psd"}
    window : str
    line_spacing_hz, enbw_hz : float
        Distance of the lines, and the window's equivalent noise bandwidth.
    coherent_gain : float
        Mean of the window; already allowed for.
    weighting : {"A", "B", "C", "Z"}
        Frequency weighting of the magnitudes.
    """

    scaling: Scaling
    window: str
    line_spacing_hz: float
    enbw_hz: float
    coherent_gain: float
    weighting: str = "Z"

    def unit_of(self, unit: str) -> str:
        """Unit of the values of a channel.

        Examples
        --------
        >>> SpectrumScale("psd", "hann", 1.0, 1.5, 0.5).unit_of("m/s")
        '(m/s)^2/Hz'
        """
        if self.scaling != "psd":
            return unit
        return f"({unit})^2/Hz" if "/" in unit or "^" in unit else f"{unit}^2/Hz"

    def level_text(self, unit: str) -> str:
        """What 0 dB is: ``dB re 20 uPa``, ``dB(A) re 20 uPa``; for densities ``dB re (20 uPa)^2/Hz``."""
        base = level_reference(unit).text
        decibels = "dB" if self.weighting == "Z" else f"dB({self.weighting})"
        return f"{decibels} re ({base})^2/Hz" if self.scaling == "psd" else f"{decibels} re {base}"

    def values(self, density: Real, has_mirror: Flags) -> Real:
        """Density, RMS or amplitude of each line.

        The RMS of a line is the root of density times noise bandwidth: right for tones; for noise it goes with
        the bandwidth, and only the density does not. Amplitude is sqrt(2) RMS, except at 0 Hz and rate/2.

        Examples
        --------
        >>> scale = SpectrumScale("amplitude", "hann", 1.0, 1.5, 0.5)
        >>> scale.values(np.array([3.0]), np.array([True])).tolist()
        [3.0]
        """
        if self.scaling == "psd":
            return density
        values = np.asarray(density * self.enbw_hz)
        np.sqrt(values, out=values)
        if self.scaling == "amplitude":
            np.multiply(values, np.sqrt(2.0), out=values, where=has_mirror)
        return values

    def level_dB(self, density: Real, unit: str) -> Real:
        """Level of a density: of the density itself, or of the RMS of a line (also under "amplitude")."""
        base = level_reference(unit).value ** 2
        power = density if self.scaling == "psd" else density * self.enbw_hz
        return level(power, base)


@dataclass(frozen=True, kw_only=True, repr=False)
class _Lines(RecordingResult):
    """What spectra and spectrograms have in common."""

    verb = "fft"
    title: ClassVar[str]

    frequency_hz: Real
    density: Real
    has_mirror: Flags
    scale: SpectrumScale

    @property
    def values(self) -> Real:
        """Amplitude, RMS or density in the form of `density`, as `scale` says."""
        return self.scale.values(self.density, self.has_mirror)

    @property
    def value_units(self) -> tuple[str, ...]:
        """Units of `values`."""
        return tuple(self.scale.unit_of(unit) for unit in self.units)

    @property
    def level_dB(self) -> Real:
        """Levels in the form of `density`; see `SpectrumScale.level_dB`."""
        return np.stack([self.scale.level_dB(row, unit) for row, unit in zip(self.density, self.units)])

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        return {self.scale.scaling: self.values, "level_dB": self.level_dB}

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        scale, named = self.scale, zip(self.channels, self.units)
        return [
            f"{self.title} of {self.label}",
            ", ".join(f"{name} in {scale.unit_of(unit)}, {scale.level_text(unit)}" for name, unit in named),
            f"window {scale.window}: coherent gain {scale.coherent_gain:.6g} (allowed for), noise bandwidth "
            f"{scale.enbw_hz:.6g} Hz",
        ]

    def sheets(self, peaks: int = 1) -> list[Sheet]:
        """The highest lines of every channel, over all times."""
        scale, over_time = self.scale, self.density.ndim == 3
        density = self.density.max(axis=1) if over_time else self.density
        phase, rms = getattr(self, "phase_deg", None), getattr(self, "rms", None)
        rows = []
        for row, (name, unit) in enumerate(zip(self.channels, self.units)):
            values = scale.values(density[row], self.has_mirror)
            for rank, k in enumerate(highest(values, peaks, self.has_mirror)):
                level = float(scale.level_dB(density[row, k : k + 1], unit)[0])
                rows.append(
                    [
                        "" if rank else name,
                        "" if rank or rms is None else f"{rms[row]:.5g} {unit}",
                        f"{self.frequency_hz[k]:.6g}",
                        f"{values[k]:.5g} {scale.unit_of(unit)}",
                        cell(level) if np.isfinite(level) else "",
                        scale.level_text(unit).removeprefix("dB re "),
                        "" if phase is None else f"{phase[row, k]:.2f}",
                    ]
                )
        weighting = "" if scale.weighting == "Z" else f"{scale.weighting} weighting, "
        title = (
            f"{self.label}: {scale.scaling}, {scale.window}, lines {scale.line_spacing_hz:.6g} Hz apart, "
            f"noise bandwidth {scale.enbw_hz:.6g} Hz, {weighting}{self._blocks()}"
        )
        return [Sheet(title, ["channel", "RMS", "peak Hz", scale.scaling, "dB", "re", "phase deg"], rows)]

    def _blocks(self) -> str:
        """What was averaged, in words."""
        raise NotImplementedError

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        scale = self.scale
        return {
            **picked(scale, "scaling weighting"),
            "window": picked(scale, "name=window coherent_gain enbw_hz line_spacing_hz"),
            **picked(self, "frequency_hz notes settings"),
        }

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        return {
            **picked(self, "unit=value_units values level_dB"),
            "level_reference": [self.scale.level_text(unit) for unit in self.units],
        }


@dataclass(frozen=True, repr=False)
class Spectrum(_Lines):
    """Spectra of several channels on common lines.

    Attributes
    ----------
    label : str
    frequency_hz : array (n,)
    channels, units : tuple of str
    density : array (channels, n)
        One-sided mean-square spectral density in unit^2/Hz, whatever the scaling.
    has_mirror : bool array (n,)
        False at 0 Hz and at half the sampling rate.
    scale : SpectrumScale
    averaging : str
        "linear", "exponential", "max", "min", or "none" for a single block.
    n_blocks : int
    n_effective : float
    phase_deg : array (channels, n) or None
        exp(+j w t), in (-180, 180]. Of a single block: of a cosine, time zero at the block's first sample. Of
        an average: over `phase_reference`, from the averaged cross spectrum. None: an average has no
        phase of its own.
    phase_reference : str or None
    rms : array (channels,)
        Root of the density summed over the lines shown.
    flags : tuple of tuples of str
    """

    title = "spectra"

    averaging: str
    n_blocks: int
    n_effective: float
    phase_deg: Real | None
    phase_reference: str | None
    rms: Real

    dimensions = ("channel", "frequency_hz")

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, {self.scale.scaling} of {counted(len(self.channels), 'channel')}, "
            f"{counted(self.frequency_hz.size, 'line')} {self.scale.line_spacing_hz:.4g} Hz apart, "
            f"{self.scale.window}, {counted(self.n_blocks, 'block')}"
        )

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        found = super().values_over()
        return found if self.phase_deg is None else {**found, "phase_deg": self.phase_deg}

    def tables(self) -> Iterable[dict[str, Any]]:
        """The columns; that of the phase is empty where there is none."""
        for table in super().tables():
            yield {**table, "phase_deg": table.get("phase_deg", "")}

    def _blocks(self) -> str:
        return f"{counted(self.n_blocks, 'block')}, averaging {self.averaging}"

    def keeps(self, limits: LimitCurve) -> list[Kept]:
        """How each channel keeps to limits."""
        return [
            limits.of_lines(name, self.frequency_hz, level)
            for name, level in zip(self.channels, self.level_dB, strict=True)
        ]

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        names = "averaging n_blocks n_effective u_dB degrees_of_freedom phase_reference"
        return {**super().facts(), **picked(self, names)}

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        phases = [None] * len(self.channels) if self.phase_deg is None else self.phase_deg
        return {**super().of_channels(), "phase_deg": phases, **picked(self, "rms flags")}

    @property
    def u_dB(self) -> float:
        """Standard uncertainty of a line of noise in dB; of a tone it is less.

        10 / ln 10 times the root of the trigamma function of the effective averages, the standard deviation of the
        logarithm of a chi-square: 4.34 / sqrt(n) dB for many averages, 5.57 dB for one.
        """
        from scipy.special import polygamma

        if not self.n_effective > 0:
            return float("nan")
        return float(10 / np.log(10) * np.sqrt(polygamma(1, self.n_effective)))

    @property
    def degrees_of_freedom(self) -> float:
        """Of the density of a line of noise: two for each effective average."""
        return 2 * self.n_effective


@dataclass(frozen=True, repr=False)
class Spectrogram(_Lines):
    """Spectra against time.

    Attributes
    ----------
    time_s : array (columns,)
        Middle of each column, from the start of the recording.
    density : array (channels, columns, n)
        One-sided mean-square spectral density.
    blocks_per_column : int
    """

    title = "spectrogram"

    time_s: Real
    blocks_per_column: int

    dimensions = ("channel", "time_s", "frequency_hz")

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, {self.scale.scaling} of {counted(len(self.channels), 'channel')}, "
            f"{self.time_s.size} times, {counted(self.frequency_hz.size, 'line')}"
        )

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        return {**super().facts(), **picked(self, "time_s blocks_per_column")}

    def _blocks(self) -> str:
        return f"{counted(len(self.time_s), 'column')} of {counted(self.blocks_per_column, 'block')}"


def highest(values: Real, count: int, has_mirror: Flags | None = None) -> list[int]:
    """Lines of the highest local maxima, highest first; the first line where there is none.

    A line with a mirror has two neighbours. Where one of them is not given, because the range of lines or of
    integration ends there, the line may be the foot of something outside, and is no maximum.

    Examples
    --------
    >>> highest(np.array([0.0, 3.0, 1.0, 2.0, 5.0, 4.0]), 2)
    [4, 1]
    >>> highest(np.array([0.0, 3.0, 1.0, 2.0, 1.0, 4.0]), 2, np.ones(6, bool))
    [3]
    """
    around = np.concatenate([[-np.inf], np.nan_to_num(values, nan=-1.0), [-np.inf]])
    if has_mirror is not None:
        around[0], around[-1] = np.where(has_mirror[[0, -1]], np.inf, -np.inf)
        around[1 : 1 + np.argmax(around[1:] > 0)] = np.inf
    lines = around[1:-1]
    maxima = np.flatnonzero((lines >= around[:-2]) & (lines > around[2:]) & np.isfinite(lines))
    return maxima[np.argsort(-lines[maxima], kind="stable")][:count].tolist() or [0]


@dataclass(frozen=True, repr=False)
class ShockResponse(RecordingResult):
    """Largest responses of oscillators to the acceleration of a channel, over their natural frequency.

    Attributes
    ----------
    frequency_hz : array (n,)
    units : tuple of str
        Of the responses.
    positive, negative : arrays (channels, n)
        Largest response in the direction of a positive acceleration, and in the other one as a magnitude.
    response : str
        ``acceleration``, ``pseudo-velocity`` or ``displacement``.
    quality : float
        Q of the oscillators.
    flags : tuple of tuples of str
    """

    verb = "srs"
    dimensions = ("channel", "frequency_hz")
    over = "maximax positive negative"
    common = "response quality frequency_hz"
    each = f"unit=units {over} flags"

    frequency_hz: Real
    positive: Real
    negative: Real
    response: str
    quality: float

    @property
    def maximax(self) -> Real:
        """The larger one of both."""
        return np.maximum(self.positive, self.negative)

    def summary(self) -> str:
        """What it is, on one line."""
        channels = counted(len(self.channels), "channel")
        return f"{self.label}, shock response ({self.response}, Q {self.quality:g}) of {channels}"

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        units = ", ".join(f"{name} in {unit}" for name, unit in zip(self.channels, self.units, strict=True))
        return [self.summary(), units]

    def sheets(self) -> list[Sheet]:
        """The highest value of each channel."""
        rows = []
        for name, unit, values in zip(self.channels, self.units, self.maximax, strict=True):
            k = int(np.argmax(values))
            rows.append([name, f"{self.frequency_hz[k]:.6g}", f"{values[k]:.5g} {unit}"])
        return [Sheet(self.summary(), ["channel", "peak Hz", "maximax"], rows)]
