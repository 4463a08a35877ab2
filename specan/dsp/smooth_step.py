"""Steps so smooth that what is cut with them rings for a short time only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def falling_step(x: NDArray[np.float64], last_one: float, first_zero: float) -> NDArray[np.float64]:
    """1 up to `last_one`, 0 from `first_zero`, an error function between (it reaches both to 1e-17).

    The transform of its slope is a Gauss function: a filter with this response has no side lobes.

    Examples
    --------
    >>> falling_step(np.array([0.0, 1.0, 1.5, 2.0]), 1.0, 2.0).round(12).tolist()
    [1.0, 1.0, 0.5, 0.0]
    """
    from scipy.special import erfc

    middle, half = (last_one + first_zero) / 2.0, (first_zero - last_one) / 2.0
    return np.asarray(0.5 * erfc(6.0 * (x - middle) / half))
