"""The evidence of one explanation: how probable the data are under it, its parameters not known beforehand.

At the minimum of an explanation the whitened residual is r and its derivative J. Its parameters are known beforehand to
a width W, and what no equation is exact about adds columns B to the prediction, each with a coefficient of unit
deviation. With X = [B, J W] Laplace's approximation of the marginal likelihood is

    ln Z = -1/2 chi2 - 1/2 ln det(I + X'X)

where chi2 is what is left after one linear step of parameters and coefficients together (MacKay 1992, Neural
Computation 4:415; the coefficients integrate out exactly). Where the size of the noise was estimated from repeats with
nu degrees of freedom, the marginal over that size is a t-distribution: -1/2 (nu + n) ln(1 + chi2/nu) instead of
-1/2 chi2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from specan.study.estimation.linear import held_inside
from specan.study.estimation.problem import Problem
from specan.study.evidence.noise import Autoregression
from specan.study.observation import Array

PULL_STEPS = 3  # linear steps in which the pulls of known ranges settle


@dataclass(frozen=True, eq=False)
class Tangent:
    """A model at some values of its parameters, made linear there.

    Attributes
    ----------
    problem : Problem
    theta : array, shape (p,)
    residual, jacobian : array, shape (n,), (n, p)
        Of the measured rows, whitened.
    noise : Autoregression, optional
        A form of the noise other than the declared one.
    """

    problem: Problem
    theta: Array
    residual: Array
    jacobian: Array
    noise: Autoregression | None = None

    @classmethod
    def at(cls, problem: Problem, theta: Array, residual: Array, jacobian: Array) -> Tangent:
        """From the residual and its derivative with pseudo-measurements, as fits give them."""
        return cls(problem, theta, residual[: problem.n_data], jacobian[: problem.n_data])

    @property
    def chi2(self) -> float:
        """Sum of squares, pulls and priors included."""
        pulls = self.problem.pseudo.residual(self.theta)
        return float(self.residual @ self.residual + pulls @ pulls)

    def with_noise(self, noise: Autoregression | None) -> Tangent:
        """The same under another form of the noise."""
        if noise is None:
            return self
        rows = noise.innovations(np.column_stack([self.residual, self.jacobian]))
        return replace(self, residual=rows[:, 0], jacobian=rows[:, 1:], noise=noise)

    @cached_property
    def widths(self) -> Array:
        """Standard deviation of what is known of each parameter beforehand: of its prior, of a uniform range."""
        pseudo, known = self.problem.pseudo, self.problem.pseudo.ranges
        with np.errstate(invalid="ignore"):
            span = known.high - known.low
        widths = np.empty(pseudo.size)
        widths[pseudo.held] = pseudo.sd
        given = np.isfinite(span) & (span > 0)
        widths[pseudo.ranged] = np.where(given, span, 4 * self.problem.scale[pseudo.ranged]) / np.sqrt(12)
        return widths

    def ln_likelihood(self, chi2: Array | float) -> Array:
        """Of what is left: normal, or of a t-distribution where repeats told the size of the noise.

        Repeats hold their own chi-square, whatever the conditions explain. Something that differs within repeats, as a
        drift, lowers that too: then all degrees of freedom of the repeats tell the size of the noise, those of readings
        within one set-up included.
        """
        nu, pure = self.problem.noise_dof, self.problem.pure_error_dof
        if not np.isfinite(nu):
            return -0.5 * np.asarray(chi2)
        n = max(self.problem.n_effective - pure, 1.0)
        beyond = np.asarray(chi2) - pure
        within = np.maximum(np.minimum(beyond, 0.0) / max(pure, 1.0), -0.999)
        return -0.5 * (nu + n) * np.log1p(np.maximum(beyond, 0.0) / nu) - 0.5 * (pure + n) * np.log1p(within)


class Marginal:
    """What is left of a tangent's residual once parameters and coefficients of columns have taken one linear step.

    Parameters
    ----------
    tangent : Tangent
    columns : array, shape (n, k)
        Over the measured rows, whitened; their coefficients have unit deviation.

    Attributes
    ----------
    chi2 : float
        Pulls of known ranges, priors and coefficients included.
    ln_evidence : float
    """

    def __init__(self, tangent: Tangent, columns: Array | None = None) -> None:
        self.tangent = tangent
        problem, size = tangent.problem, tangent.problem.scale
        columns = np.zeros((tangent.residual.size, 0)) if columns is None else self._seen(columns)
        k = columns.shape[1]
        self._size, self._whole = size, np.hstack([columns, tangent.jacobian * size])
        normal, along = self._whole.T @ self._whole, self._whole.T @ tangent.residual
        ends = problem.bounds()[0] - tangent.theta, problem.bounds()[1] - tangent.theta
        low, high = np.minimum(ends[0] / size, 0.0), np.maximum(ends[1] / size, 0.0)
        step = np.zeros(k + size.size)
        for _ in range(PULL_STEPS):
            theta = tangent.theta + step[k:] * size
            pull = problem.pseudo.jacobian(theta) * size
            matrix, right = normal.copy(), along.copy()
            matrix[:k, :k] += np.eye(k)
            matrix[k:, k:] += pull.T @ pull
            right[k:] += pull.T @ (problem.pseudo.residual(theta) - pull @ step[k:])
            before, step = step, _least(matrix, right, k, low, high)
            if np.allclose(step, before, rtol=1e-3, atol=1e-6):
                break
        pulls = problem.pseudo.residual(tangent.theta + step[k:] * size)
        self.step, self.coefficients = step[k:] * size, step[:k]
        self._left = tangent.residual + self._whole @ step
        self.chi2 = float(self._left @ self._left + pulls @ pulls + step[:k] @ step[:k])
        known = np.concatenate([np.ones(k), size / tangent.widths])
        volume = float(np.linalg.slogdet((normal + np.diag(known**2)) / np.outer(known, known))[1])
        # What rests on an end of its domain does not move when something is added.
        rest = np.concatenate([np.zeros(k, bool), (step[k:] <= low) | (step[k:] >= high)])
        stiff = np.where(rest, 1e12 * np.maximum(np.diag(matrix), 1.0), known**2)
        self._factor = cho_factor(matrix + np.diag(stiff))
        of_noise = 0.0 if tangent.noise is None else tangent.noise.ln_volume + tangent.noise.ln_price
        self.ln_evidence = float(tangent.ln_likelihood(self.chi2)) - 0.5 * volume + of_noise

    def _seen(self, columns: Array) -> Array:
        noise = self.tangent.noise
        return columns if noise is None else noise.innovations(columns)

    def beside(self, columns: Array, sizes: Array) -> tuple[Array, Array]:
        """ln of the evidence with more columns over that without.

        Parameters
        ----------
        columns : array, shape (n, q)
        sizes : array, shape (m,)
            Deviations of the coefficients beforehand, the same for all columns.

        Returns
        -------
        gains : array, shape (m,)
        coefficients : array, shape (m, q)
            The likeliest.
        """
        seen = self._seen(columns)
        along = self._whole.T @ seen
        curvature, turned = np.linalg.eigh(seen.T @ seen - along.T @ cho_solve(self._factor, along))
        curvature = np.maximum(curvature, 0.0)
        slope = turned.T @ (seen.T @ self._left)
        found = -slope / (curvature + 1 / sizes[:, None] ** 2)
        volume = np.sum(np.log1p(sizes[:, None] ** 2 * curvature), axis=1)
        gains = self.tangent.ln_likelihood(self.chi2 + found @ slope) - self.tangent.ln_likelihood(self.chi2)
        return gains - 0.5 * volume, found @ turned.T

    def one_by_one(self, columns: Array, sizes: Array) -> tuple[Array, Array]:
        """What `beside` gives of each column alone; both of shape (m, q)."""
        seen = self._seen(columns)
        along = self._whole.T @ seen
        curvature = np.sum(seen**2, axis=0) - np.sum(along * cho_solve(self._factor, along), axis=0)
        curvature, slope = np.maximum(curvature, 0.0), seen.T @ self._left
        found = -slope / (curvature + 1 / sizes[:, None] ** 2)
        volume = np.log1p(sizes[:, None] ** 2 * curvature)
        gains = self.tangent.ln_likelihood(self.chi2 + found * slope) - self.tangent.ln_likelihood(self.chi2)
        return gains - 0.5 * volume, found

    def curvature(self, column: Array) -> float:
        """Half the second derivative of chi-square by a coefficient of a column, all else free."""
        seen = self._seen(column)
        along = self._whole.T @ seen
        return float(seen @ seen - along @ cho_solve(self._factor, along))

    def shifted(self, columns: Array, coefficients: Array) -> Array:
        """Theta after a linear step beside columns with these coefficients."""
        along = self._whole.T @ (self._seen(columns) @ coefficients)
        more = -cho_solve(self._factor, along)[along.size - self._size.size :] * self._size
        low, high = self.tangent.problem.bounds()
        return np.asarray(np.clip(self.tangent.theta + self.step + more, low, high))


def _least(normal: Array, along: Array, k: int, low: Array, high: Array) -> Array:
    """The x that makes x' normal x + 2 along' x least; elements from the k-th on stay between two ends."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    root = np.linalg.cholesky(normal * np.outer(scale, scale) + 1e-12 * np.eye(scale.size))
    below = solve_triangular(root, along * scale, lower=True)
    found = -solve_triangular(root.T, below) * scale
    if np.all((found[k:] >= low) & (found[k:] <= high)):
        return np.asarray(found)
    # What is free of ends is eliminated first: the triangle's last rows are the problem of the others.
    held = held_inside(root.T[k:, k:] / scale[k:], below[k:], low, high)
    right = below[:k] + root.T[:k, k:] @ (held / scale[k:])
    return np.concatenate([-solve_triangular(root.T[:k, :k], right) * scale[:k], held])
