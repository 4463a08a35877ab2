"""Weighted least squares of a problem: bounds, several starts, covariance, profile intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.errors import ComputationError, RequestError, nearest
from specan.models.effect import ParameterName
from specan.study.estimation.levenberg_marquardt import MOST_REFINING, Minimum, descend, refine
from specan.study.estimation.problem import Problem
from specan.study.observation import Array

NEAR = 1e-4  # relative, where the trust-region steps of each start end; those of `refine` go on from the best
LEVEL = 0.95  # confidence of profile intervals
NORMAL_95 = 1.96  # standard deviations on either side of 95 % of a normal law
PART_OF_SPREAD = 0.05  # of the uncertainty of what is held, over which a derivative is taken
FLOOR = 1e-8  # of the largest singular value: directions below it count as determined that well


@dataclass(frozen=True, eq=False)
class Fit:
    """A converged minimum of the sum of squares.

    Attributes
    ----------
    theta : array
        Free parameters in the order of `names`, SI.
    values : mapping
        SI value of every parameter of the model, those held included.
    chi2 : float
        Sum of squares of `residual`: data, priors and known ranges.
    residual, jacobian : array
        As `Problem.residual` and `Problem.jacobian` give them at the minimum.
    covariance : array
        (J'J)^-1. A direction that the data do not determine has a huge variance, never a small one.
    at_bound : tuple of str
        Parameters that rest on an end of their domain.
    dof : float
        n_effective + number of priors - number of free parameters.
    reduced_chi2 : float
        Chi-square per degree of freedom, both without known ranges and without what only compares repeats
        (`Observation.pure_error_dof`): one for a true model.
    p_value : float
        Probability of a worse fit of a true model, see `misfit_p_value`.
    """

    names: tuple[ParameterName, ...]
    theta: Array
    values: Mapping[str, Any]
    chi2: float
    residual: Array
    jacobian: Array
    covariance: Array
    at_bound: tuple[ParameterName, ...]
    converged: bool
    n_effective: float
    dof: float
    reduced_chi2: float
    p_value: float

    def standard_error(self, name: str) -> float:
        """Standard uncertainty of a parameter, from the covariance."""
        return float(np.sqrt(self.covariance[self.names.index(name), self.names.index(name)]))


def fit(
    problem: Problem,
    start: Array | Mapping[str, Any] | None = None,
    starts: int = 1,
    max_evaluations: int = 60,
) -> Fit:
    """Fit the free parameters of a problem.

    Parameters
    ----------
    problem : Problem
    start : array or mapping, optional
        Theta, or SI values by name, to start from; the problem's own start by default.
    starts : int
        Number of starts; those after the first lie in the plausible ranges at fixed quasi-random places,
        so that the same problem always gives the same answer. Only the first without
        `Strategy.further_starts`.
    max_evaluations : int
        Trust-region steps that one start may take before another method is tried.

    Raises
    ------
    ComputationError
        No start converged, or the best is not finite: never a verdict.
    RequestError
        More free parameters than values to determine them.
    """
    first = np.asarray(start, dtype=float) if isinstance(start, np.ndarray) else problem.start(start)
    if first.size > problem.n_data + problem.n_priors:
        raise RequestError(
            f"{problem.n_data} measured values cannot determine {first.size} parameters",
            remedy="hold some of them fixed or measure more conditions",
        )
    best: Minimum | None = None
    reason = "no start gave finite values"
    for theta0 in [first, *_other_starts(problem, starts - 1 if problem.strategy.further_starts else 0)]:
        try:
            found = _descend(problem, theta0, max_evaluations)
        except ComputationError as fault:
            reason = fault.found
            continue
        if best is None or found.chi2 < best.chi2 - 1e-9 * abs(best.chi2):
            best = found
    if best is None:
        raise ComputationError(
            f"the fit of {', '.join(problem.names) or 'no parameter'} failed: {reason}",
            remedy="give other start values or narrower bounds, or take an effect out",
        )
    if best.theta.size and problem.strategy.exact_minimum:
        best, _ = refine(problem, best.theta)
    return describe(problem, best.theta, best.residual, best.jacobian)


def _descend(problem: Problem, theta0: Array, max_evaluations: int) -> Minimum:
    """Trust-region steps; in a valley that bends too much for them, those of `refine` from where they got."""
    if theta0.size == 0:
        residual = _finite(problem.residual(theta0))
        return Minimum(theta0, residual, np.empty((residual.size, 0)), float(residual @ residual))
    if not problem.strategy.exact_minimum:
        return descend(problem, _nearer(problem, theta0) if problem.strategy.continuation else theta0)
    from scipy.optimize import least_squares

    low, high = problem.bounds()
    inside = np.clip(theta0, low + 1e-10 * problem.scale, high - 1e-10 * problem.scale)
    try:
        found = least_squares(
            lambda theta: _finite(problem.residual(theta)),
            inside,
            jac=lambda theta: _finite(problem.jacobian(theta)),
            bounds=(low, high),
            x_scale=problem.scale,
            method="trf",
            xtol=NEAR,
            ftol=NEAR,
            gtol=NEAR,
            max_nfev=max_evaluations,
        )
    except np.linalg.LinAlgError as fault:
        raise ComputationError(f"linear algebra failed ({fault})") from None
    if found.status > 0:
        return Minimum(found.x, found.fun, found.jac, 2 * float(found.cost))
    minimum, settled = refine(problem, found.x)
    if not settled:
        raise ComputationError(f"it did not settle within {MOST_REFINING} Jacobians")
    return minimum


def _nearer(problem: Problem, theta0: Array) -> Array:
    """Where a descent on a subsample leads, if it leads anywhere."""
    try:
        return descend(problem.subsampled(theta0), theta0).theta
    except ComputationError:
        return theta0


def _finite(array: Array) -> Array:
    if not np.all(np.isfinite(array)):
        raise ComputationError("the model gives values that are not finite")
    return array


def _other_starts(problem: Problem, count: int) -> list[Array]:
    """Places in the plausible ranges by the additive recurrence of the generalised golden ratio."""
    if count < 1 or not problem.names:
        return []
    size = len(problem.names)
    root = 2.0
    for _ in range(30):  # the root of x^(d+1) = x + 1
        root = (1 + root) ** (1 / (size + 1))
    steps = root ** -np.arange(1, size + 1)
    low, high = _plausible(problem)
    return [low + (0.5 + k * steps) % 1 * (high - low) for k in range(1, count + 1)]


def _plausible(problem: Problem) -> tuple[Array, Array]:
    low, high = problem.bounds()
    start, scale = problem.start(), problem.scale
    inner = [problem.assembly.parameters[name.whole].si for name in problem.names]
    low = np.maximum(low, [s.min for s in inner])
    high = np.minimum(high, [s.max for s in inner])
    low = np.where(np.isfinite(low), low, start - 2 * scale)
    high = np.where(np.isfinite(high), high, start + 2 * scale)
    return np.minimum(low, high), np.maximum(low, high)


def describe(
    problem: Problem, theta: Array, residual: Array | None = None, jacobian: Array | None = None
) -> Fit:
    """A Fit of a theta that some descent has found to be a minimum; what it knows there is used again."""
    snapped, at_bound = _snap(problem, theta)
    if residual is None or jacobian is None or np.any(snapped != theta):
        residual = _finite(problem.residual(snapped))
        jacobian = _finite(problem.jacobian(snapped))
    theta = snapped
    chi2 = float(residual @ residual)
    dof = problem.n_effective + problem.n_priors - theta.size
    met = chi2 - problem.pulled(residual)  # a value outside its known range is no lack of fit of the data
    lack, own = met - problem.pure_error_dof, dof - problem.pure_error_dof
    reduced = max(lack, 0.0) / own if own > 0 else float("nan")
    return Fit(
        names=problem.names,
        theta=theta,
        values=problem.values_at(theta),
        chi2=chi2,
        residual=residual,
        jacobian=jacobian,
        covariance=covariance(jacobian, problem.scale),
        at_bound=at_bound,
        converged=True,
        n_effective=problem.n_effective,
        dof=dof,
        reduced_chi2=reduced,
        p_value=misfit_p_value(met, dof, problem.noise_dof, problem.pure_error_dof),
    )


def _snap(problem: Problem, theta: Array) -> tuple[Array, tuple[ParameterName, ...]]:
    """Put parameters that stopped a hair from an end of their domain on it, where that is no worse."""
    if not theta.size:
        return theta, ()
    low, high = problem.bounds()
    near = 1e-4 * problem.scale
    snapped = np.where(theta - low < near, low, np.where(high - theta < near, high, theta))
    touching = (snapped == low) | (snapped == high)
    if not np.any(touching):
        return theta, ()
    before, after = (float(np.sum(problem.residual(t) ** 2)) for t in (theta, snapped))
    if not after <= before + 1e-3:
        return theta, ()
    return snapped, tuple(n for n, t in zip(problem.names, touching, strict=True) if t)


def covariance(jacobian: Array, scale: Array) -> Array:
    """(J'J)^-1, with the variance of undetermined directions large but finite.

    Parameters
    ----------
    jacobian : array, shape (n, p)
        Derivative of a whitened residual.
    scale : array, shape (p,)
        Typical size of each parameter, which makes the columns comparable.
    """
    if jacobian.shape[1] == 0:
        return np.empty((0, 0))
    sizes = np.linalg.norm(jacobian, axis=0)
    most = max(float(np.max(sizes * scale)), 1.0)
    sizes = np.where(sizes * scale > FLOOR * most, sizes, most / scale)
    _, s, vt = np.linalg.svd(jacobian / sizes, full_matrices=False)
    root = (vt.T / np.maximum(s, FLOOR * float(s[0]))) / sizes[:, None]
    return root @ root.T


def misfit_p_value(chi2: float, dof: float, noise_dof: float = np.inf, pure_error_dof: float = 0.0) -> float:
    """Probability that a true model fits worse.

    Chi-square where the noise is known; else the lack of fit over the pure error,
    F = ((chi2 - pure_error_dof) / (dof - pure_error_dof)) with dof - pure_error_dof and noise_dof degrees of freedom.

    Parameters
    ----------
    chi2, dof : float
        Sum of squares and degrees of freedom of the whole fit.
    noise_dof : float
        Degrees of freedom of the noise estimate.
    pure_error_dof : float
        Those of them that are part of `dof` (see `Observation.pure_error_dof`).

    Examples
    --------
    >>> round(misfit_p_value(124.342, 100), 3)
    0.05
    >>> misfit_p_value(150.0, 100, 60, 60) < misfit_p_value(150.0, 100, 60)
    True
    """
    from scipy.special import chdtrc, fdtrc

    lack, own = chi2 - pure_error_dof, dof - pure_error_dof
    if own <= 0:
        return float("nan")
    if np.isinf(noise_dof):
        return float(chdtrc(own, max(lack, 0.0)))
    return float(fdtrc(own, noise_dof, max(lack, 0.0) / own))


def intervals_95(problem: Problem, best: Fit, widen: float = 1.0) -> dict[ParameterName, tuple[float, float]]:
    """95 % intervals of all elements of theta from the covariance, inside their domains.

    What is held and has a standard uncertainty q (`Parameter.spread`) moves the minimum by ``-(J'J)^-1 J' dr/dq q``,
    which is added in squares. Of a quantity that is positive that may be more than the quantity: a factor, then.

    Parameters
    ----------
    widen : float
        Factor on what the covariance says.
    """
    moved = _moved_by_what_is_held(problem, best)
    sd = np.hypot(widen * np.sqrt(np.diag(best.covariance)), moved)
    found = {}
    for name, value, reach, held, low, high in zip(
        best.names, best.theta, NORMAL_95 * sd, moved, *problem.bounds(), strict=True
    ):
        if held > 0 and problem.assembly.parameters[name.whole].si.min > 0 < value:
            ends = value * np.exp(-reach / value), value * np.exp(reach / value)
        else:
            ends = value - reach, value + reach
        found[name] = max(float(ends[0]), float(low)), min(float(ends[1]), float(high))
    return found


def _moved_by_what_is_held(problem: Problem, best: Fit) -> Array:
    """Standard deviation of theta from the standard uncertainties of all parameters that are held."""
    moved = [np.zeros(best.theta.size)]
    for name, parameter in problem.assembly.parameters.items():
        if not parameter.spread or name in problem.free or name in problem.values:
            continue
        held, one = parameter.si.default, parameter.to_si(parameter.default + parameter.spread)
        ends = [
            replace(problem, values={**problem.values, name: held + part * (one - held)}).residual(best.theta)
            for part in (PART_OF_SPREAD, -PART_OF_SPREAD)
        ]
        moved.append(best.covariance @ (best.jacobian.T @ (ends[0] - ends[1])) / (2 * PART_OF_SPREAD))
    return np.asarray(np.linalg.norm(moved, axis=0))


def profile_interval(problem: Problem, best: Fit, name: str, *, inflate: bool = False) -> tuple[float, float]:
    """95 % interval {x : min chi2(x) - chi2_min < quantile}, all other parameters refitted (Raue et al. 2009).

    An end that lies beyond the domain is the end of the domain: the interval is then one-sided.

    Parameters
    ----------
    name : str
        Element of `problem.names`.
    inflate : bool
        Widen by the root of the reduced chi-square where that exceeds one.
    """
    if name not in problem.names:
        raise RequestError(f"{name!r} is not a free parameter", remedy=nearest(name, problem.names))
    from scipy.special import chdtri, fdtri

    noise_dof = problem.noise_dof
    quantile = float(chdtri(1, 1 - LEVEL) if np.isinf(noise_dof) else fdtri(1, noise_dof, LEVEL))
    if inflate and best.dof > 0:
        quantile *= max(1.0, best.reduced_chi2)
    ends = [_profile_end(problem, best, name, side, quantile) for side in (-1, 1)]
    return ends[0], ends[1]


def _profile_end(problem: Problem, best: Fit, name: str, side: int, quantile: float) -> float:
    from scipy.optimize import brentq

    excess = _Excess(problem, best, name, quantile)
    centre = inner = best.theta[excess.index]
    end = float(problem.bounds()[0 if side < 0 else 1][excess.index])
    if centre == end:
        return end
    step = np.sqrt(quantile) * best.standard_error(name)
    for _ in range(12):
        outer = centre + side * step
        if side * (outer - end) >= 0:
            if excess(end) <= 0:
                return end
            outer = end
        if excess(outer) > 0:
            return float(brentq(excess.root, inner, outer, xtol=1e-4 * abs(outer - centre), rtol=1e-10))
        inner, step = outer, 1.6 * step
    return end


class _Excess:
    """Least chi-square with one element of theta held at a value, less that of the fit and a quantile."""

    def __init__(self, problem: Problem, best: Fit, name: str, quantile: float) -> None:
        self.problem, self.best, self.quantile = problem, best, quantile
        self.index = k = problem.names.index(name)
        self.others = np.arange(best.theta.size) != k
        self.direction = best.covariance[:, k] / max(best.covariance[k, k], 1e-300)
        self.known = {float(best.theta[k]): -quantile}  # each value is fitted once

    def __call__(self, value: float) -> float:
        if value in self.known:
            return self.known[value]
        from scipy.optimize import least_squares

        problem, best, others = self.problem, self.best, self.others
        low, high = problem.bounds()
        guess = np.clip(best.theta + self.direction * (value - best.theta[self.index]), low, high)
        if not np.any(others):
            chi2 = float(np.sum(_finite(problem.residual(np.array([value]))) ** 2))
        else:
            inside = np.clip(guess, low + 1e-10 * problem.scale, high - 1e-10 * problem.scale)
            found = least_squares(
                lambda part: _finite(problem.residual(self._whole(part, value))),
                inside[others],
                jac=lambda part: _finite(problem.jacobian(self._whole(part, value)))[:, others],
                bounds=(low[others], high[others]),
                x_scale=problem.scale[others],
                xtol=1e-7,
                ftol=1e-7,
                max_nfev=60,
            )
            chi2 = 2 * float(found.cost)
        self.known[value] = chi2 - best.chi2 - self.quantile
        return self.known[value]

    def root(self, value: float) -> float:
        """The same for the root of chi-square, which is nearly straight: zero in the same place."""
        return float(np.sqrt(max(self(value) + self.quantile, 0.0)) - np.sqrt(self.quantile))

    def _whole(self, part: Array, value: float) -> Array:
        theta = np.empty(self.others.size)
        theta[self.others], theta[self.index] = part, value
        return theta
