"""Residuals with everything taken out that the fitted parameters could still absorb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Projection:
    """A fit, linearised: whitened residual and an orthonormal basis of what its parameters can do.

    Attributes
    ----------
    residual : array, (n_rows,)
        Whitened residual, pseudo-data of the priors included.
    basis : array, (n_rows, rank)
        Orthonormal basis of the whitened Jacobian's columns.
    """

    residual: Array
    basis: Array

    @classmethod
    def of(cls, residual: Array, jacobian: Array) -> Projection:
        """Linearise; columns that add nothing to the others are left out of the basis."""
        return cls(residual, orthonormal(jacobian))

    @property
    def rank(self) -> int:
        """Number of parameter combinations that the data determine."""
        return int(self.basis.shape[1])

    def project_out(self, columns: Array) -> Array:
        """Part of a vector, or of each column, that no change of the parameters can produce.

        Examples
        --------
        >>> import numpy as np
        >>> line = np.column_stack([np.ones(3), [-1.0, 0.0, 1.0]])
        >>> Projection.of(np.zeros(3), line).project_out(np.array([0.0, 1.0, 2.0])).round(12) + 0.0
        array([0., 0., 0.])
        """
        return columns - self.basis @ (self.basis.T @ columns)

    def free_chi2(self, shift: Array) -> float:
        """Chi-square that is left of `shift` after a linear refit."""
        rest = self.project_out(shift)
        return float(rest @ rest)


def orthonormal(columns: Array, tolerance: float = 1e-9) -> Array:
    """Orthonormal basis of the span of the columns, each counted at its own scale."""
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 0] / norms[norms > 0]
    if not columns.size:
        return np.zeros((columns.shape[0], 0))
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > tolerance * values[0]])
