"""Shock response spectra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.result import RecordingResult, Sheet, counted

Real = NDArray[np.float64]


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
    units: tuple[str, ...]
    positive: Real
    negative: Real
    response: str
    quality: float
    flags: tuple[tuple[str, ...], ...]

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
