"""Limits that a spectrum has to keep, and how it keeps them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
        """Compare bands with the limits at their nominal frequencies, and overall levels with theirs.

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
        ends = np.array([self.overall_dB.get(name, (np.nan, np.nan)) for name in overall_dB]).reshape(-1, 2)
        places = [*(f"{f:g} Hz" for f in nominal_hz), *(f"total-{name}" for name in overall_dB)]
        levels = np.append(level_dB, list(overall_dB.values()))
        limits = np.concatenate([self.at_bands(nominal_hz), ends.T], axis=1)
        return self._worst(channel, places.__getitem__, levels, limits)

    def of_lines(self, channel: str, frequency_hz: Real, level_dB: Real) -> Kept:
        """Compare lines with the limits.

        Raises
        ------
        RequestError
            No line lies within the range of the limits.
        """
        limits = self.at_lines(frequency_hz)
        return self._worst(channel, lambda line: f"{frequency_hz[line]:g} Hz", level_dB, limits)

    def at_bands(self, nominal_hz: Real) -> Real:
        """Lower and upper limits of bands, NaN where there is none."""
        found = np.full((2, nominal_hz.size), np.nan)
        for frequency, *ends in zip(self.frequency_hz, self.lower_dB, self.upper_dB):
            # Nominal frequencies are rounded to two or three digits, and bands are at least 3 % apart.
            found[:, np.abs(nominal_hz / frequency - 1) < 0.01] = np.array(ends)[:, None]
        return found

    def at_lines(self, frequency_hz: Real) -> Real:
        """Lower and upper limits of lines: straight over the logarithm of the frequency between their points."""
        with np.errstate(divide="ignore"):
            x = np.log(frequency_hz)
        return np.array(
            [
                np.interp(x, np.log(self.frequency_hz), ends, left=np.nan, right=np.nan)
                for ends in (self.lower_dB, self.upper_dB)
            ]
        )

    def _worst(self, channel: str, place: Callable[[int], str], level: Real, limits: Real) -> Kept:
        excess = np.fmax(level - limits[1], limits[0] - level)
        compared = int(np.sum(~np.isnan(excess)))
        if not compared:
            raise RequestError(
                f"the limits in {self.label} have no band or line of {channel}",
                expected="frequencies of the bands or lines that are shown",
                remedy="choose another --fraction or range, or correct the limits",
            )
        worst = int(np.nanargmax(excess))
        return Kept(channel, float(excess[worst]), place(worst), compared)
