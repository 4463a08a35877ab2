"""Acceleration, velocity and displacement from each other, in the frequency domain."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]


def derivative_factor(frequency_hz: ArrayLike, times: int) -> NDArray[np.complex128]:
    """Factor (j w)^times on a spectrum of exp(+j w t); zero at frequency zero for integrations.

    Examples
    --------
    >>> derivative_factor(np.array([0.0, 1.0]), 1).round(4).tolist()
    [0j, 6.2832j]
    """
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
    if times >= 0:
        return np.asarray((1j * omega) ** times, dtype=np.complex128)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(omega > 0, (1j * np.where(omega > 0, omega, 1.0)) ** times, 0.0)
