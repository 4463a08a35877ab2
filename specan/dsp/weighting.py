"""Frequency weightings A, B, C and Z as exact curves."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Weighting = Literal["A", "B", "C", "Z"]
WEIGHTINGS: tuple[Weighting, ...] = ("Z", "A", "B", "C")


def _pole_frequencies() -> tuple[float, float, float, float]:
    """f_1 to f_4 in Hz, IEC 61672-1:2013, E.3 and E.4: from the design goals, not rounded."""
    f_r, f_l, f_h, f_a, d = 1000.0, 10.0**1.5, 10.0**3.9, 10.0**2.45, math.sqrt(0.5)
    b = (f_r**2 + f_l**2 * f_h**2 / f_r**2 - d * (f_l**2 + f_h**2)) / (1.0 - d)
    c = f_l**2 * f_h**2
    root = math.sqrt(b * b - 4.0 * c)
    golden = math.sqrt(5.0)
    return (
        math.sqrt((-b - root) / 2.0),
        (3.0 - golden) / 2.0 * f_a,
        (3.0 + golden) / 2.0 * f_a,
        math.sqrt((-b + root) / 2.0),
    )


F_1, F_2, F_3, F_4 = _pole_frequencies()
F_5 = 10.0**2.2
"""The pole that makes C into B: 158.48932 Hz, ANSI S1.4-1983, appendix C (the curve of IEC 60651)."""


ZEROS: dict[Weighting, int] = {"Z": 0, "A": 4, "B": 3, "C": 2}
"""Zeros at 0 Hz."""
_C_POLES = (F_1, F_1, F_4, F_4)
POLES: dict[Weighting, tuple[float, ...]] = {
    "Z": (),
    "A": (*_C_POLES, F_2, F_3),
    "B": (*_C_POLES, F_5),
    "C": _C_POLES,
}
"""Frequencies in Hz, of poles on the negative real axis."""


def power_weighting(frequency: ArrayLike, weighting: Weighting) -> NDArray[np.float64]:
    """Factor on the mean square at each frequency, 1 at 1 kHz.

    ======  =====================================================================  =====================
    C       [f_4^2 f^2 / ((f^2 + f_1^2) (f^2 + f_4^2))]^2                          IEC 61672-1:2013 (E.1)
    A       C x f^4 / ((f^2 + f_2^2) (f^2 + f_3^2))                                IEC 61672-1:2013 (E.6)
    B       C x f^2 / (f^2 + f_5^2)                                                ANSI S1.4-1983, app. C
    Z       1                                                                      IEC 61672-1:2013, 5.5
    ======  =====================================================================  =====================

    The gain that makes each curve 0 dB at 1 kHz is computed, not rounded to 0.001 dB (E.4.2).

    Examples
    --------
    >>> (10 * np.log10(power_weighting([31.62, 1000.0], "A"))).round(2).tolist()
    [-39.44, 0.0]
    """
    f2 = np.square(np.asarray(frequency, dtype=np.float64))
    return np.asarray(_shape(f2, weighting) / _shape(np.asarray(1e6), weighting))


def weighting_level(frequency: ArrayLike, weighting: Weighting) -> NDArray[np.float64]:
    """The same in dB; minus infinity at 0 Hz for A, B and C."""
    with np.errstate(divide="ignore"):
        return 10.0 * np.log10(power_weighting(frequency, weighting))


def complex_weighting(frequency: ArrayLike, weighting: Weighting) -> NDArray[np.complex128]:
    """Complex response of the analogue network, exp(+j w t); its squared magnitude is `power_weighting`.

    Poles at -f_1 (twice) and -f_4 (twice), for A also at -f_2 and -f_3, for B at -f_5; zeros at 0 Hz.
    """
    s = np.asarray(1j * np.asarray(frequency, dtype=np.float64))
    magnitude = math.sqrt(1.0 / float(_shape(np.asarray(1e6), weighting)))
    if weighting == "Z":
        return np.ones_like(s)
    response = np.asarray(magnitude * F_4**2 * np.square(s / ((s + F_1) * (s + F_4))), dtype=np.complex128)
    if weighting == "A":
        return response * np.square(s) / ((s + F_2) * (s + F_3))
    if weighting == "B":
        return response * s / (s + F_5)
    return response


def _shape(f2: NDArray[np.float64], weighting: Weighting) -> NDArray[np.float64]:
    """The curve before it is made 1 at 1 kHz; of the squared frequency."""
    if weighting == "Z":
        return np.ones_like(f2)
    c = np.square(F_4**2 * f2 / ((f2 + F_1**2) * (f2 + F_4**2)))
    if weighting == "A":
        return c * np.square(f2) / ((f2 + F_2**2) * (f2 + F_3**2))
    if weighting == "B":
        return c * f2 / (f2 + F_5**2)
    return c
