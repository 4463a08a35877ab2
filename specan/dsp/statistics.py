"""Statistics of levels over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def exceeded(levels: NDArray[np.float64], percent: Sequence[float]) -> NDArray[np.float64]:
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
