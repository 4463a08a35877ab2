"""Long signals as the lowest and highest sample of each part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


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
