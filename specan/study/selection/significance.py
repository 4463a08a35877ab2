"""Probability that a fall in chi-square is chance, whatever the noise is known from; and for the best of many.

Every candidate is one or several unit directions in the space of whitened residuals (one for each
value of its shape parameters). Under the null the score statistic of a direction is the square of a
standard normal variable, and neighbouring directions share most of it. The probability that any of
them exceeds a threshold is bounded along the spanning tree of the largest correlations
(Hunter 1976, J. Appl. Prob. 13:597; Worsley 1982, Biometrika 69:297):

    P(any A_i)  <=  sum_i P(A_i) - sum_(i,j in tree) P(A_i and A_j),

with P(A_j and not A_i) <= (angle_ij / pi) exp(-c^2 / 2) for two-sided events, the expected number of
crossings of the level c on the great circle between two directions (Rice; Davies 1977, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from specan.study.estimation.distributions import noncentral, quantile, tail

LACK_OF_FIT = 1e-3  # probability below which a model is said not to fit
LIKE_INFINITE = 1e5  # degrees of freedom

Array = NDArray[np.float64]


def improvement_probability(
    fall: float,
    amplitudes: float,
    *,
    dispersion: float = 1.0,
    noise_dof: float = math.inf,
    sided: int = 2,
    tolerated: float = 0.0,
) -> float:
    """Probability under the null that q further amplitudes lower chi-square by `fall` or more.

    F = (fall / q) / max(s^2, 1) with q and `noise_dof` degrees of freedom. `sided` = 1 for one
    amplitude that cannot change sign: it lies on the boundary of its domain under the null, and the
    law is the even mixture of chi-square with 0 and 1 degrees (Self & Liang 1987, JASA 82:605).

    Parameters
    ----------
    fall : float
        Chi-square without less chi-square with the amplitudes.
    amplitudes : int
        Number q of amplitudes.
    dispersion : float
        max(s^2, 1), where s^2 is the reduced chi-square that is left.
    noise_dof : float
        Degrees of freedom from which the noise is known: replicates plus residual. The larger of s^2
        and 1 is never below their pooled variance, so that pooling the degrees keeps the level.
    sided : int
        1 or 2.
    tolerated : float
        Chi-square, in units of `dispersion`, that may be there without meaning anything: the law is then
        the noncentral one.

    Examples
    --------
    >>> round(improvement_probability(3.841, 1), 4)
    0.05
    """
    if fall <= 0:
        return 1.0
    value = fall / dispersion / amplitudes
    if tolerated > 0:
        return max(1 - noncentral(value, amplitudes, _known(noise_dof), tolerated), 0.0)
    return tail(value, amplitudes, noise_dof) * (0.5 if sided == 1 and amplitudes == 1 else 1.0)


def _known(noise_dof: float) -> float:
    """Degrees of freedom, infinite where they are as good as that."""
    return math.inf if noise_dof > LIKE_INFINITE else noise_dof


def lack_of_fit_probability(
    chi2: float, dof: float, noise_dof: float = math.inf, tolerated: float = 0.0
) -> float:
    """Probability that a right model leaves a reduced chi-square as large as this.

    `tolerated` as in `improvement_probability`.

    Examples
    --------
    >>> round(lack_of_fit_probability(124.342, 100), 3)
    0.05
    """
    return improvement_probability(chi2, dof, noise_dof=noise_dof, tolerated=tolerated)


def needed_reduction(level: float, amplitudes: int = 1, noise_dof: float = math.inf, sided: int = 2) -> float:
    """Fall in chi-square, in units of max(s^2, 1), at which `improvement_probability` is `level`.

    Examples
    --------
    >>> round(needed_reduction(0.05), 3), round(needed_reduction(0.05, noise_dof=10), 3)
    (3.841, 4.965)
    """
    level = 2 * level if sided == 1 and amplitudes == 1 else level
    return amplitudes * quantile(level, amplitudes, _known(noise_dof))


@cache  # many candidates have as many parameters
def detectable_noncentrality(
    gain: float, amplitudes: int = 1, noise_dof: float = math.inf, power: float = 0.8
) -> float:
    """Chi-square without noise, of which the fall in chi-square exceeds `gain` with probability `power`.

    The fall over max(s^2, 1) has the noncentral law of F; with known noise, that of chi-square, and for one amplitude
    lambda = (sqrt(gain) + z_power)^2 (Saris, Satorra & van der Veld 2009).

    Examples
    --------
    >>> round(detectable_noncentrality(needed_reduction(0.05)), 2)
    7.85
    """
    most = 4 * gain + 20.0

    def missed(noncentrality: float) -> float:
        return noncentral(gain / amplitudes, amplitudes, _known(noise_dof), noncentrality) - (1 - power)

    return 0.0 if missed(0.0) <= 0 else float(brentq(missed, 0.0, most))


@dataclass(frozen=True)
class MultipleTestingFamily:
    """Directions that were tried.

    Attributes
    ----------
    directions : array, (n_rows, n_directions)
        Unit vectors orthogonal to the base model's Jacobian, of candidates with one amplitude.
    one_sided : array of bool, (n_directions,)
        Amplitude that cannot have the other sign.
    subspaces : int
        Number of tests with more than one amplitude; each counts in full.
    """

    directions: Array
    one_sided: NDArray[np.bool_]
    subspaces: int = 0

    def probability(self, p_value: float) -> float:
        """Probability under the null that any member is as improbable as `p_value` or more so.

        Parameters
        ----------
        p_value : float
            Probability of one member alone.

        Returns
        -------
        float
            Bound on the probability of the smallest of all, at most 1.

        Examples
        --------
        Two equal directions count once, two orthogonal ones twice:

        >>> import numpy as np
        >>> same = MultipleTestingFamily(np.array([[1.0, 1.0], [0.0, 0.0]]), np.array([False, False]))
        >>> round(same.probability(0.001), 9)
        0.001
        >>> apart = MultipleTestingFamily(np.eye(2), np.array([False, False]))
        >>> round(apart.probability(0.001), 9)
        0.002
        """
        if not 0 < p_value < 1:
            return float(min(max(p_value, 0.0), 1.0))
        total = self.subspaces * p_value
        if self.directions.shape[1]:
            total += p_value + float(np.sum(np.minimum(p_value, self._crossings(p_value))))
        return min(total, 1.0)

    def _crossings(self, p_value: float) -> Array:
        """Bound on P(A_j and not A_i) for each edge of the tree."""
        angles, sided = self._tree
        # A one-sided event has all its probability on one side, so its level is lower.
        two_sided = 2 * min(p_value, 1 - p_value)
        levels_squared = np.where(sided, quantile(two_sided, 1), quantile(p_value, 1))
        return angles / np.pi * np.exp(-levels_squared / 2) * np.where(sided, 0.5, 1.0)

    @cached_property
    def _tree(self) -> tuple[Array, NDArray[np.bool_]]:
        """Angles along the spanning tree of smallest angles, and which of them join one-sided tests."""
        cosine = self.directions.T @ self.directions
        both = self.one_sided[:, None] & self.one_sided[None, :]
        # Two one-sided tests in opposite directions exclude each other; nothing is shared there.
        cosine = np.clip(np.where(both, cosine, np.abs(cosine)), 0.0, 1.0)
        angle = np.arccos(cosine)
        # A one-sided and a two-sided test have different levels: no crossing bound holds between them.
        angle[self.one_sided[:, None] != self.one_sided[None, :]] = np.pi
        angles, joined = _spanning_tree(angle)
        return angles, both[joined]


def _spanning_tree(length: Array) -> tuple[Array, tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Edges of the shortest tree that joins all points, and the two points of each (Prim 1957).

    Parameters
    ----------
    length : array, shape (n, n)
        Distance between every two points.
    """
    count = len(length)
    nearest, joined_to = length[0].copy(), np.zeros(count, dtype=np.intp)
    nearest[0] = np.nan
    edges, ends = np.empty(count - 1), np.empty(count - 1, dtype=np.intp)
    for k in range(count - 1):
        ends[k] = new = int(np.nanargmin(nearest))
        edges[k], nearest[new] = nearest[new], np.nan
        closer = length[new] < nearest
        nearest[closer], joined_to[closer] = length[new, closer], new
    return edges, (joined_to[ends], ends)


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
