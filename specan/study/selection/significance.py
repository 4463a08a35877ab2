"""Probability that a misfit is chance, and which of many are not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specan.study.estimation.distributions import tail

LACK_OF_FIT = 1e-3  # probability below which a model is said not to fit


def lack_of_fit_probability(chi2: float, dof: float, noise_dof: float = math.inf) -> float:
    """Probability that a right model leaves a chi-square as large as this.

    (chi2 / dof) / s^2 has the law of F with `dof` and `noise_dof` degrees of freedom, those from which the size s of
    the noise is known.

    Examples
    --------
    >>> round(lack_of_fit_probability(124.342, 100), 3)
    0.05
    """
    return tail(chi2 / dof, dof, noise_dof) if chi2 > 0 else 1.0


def benjamini_yekutieli(p_values: Sequence[float], level: float) -> NDArray[np.bool_]:
    """Which hypotheses fall at a false discovery rate, whatever the dependence between them.

    Examples
    --------
    >>> benjamini_yekutieli([1e-6, 0.2, 0.9], 0.05).tolist()
    [True, False, False]
    """
    p = np.asarray(p_values, dtype=float)
    if not p.size:
        return np.zeros(0, dtype=bool)
    p = np.where(np.isfinite(p), p, 1.0)
    m = p.size
    limit = level / np.sum(1 / np.arange(1, m + 1)) * np.arange(1, m + 1) / m
    ordered = np.sort(p)
    below = np.flatnonzero(ordered <= limit)
    return p <= (ordered[below[-1]] if below.size else -1.0)
