"""Statistics of levels over time, of lines, and the extremes of parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from specan.arrays import Real


def exceeded(levels: Real, percent: Sequence[float]) -> Real:
    """Level that is exceeded during N percent of the time, L_N of ISO 1996-1.

    Parameters
    ----------
    levels : ndarray, shape (channels, times)
        Readings at equal intervals.
    percent : sequence of float
        N, each between 0 and 100.

    Returns
    -------
    ndarray, shape (len(percent), channels)
        NaN for channels with a reading that is NaN, and where there is no reading.

    Examples
    --------
    >>> exceeded(np.arange(101.0)[None], [10, 50]).tolist()
    [[90.0], [50.0]]
    """
    if not levels.shape[1]:
        return np.full((len(percent), levels.shape[0]), np.nan)
    with np.errstate(invalid="ignore"):  # between two readings of silence there is no number
        found = np.percentile(levels, [100.0 - n for n in percent], axis=1)
    silent = np.isneginf(levels).all(axis=1)
    return np.where(silent, -np.inf, found)


def low_and_high(samples: Real, parts: int) -> tuple[Real, Real]:
    """Lowest and highest finite sample of each of `parts` equal parts; NaN for a part without any.

    Parameters
    ----------
    samples : array (n,)
        At least as many as parts.
    parts : int

    Returns
    -------
    low, high : arrays (parts,)

    Examples
    --------
    >>> low, high = low_and_high(np.array([0.0, 3.0, -1.0, 2.0]), 2)
    >>> low.tolist(), high.tolist()
    ([0.0, -1.0], [3.0, 2.0])
    """
    edges = np.linspace(0, samples.size, parts + 1).astype(int)[:-1]
    return np.fmin.reduceat(samples, edges), np.fmax.reduceat(samples, edges)
