"""Acceleration, velocity and displacement from each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.errors import RequestError

Real = NDArray[np.float64]

MOTION = {"m": 0, "m/s": 1, "m/s^2": 2}
"""Differentiations of a displacement that lead to a quantity of this unit."""

QUANTITIES = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}


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


def differentiate(samples: Real, sampling_rate: float, times: int = 1, *, low_hz: float = 0.0) -> Real:
    """Differentiate (`times` > 0) or integrate (`times` < 0) a record in the frequency domain.

    Integration raises what is slow: the mean is left out, and with `low_hz` all below it, with a raised-cosine edge
    from half of `low_hz` up. The record's two ends are taken for neighbours: where its slow parts differ there, the
    first and last periods of `low_hz` are not to be trusted.

    Parameters
    ----------
    samples : array (..., n)
    sampling_rate : float
        In Hz.
    times : int
        1: velocity from displacement; -2: displacement from acceleration.
    low_hz : float
        Lowest frequency kept.

    Raises
    ------
    RequestError
        An integration without a lowest frequency.

    Examples
    --------
    >>> t = np.arange(4000) / 4000
    >>> velocity = differentiate(np.cos(2 * np.pi * 50 * t), 4000.0, -1, low_hz=10.0)
    >>> bool(np.allclose(velocity, np.sin(2 * np.pi * 50 * t) / (2 * np.pi * 50), atol=1e-12))
    True
    """
    if times < 0 and not low_hz > 0:
        raise RequestError(
            "an integration raises what is slow without end", remedy="give the lowest frequency wanted"
        )
    n = samples.shape[-1]
    frequency = np.fft.rfftfreq(n, 1.0 / sampling_rate)
    factor = derivative_factor(frequency, times)
    if low_hz > 0:
        factor = factor * np.sin(0.5 * np.pi * np.clip(2 * frequency / low_hz - 1, 0.0, 1.0)) ** 2
    spectrum = np.fft.rfft(samples) * factor
    if n % 2 == 0 and times % 2:
        spectrum[..., -1] = 0.0  # the derivative of a cosine at half the sampling rate has no samples
    return np.fft.irfft(spectrum, n)
