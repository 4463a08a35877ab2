"""What is known of parameters beforehand, as pseudo-measurements: Gaussian priors, and known ranges with soft tails.

A prior of an instrument error is the residual (theta - mean) / sd. Every other parameter has a known range.

A range says where such machines were found; it is knowledge, no law. Inside it every value is as good as
another. Outside, the pull (value - end) / sd is a residual like any other, so that its square is added to
chi-square: sd is a quarter of the range, as for a range of plus and minus two standard deviations (GUM,
JCGM 100:2008, 4.3.5 and 6.3.3). A quantity that is known to be positive is known to that share of itself: below its
range, sd is at most a quarter of the lower end, so that "none at all" is four standard deviations away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array

SHARE = 0.25  # standard deviation of a tail over the range


@dataclass(frozen=True, eq=False)
class KnownRanges:
    """Ranges of several parameters; infinite ends pull nowhere.

    Attributes
    ----------
    low, high : array, shape (n,)
        Ends of the ranges, SI.
    below, above : array, shape (n,)
        Standard deviations of the tails.
    """

    low: Array
    high: Array
    below: Array
    above: Array

    @classmethod
    def of(cls, low: Array, high: Array, size: Array) -> KnownRanges:
        """Ranges with their tails; `size` serves for the width of a range that is open at one end.

        Examples
        --------
        >>> import numpy as np
        >>> known = KnownRanges.of(np.array([0.01, 0.3]), np.array([0.12, 1.5]), np.ones(2))
        >>> known.pulls(np.array([0.175, 0.0])).round(2)
        array([ 2., -4.])
        """
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        width = np.where(np.isfinite(high - low) & (high > low), high - low, size / SHARE)
        floor = np.where(low > 0, np.minimum(low, width), width)
        return cls(low, high, SHARE * floor, SHARE * width)

    def pulls(self, values: Array) -> Array:
        """Standard deviations by which values lie outside, with their sign; zero inside."""
        under, over = np.minimum(values - self.low, 0.0), np.maximum(values - self.high, 0.0)
        return np.asarray(under / self.below + over / self.above, dtype=float)

    def slopes(self, values: Array) -> Array:
        """Derivative of `pulls`."""
        return np.where(values < self.low, 1 / self.below, np.where(values > self.high, 1 / self.above, 0.0))


@dataclass(frozen=True, eq=False)
class PseudoMeasurements:
    """Rows of a residual that follow the data: priors, then known ranges.

    Attributes
    ----------
    held, ranged : array of int
        Elements of theta with a prior, and those with a known range.
    mean, sd : array, shape (n priors,)
        Priors, SI.
    ranges : KnownRanges
    size : int
        Length of theta.
    """

    held: NDArray[np.intp]
    ranged: NDArray[np.intp]
    mean: Array
    sd: Array
    ranges: KnownRanges
    size: int

    def residual(self, theta: Array) -> Array:
        """(theta - mean) / sd of the priors, then the pulls of the known ranges."""
        return np.concatenate([(theta[self.held] - self.mean) / self.sd, self.pulls(theta)])

    def jacobian(self, theta: Array) -> Array:
        """Derivative of `residual`."""
        rows = np.zeros((self.held.size + self.ranged.size, self.size))
        rows[np.arange(self.held.size), self.held] = 1 / self.sd
        rows[self.held.size + np.arange(self.ranged.size), self.ranged] = self.ranges.slopes(
            theta[self.ranged]
        )
        return rows

    def pulls(self, theta: Array) -> Array:
        """Standard deviations by which elements without a prior leave their known ranges."""
        return self.ranges.pulls(theta[self.ranged])
