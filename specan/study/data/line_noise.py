"""Noise of the lines of transfer functions, free of what short records leak (Pintelon and Schoukens)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.study.data.background_noise import Background

Real = NDArray[np.float64]

LEAST_BLOCKS = 4  # below which scatter is no estimate of the noise
ORDER = 3  # of the polynomial
HALF = 5  # lines of the whole record to either side; 11 equations for 8 unknowns


def noise_of_lines(
    recording: Recording,
    reference: Channel,
    channels: Sequence[Channel],
    signals: Any,
    frequency: Any,
    block: int,
    start: int,
    background: Background | None = None,
) -> Any:
    """Random uncertainty of the real part of every line, from the noise that no leakage enlarges.

    ``sigma^2 = G_nn sum w^2 rate / (2 n_eff mean |V_b|^2) / 2`` for each real component.
    """
    from specan.dsp.welch import effective_averages, power_density

    rate = reference.sampling_rate
    responses = (recording.read([channel])[0] for channel in channels)
    density_of_noise = noise_density(signals[0], responses, rate, frequency)
    if background is not None:
        density_of_noise = background.beside(density_of_noise)
    f, density = power_density(signals[0][start:], rate, block)
    blocks = (reference.n_samples - start - block) // (block // 2) + 1
    averages = effective_averages(blocks, "hann", 0.5)
    drive = np.interp(frequency, f, density)
    if len(signals) > 1:
        from scipy.signal import coherence

        drive = drive * np.interp(frequency, *coherence(signals[1], signals[0], rate, "hann", block))
    return np.sqrt(density_of_noise / (2 * averages * drive))


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


def _smooth(density: Real, freedom: float) -> Real:
    """Mean of the logarithm over neighbouring lines, freed of its bias; a peak does not lift its neighbours."""
    from scipy.ndimage import uniform_filter1d
    from scipy.special import digamma

    logarithm = np.log(np.maximum(density, np.finfo(float).tiny))
    bias = float(digamma(freedom)) - np.log(freedom)
    # 15: lines over which the logarithm of the noise is averaged
    smooth: Real = np.exp(
        uniform_filter1d(logarithm, min(15, density.shape[1]), axis=1, mode="nearest") - bias
    )
    return smooth
