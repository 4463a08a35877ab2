"""What excited a recording, and what a sine says of every channel: levels, phase, distortion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from specan.arrays import Real
from specan.data.levels import rms_level
from specan.result import RecordingResult, Sheet, cell, counted, picked


@dataclass(frozen=True, kw_only=True, repr=False)
class ToneTable(RecordingResult):
    """One tone on several channels; arrays have one entry a channel.

    Attributes
    ----------
    frequency_hz : float
        As measured on `leader`.
    leader : str
        Channel that gave the frequency.
    reference : str or None
        Channel over which phases and magnitudes stand.
    roles, units : tuple of str
    rms : array
        RMS of the whole signal without its mean.
    tone_rms : array
        RMS of the fundamental, corrected as the channel demands (velocity from displacement).
    phase_deg : array
        Of the channel over the reference, exp(+j w t), in (-180, 180]; NaN without a reference.
    u_phase_deg, u_magnitude_percent : arrays
        Combined standard uncertainties of phase and magnitude over the reference.
    u_random_percent : arrays
        The random part, from the noise close to the tone. Twice it is the 95 % interval, however few the blocks: it is
        raised by the factor of Student's distribution.
    degrees_of_freedom : int
        Behind the random part; 0 where the section is too short for one.
    u_common_phase_deg, u_common_percent : arrays
        The part of calibration and delay, which no averaging makes smaller.
    magnitude : array
        Fundamental over that of the reference, in `magnitude_units`.
    harmonics_rms : array (channels, h)
        RMS of fundamental, second harmonic, ... up to half the sampling rate.
    thd_percent : array
        Root of the sum of squares of the harmonics from the second on, over the fundamental.
    noise_rms : array
        What fundamental and harmonics leave.
    mean : array
        Mean of the samples.
    flags : tuple of tuples of str
    stated : bool
        Whether somebody said that it is a sine recording; else it was found in the signal.
    """

    verb = "tones"
    common = "frequency_hz leader reference"

    frequency_hz: float
    leader: str
    reference: str | None
    roles: tuple[str, ...]
    rms: Real
    tone_rms: Real
    phase_deg: Real
    u_phase_deg: Real
    u_magnitude_percent: Real
    u_random_percent: Real
    degrees_of_freedom: int
    u_common_phase_deg: Real
    u_common_percent: Real
    magnitude: Real
    magnitude_units: tuple[str, ...]
    harmonics_rms: Real
    thd_percent: Real
    noise_rms: Real
    mean: Real
    n_blocks: int
    stated: bool = True

    def summary(self) -> str:
        """What it is, on one line."""
        over = f", phases over {self.reference}" if self.reference else ", no reference"
        return f"{self.label}, {self.frequency_hz:.6g} Hz, {counted(len(self.channels), 'channel')}{over}"

    def columns(self) -> dict[str, Any]:
        """One row for each channel, with the names of ``sine.txt``."""
        return {
            **picked(self, "channel=channels role=roles unit=units"),
            "frequency_hz": np.full(len(self.channels), self.frequency_hz),
            **picked(self, "rms level_dB tone_rms phase_deg u_phase_deg magnitude_re_reference=magnitude"),
            **picked(self, "u_magnitude_percent thd_percent noise_rms"),
            "flags": [" ".join(words) for words in self.flags],
        }

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        known = self.columns()
        return {
            **{name: known[name] for name in known if name != "channel"},
            "harmonics_rms": self.harmonics_rms,
        }

    def sheets(self) -> list[Sheet]:
        """The tone on every channel."""
        over = f", phases over {self.reference}" if self.reference else ""
        title = f"{self.label}: {self.frequency_hz:.6g} Hz on {self.leader}{over}"
        shown: dict[str, tuple[Iterable[Any], str]] = {
            "channel": (self.channels, ""),
            "RMS of tone": (self.tone_rms, ".5g"),
            "unit": (self.units, ""),
            "phase deg": (self.phase_deg, ".2f"),
            "u deg": (self.u_phase_deg, ".2g"),
            "THD %": (self.thd_percent, ".3g"),
            "noise RMS": (self.noise_rms, ".3g"),
        }
        columns = [[cell(value, form) for value in values] for values, form in shown.values()]
        return [Sheet(title, list(shown), [list(row) for row in zip(*columns)])]

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        over = f"phases over {self.reference}, exp(+j w t)" if self.reference else "no reference, no phases"
        return [f"tone of {self.label}: {self.frequency_hz:.9g} Hz on {self.leader}", over]

    @property
    def level_dB(self) -> Real:
        """Level of `rms` re the reference of each unit (ISO 1683)."""
        return rms_level(self.rms, self.units)

    @property
    def reference_rms(self) -> float:
        """RMS of the fundamental of the reference; NaN without one."""
        if self.reference is None or self.reference not in self.channels:
            return float("nan")
        return float(self.tone_rms[self.channels.index(self.reference)])


ExcitationKind = Literal["sine", "noise", "sweep", "stepped-sine", "calibrator", "unknown"]


@dataclass(frozen=True)
class Excitation:
    """Kind of excitation and how it was decided.

    Attributes
    ----------
    kind : {"sine", "noise", "sweep", "stepped-sine", "calibrator", "unknown"}
    frequency_hz : float or None
        Frequency of the sine or of the calibrator, where it is known.
    reason : str
        Who said so (user, property, channel), and what contradicts it.
    stated : bool
        Whether somebody said so; else it was found in the signal.
    """

    kind: ExcitationKind
    frequency_hz: float | None
    reason: str
    stated: bool = False
