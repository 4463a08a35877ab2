"""Steps so smooth that what is cut with them rings for a short time only."""

from __future__ import annotations

import math

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
    middle, half = (last_one + first_zero) / 2.0, (first_zero - last_one) / 2.0
    place = 6.0 * (x - middle) / half
    # Beyond these places the complementary error function is 2 and 0 to the last bit.
    result = np.where(place < 0.0, 2.0, 0.0)
    inside = (place > -6.5) & (place < 28.0)
    result[inside] = [math.erfc(v) for v in place[inside].tolist()]
    return np.asarray(0.5 * result)
