"""A frugal least-squares descent for the many refits of a search: few Jacobians, most steps by secants.

Levenberg-Marquardt steps (Marquardt 1963) with the parameters held inside their bounds; between exact
Jacobians the secant update of Broyden (1965) keeps the last one current at the price of one residual. A
minimum is accepted only on an exact Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.study.problem import Problem

Array = NDArray[np.float64]

SETTLED = 1e-3  # chi-square that an exact Gauss-Newton step may still promise
STALLED = 0.02  # or by which it has fallen over the last five exact Jacobians, in a valley that bends
MOST_JACOBIANS = 25
MOST_SECANTS = 12
MOST_DOUBLINGS = 8


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended."""

    theta: Array
    residual: Array
    jacobian: Array
    chi2: float


def descend(problem: Problem, start: Array) -> Minimum:
    """Minimise the sum of squares of a problem's residual from one start.

    Raises
    ------
    ComputationError
        Not finite at the start, or not settled after 25 Jacobians.
    """
    low, high = problem.bounds()
    size = problem.scale
    theta = np.clip(start, low, high)
    residual = _residual(problem, theta)
    if residual is None:
        raise ComputationError("the model gives values that are not finite at the start of a fit")
    damping = 1e-4
    history: list[float] = []
    for _ in range(MOST_JACOBIANS):
        history.append(float(residual @ residual))
        jacobian = problem.jacobian(theta)
        if not np.all(np.isfinite(jacobian)):
            raise ComputationError("the model gives derivatives that are not finite")
        if len(history) > 5 and history[-6] - history[-1] < STALLED:
            return Minimum(theta, residual, jacobian, history[-1])
        slope = jacobian * size
        for secant in range(MOST_SECANTS):
            step, promised = _step(slope, residual, (low - theta) / size, (high - theta) / size, damping)
            if promised < SETTLED:
                if secant == 0 and _promise_undamped(slope, residual, theta, low, high, size) < SETTLED:
                    return Minimum(theta, residual, jacobian, float(residual @ residual))
                if secant > 0:
                    break
            trial, there = _try(problem, theta, step * size)
            if secant == 0 and there is not None and there @ there > residual @ residual:
                bend = _bend(slope, step, there - residual - slope @ step, damping)
                straight = trial, there
                trial, there = _try(problem, theta, (step + bend) * size)
                if there is None or there @ there > straight[1] @ straight[1]:
                    trial, there = straight
            moved = (trial - theta) / size
            gained = -np.inf if there is None else float(residual @ residual - there @ there)
            if there is not None and moved @ moved > 0:
                slope = slope + np.outer(there - residual - slope @ moved, moved) / (moved @ moved)
            if there is not None and gained > 0:
                if gained > 0.5 * promised and damping > 1e-7:
                    trial, there = _further(problem, theta, trial, there)
                theta, residual = trial, there
                damping = max(damping / 10, 1e-12) if gained > 0.3 * promised else damping
                if gained < 0.1 * promised:
                    break
            else:
                damping = min(max(damping * 10, 1e-6), 1e10)
                if secant > 0:
                    break
                slope = jacobian * size  # the exact one is better than a secant over a step that failed
    raise ComputationError(f"it did not settle within {MOST_JACOBIANS} Jacobians")


def _try(problem: Problem, theta: Array, step: Array) -> tuple[Array, Array | None]:
    low, high = problem.bounds()
    trial = np.clip(theta + step, low, high)
    return trial, _residual(problem, trial)


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


def _residual(problem: Problem, theta: Array) -> Array | None:
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


def _promise_undamped(
    slope: Array, residual: Array, theta: Array, low: Array, high: Array, size: Array
) -> float:
    """What a step with next to no damping promises: a large damping must not pass for a minimum."""
    return _step(slope, residual, (low - theta) / size, (high - theta) / size, 1e-6)[1]
