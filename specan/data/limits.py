"""Limits that a spectrum has to keep, and how it keeps them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from specan.arrays import Real
from specan.errors import RequestError


@dataclass(frozen=True)
class Kept:
    """How one channel keeps a limit.

    Attributes
    ----------
    channel : str
    excess_dB : float
        Largest distance beyond a limit; negative where all limits are kept, then the smallest margin.
    place : str
        Band, line or total at which that is.
    compared : int
        Values that were compared with a limit.
    """

    channel: str
    excess_dB: float
    place: str
    compared: int

    @property
    def passed(self) -> bool:
        """Whether no limit is exceeded."""
        return self.excess_dB <= 0.0


@dataclass(frozen=True)
class LimitCurve:
    """Upper and lower limits in dB at frequencies, and for overall levels.

    Attributes
    ----------
    label : str
    frequency_hz : array (n,)
        Rising; of bands their nominal mid-frequencies.
    lower_dB, upper_dB : arrays (n,)
        NaN where there is no limit.
    overall_dB : mapping of str to (lower, upper)
        Of ``total-A`` and so on.
    """

    label: str
    frequency_hz: Real
    lower_dB: Real
    upper_dB: Real
    overall_dB: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def of_bands(
        self, channel: str, nominal_hz: Real, level_dB: Real, overall_dB: Mapping[str, float]
    ) -> Kept:
        """Hold bands against the limits at their nominal frequencies, and overall levels against theirs.

        Raises
        ------
        RequestError
            No band has a limit.

        Examples
        --------
        >>> curve = LimitCurve("a", np.array([500.0, 1000.0]), np.full(2, np.nan), np.array([60.0, 55.0]))
        >>> curve.of_bands("Mic 1", np.array([500.0, 1000.0]), np.array([58.0, 56.5]), {})
        Kept(channel='Mic 1', excess_dB=1.5, place='1000 Hz', compared=2)
        """
        found: list[tuple[float, str]] = []
        for frequency, lower, upper in zip(self.frequency_hz, self.lower_dB, self.upper_dB):
            # Nominal frequencies are rounded to two or three digits, and bands are at least 3 % apart.
            for band in np.flatnonzero(np.abs(nominal_hz / frequency - 1) < 0.01):
                found.append((_excess(level_dB[band], lower, upper), f"{nominal_hz[band]:g} Hz"))
        for name, (lower, upper) in self.overall_dB.items():
            if name in overall_dB:
                found.append((_excess(overall_dB[name], lower, upper), f"total-{name}"))
        return self._worst(channel, found)

    def of_lines(self, channel: str, frequency_hz: Real, level_dB: Real) -> Kept:
        """Hold lines against the limits, which are straight over the logarithm of the frequency between their points.

        Raises
        ------
        RequestError
            No line lies within the range of the limits.
        """
        within = (frequency_hz >= self.frequency_hz[0]) & (frequency_hz <= self.frequency_hz[-1])
        within &= frequency_hz > 0
        f, level = frequency_hz[within], level_dB[within]
        lower, upper = (
            np.interp(np.log(f), np.log(self.frequency_hz), values)
            for values in (self.lower_dB, self.upper_dB)
        )
        excess = np.fmax(level - upper, lower - level)
        held = np.isfinite(excess) | np.isneginf(excess)
        found = []
        if held.any():
            worst = int(np.argmax(np.where(held, excess, -np.inf)))
            found = [(float(excess[worst]), f"{f[worst]:g} Hz")]
        return self._worst(channel, found, int(held.sum()))

    def _worst(self, channel: str, found: list[tuple[float, str]], compared: int | None = None) -> Kept:
        found = [entry for entry in found if not np.isnan(entry[0])]
        if not found:
            raise RequestError(
                f"the limits in {self.label} apply to nothing that {channel} shows",
                expected="frequencies of the bands or lines that are shown",
                remedy="choose another --fraction or range, or correct the limits",
            )
        worst, place = max(found)
        return Kept(channel, float(worst), place, len(found) if compared is None else compared)


def _excess(level: float, lower: float, upper: float) -> float:
    return float(np.fmax(level - upper, lower - level))
