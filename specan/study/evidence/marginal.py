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

from specan.study.estimation.linear import held_inside
from specan.study.estimation.problem import Problem
from specan.study.evidence.noise import Noise
from specan.study.observation import Array

# Shares of what an effect changes, to which its equation may be wrong: as likely each.
FORMS = (0.01, 0.03, 0.1, 0.3)
AT_END = 1e-6  # sizes of a parameter, within which it rests on an end of its domain: what rounding leaves


@dataclass(frozen=True, eq=False)
class Tangent:
    """A model at some values of its parameters, made linear there.

    Attributes
    ----------
    problem : Problem
    theta : array, shape (p,)
    residual, jacobian : array, shape (n,), (n, p)
        Of the measured rows, whitened.
    noises : tuple of Noise
        Forms of the noise beside the declared one, each upon the rows that those before it leave.
    ln_volume : float
        -1/2 ln det of the covariance that these forms change.
    """

    problem: Problem
    theta: Array
    residual: Array
    jacobian: Array
    noises: tuple[Noise, ...] = ()
    ln_volume: float = 0.0

    @classmethod
    def at(cls, problem: Problem, theta: Array, residual: Array, jacobian: Array) -> Tangent:
        """From the residual and its derivative with pseudo-measurements, as fits give them."""
        n = problem.n_data
        return cls(problem, theta, residual[:n], jacobian[:n])

    def with_pseudo_rows(self, problem: Problem) -> tuple[Array, Array]:
        """Residual and Jacobian with the pseudo-measurements of a problem, as fits have them."""
        pseudo = problem.pseudo
        return (
            np.concatenate([self.residual, pseudo.residual(self.theta)]),
            np.concatenate([self.jacobian, pseudo.jacobian(self.theta)]),
        )

    @property
    def chi2(self) -> float:
        """Sum of squares, pulls and priors included."""
        pulls = self.problem.pseudo.residual(self.theta)
        return float(self.residual @ self.residual + pulls @ pulls)

    def with_noise(self, noise: Noise | None) -> Tangent:
        """The same under a further form of the noise."""
        if noise is None:
            return self
        rows = noise.innovations(np.column_stack([self.residual, self.jacobian]))
        return replace(
            self,
            residual=rows[:, 0],
            jacobian=rows[:, 1:],
            noises=(*self.noises, noise),
            ln_volume=self.ln_volume + noise.ln_volume,
        )

    def seen(self, columns: Array) -> Array:
        """Whitened columns under its forms of the noise."""
        for noise in self.noises if columns.size else ():
            columns = noise.innovations(columns)
        return columns

    @cached_property
    def widths(self) -> Array:
        """Standard deviation of what is known of each parameter beforehand: of its prior, of a uniform range."""
        known = self.problem.pseudo
        with np.errstate(invalid="ignore"):
            span = known.high - known.low
        given = np.isfinite(span) & (span > 0)
        found = np.where(given, span, 4 * self.problem.scale[known.order]) / np.sqrt(12)
        found[: known.priors] = known.above[: known.priors]
        return found[np.argsort(known.order)]

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


@dataclass(frozen=True, eq=False)
class Columns:
    """A tangent's rows beside columns, and what a least-squares fit needs of both; see `Marginal`."""

    tangent: Tangent
    columns: Array

    def whole(self) -> Array:
        """X: columns as the noise lets them be seen, then the derivative by each parameter in its size."""
        jacobian = self.tangent.jacobian * self.tangent.problem.scale
        return np.hstack([self.tangent.seen(self.columns), jacobian])

    @cached_property
    def sums(self) -> tuple[Array, Array]:
        """X'X and X'r."""
        whole = self.whole()
        return whole.T @ whole, whole.T @ self.tangent.residual


class Marginal:
    """What is left of a tangent's residual once parameters and coefficients of columns have taken one linear step.

    Parameters
    ----------
    tangent : Tangent
    columns : array, shape (n, k), or Columns
        Over the measured rows, whitened.
    share : float
        Deviation of their coefficients.

    Attributes
    ----------
    chi2 : float
        Pulls of known ranges, priors and coefficients included.
    ln_evidence : float
    """

    def __init__(self, tangent: Tangent, columns: Array | Columns | None = None, share: float = 1.0) -> None:
        if not isinstance(columns, Columns):
            none = np.zeros((tangent.residual.size, 0))
            columns = Columns(tangent, none if columns is None else columns)
        self.tangent, self.share, self._columns = tangent, share, columns
        problem, size = tangent.problem, tangent.problem.scale
        k = columns.columns.shape[1]
        self._size, self._scale = size, np.concatenate([np.full(k, share), np.ones(size.size)])
        normal = columns.sums[0] * np.outer(self._scale, self._scale)
        along = columns.sums[1] * self._scale
        ends = problem.bounds[0] - tangent.theta, problem.bounds[1] - tangent.theta
        low, high = np.minimum(ends[0] / size, 0.0), np.maximum(ends[1] / size, 0.0)
        step = np.zeros(k + size.size)
        # 3: linear steps in which the pulls of known ranges settle
        for _ in range(3):
            theta = tangent.theta + step[k:] * size
            pull = problem.pseudo.jacobian(theta) * size
            matrix, right = normal.copy(), along.copy()
            matrix[:k, :k] += np.eye(k)
            matrix[k:, k:] += pull.T @ pull
            right[k:] += pull.T @ (problem.pseudo.residual(theta) - pull @ step[k:])
            before, step = step, _least(matrix, right, k, low, high)
            if np.all(np.abs(step - before) <= 1e-6 + 1e-3 * np.abs(before)):
                break
        pulls = problem.pseudo.residual(tangent.theta + step[k:] * size)
        self.step, self._step = step[k:] * size, step
        left = tangent.residual @ tangent.residual + step @ (2 * along + normal @ step)
        self.chi2 = float(left + pulls @ pulls + step[:k] @ step[:k])
        known = np.concatenate([np.ones(k), size / tangent.widths])
        volume = float(np.linalg.slogdet((normal + np.diag(known**2)) / np.outer(known, known))[1])
        # What rests on an end of its domain does not move when something is added.
        at_end = (step[k:] <= low + AT_END) | (step[k:] >= high - AT_END)
        rest = np.concatenate([np.zeros(k, bool), at_end])
        self._matrix = matrix + np.diag(np.where(rest, 1e12 * np.maximum(np.diag(matrix), 1.0), known**2))
        self.ln_evidence = float(tangent.ln_likelihood(self.chi2)) - 0.5 * volume + tangent.ln_volume

    @property
    def columns(self) -> Array:
        """Over the measured rows, whitened; their coefficients have unit deviation."""
        return self.share * self._columns.columns

    @cached_property
    def _whole(self) -> Array:
        return self._columns.whole() * self._scale

    @cached_property
    def _left(self) -> Array:
        return np.asarray(self.tangent.residual + self._whole @ self._step)

    @cached_property
    def _root(self) -> Array:
        """R with R'R the inverse of the matrix."""
        scale = 1 / np.sqrt(np.diag(self._matrix))
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self._matrix * np.outer(scale, scale))) * scale)

    @cached_property
    def _taken(self) -> Array:
        """R X': the squares of this times a column are what parameters and coefficients take of it."""
        return np.asarray(self._root @ self._whole.T)

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
        seen = self.tangent.seen(columns)
        taken = self._taken @ seen
        curvature, axes = np.linalg.eigh(seen.T @ seen - taken.T @ taken)
        slope = axes.T @ (seen.T @ self._left)
        drops, volumes, found = _alone(curvature, slope, sizes)
        gains = self.tangent.ln_likelihood(self.chi2 + drops.sum(axis=1)) - self.tangent.ln_likelihood(
            self.chi2
        )
        return gains - 0.5 * volumes.sum(axis=1), found @ axes.T

    def with_pulls(self, columns: Array, sizes: Array) -> tuple[Array, Array]:
        """What `beside` gives, with pulls and ends of ranges as they are where the parameters go to."""
        ones = [Marginal(self.tangent, np.hstack([self.columns, size * columns])) for size in sizes]
        first = self.columns.shape[1]
        own = slice(first, first + columns.shape[1])
        gains = np.array([one.ln_evidence for one in ones]) - self.ln_evidence
        return gains, np.array([size * one._step[own] for size, one in zip(sizes, ones, strict=True)])

    def one_by_one(self, columns: Array, sizes: Array) -> tuple[Array, Array]:
        """What `beside` gives of each column alone; both of shape (m, q)."""
        seen = self.tangent.seen(columns)
        curvature = np.sum(seen**2, axis=0) - np.sum((self._taken @ seen) ** 2, axis=0)
        drops, volumes, found = _alone(curvature, seen.T @ self._left, sizes)
        gains = self.tangent.ln_likelihood(self.chi2 + drops) - self.tangent.ln_likelihood(self.chi2)
        return gains - 0.5 * volumes, found

    def curvature(self, column: Array) -> float:
        """Half the second derivative of chi-square by a coefficient of a column, all else free."""
        seen = self.tangent.seen(column[:, None])[:, 0]
        return float(seen @ seen - np.sum((self._taken @ seen) ** 2))

    def shifted(self, columns: Array, coefficients: Array) -> Array:
        """Theta after a linear step beside columns with these coefficients."""
        along = self._taken @ (self.tangent.seen(columns) @ coefficients)
        more = -(along @ self._root)[-self._size.size :] * self._size
        low, high = self.tangent.problem.bounds
        return np.asarray(np.clip(self.tangent.theta + self.step + more, low, high))


def _alone(curvature: Array, slope: Array, sizes: Array) -> tuple[Array, Array, Array]:
    """Of columns that do not act on each other: drops of chi-square, ln det, coefficients; each (m, q)."""
    curvature = np.maximum(curvature, 0.0)
    found = -slope / (curvature + 1 / sizes[:, None] ** 2)
    return found * slope, np.log1p(sizes[:, None] ** 2 * curvature), found


def _least(normal: Array, along: Array, k: int, low: Array, high: Array) -> Array:
    """The x that makes x' normal x + 2 along' x least; elements from the k-th on stay between two ends."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    found = -np.linalg.solve(scaled, along * scale) * scale
    if np.all((found[k:] >= low) & (found[k:] <= high)):
        return np.asarray(found)
    # What is free of ends is eliminated first: the triangle's last rows are the problem of the others.
    root = np.linalg.cholesky(scaled)
    below = np.linalg.solve(root, along * scale)
    held = held_inside(root.T[k:, k:] / scale[k:], below[k:], low, high)
    right = below[:k] + root.T[:k, k:] @ (held / scale[k:])
    return np.concatenate([-np.linalg.solve(root.T[:k, :k], right) * scale[:k], held])
