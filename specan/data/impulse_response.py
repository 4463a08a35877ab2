"""Impulse responses of channels to a reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import ArraySource, Recording
from specan.result import Result, counted, crossed, full_names


@dataclass(frozen=True, repr=False)
class ImpulseResponses(Result):
    """Responses to a unit impulse of the reference, time zero first.

    Attributes
    ----------
    label : str
        Which recording.
    channels : tuple of Channel
        As they were recorded.
    reference, reference_unit : str
    method : {"H1", "deconvolution"}
    sampling_rate : float
    samples : array (channels, n)
        A response convolved with the reference's samples gives the channel's: in unit of the channel over unit
        of the reference, for one sample.
    upper_hz : float
        Up to which frequency the responses hold.
    notes : tuple of str
    settings : mapping
    """

    label: str
    channels: tuple[Channel, ...]
    reference: str
    reference_unit: str
    method: str
    sampling_rate: float
    samples: NDArray[np.float64]
    upper_hz: float
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    dimensions = ("channel", "time_s")

    @property
    def time_s(self) -> NDArray[np.float64]:
        """From the reference's impulse on."""
        return np.arange(self.samples.shape[1]) / self.sampling_rate

    def summary(self) -> str:
        """What it is, on one line."""
        return (
            f"{self.label}, impulse responses of {counted(len(self.channels), 'channel')} to {self.reference}, "
            f"{self.samples.shape[1] / self.sampling_rate:.4g} s ({self.method})"
        )

    def columns(self) -> dict[str, Any]:
        """One row for each channel and instant."""
        names = full_names([c.name for c in self.channels], [c.group for c in self.channels])
        return {**crossed(channel=names, time_s=self.time_s), "response": self.samples.ravel()}

    def content(self) -> dict[str, Any]:
        """What `to_json` gives, with arrays in it."""
        return {
            "reference": self.reference,
            "method": self.method,
            "samples": self.samples.shape[1],
            "sampling_rate_hz": self.sampling_rate,
            "channels": [{"name": c.name, "unit": c.unit} for c in self.channels],
            "notes": self.notes,
            "settings": self.settings,
        }

    def recording(self) -> Recording:
        """The responses as a recording, to be analysed or exported."""
        n = self.samples.shape[1]
        channels = tuple(
            Channel(c.name, c.group, unit=c.unit, role=c.role, sampling_rate=self.sampling_rate, n_samples=n)
            for c in self.channels
        )
        return Recording(self.label, channels, ArraySource(list(self.samples)), notes=self.notes)
