"""Family-wise probability: how often the best of many candidates looks this good by chance.

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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
        from scipy.special import ndtri

        angles, sided = self._tree()
        # A one-sided event has all its probability on one side, so its level is lower.
        level = -ndtri(np.where(sided, p_value, p_value / 2))
        return angles / np.pi * np.exp(-(level**2) / 2) * np.where(sided, 0.5, 1.0)

    def _tree(self) -> tuple[Array, NDArray[np.bool_]]:
        """Angles along the spanning tree of smallest angles, and which of them join one-sided tests."""
        from scipy.sparse.csgraph import minimum_spanning_tree

        cosine = self.directions.T @ self.directions
        both = self.one_sided[:, None] & self.one_sided[None, :]
        # Two one-sided tests in opposite directions exclude each other; nothing is shared there.
        cosine = np.clip(np.where(both, cosine, np.abs(cosine)), 0.0, 1.0)
        angle = np.arccos(cosine)
        # A one-sided and a two-sided test have different levels: no crossing bound holds between them.
        angle[self.one_sided[:, None] != self.one_sided[None, :]] = np.pi
        tree = minimum_spanning_tree(angle + 1e-9).tocoo()  # a zero would be no edge
        return np.maximum(tree.data - 1e-9, 0.0), self.one_sided[tree.row] & self.one_sided[tree.col]


def simulated_probability(family: MultipleTestingFamily, p_value: float, draws: int, seed: int = 0) -> float:
    """The same probability by parametric bootstrap of the maximum (one-amplitude members only).

    Draws of whitened noise are projected on all directions at once; the share of draws whose smallest
    p-value lies at or below `p_value` is returned, (k + 1) / (draws + 1).
    """
    from scipy.special import ndtr

    if not family.directions.shape[1]:
        return family.probability(p_value)
    generator = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(family.directions.T @ family.directions)
    keep = values > 1e-10 * values[-1]
    mixing = vectors[:, keep] * np.sqrt(values[keep])
    hits = 0
    for start in range(0, draws, 1000):
        z = generator.standard_normal((min(1000, draws - start), mixing.shape[1])) @ mixing.T
        single = np.where(family.one_sided, ndtr(-z), 2 * ndtr(-np.abs(z)))
        hits += int(np.sum(single.min(axis=1) <= p_value))
    return min((hits + 1) / (draws + 1) + family.subspaces * p_value, 1.0)
