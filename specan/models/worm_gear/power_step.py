"""A power law measured from its reference: how much it changes there is one number, its exponent another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SMALL = 1e-9  # exponents below it are the logarithm to many digits


def power_step(ratio: ArrayLike, exponent: ArrayLike) -> NDArray[np.float64]:
    """``(x^a - 1) / (2^a - 1)``: 0 at x = 1, 1 at x = 2, and the binary logarithm for a = 0.

    Adding a multiple c of it to a coefficient mu_0 gives the power law mu_0 x^a where c = mu_0 (2^a - 1); unlike
    a factor x^a it stays visible where mu_0 vanishes, and c enters linearly.

    Examples
    --------
    >>> power_step([1.0, 2.0, 4.0], 0.0)
    array([0., 1., 2.])
    >>> power_step([1.0, 2.0, 4.0], 1.0)
    array([0., 1., 3.])
    """
    a = np.asarray(exponent, dtype=float)
    a = np.where(np.abs(a) < SMALL, SMALL, a)
    step: NDArray[np.float64] = np.expm1(a * np.log(ratio)) / np.expm1(a * np.log(2.0))
    return step
