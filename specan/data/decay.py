"""Impulse responses, and their decay times and energy ratios in bands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.data.band_levels import all_flags, flag_words
from specan.data.channel import Channel
from specan.data.recording import ArraySource, Recording
from specan.result import RecordingResult, Sheet, cell, counted, explained, picked, records

# Above these a decay is far from a straight line: ISO 3382-2:2008, B.2 and B.3.
NOT_LINEAR_PERMILLE, CURVED_PERCENT = 10.0, 10.0

# Bandwidth times decay time that a band filter reversed in time allows: ISO 3382-1:2009, 7.3.
LEAST_BT = 4.0
MEANINGS = {
    "low-range": "the noise is too high for T20",
    "low-BT": f"bandwidth times decay time is below {LEAST_BT:g}, the band filter itself decays too slowly",
    "not-linear": "the decay is not a straight line (ISO 3382-2:2008, B.2)",
    "curved": "T30 is more than 10 % longer than T20 (ISO 3382-2:2008, B.3)",
}

TIMES = ("edt_s", "t20_s", "u_t20_s", "t30_s", "u_t30_s")
# What every table of decay times holds, in this order.
VALUES = (
    *TIMES, "c50_dB", "c80_dB", "d50_percent", "centre_time_s", "range_dB", "nonlinearity_permille",
    "curvature_percent",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class DecayTimes(RecordingResult):
    """Room acoustic parameters after ISO 3382-1:2009, one row a channel and one column a band.

    Attributes
    ----------
    label : str
    channels, groups : tuple of str
    fraction : int
    exact_hz, nominal_hz, bandwidth_hz : arrays (bands,)
    edt_s, t20_s, t30_s : arrays (channels, bands)
        Early decay time (0 to -10 dB) and reverberation times (-5 to -25, -5 to -35 dB); NaN where the range is short.
    u_t20_s, u_t30_s : arrays (channels, bands)
        Standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1; one position, n = 10).
    range_dB : array (channels, bands)
        Level of the beginning of the decay above the noise.
    nonlinearity_permille : array (channels, bands)
        xi of T30, or of T20 where there is no T30 (ISO 3382-2:2008, B.2).
    c50_dB, c80_dB, d50_percent, centre_time_s : arrays (channels, bands)
        Clarity, definition and centre time (ISO 3382-1:2009, A.2).
    start_s : array (channels,)
        Arrival of the direct sound: where the response first comes within 20 dB of its maximum.
    flags : tuple of tuples of str
        For each channel why it has no result: ``dead``, ``not-finite``, ``short``.
    """

    verb = "decay"
    common = "fraction nominal_hz exact_hz"

    fraction: int
    exact_hz: Real
    nominal_hz: Real
    bandwidth_hz: Real
    edt_s: Real
    t20_s: Real
    t30_s: Real
    u_t20_s: Real
    u_t30_s: Real
    range_dB: Real
    nonlinearity_permille: Real
    c50_dB: Real
    c80_dB: Real
    d50_percent: Real
    centre_time_s: Real
    start_s: Real

    dimensions = ("channel", "nominal_hz")

    @property
    def curvature_percent(self) -> Real:
        """C = 100 (T30 / T20 - 1) (ISO 3382-2:2008, B.3)."""
        return 100.0 * (self.t30_s / self.t20_s - 1.0)

    def band_flags(self, row: int, band: int) -> tuple[str, ...]:
        """What is wrong with a band: the channel's words, or ``low-BT``, ``low-range``, ``not-linear``, ``curved``."""
        best = self.t30_s[row, band] if np.isfinite(self.t30_s[row, band]) else self.t20_s[row, band]
        words = {
            "curved": self.curvature_percent[row, band] > CURVED_PERCENT,
            "low-BT": best * self.bandwidth_hz[band] < LEAST_BT,
            "low-range": not np.isfinite(best),
            "not-linear": self.nonlinearity_permille[row, band] > NOT_LINEAR_PERMILLE,
        }
        return self.flags[row] or tuple(word for word, holds in words.items() if holds)

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, decay times of {counted(len(self.channels), 'channel')} in {self.exact_hz.size} bands of "
            f"1/{self.fraction} octave"
        )

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        return {**picked(self, " ".join(VALUES)), "flags": flag_words(self)}

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        return [
            f"decay times of {self.label}, 1/{self.fraction} octave bands (ISO 3382-1:2009)",
            "u: standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1)",
        ]

    def tables(self) -> Iterable[dict[str, Any]]:
        """The columns, all values to four digits."""
        for table in super().tables():
            bands = {"channel": table.pop("channel"), "band_hz": table.pop("nominal_hz")}
            digits = {
                name: [f"{v:.4g}" if np.isfinite(v) else "" for v in table[name] + 0.0] for name in VALUES
            }
            yield {**bands, **digits, "flags": table["flags"]}

    def sheets(self) -> list[Sheet]:
        """A table a channel, a row a band."""
        forms = {**dict.fromkeys(TIMES, ".3f"), "c80_dB": ".1f", "d50_percent": ".1f", "range_dB": ".0f"}
        header = ["Hz", "EDT s", "T20 s", "u s", "T30 s", "u s", "C80 dB", "D50 %", "range dB", ""]
        found = [
            Sheet(
                f"{self.label}, {name}: 1/{self.fraction} octave bands",
                header,
                [
                    [
                        f"{nominal:g}", *(cell(getattr(self, key)[row, band], form) for key, form in forms.items()),
                        " ".join(self.band_flags(row, band)),
                    ]
                    for band, nominal in enumerate(self.nominal_hz)
                ],
            )
            for row, name in enumerate(self.channels)
        ]  # fmt: skip
        below = (
            "--json and -o hold C50 and the centre time as well.\n"
            "u: standard deviation over positions in a diffuse field (ISO 3382-2:2008, 7.1)."
        ) + explained(MEANINGS, found)
        return [*found[:-1], *(sheet._replace(below=below) for sheet in found[-1:])]

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        return {**picked(self, f"group=groups start_s {' '.join(VALUES)}"), "flags": all_flags(self)}


@dataclass(frozen=True, repr=False)
class ImpulseResponses(RecordingResult):
    """Responses to a unit impulse of the reference, time zero first.

    Attributes
    ----------
    sources : tuple of Channel
        The channels as they were recorded.
    reference, reference_unit : str
    method : {"H1", "deconvolution"}
    sampling_rate : float
    samples : array (channels, n)
        A response convolved with the reference's samples gives the channel's: in unit of the channel over unit
        of the reference, for one sample.
    upper_hz : float
        Up to which frequency the responses hold.
    """

    sources: tuple[Channel, ...]
    reference: str
    reference_unit: str
    method: str
    sampling_rate: float
    samples: Real
    upper_hz: float

    dimensions = ("channel", "time_s")

    @property
    def time_s(self) -> Real:
        """From the reference's impulse on."""
        return np.arange(self.samples.shape[1]) / self.sampling_rate

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, impulse responses of {counted(len(self.channels), 'channel')} to {self.reference}, "
            f"{self.samples.shape[1] / self.sampling_rate:.4g} s ({self.method})"
        )

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        return {"response": self.samples}

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives, with arrays in it."""
        return {
            **picked(self, "reference method"),
            "samples": self.samples.shape[1],
            "sampling_rate_hz": self.sampling_rate,
            "channels": records(name=self.channels, unit=self.units),
            **picked(self, "notes settings"),
        }

    def recording(self) -> Recording:
        """The responses as a recording, to be analysed or exported."""
        kept = "name group unit role shares_name"
        about = {"sampling_rate": self.sampling_rate, "n_samples": self.samples.shape[1]}
        channels = tuple(Channel(**picked(c, kept), **about) for c in self.sources)
        return Recording(self.label, channels, ArraySource(list(self.samples)), notes=self.notes)
