"""The inverse root of a correlation matrix in which some rows are alike, as repeats of a condition are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array


class InverseRoot:
    """C^(-1/2) for a correlation matrix C, the symmetric one.

    Rows i, j are alike where C_ik = C_jk for every other row k, and C_ij is the same for all pairs of a set. With S,
    whose columns are the indicators of the sets over the root of their sizes m, C is S A S' on their span, A = S' C S,
    and 1 - C_ij on the contrasts of each set. So its root is S A^(-1/2) S' and a number for each contrast: of m
    repeats of each row an eighth of the work for m = 2, a quarter of the numbers to multiply with.

    Parameters
    ----------
    correlation : array, shape (n, n)
    sets : array of int, shape (n,)
        Rows that may be alike share a number; those that are not alike after all are taken one by one.

    Attributes
    ----------
    least : float
        Least eigenvalue of C.
    """

    def __init__(self, correlation: Array, sets: NDArray[np.intp]) -> None:
        _, self._set, counts = np.unique(_alike(correlation, sets), return_inverse=True, return_counts=True)
        self._order = np.argsort(self._set, kind="stable")
        self._starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self._share = (1 / np.sqrt(counts))[self._set]
        self._single = bool(np.all(counts == 1))
        values, vectors = np.linalg.eigh(self._together(self._together(correlation).T))
        first, second = self._order[self._starts], self._order[self._starts + (counts > 1)]
        contrasts = np.where(counts > 1, 1 - correlation[first, second], 1.0)
        self.least = float(min(values[0], contrasts.min()))
        if self.least > 0:
            self._root = (vectors / np.sqrt(values)) @ vectors.T
            self._of_contrast = (1 / np.sqrt(contrasts))[self._set]

    def __call__(self, array: Array) -> Array:
        """The root on an array, shape (n,) or (n, k)."""
        if self._single:
            return np.asarray(self._root @ array)
        shape = (-1,) + (1,) * (array.ndim - 1)
        share = self._share.reshape(shape)
        common = self._together(array)
        apart = (array - share * common[self._set]) * self._of_contrast.reshape(shape)
        return np.asarray(share * (self._root @ common)[self._set] + apart)

    def _together(self, array: Array) -> Array:
        """S' on an array."""
        if self._single:
            return array
        share = self._share.reshape((-1,) + (1,) * (array.ndim - 1))
        return np.asarray(np.add.reduceat((share * array)[self._order], self._starts, axis=0))


def _alike(correlation: Array, sets: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of the set of each row; a row in a set that is not of alike ones gets its own."""
    own = np.arange(sets.size)
    _, first, index = np.unique(sets, return_index=True, return_inverse=True)
    if first.size == sets.size:
        return own
    same = sets[:, None] == sets
    inside = np.where(same & (own[:, None] != own), correlation, np.nan)
    unlike = np.any(~same & (correlation != correlation[first[index]]), axis=1)
    with np.errstate(invalid="ignore"):
        low, high = np.fmin.reduce(inside, axis=1), np.fmax.reduce(inside, axis=1)
    unlike |= (low != high) & ~np.isnan(low)
    unlike |= low != low[first[index]]
    spoiled = np.bincount(index, unlike) > 0
    return np.where(spoiled[index], first.size + own, index)
