"""Envelope of a band and its kurtosis: what shocks leave in a machine's vibration."""

from __future__ import annotations

import numpy as np

from specan.arrays import Complex, Real
from specan.errors import RequestError


def envelope(samples: Real, sampling_rate: float, low_hz: float, high_hz: float) -> Real:
    """Magnitude of the analytic signal of a band, mean included.

    The band is cut from the spectrum of the whole record with raised-cosine edges a twentieth of it wide.

    Parameters
    ----------
    samples : array (..., n)
    sampling_rate, low_hz, high_hz : float
        The band must end below half the sampling rate.

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> found = envelope((1 + 0.5 * np.cos(2 * np.pi * 7 * t)) * np.cos(2 * np.pi * 1000 * t), 8000.0, 800.0, 1200.0)
    >>> bool(np.abs(found - 1 - 0.5 * np.cos(2 * np.pi * 7 * t)).max() < 1e-9)
    True
    """
    return np.abs(_band(samples, sampling_rate, low_hz, high_hz))


def band_kurtosis(samples: Real, sampling_rate: float, bands_hz: list[tuple[float, float]]) -> Real:
    """Kurtosis of the signal in each band: 3 for gaussian noise, 1.5 for a sine, large for shocks.

    Returns an array (..., bands); NaN where the band holds nothing.

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> band_kurtosis(np.cos(2 * np.pi * 1000 * t), 8000.0, [(800.0, 1200.0)]).round(6).tolist()
    [1.5]
    """
    found = []
    for low, high in bands_hz:
        part = _band(samples, sampling_rate, low, high).real
        power = np.mean(part**2, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found.append(np.where(power > 0, np.mean(part**4, axis=-1) / power**2, np.nan))
    return np.stack(found, axis=-1)


_LOWEST_HZ = 100.0  # from which on the kurtosis of a band is shown


def octaves_below(sampling_rate: float) -> list[tuple[float, float]]:
    """Octaves downwards from 0.4 of the sampling rate, the highest last.

    Examples
    --------
    >>> octaves_below(1000.0)
    [(100.0, 200.0), (200.0, 400.0)]
    """
    found, high = [], 0.4 * sampling_rate
    while high / 2 >= _LOWEST_HZ * (1 - 1e-9):
        found.append((high / 2, high))
        high /= 2
    return found[::-1]


def _band(samples: Real, sampling_rate: float, low_hz: float, high_hz: float) -> Complex:
    if not 0 <= low_hz < high_hz < sampling_rate / 2:
        raise RequestError(
            f"the band from {low_hz:g} to {high_hz:g} Hz cannot be cut at {sampling_rate:g} samples per second",
            expected=f"a band below {sampling_rate / 2:g} Hz",
        )
    n = samples.shape[-1]
    frequency = np.fft.rfftfreq(n, 1.0 / sampling_rate)
    edge = 0.05 * (high_hz - low_hz)
    rise = np.clip((frequency - low_hz + edge / 2) / edge, 0.0, 1.0)
    if low_hz == 0:
        rise = (frequency > 0).astype(float)
    fall = np.clip((high_hz + edge / 2 - frequency) / edge, 0.0, 1.0)
    weight = np.sin(0.5 * np.pi * rise) ** 2 * np.sin(0.5 * np.pi * fall) ** 2
    spectrum = np.zeros((*samples.shape[:-1], n), dtype=complex)
    spectrum[..., : frequency.size] = 2.0 * weight * np.fft.rfft(samples)
    return np.fft.ifft(spectrum)
