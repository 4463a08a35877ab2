"""Acceptance limits of band filters, class 1: what a filter's attenuation has to lie between."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.dsp.bands import OCTAVE_RATIO

# IEC 61260-1:2014, table 1, class 1. Breakpoints of octave bands are G^x. The maximum holds inside the
# band edges (x = 1/2), the minimum of the stop band outside; inside, the minimum is -0.4 dB.
# Checked against the tables in pyfar 0.8.1 (constants.fractional_octave_filter_tolerance).
_PASS_X = np.array([0.0, 1 / 8, 1 / 4, 3 / 8, 1 / 2])
_PASS_MAXIMUM = np.array([0.4, 0.5, 0.7, 1.4, 5.3])
_PASS_MINIMUM = -0.4
_STOP_X = np.array([1 / 2, 1.0, 2.0, 3.0, 4.0])
_STOP_MINIMUM = np.array([1.2, 16.6, 40.5, 60.0, 70.0])

BREAKPOINTS = (0.0, 1 / 8, 1 / 4, 3 / 8, 1 / 2, 1.0, 2.0, 3.0, 4.0)
"""Exponents x of the octave-band breakpoints G^x."""


def breakpoint_ratio(exponent: ArrayLike, fraction: int) -> NDArray[np.float64]:
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


def class_1_limits(ratio: ArrayLike, fraction: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
    stop = np.interp(log_ratio, np.log(breakpoint_ratio(_STOP_X, fraction)), _STOP_MINIMUM)
    passed = np.interp(log_ratio, np.log(breakpoint_ratio(_PASS_X, fraction)), _PASS_MAXIMUM)
    minimum = np.where(log_ratio >= edge - slack, stop, _PASS_MINIMUM)
    maximum = np.where(log_ratio <= edge + slack, passed, np.inf)
    return minimum, maximum
