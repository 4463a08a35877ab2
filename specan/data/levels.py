"""What a signal is before any spectrum: its quality, and its single-number levels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from specan.arrays import Real
from specan.result import RecordingResult, Sheet, cell, counted, picked
from specan.units import LevelReference, level_reference


def level(mean_square: Real, zero: Real | float) -> Real:
    """10 lg(mean square / `zero`) in dB; minus infinity for nothing, NaN for NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 10.0 * np.log10(np.asarray(mean_square) / zero)


def decibels(amplitude: ArrayLike) -> Real:
    """20 lg of a magnitude; minus infinity for nothing, NaN for NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(np.abs(amplitude)))


def rms_level(rms: ArrayLike, units: Sequence[str]) -> Real:
    """Levels of RMS values, (channels, ...), re the references of the channels' units."""
    references = np.array([level_reference(unit).value for unit in units])
    return decibels((np.asarray(rms).T / references).T)


@dataclass(frozen=True)
class Quality:
    """What the samples of one channel say about their own usability.

    Attributes
    ----------
    minimum, maximum : float
        Of the finite samples; NaN where there is none.
    clipped : bool
        Whether the signal rests on one of them.
    not_finite : bool
        Whether there are samples that are not finite, or too large to be squared.
    """

    minimum: float
    maximum: float
    clipped: bool
    not_finite: bool

    @property
    def flags(self) -> tuple[str, ...]:
        """Words for the result tables, in alphabetical order."""
        words = {
            "clipped": self.clipped,
            "dead": not self.not_finite and self.minimum == self.maximum,
            "nan": self.not_finite,
        }
        return tuple(word for word, holds in words.items() if holds)


@dataclass(frozen=True, repr=False)
class SignalLevels(RecordingResult):
    """Single-number values of several channels of one recording.

    Everything but `mean`, `minimum` and `maximum` is of the signal about its mean, the alternating part.

    Attributes
    ----------
    references : tuple of LevelReference
        What 0 dB is, for each channel.
    mean, minimum, maximum : arrays (channels,)
    rms : array (channels,)
    equivalent_dB : mapping of str to array (channels,)
        Equivalent levels over the section with the weightings "Z", "A", "B", "C"; A, B and C of sound
        pressure only (NaN otherwise).
    c_peak_dB : array (channels,)
        C-weighted peak sound level (IEC 61672-1:2013, 3.11); of sound pressure only (NaN otherwise).
    weighting, averaging : str
        Of the time-weighted level that the next three are about ("A", "fast").
    percentile_dB : mapping of float to array (channels,)
        Level exceeded during N percent of the time.
    max_dB, min_dB : arrays (channels,)
        Largest time-weighted level, and smallest one after it has settled.
    start_s, duration_s : float
    sampling_rate : float
    settling : str
        How the percentiles were taken, in a sentence.
    """

    verb = "rms"
    common = "start_s duration_s sampling_rate_hz=sampling_rate settling"

    references: tuple[LevelReference, ...]
    mean: Real
    minimum: Real
    maximum: Real
    rms: Real
    equivalent_dB: Mapping[str, Real]
    c_peak_dB: Real
    weighting: str
    averaging: str
    percentile_dB: Mapping[float, Real]
    max_dB: Real
    min_dB: Real
    start_s: float
    duration_s: float
    sampling_rate: float
    settling: str

    @property
    def peak(self) -> Real:
        """Largest magnitude about the mean."""
        return np.maximum(self.maximum - self.mean, self.mean - self.minimum)

    @property
    def crest_factor(self) -> Real:
        """Peak / rms; NaN where there is no signal."""
        return self.peak / np.where(self.rms > 0, self.rms, np.nan)

    @property
    def level_dB(self) -> Real:
        """20 lg(rms / reference)."""
        return level(np.square(self.rms), self.zero)

    @property
    def peak_dB(self) -> Real:
        """20 lg(peak / reference)."""
        return level(np.square(self.peak), self.zero)

    @property
    def exposure_dB(self) -> dict[str, Real]:
        """Exposure levels, re the reference squared times 1 s (IEC 61672-1:2013, 3.15)."""
        return {w: values + 10.0 * np.log10(self.duration_s) for w, values in self.equivalent_dB.items()}

    @property
    def zero(self) -> Real:
        """Mean squares that are 0 dB."""
        return np.array([reference.value**2 for reference in self.references])

    def summary(self) -> str:
        """What it is, on one line."""
        stop = self.start_s + self.duration_s
        return f"{self.label}, {counted(len(self.channels), 'channel')}, {self.start_s:g} s to {stop:g} s"

    def columns(self) -> dict[str, Any]:
        """One row for each channel, as ``specan rms -o`` writes it."""
        return {
            **picked(self, "channel=channels group=groups unit=units"),
            **picked(self, "rms peak crest_factor mean minimum maximum"),
            "level_reference": [reference.text for reference in self.references],
            **picked(self, "level_dB peak_dB C_peak_dB=c_peak_dB"),
            **{f"Leq_{weighting}_dB": values for weighting, values in self.equivalent_dB.items()},
            **{f"LE_{weighting}_dB": values for weighting, values in self.exposure_dB.items()},
            **picked(self, "max_dB min_dB"),
            **{f"L{n:g}_dB": values for n, values in self.percentile_dB.items()},
            "flags": [" ".join(words) for words in self.flags],
        }

    @property
    def weighted(self) -> str:
        """What is said of the weighting, where a channel is a sound pressure."""
        return f", sound pressure {self.weighting}-weighted" if "Pa" in self.units else ""

    def sheets(self) -> list[Sheet]:
        """The signal, its levels, and their percentiles."""
        letter, stop = {"fast": "F", "slow": "S"}[self.averaging], self.start_s + self.duration_s
        exposure = "LE: exposure level; " if "Pa" in self.units else ""
        weighted = f"the {self.averaging} level{self.weighted}"

        def sheet(title: str, columns: Mapping[str, Iterable[Any]], form: str) -> Sheet:
            """The columns that hold something: weighted levels are of sound pressure only."""
            named = {"channel": self.channels, **columns}
            texts = {name: [cell(v, form) for v in values] for name, values in named.items()}
            shown = {name: column for name, column in texts.items() if any(column)}
            return Sheet(title, list(shown), [list(row) for row in zip(*shown.values())])

        signal: dict[str, Iterable[Any]] = {
            "unit": self.units, "RMS": self.rms, "peak": self.peak,
            "crest": map(cell, self.crest_factor), "mean": [cell(v, ".4g") for v in self.mean],
        }  # fmt: skip
        re = [r.text for r in self.references]
        one = f", dB re {re[0]}" if len(set(re)) == 1 else ""
        levels: dict[str, Iterable[Any]] = {
            "dB re": [] if one else re, "level": self.level_dB, "Leq A": self.equivalent_dB["A"],
            "LE A": self.exposure_dB["A"], "C peak": self.c_peak_dB, f"{letter} max": self.max_dB,
            f"{letter} min": self.min_dB,
        }  # fmt: skip
        percentiles = {f"L{n:g}": values for n, values in self.percentile_dB.items()}
        found = [
            sheet(f"{self.label}: {self.start_s:g} s to {stop:g} s, about the mean", signal, ".5g"),
            sheet(f"Levels{one}; {exposure}{letter} max, min: of {weighted}", levels, ".2f"),
            sheet(f"Percentiles of {weighted}: LN is exceeded during N % of the time", percentiles, ".1f"),
        ]
        return [one for one in found if len(one.header) > 1]

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        return [
            f"levels of {self.label}, {self.start_s:g} s to {self.start_s + self.duration_s:g} s, about the mean",
            f"max, min and L of the {self.averaging} level{self.weighted}",
            f"settling: {self.settling}",
        ]

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        time_weighted = {
            "weighting": [self.weighting if unit == "Pa" else "Z" for unit in self.units],
            "averaging": [self.averaging] * len(self.units),
            **picked(self, "max=max_dB min=min_dB exceeded=percentile_dB"),
        }
        return {
            **picked(self, "group=groups unit=units"),
            "level_reference": [reference.text for reference in self.references],
            **picked(self, "rms level_dB peak peak_dB C_peak_dB=c_peak_dB crest_factor mean minimum maximum"),
            **picked(self, "equivalent_dB exposure_dB"),
            "time_weighted_dB": time_weighted,
            "flags": self.flags,
        }
