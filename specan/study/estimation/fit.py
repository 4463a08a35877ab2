"""Weighted least squares of a problem: bounds, several starts, covariance, profile intervals, probabilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import brentq, least_squares

from specan.errors import ComputationError, RequestError
from specan.models.effect import ParameterName
from specan.study.estimation.levenberg_marquardt import (
    STEP_TOLERANCE,
    Minimum,
    NotSettledError,
    descend,
    finite,
    unit,
)
from specan.study.estimation.linear import least_inside, orthonormal
from specan.study.estimation.problem import Problem
from specan.study.observation import Array


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


MOST_EXACT = 400  # steps to the minimum itself
FLOOR = 1e-8  # of the largest singular value: directions below it count as determined that well


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum of the sum of squares.

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
    converged : bool
        False where no descent settled: the lowest place that any came to.
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

    @property
    def dispersion(self) -> float:
        """The reduced chi-square, never below one; one where there is none."""
        return max(1.0, self.reduced_chi2)  # in this order: of nothing it is not a number

    def standard_error(self, name: str) -> float:
        """Standard uncertainty of a parameter, from the covariance."""
        return float(np.sqrt(self.covariance[self.names.index(name), self.names.index(name)]))


def fit(problem: Problem, start: Array | Mapping[str, Any] | None = None, starts: int = 1) -> Fit:
    """Fit the free parameters of a problem.

    Parameters
    ----------
    problem : Problem
    start : array or mapping, optional
        Theta of a fit that is near, or SI values by name, to start from; the problem's own start by default.
    starts : int
        Number of starts; those after the first lie in the plausible ranges at fixed quasi-random places,
        so that the same problem always gives the same answer. Only the first
        where the strategy is frugal.

    Raises
    ------
    ComputationError
        No start leads anywhere, or the best is not finite: never a verdict.
    RequestError
        More free parameters than values to determine them.
    """
    first = np.asarray(start, dtype=float) if isinstance(start, np.ndarray) else problem.start(start)
    if first.size > problem.n_data + problem.n_priors:
        raise RequestError(
            f"{problem.n_data} measured values cannot determine {first.size} parameters",
            remedy="hold some of them fixed or measure more conditions",
        )
    if not first.size:
        return describe(problem, first)
    places = [first, *_other_starts(problem, 0 if problem.strategy.frugal else starts - 1)]
    found, converged = _minima(problem, places, near=isinstance(start, np.ndarray))
    best = found[0]
    for other in found[1:]:
        if other.chi2 < best.chi2 - 1e-9 * abs(best.chi2):
            best = other
    if not problem.strategy.frugal:
        try:
            best = _exact(problem, best.theta)
        except ComputationError as fault:  # where the descents ended is good enough
            best = getattr(fault, "reached", best)
    return replace(describe(problem, best.theta, best.residual, best.jacobian), converged=converged)


def _minima(problem: Problem, places: Sequence[Array], near: bool) -> tuple[list[Minimum], bool]:
    """Where descents from several places settle; else, and False, the lowest that they came to."""
    found: list[Minimum] = []
    unsettled: list[Minimum] = []
    reason = "no start gave finite values"
    frugal = _from_nearer if problem.strategy.continuation else descend
    for method in (frugal,) if problem.strategy.frugal else (frugal, _exact):
        for theta0 in places:
            try:
                found.append(method(problem, theta0))
            except NotSettledError as fault:
                unsettled.append(fault.reached)
            except ComputationError as fault:
                reason = fault.found
            except np.linalg.LinAlgError as fault:
                reason = f"linear algebra failed ({fault})"
        # two descents that lead to the lowest minimum agree
        chi2 = sorted(minimum.chi2 for minimum in found)
        agree = len(chi2) > 1 and chi2[1] - chi2[0] < STEP_TOLERANCE * unit(problem, chi2[0])
        if agree or (found and near):
            break
    if not (found or unsettled):
        raise ComputationError(
            f"the fit of {', '.join(problem.names) or 'no parameter'} failed: {reason}",
            remedy="give other start values or narrower bounds, or take an effect out",
        )
    return found or unsettled, bool(found)


def _exact(problem: Problem, start: Array) -> Minimum:
    """The minimum itself, by trust-region steps (Branch, Coleman & Li 1999) with derivatives of fourth order.

    They end where the residual is orthogonal to all that the parameters can do, which is no matter of how uncertain the
    data are said to be.
    """
    low, high = problem.bounds
    slopes = finite(problem.jacobian(start))
    predicted = float(np.linalg.norm(problem.whiten(np.concatenate(problem.predictions(start)))))

    def residual(theta: Array) -> Array:
        try:
            return problem.residual(theta)
        except ComputationError:  # a loop of the model that does not converge there: the step was too long
            return np.full(slopes.shape[0], np.nan)

    def jacobian(theta: Array) -> Array:
        """With steps that change all predictions by the same share, whatever the size of a parameter."""
        nonlocal slopes
        # 1e-4: that share: rounding then errs by 1e-12
        share = 1e-4 * predicted / np.maximum(np.linalg.norm(slopes[: problem.n_data], axis=0), 1e-300)
        # 1e-3, 1e-8: of a parameter's size, which a step does not exceed, and below which it is lost in rounding
        most, least = (part * np.maximum(problem.scale, np.abs(theta)) for part in (1e-3, 1e-8))
        steps = np.where(share > 0, np.clip(share, least, most), most)
        slopes = finite(problem.jacobian(theta, steps, 4))
        return slopes

    inside = np.clip(start, low + 1e-10 * problem.scale, high - 1e-10 * problem.scale)
    finite(residual(inside))
    # 1e-15: rounding ends the last steps
    ends = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
    found = least_squares(
        residual, inside, jacobian, (low, high), x_scale=problem.scale, max_nfev=MOST_EXACT, **ends
    )
    minimum = Minimum(found.x, found.fun, found.jac, 2 * float(found.cost))
    promised = float(np.sum((orthonormal(found.jac).T @ found.fun) ** 2))
    if found.status == 0 and promised > STEP_TOLERANCE * unit(problem, minimum.chi2):
        raise NotSettledError(minimum, MOST_EXACT)
    return minimum


def _from_nearer(problem: Problem, theta0: Array) -> Minimum:
    """A descent from where that on a subsample leads, if it leads anywhere."""
    with suppress(ComputationError):
        theta0 = descend(problem.subsampled(theta0), theta0).theta
    return descend(problem, theta0)


def _other_starts(problem: Problem, count: int) -> list[Array]:
    """Places in the plausible ranges."""
    low, high = problem.bounds
    start, scale = problem.start(), problem.scale
    inner = [problem.assembly.parameters[name.whole].si for name in problem.names]
    low = np.maximum(low, [s.min for s in inner])
    high = np.minimum(high, [s.max for s in inner])
    low = np.where(np.isfinite(low), low, start - 2 * scale)
    high = np.where(np.isfinite(high), high, start + 2 * scale)
    low, high = np.minimum(low, high), np.maximum(low, high)
    return list(low + quasi_random(count, len(problem.names)) * (high - low))


def quasi_random(count: int, size: int) -> Array:
    """Points of the unit cube, (count, size), by the additive recurrence of the generalised golden ratio."""
    root = 2.0
    for _ in range(30):  # the root of x^(d+1) = x + 1
        root = (1 + root) ** (1 / (size + 1))
    return (0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1, size + 1)) % 1


def describe(
    problem: Problem, theta: Array, residual: Array | None = None, jacobian: Array | None = None
) -> Fit:
    """A Fit of a theta that some descent has found to be a minimum; what it knows there is used again."""
    snapped, at_bound = _snap(problem, theta)
    if residual is None or jacobian is None or np.any(snapped != theta):
        residual = finite(problem.residual(snapped))
        jacobian = finite(problem.jacobian(snapped))
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
        covariance=_with_correlation(problem, residual, jacobian),
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
    low, high = problem.bounds
    near = 1e-4 * problem.scale
    snapped = np.where(theta - low < near, low, np.where(high - theta < near, high, theta))
    touching = (snapped == low) | (snapped == high)
    if not np.any(touching):
        return theta, ()
    before, after = (float(np.sum(problem.residual(t) ** 2)) for t in (theta, snapped))
    if not after <= before + 1e-3:
        return theta, ()
    return snapped, tuple(n for n, t in zip(problem.names, touching, strict=True) if t)


def _with_correlation(problem: Problem, residual: Array, jacobian: Array) -> Array:
    """Covariance of theta where residuals may follow each other (the sandwich of Huber 1967 and White 1980)."""
    found = covariance(jacobian, problem.scale)
    parts = zip(problem.observations, problem.split(residual), problem.split(jacobian), strict=False)
    more = sum(o.excess(own, slopes) for o, own, slopes in parts)
    return found + found @ more @ found if np.any(more) else found


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
    lack, own = chi2 - pure_error_dof, dof - pure_error_dof
    if own <= 0:
        return float("nan")
    return tail(max(lack, 0.0) / own, own, noise_dof)


def intervals_95(
    problem: Problem, best: Fit, names: Container[str] | None = None, *, profiled: bool = True
) -> dict[ParameterName, tuple[float, float]]:
    """95 % intervals of elements of theta, inside their domains, widened by the root of the dispersion.

    By profile: {x : min chi2(x) - chi2_min < quantile}, all other parameters refitted (Raue et al. 2009). From the
    covariance where the strategy is frugal (the chi-square of many rows is quadratic) and where a refit fails.
    What is held and has a standard uncertainty q (`Parameter.spread`) moves the minimum by ``-(J'J)^-1 J' dr/dq q``,
    which is added in squares; so is what all sizes of effects share (`Observation.size_error`). Of a quantity whose
    sign is known that may be more than the quantity: a factor, then.

    Parameters
    ----------
    names : collection of str, optional
        Of which; all by default.
    profiled : bool
        False: from the covariance, which is quick.
    """
    # 1.96: standard deviations on either side of 95 % of a normal law
    factor = 1.96 * _unsure_sizes(problem, best)
    moved = np.hypot(1.96 * _moved_by_what_is_held(problem, best), factor)
    # The noise of a recording is told by its many samples.
    known = np.inf if all(o.kind == "time" for o in problem.observations) else problem.noise_dof
    allowed = best.dispersion * quantile(1 - 0.95, 1, known)
    found = {}
    for k, (name, low, high) in enumerate(zip(problem.names, *problem.bounds, strict=True)):
        if names is not None and name not in names:
            continue
        value, reach = float(best.theta[k]), float(np.sqrt(allowed)) * best.standard_error(name)
        ends = value - reach, value + reach
        if profiled and not problem.strategy.frugal:
            with suppress(ComputationError, ValueError):  # ValueError: an end that is not bracketed
                ends = _profile(problem, best, k, allowed)
        away = max(abs(end - value) for end in ends)
        down, up = (np.hypot(end - value, moved[k]) for end in ends)
        positive = problem.assembly.parameters[name.whole].si.min > 0 < value
        if moved[k] > 0 and (positive or (factor[k] and away < abs(value))):
            with np.errstate(over="ignore"):  # of next to nothing: the domain ends it
                both = value * np.exp(-down / abs(value)), value * np.exp(up / abs(value))
            ends = min(both), max(both)
        else:
            ends = value - down, value + up
        found[name] = max(float(ends[0]), float(low)), min(float(ends[1]), float(high))
    return found


def _moved_by_what_is_held(problem: Problem, best: Fit) -> Array:
    """Standard deviation of theta from the standard uncertainties of all parameters that are held."""
    small = 0.05  # of the uncertainty of what is held, over which a derivative is taken
    moved = [np.zeros(best.theta.size)]
    for name, parameter in problem.assembly.parameters.items():
        if not parameter.spread or name in problem.free or name in problem.values:
            continue
        held, one = parameter.si.default, parameter.to_si(parameter.default + parameter.spread)
        ends = [
            replace(problem, values={**problem.values, name: held + part * (one - held)}).residual(best.theta)
            for part in (small, -small)
        ]
        moved.append(best.covariance @ (best.jacobian.T @ (ends[0] - ends[1])) / (2 * small))
    return np.asarray(np.linalg.norm(moved, axis=0))


def _unsure_sizes(problem: Problem, best: Fit) -> Array:
    """Standard deviation of theta by what the sizes of all effects share: they are known up to a factor."""
    neutral = {str(use): problem.assembly.model.effects[use.name].neutral for use in problem.assembly.uses}
    sizes = [name.own in neutral.get(name.owner, ()) for name in problem.names]
    return max(o.size_error for o in problem.observations) * np.abs(best.theta) * sizes


def _profile(problem: Problem, best: Fit, index: int, allowed: float) -> tuple[float, float]:
    """Where the least chi-square has risen by `allowed`; an end beyond the domain is the end of the domain."""
    excess = _excess(problem, best, index, allowed)
    centre, ends = float(best.theta[index]), []
    for side, bounds in zip((-1, 1), problem.bounds, strict=True):
        end = found = float(bounds[index])
        inner, step = centre, float(np.sqrt(allowed)) * best.standard_error(best.names[index])
        # 12: steps outward to an end of a profile
        for _ in range(12 if centre != end else 0):
            outer = centre + side * step
            if side * (outer - end) >= 0:
                if excess(end) <= 0:
                    break
                outer = end
            if excess(outer) > 0:
                # the root of chi-square is nearly straight
                found = brentq(
                    lambda value: math.sqrt(max(excess(value) + allowed, 0.0)) - math.sqrt(allowed),
                    inner,
                    outer,
                    xtol=1e-3 * abs(outer - centre),
                )
                break
            inner, step = outer, 1.6 * step
        ends.append(found)
    return ends[0], ends[1]


_NEARBY = 0.2  # of the way from the minimum, over which a Jacobian serves: its error there is of second order


def _excess(problem: Problem, best: Fit, index: int, allowed: float) -> Callable[[float], float]:
    """Least chi-square with one element of theta held at a value, less that of the fit and what it may rise."""
    others = np.arange(best.theta.size) != index
    direction = best.covariance[:, index] / max(best.covariance[index, index], 1e-300)
    low, high = (ends[others] for ends in problem.bounds)

    where, kept = np.inf, best.jacobian

    def whole(part: Array, value: float) -> Array:
        theta = np.empty(others.size)
        theta[others], theta[index] = part, value
        return theta

    def slopes(part: Array, value: float) -> Array:
        """Those at a value nearby: along a profile they change little, and cost more than all else."""
        nonlocal where, kept
        if not abs(value - where) <= _NEARBY * abs(value - best.theta[index]):
            where, kept = value, finite(problem.jacobian(whole(part, value)))
        return kept[:, others]

    @cache
    def excess(value: float) -> float:
        if value == best.theta[index]:
            return -allowed
        guess = (best.theta + direction * (value - best.theta[index]))[others]
        if guess.size:
            _, chi2 = least_inside(
                lambda part: finite(problem.residual(whole(part, value))),
                lambda part: slopes(part, value),
                guess,
                low,
                high,
            )
        else:
            chi2 = float(np.sum(finite(problem.residual(whole(guess, value))) ** 2))
        return chi2 - best.chi2 - allowed

    return excess
