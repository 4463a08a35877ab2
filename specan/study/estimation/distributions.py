"""Chi-square and F, and which of many tests are significant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special


def tail(value: float, dof: float, noise_dof: float = math.inf) -> float:
    """Probability that chi-square per degree of freedom, over a noise known from `noise_dof` degrees, is larger.

    F with `dof` and `noise_dof` degrees of freedom; chi-square over `dof` where the noise is known.

    Examples
    --------
    >>> round(tail(3.841, 1), 4), round(tail(4.965, 1, 10), 4)
    (0.05, 0.05)
    """
    value = max(value, 0.0)
    if math.isinf(noise_dof):
        return float(special.chdtrc(dof, dof * value))
    return float(special.fdtrc(dof, noise_dof, value))


@cache
def quantile(chance: float, dof: float, noise_dof: float = math.inf) -> float:
    """The value of which `tail` is `chance`.

    Examples
    --------
    >>> round(quantile(0.05, 1), 3), round(quantile(0.05, 1, 10), 3)
    (3.841, 4.965)
    """
    if not 0 < chance < 1:
        return math.inf if chance <= 0 else 0.0
    if math.isinf(noise_dof):
        return float(special.chdtri(dof, chance)) / dof
    # scipy's inverse of F takes the probability below, which is one where that above is small.
    share = float(special.betaincinv(noise_dof / 2, dof / 2, chance))
    return noise_dof * (1 - share) / (dof * share) if share > 0 else math.inf


def discoveries(p_values: Sequence[float], level: float = 0.05) -> NDArray[np.bool_]:
    """Which hypotheses fall at a false discovery rate, whatever the dependence between them.

    The rule of Benjamini and Yekutieli (2001, Annals of Statistics 29:1165). What is not a number is not significant.

    Examples
    --------
    >>> discoveries([1e-6, 0.2, 0.9], 0.05).tolist()
    [True, False, False]
    """
    from scipy.stats import false_discovery_control

    p = np.nan_to_num(np.asarray(p_values, dtype=float), nan=1.0)
    return false_discovery_control(p, method="by") <= level if p.size else np.zeros(0, dtype=bool)
