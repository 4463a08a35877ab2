"""From values at few lines to those at all: what varies slowly with frequency is computed where it must be only.

Walls, air and the modes above the band change little from line to line. A polynomial through a few well chosen
lines gives them everywhere, as exactly as the solver does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real

COUNTS = (24, 48, 96)  # lines that are tried
SAVING = 3  # times fewer than all: below that the detour does not pay
LOOKED_AT = slice(4, None, 8)  # lines at which it is looked whether what was taken from the few holds
EXACT = 1e-9  # part of the largest value to which a polynomial must meet those that it has not seen


@dataclass(frozen=True, eq=False)
class FrequencyInterpolation:
    """Some lines that stand for all of them.

    Attributes
    ----------
    chosen : array of int (few,)
        Their numbers.
    matrix : array (lines, few)
        From values there to values at all lines.
    series : array (few, few)
        From values there to the coefficients of Chebyshev polynomials over the band.
    middle, half : float
        Middle of the band and half its width, Hz.
    place : array (lines,)
        All lines, from -1 at the lower end of the band to 1 at the upper one.
    """

    chosen: NDArray[np.intp]
    matrix: Real
    series: Real
    middle: float
    half: float
    place: Real

    def everywhere(self, values: Complex) -> Complex:
        """Values (lines, ...) from those at the chosen lines (few, ...)."""
        return mixed(self.matrix, values)

    def meets(self, values: Complex) -> bool:
        """Whether values known at all lines (lines, ...) follow from those at the chosen ones."""
        off = np.max(np.abs(self.everywhere(values[self.chosen]) - values))
        return bool(off <= EXACT * np.max(np.abs(values)))


def mixed(matrix: Real, values: Complex) -> Complex:
    """Product of a real matrix and complex values; as numpy takes it, without BLAS, it takes ten times as long."""
    flat = np.ascontiguousarray(values, dtype=complex).reshape(len(values), -1)
    found: Complex = (matrix @ flat.view(float)).view(complex)
    return found.reshape(-1, *values.shape[1:])


def interpolations(frequency: Real) -> Iterator[FrequencyInterpolation]:
    """Choices of lines of a frequency axis, the fewest first; none where all are few already."""
    frequency = np.asarray(frequency, dtype=float)
    for count in COUNTS:
        if count * SAVING <= len(frequency) and np.ptp(frequency) > 0:
            yield _chosen(frequency.tobytes(), count)


@lru_cache(maxsize=32)
def _chosen(frequency: bytes, count: int) -> FrequencyInterpolation:
    """Lines at which a polynomial is best pinned down: approximate Fekete points (Sommariva & Vianello 2009).

    They are the pivots of a QR decomposition of the Chebyshev polynomials over all lines.
    """
    from scipy.linalg import qr

    f = np.frombuffer(frequency)
    middle, half = float((f.max() + f.min()) / 2), float(np.ptp(f) / 2)
    place = (f - middle) / half
    basis = np.polynomial.chebyshev.chebvander(place, count - 1)
    _, pivots = qr(basis.T, mode="r", pivoting=True)
    chosen = np.sort(pivots[:count])
    matrix = np.linalg.solve(basis[chosen].T, basis.T).T
    return FrequencyInterpolation(chosen, matrix, np.linalg.inv(basis[chosen]), middle, half, place)
