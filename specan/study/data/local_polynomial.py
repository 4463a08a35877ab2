"""Noise of a response, free of what short records leak: local polynomials (Pintelon & Schoukens)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

ORDER = 3  # of the polynomial
HALF = 5  # lines of the whole record to either side; 11 equations for 8 unknowns


def noise_density(reference: Real, responses: Iterable[Real], rate: float, frequency_hz: Real) -> Real:
    """One-sided noise density of each response at the given frequencies.

    Around a line the transfer function and the transient that the record's ends leave are polynomials of
    the line's number, ``P_k = G(k) V_k + T(k) + noise``; what a least-squares fit over a few lines of the
    whole record's spectrum leaves is noise. A coherence of short blocks would count the leakage of a lightly
    damped mode as noise too (Pintelon and Schoukens, System Identification, 2nd ed. (2012), ch. 7).

    Parameters
    ----------
    reference : array (n,)
    responses : iterable of array (n,)
        One a channel; taken one at a time, so that a long recording need not be held whole.
    rate : float
        Sampling rate, Hz.
    frequency_hz : array (lines,)

    Returns
    -------
    array (channels, lines)
        Unit of the responses squared per Hz, smoothed over neighbouring lines.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> v, noise = rng.standard_normal((2, 20_000))
    >>> found = noise_density(v, 3 * v[None] + 0.1 * noise, 1000.0, np.arange(20.0, 400.0))
    >>> round(float(found.mean() / (0.01 / 500)), 1)
    1.0
    """
    n = reference.size
    spectrum = np.fft.rfft(reference)
    centre = np.clip(np.round(frequency_hz * n / rate).astype(int), HALF + 1, spectrum.size - HALF - 2)
    number = np.arange(-HALF, HALF + 1)
    powers = (number[:, None] / HALF) ** np.arange(ORDER + 1)
    rows = centre[:, None] + number
    system = np.concatenate(
        [powers * spectrum[rows][..., None], np.broadcast_to(powers, (*rows.shape, ORDER + 1))], -1
    )
    # columns of very different size: the transient is far smaller than the response
    scale = np.linalg.norm(system, axis=1, keepdims=True)
    basis, _ = np.linalg.qr(system / np.where(scale > 0, scale, 1.0))
    picked = np.stack(
        [np.fft.rfft(response)[rows] for response in responses], axis=-1
    )  # (lines, equations, channels)
    left = picked - basis @ (basis.conj().transpose(0, 2, 1) @ picked)
    freedom = rows.shape[1] - system.shape[2]
    density = 2 * np.sum(np.abs(left) ** 2, axis=1).T / (freedom * n * rate)
    return _smooth(density, freedom)


def _smooth(density: Real, freedom: float, width: int = 15) -> Real:
    """Mean of the logarithm over neighbouring lines, freed of its bias; a peak does not lift its neighbours."""
    from scipy.ndimage import uniform_filter1d
    from scipy.special import digamma

    logarithm = np.log(np.maximum(density, np.finfo(float).tiny))
    bias = float(digamma(freedom)) - np.log(freedom)
    smooth: Real = np.exp(
        uniform_filter1d(logarithm, min(width, density.shape[1]), axis=1, mode="nearest") - bias
    )
    return smooth
