"""A frugal least-squares descent for the many refits of a search: few Jacobians, most steps by secants.

Levenberg-Marquardt steps (Marquardt 1963) with the parameters held inside their bounds; between exact
Jacobians the secant update of Broyden (1965) keeps the last one current at the price of one residual. A
minimum is accepted only on an exact Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.study.estimation.problem import Problem

Array = NDArray[np.float64]

# In units of the reduced chi-square where that exceeds one: a fit that is bad needs no digits.
STEP_TOLERANCE = 1e-3  # chi-square that an exact Gauss-Newton step may still promise
STALL_TOLERANCE = 0.02  # or by which it has fallen over the last five exact Jacobians, in a valley that bends
POOR_FIT = 10.0  # reduced chi-square above which the exact minimum of a frugal fit is of no interest
FAR_TOLERANCE = 0.05  # share by which five Jacobians have to lower chi-square there to be worth going on
MOST_JACOBIANS = 25  # of one descent, before it counts as not converged
SCREENING_JACOBIANS = 3  # Jacobians that each of several starts is led by before the others are left
MOST_SECANTS = 12  # steps between two exact Jacobians
MOST_DOUBLINGS = 8  # of a step that keeps paying
# Damping of the first step, in units of the diagonal of J'J. In a valley of nearly collinear parameters 1e-4 shortens
# every step; where an evaluation is expensive a step that fails costs more than that.
FAR_START, LEAST_START = 1e-4, 1e-8
LEAST_DAMPING = 1e-6  # damping with which a minimum is confirmed: a large one must not pass for it


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended."""

    theta: Array
    residual: Array
    jacobian: Array
    chi2: float


def descend(problem: Problem, start: Array, slopes: Array | None = None) -> Minimum:
    """Minimise the sum of squares of a problem's residual from one start.

    Parameters
    ----------
    problem : Problem
    start : array
        Theta.
    slopes : array, optional
        Jacobian near the start. It is kept current by secants, and a minimum is then accepted on it:
        for problems whose Jacobian costs more than the verdict needs.

    Raises
    ------
    ComputationError
        Not finite at the start, or not settled after 25 Jacobians. A model that is far from many data and slides
        along a valley is taken where it is: nothing is concluded from its exact minimum.
    """
    descent = _Descent(problem, np.asarray(start, dtype=float))
    history: list[float] = []
    for count in range(MOST_JACOBIANS):
        history.append(descent.chi2)
        guessed = slopes is not None and count == 0
        jacobian = slopes if slopes is not None and count == 0 else problem.jacobian(descent.theta)
        if not np.all(np.isfinite(jacobian)):
            raise ComputationError("the model gives derivatives that are not finite")
        slow = len(history) > 5 and history[-6] - history[-1] < descent.little
        found = descent.minimum(jacobian) if slow else descent.follow(jacobian, guessed)
        if found is not None:
            return found
    raise ComputationError(f"it did not settle within {MOST_JACOBIANS} Jacobians")


def descend_steps(problem: Problem, start: Array, jacobians: int) -> Array:
    """Where some exact Jacobians lead: near a minimum, if there is one near."""
    descent = _Descent(problem, np.asarray(start, dtype=float))
    for _ in range(jacobians):
        if descent.follow(problem.jacobian(descent.theta), guessed=False) is not None:
            break
    return descent.theta


def best_screened(problem: Problem, starts: Sequence[Array]) -> Array:
    """Where some Jacobians lead that of several starts from which they lead lowest.

    Raises
    ------
    ComputationError
        None is finite.
    """
    if len(starts) == 1:
        return starts[0]
    reached: list[tuple[float, Array]] = []
    reason = ""
    for start in starts:
        try:
            theta = descend_steps(problem, start, SCREENING_JACOBIANS)
        except ComputationError as fault:
            reason = fault.found
            continue
        residual = problem.residual(theta)
        reached.append((float(residual @ residual), theta))
    if not reached:
        raise ComputationError(reason)
    return min(reached, key=lambda r: r[0])[1]


def unit(problem: Problem, chi2: float) -> float:
    """Chi-square per degree of freedom, at least one; the unit of the convergence tolerances."""
    return max(chi2 / (problem.n_data + problem.n_priors), 1.0) * problem.strategy.tolerance


class _Descent:
    """Where a descent stands: theta, the residual there, and the damping of the next step."""

    def __init__(self, problem: Problem, start: Array) -> None:
        self.problem, self.size = problem, problem.scale
        self.low, self.high = problem.bounds()
        self.theta = np.clip(start, self.low, self.high)
        residual = finite_residual(problem, self.theta)
        if residual is None:
            raise ComputationError("the model gives values that are not finite at the start of a fit")
        self.residual = residual
        self.damping = LEAST_START if problem.strategy.exact_minimum else FAR_START

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def unit(self) -> float:
        return unit(self.problem, self.chi2)

    @property
    def little(self) -> float:
        """By how much five Jacobians must lower chi-square to be worth going on."""
        far_off = self.problem.strategy.pruning and self.chi2 > POOR_FIT * (
            self.problem.n_data + self.problem.n_priors
        )
        return FAR_TOLERANCE * self.chi2 if far_off else STALL_TOLERANCE * self.unit

    def minimum(self, jacobian: Array) -> Minimum:
        return Minimum(self.theta, self.residual, jacobian, self.chi2)

    def follow(self, jacobian: Array, guessed: bool) -> Minimum | None:
        """Steps by secants from one Jacobian; the minimum if it, or a guess kept current, promises no more."""
        slope = jacobian * self.size
        for secant in range(MOST_SECANTS):
            step, promised = self._step(slope, self.damping)
            if promised < STEP_TOLERANCE * self.unit:
                if (secant == 0 or guessed) and self._step(slope, LEAST_DAMPING)[
                    1
                ] < STEP_TOLERANCE * self.unit:
                    return self.minimum(slope / self.size)
                if secant > 0:
                    return None
            before, residual = self.theta, self.residual
            trial, there = self._try(slope, step, bend=secant == 0)
            moved = (trial - before) / self.size
            if there is not None and moved @ moved > 0:
                slope = slope + np.outer(there - residual - slope @ moved, moved) / (moved @ moved)
            gained = -np.inf if there is None else float(residual @ residual - there @ there)
            if there is None or gained <= 0:
                self.damping = min(max(self.damping * 10, 1e-6), 1e10)
                if secant > 0:
                    return None
                slope = jacobian * self.size  # the exact one is better than a secant over a step that failed
                continue
            if gained > 0.5 * promised and self.damping > 1e-7:
                trial, there = _further(self.problem, before, trial, there)
            self.theta, self.residual = trial, there
            if gained > 0.3 * promised:
                self.damping = max(self.damping / 10, 1e-12)
            if gained < 0.1 * promised:
                return None
        return None

    def _step(self, slope: Array, damping: float) -> tuple[Array, float]:
        low, high = (self.low - self.theta) / self.size, (self.high - self.theta) / self.size
        return _step(slope, self.residual, low, high, damping)

    def _try(self, slope: Array, step: Array, bend: bool) -> tuple[Array, Array | None]:
        """Residual after a step; if chi-square rises and it is asked for, after the step bent with the valley."""
        trial, there = _try(self.problem, self.theta, step * self.size)
        if not bend or there is None or there @ there <= self.chi2:
            return trial, there
        turn = _bend(slope, step, there - self.residual - slope @ step, self.damping)
        other, beside = _try(self.problem, self.theta, (step + turn) * self.size)
        return (trial, there) if beside is None or beside @ beside > there @ there else (other, beside)


def _try(problem: Problem, theta: Array, step: Array) -> tuple[Array, Array | None]:
    low, high = problem.bounds()
    trial = np.clip(theta + step, low, high)
    return trial, finite_residual(problem, trial)


def _further(problem: Problem, theta: Array, trial: Array, there: Array) -> tuple[Array, Array]:
    """Go on in the direction of a good damped step while it pays: a valley costs residuals, no Jacobians."""
    reach = 2.0
    for _ in range(MOST_DOUBLINGS):
        beyond, residual = _try(problem, theta, reach * (trial - theta))
        if residual is None or residual @ residual >= there @ there:
            break
        theta, trial, there = trial, beyond, residual
    return trial, there


def _bend(slope: Array, step: Array, off: Array, damping: float) -> Array:
    """Half the acceleration along a step that failed: how the valley turns away from it.

    With the second difference r'' = 2 off the acceleration is -(J'J + damping)^-1 J' r'' (Transtrum &
    Sethna 2012, arXiv:1201.5885); one that is longer than the step itself is not trusted.
    """
    normal = slope.T @ slope
    weight = damping * np.maximum(np.diag(normal), 1e-12)
    bend = -_solve(normal + np.diag(weight), slope.T @ off)
    length, most = float(np.linalg.norm(bend)), float(np.linalg.norm(step))
    return bend * min(1.0, most / length) if length > 0 else bend


def finite_residual(problem: Problem, theta: Array) -> Array | None:
    """Residual at theta; None where the model has no value or one that is not finite."""
    try:
        residual = problem.residual(theta)
    except ComputationError:  # a loop of the model that does not settle there: the step was too long
        return None
    return residual if np.all(np.isfinite(residual)) else None


def _step(slope: Array, residual: Array, low: Array, high: Array, damping: float) -> tuple[Array, float]:
    """Damped step inside the bounds and the fall in chi-square that it promises."""
    gradient, normal = slope.T @ residual, slope.T @ slope
    weight = damping * np.maximum(np.diag(normal), 1e-12)
    step = _solve(normal + np.diag(weight), -gradient)
    if np.any((step < low) | (step > high)):
        from scipy.optimize import lsq_linear

        root = np.linalg.cholesky(normal + np.diag(weight + 1e-12 * np.diag(normal).max()))
        right = np.linalg.solve(root, -gradient)
        ends = (np.minimum(low, 0.0), np.maximum(high, 0.0) + 1e-300)
        step = np.clip(lsq_linear(root.T, right, ends, method="bvls").x, low, high)
    after = residual + slope @ step
    return step, float(residual @ residual - after @ after)


def _solve(matrix: Array, right: Array) -> Array:
    root = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(root, root)
    try:
        return np.linalg.solve(scaled + 1e-14 * np.eye(root.size), right / root) / root
    except np.linalg.LinAlgError:
        return np.linalg.lstsq(scaled, right / root, rcond=1e-12)[0] / root
