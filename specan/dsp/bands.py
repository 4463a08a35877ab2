"""Bands with edges: fractional octaves and critical bands, and the filter that defines a level in a band.

The grid of octaves is that of IEC 61260-1:2014, clause 5, with the base-10 octave ratio; the filter is a Butterworth
band-pass of order 4 (eight poles) whose effective bandwidth equals the width of the band.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.arrays import Complex, Real
from specan.divisions import TABLES

# G, IEC 61260-1:2014, formula (1).
OCTAVE_RATIO = 10.0**0.3

# f_r in Hz, IEC 61260-1:2014, 3.4.
REFERENCE_FREQUENCY = 1000.0

# Order of the Butterworth low-pass prototype.
FILTER_ORDER = 4

# Mantissas of the nominal mid-frequencies of 1/1 and 1/3 octaves, IEC 61260-1:2014, table E.1 (ISO 266, R10).
_PREFERRED = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)


class Band(NamedTuple):
    """One band: geometric middle, edges and name in Hz, and b, for which its edges are G^(1/b) apart."""

    mid: float
    lower: float
    upper: float
    nominal: float
    designator: float


@dataclass(frozen=True)
class Bands:
    """Consecutive bands, ascending.

    Attributes
    ----------
    mid, lower, upper : ndarray, shape (bands,)
        Geometric middles and edges in Hz.
    nominal : ndarray, shape (bands,)
        Nominal mid-frequencies, the names of the bands.
    designator : ndarray, shape (bands,)
        b, for which the edges of a band are G^(1/b) apart.

    Examples
    --------
    >>> thirds = Bands.between(3, 900.0, 1300.0)
    >>> thirds.nominal.tolist(), thirds.upper.round(1).tolist()
    ([1000.0, 1250.0], [1122.0, 1412.5])
    >>> [(band.nominal, band.lower, band.upper) for band in Bands.between("bark", 900.0, 1000.0)]
    [(840.0, 770.0, 920.0), (1000.0, 920.0, 1080.0)]
    """

    mid: Real
    lower: Real
    upper: Real
    nominal: Real
    designator: Real

    @classmethod
    def octaves(cls, fraction: int, index: ArrayLike) -> Bands:
        """Fractional octaves of these numbers; see `mid_frequencies`."""
        numbers = np.atleast_1d(np.asarray(index))
        names = np.array([nominal_frequency(int(k), fraction) for k in numbers])
        widths = np.full(numbers.shape, float(fraction))
        return cls(mid_frequencies(numbers, fraction), *band_edges(numbers, fraction), names, widths)

    @classmethod
    def between(cls, division: int | str, low: float, high: float) -> Bands:
        """The bands from the one that contains `low` to the one that contains `high` (Hz), as far as there are any."""
        if isinstance(division, int):
            return cls.octaves(division, band_range(low, high, division))
        table = TABLES[division]
        lower, upper = np.array(table.edges[:-1]), np.array(table.edges[1:])
        designator = math.log(OCTAVE_RATIO) / np.log(upper / lower)
        every = cls(np.sqrt(lower * upper), lower, upper, np.array(table.middles), designator)
        return every[(upper > low) & (lower <= high)]

    def __len__(self) -> int:
        return self.mid.size

    def __iter__(self) -> Iterator[Band]:
        return (Band(*map(float, row)) for row in zip(*vars(self).values(), strict=True))

    def __getitem__(self, which: Any) -> Bands:
        return Bands(*(each[which] for each in vars(self).values()))


def mid_frequencies(index: ArrayLike, fraction: int) -> Real:
    """Exact mid-band frequencies in Hz.

    f_m = f_r G^(k/b) for an odd fraction b, f_r G^((2k+1)/(2b)) for an even one: IEC 61260-1:2014,
    formulas (2) and (3).

    Parameters
    ----------
    index : array_like of int
        Band numbers k; k = 0 is the band at (odd b) or just above (even b) 1 kHz.
    fraction : int
        Bandwidth designator b: 3 for one-third octaves.

    Examples
    --------
    >>> mid_frequencies([-17, 0, 13], 3).round(2).tolist()
    [19.95, 1000.0, 19952.62]
    >>> mid_frequencies([-1, 0], 6).round(2).tolist()
    [944.06, 1059.25]
    """
    k = np.asarray(index, dtype=np.float64)
    return REFERENCE_FREQUENCY * OCTAVE_RATIO ** (k / fraction + _even_shift(fraction))


def band_edges(index: ArrayLike, fraction: int) -> tuple[Real, Real]:
    """Lower and upper band-edge frequencies f_m G^(-+1/(2b)) in Hz; IEC 61260-1:2014, formulas (4), (5)."""
    mid = mid_frequencies(index, fraction)
    half = OCTAVE_RATIO ** (0.5 / fraction)
    return mid / half, mid * half


def band_at(frequency: float, fraction: int) -> int:
    """Number of the band that contains a frequency; a frequency on an edge belongs to the upper band.

    Examples
    --------
    >>> band_at(20.0, 3), band_at(1000.0, 24)
    (-17, 0)
    """
    place = fraction * math.log(frequency / REFERENCE_FREQUENCY, OCTAVE_RATIO) - fraction * _even_shift(
        fraction
    )
    # An edge as computed may miss itself by a rounding error.
    return math.floor(place + 0.5 + 1e-9)


def band_range(low: float, high: float, fraction: int) -> NDArray[np.int64]:
    """Numbers of the bands from the one that contains `low` to the one that contains `high` (Hz).

    Examples
    --------
    >>> [len(band_range(20.0, 20000.0, b)) for b in (1, 2, 3, 6, 12, 24)]
    [11, 21, 31, 61, 121, 241]
    """
    return np.arange(band_at(low, fraction), band_at(high, fraction) + 1)


def nominal_frequency(index: int, fraction: int) -> float:
    """Nominal mid-band frequency in Hz, the name of a band; IEC 61260-1:2014, annex E.

    1/1 and 1/3 octaves have the preferred numbers of table E.1. In half octaves the exact frequency is rounded to three
    significant digits; from 1/6 to 1/24 octave likewise if the first is 1 to 4, else to two (E.3).

    Examples
    --------
    >>> [nominal_frequency(k, 3) for k in (-15, -12, 5, 13)]
    [31.5, 63.0, 3150.0, 20000.0]
    >>> [nominal_frequency(k, 24) for k in (-111, 75)]
    [41.6, 8800.0]
    """
    if fraction in (1, 3):
        third = int(index) * (3 // fraction)
        return float(f"{_PREFERRED[third % 10]}e{third // 10 + 3}")
    exact = float(mid_frequencies(index, fraction))
    first_digit = int(f"{exact:e}"[0])
    return float(f"{exact:.{2 if first_digit < 5 or fraction == 2 else 1}e}")


def filter_half_width(fraction: float) -> float:
    """Half the natural logarithm of the ratio of the -3 dB frequencies of the band filter.

    A Butterworth band-pass lets (pi/2N) / sin(pi/2N) times its -3 dB width of white noise through (0.112 dB
    for N = 4). The filter is made narrower by that factor, so that its effective bandwidth is the width
    f_2 - f_1 of the band (IEC 61260-1:2014, 5.12 allows +-0.4 dB in class 1).
    """
    angle = math.pi / (2 * FILTER_ORDER)
    reference = math.log(OCTAVE_RATIO) / (2 * fraction)
    return math.asinh(math.sinh(reference) * math.sin(angle) / angle)


def power_response(log_ratio: ArrayLike, fraction: float) -> Real:
    """|H|^2 of the band filter as a function of ln(f / f_m).

    |H|^2 = 1 / (1 + x^(2N)) with x = (f/f_m - f_m/f) / (r - 1/r), r the ratio of the upper -3 dB
    frequency to the mid-frequency: the analogue Butterworth band-pass, without a sampled filter's warping.

    Examples
    --------
    >>> power_response(0.0, 3)
    array(1.)
    """
    x = np.sinh(np.asarray(log_ratio, dtype=np.float64)) / math.sinh(filter_half_width(fraction))
    # sinh overflows far from the band only, where nothing is left of the response.
    return np.asarray(1.0 / (1.0 + np.minimum(np.abs(x), 1e30) ** (2 * FILTER_ORDER)))


def complex_response(ratio: ArrayLike, fraction: float) -> Complex:
    """Complex response of the band filter at f/f_m, whose squared magnitude is `power_response`; exp(+j w t)."""
    with np.errstate(divide="ignore", over="ignore"):
        x = np.sinh(np.log(np.asarray(ratio, dtype=np.float64))) / math.sinh(filter_half_width(fraction))
    x = np.clip(x, -1e30, 1e30)
    order = FILTER_ORDER
    response = np.ones(x.shape, dtype=np.complex128)
    for k in range(order):
        pole = np.exp(1j * math.pi * (2 * k + order + 1) / (2 * order))
        response /= 1j * x - pole
    return response


def _even_shift(fraction: int) -> float:
    return 0.0 if fraction % 2 else 0.5 / fraction


# IEC 61260-1:2014, table 1, class 1. Breakpoints of octave bands are G^x. The maximum holds inside the
# band edges (x = 1/2), the minimum of the stop band outside; inside, the minimum is -0.4 dB.
# Checked against the tables in pyfar 0.8.1 (constants.fractional_octave_filter_tolerance).
_PASS_MAXIMUM = np.array([0.4, 0.5, 0.7, 1.4, 5.3])
_PASS_MINIMUM = -0.4
_STOP_MINIMUM = np.array([1.2, 16.6, 40.5, 60.0, 70.0])

# Exponents x of the octave-band breakpoints G^x.
BREAKPOINTS = (0.0, 1 / 8, 1 / 4, 3 / 8, 1 / 2, 1.0, 2.0, 3.0, 4.0)


def breakpoint_ratio(exponent: ArrayLike, fraction: int) -> Real:
    """Ratio f/f_m >= 1 of a 1/b octave band that stands for G^x of an octave band.

    Omega_b = 1 + (G^(1/(2b)) - 1) / (G^(1/2) - 1) (G^x - 1): IEC 61260-1:2014, formula (9). Below the
    mid-frequency it is the inverse, formula (10).

    Examples
    --------
    >>> breakpoint_ratio([1 / 8, 1.0, 4.0], 3).round(5).tolist()
    [1.02667, 1.29437, 5.39195]
    """
    scale = (OCTAVE_RATIO ** (0.5 / fraction) - 1.0) / (OCTAVE_RATIO**0.5 - 1.0)
    return np.asarray(1.0 + scale * (OCTAVE_RATIO ** np.asarray(exponent, dtype=np.float64) - 1.0))


def class_1_limits(ratio: ArrayLike, fraction: int) -> tuple[Real, Real]:
    """Smallest and largest relative attenuation in dB at f/f_m; IEC 61260-1:2014, 5.10 and table 1.

    Between breakpoints the limits are linear in lg(f/f_m), formulas (11) and (12). On an edge both sets
    of limits hold: at least 1.2 dB, at most 5.3 dB.

    Examples
    --------
    >>> [limit.round(4).tolist() for limit in class_1_limits([1.0, 10.0], 1)]
    [[-0.4, 63.3333], [0.4, inf]]
    """
    log_ratio = np.abs(np.log(np.asarray(ratio, dtype=np.float64)))
    edge = np.log(OCTAVE_RATIO) / (2 * fraction)
    slack = 1e-9  # a frequency computed to be an edge is one
    breakpoints = np.log(breakpoint_ratio(BREAKPOINTS, fraction))
    stop = np.interp(log_ratio, breakpoints[4:], _STOP_MINIMUM)
    passed = np.interp(log_ratio, breakpoints[:5], _PASS_MAXIMUM)
    minimum = np.where(log_ratio >= edge - slack, stop, _PASS_MINIMUM)
    maximum = np.where(log_ratio <= edge + slack, passed, np.inf)
    return minimum, maximum
